"""An entry of the registry of quantities, and the files in which it stands."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from operator import attrgetter, itemgetter
from typing import Any

import numpy as np

from contact.results.functionals import Functional

SUMMARY, STEPS, SWEEP = "summary.json", "steps.csv", "sweep.csv"
ADAPT = "adapt.csv"
#: Results of each contact: entries of `contacts` in the summary, columns with its name at the end.
CONTACTS = "contacts.csv"
NODES, HISTORY, AGAINST = "contact.csv", "history.csv", "contact-against.csv"
BODY, SURFACE, OPPOSITE = "fields.vtu", "contact.vtu", "contact-against.vtu"
#: Tables with a row per solution; the others have columns of arrays.
ROWS = (STEPS, SWEEP, ADAPT, CONTACTS)
#: Names of the entries of a vector, and of an interval.
AXES, ENDS = ("x", "y", "z"), ("least", "largest")
#: Column of an entry of a vector.
VECTOR = "{name}_{axis}"
#: Status of a node -> its number in ``contact.vtu``.
STATUS = {"none": -1, "open": 0, "stick": 1, "slip": 2}


def is_of(column: str, key: str) -> bool:
    """Whether a column is that of a key or of an entry: ``reactions`` has ``reactions.left_x``."""
    return bool(re.fullmatch(rf"{re.escape(key)}(\..*)?(_({'|'.join(AXES + ENDS)}))?", column))


@dataclass(frozen=True)
class Quantity:
    """A key of ``summary.json``, a column of a table or a field."""

    name: str  #: PART, KEY and AXIS in it stand for names of the case, and x, y, z
    unit: str  #: "length", "stress", ..., empty for none
    text: str  #: the description, with the sign
    #: A function of the subject of a file, called on all ranks: `Results`, in ``history.csv`` a
    #: `Record`, in ``contact.csv`` and ``contact.vtu`` `ContactResult`, in ``fields.vtu`` and on
    #: master sides a mapping, of each contact `ContactShare`. By default the functional, or the
    #: attribute or entry of the quantity's name. A mapping has several columns, a vector one per
    #: component; None is for a quantity that a problem does not have, which has no key then.
    value: Callable[[Any], Any] | None = None
    files: tuple[str, ...] = (SUMMARY,)  #: where it stands; the first has the description
    component: str = ""  #: name of the column of an entry, of a vector
    entries: tuple[str, ...] = AXES  #: their names
    #: The number as a function of problem and state, as which it has derivatives too.
    functional: Functional | None = None
    #: Of a problem those of its columns, by their names; of each contact also of its number.
    functionals: Callable[..., Mapping[str, Functional]] | None = None

    def of(self, given: Any) -> Any:
        """Return the value."""
        if self.value is not None:
            return self.value(given)
        if self.functional is not None:
            return self.functional(given.problem, given.state)
        return (itemgetter if isinstance(given, Mapping) else attrgetter)(self.name)(given)

    def in_file(self, file: str, given: Any) -> dict[str, Any]:
        """Return the keys, columns or field in a file; none where the quantity is absent."""
        value = self.of(given)
        if value is None:
            return {}
        table = file.endswith(".csv")
        if table and isinstance(value, Mapping):
            return dict(value)
        if table and self.component and np.ndim(value) > (file not in ROWS):
            parts = np.asarray(value).T
            if file not in ROWS or len(parts) > 1:  # a moment in the plane is a number
                names = [self.component.format(name=self.name, axis=end) for end in self.entries]
                columns = parts.tolist() if file in ROWS else parts
                return dict(zip(names, columns, strict=False))
            value = parts.item()
        return {self.name: value}
