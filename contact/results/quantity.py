"""A quantity of the output files, and the names of these."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from operator import attrgetter, itemgetter
from typing import Any

import numpy as np

SUMMARY, STEPS, SWEEP = "summary.json", "steps.csv", "sweep.csv"
ADAPT = "adapt.csv"
NODES, HISTORY, AGAINST = "contact.csv", "history.csv", "contact-against.csv"
BODY, SURFACE, OPPOSITE = "fields.vtu", "contact.vtu", "contact-against.vtu"
#: Tables with a row per solution; the others have columns of arrays.
ROWS = (STEPS, SWEEP, ADAPT)
#: Names of the entries of a vector, and of an interval.
AXES, ENDS = ("x", "y", "z"), ("least", "largest")
#: Column of an entry of a vector.
VECTOR = "{name}_{axis}"
#: Status of a node -> its number in ``contact.vtu``.
STATUS = {"none": -1, "open": 0, "stick": 1, "slip": 2}


def elsewhere(given: Any) -> None:
    """Return nothing: the value of a quantity that is written by who knows it."""


def of_law(given: Any) -> None:
    """Return nothing: the value of an internal variable, which laws may have by this name."""


def is_of(column: str, key: str) -> bool:
    """Tell whether a column of a table is that of a key: itself, or an entry of it.

    ``reactions`` has ``reactions.left_x``, as have ``reactions.left`` and the column's own name.
    """
    return (
        re.fullmatch(rf"{re.escape(key)}(\..*)?(_({'|'.join(AXES + ENDS)}))?", column) is not None
    )


@dataclass(frozen=True)
class Quantity:
    """A key of ``summary.json``, a column of a table or a field.

    Attributes
    ----------
    name
        PART, KEY and AXIS in it stand for names of the case, and x, y, z.
    text
        The description, with the sign; `unit` is "length", "stress", ..., empty for none.
    value
        A function of `solution.Solution`, called on all ranks; in ``history.csv`` of
        `methods.report.Record`, in ``contact.csv`` and ``contact.vtu`` of `surface.ContactResult`,
        in ``fields.vtu`` of `fields.Point`, on master sides of a mapping. By default the attribute,
        or entry, of the quantity's name. A mapping has several columns, a vector one per component;
        None is for a quantity that a problem does not have, which has no key, column or field then.
    files
        Where it stands; the first has the description.
    component
        Of a list of fixed length, or of those in a table: name of the column of an entry.
    entries
        Names of the entries.
    """

    name: str
    unit: str
    text: str
    value: Callable[[Any], Any] | None = None
    files: tuple[str, ...] = (SUMMARY,)
    component: str = ""
    entries: tuple[str, ...] = AXES

    def in_file(self, file: str, given: Any) -> dict[str, Any]:
        """Return the keys, columns or field in a file; none where the quantity is absent."""
        get = itemgetter if isinstance(given, Mapping) else attrgetter
        value = (self.value or get(self.name))(given)
        if value is None:
            return {}
        table = file.endswith(".csv")
        if table and isinstance(value, Mapping):
            return dict(value)
        if table and self.component and np.ndim(value) > (file not in ROWS):
            names = (self.component.format(name=self.name, axis=entry) for entry in self.entries)
            parts = np.asarray(value).T
            return dict(zip(names, parts.tolist() if file in ROWS else parts, strict=False))
        return {self.name: value}
