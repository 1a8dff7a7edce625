"""Tables of the case file that are read as one section or several, or as one of several kinds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import reduce
from operator import or_
from typing import Annotated, Any, TypeVar, get_args

from pydantic import (
    BeforeValidator,
    Discriminator,
    Field,
    Tag,
)

from contact.case.accepted import accepted_by, either
from contact.case.types import Section, Words, as_tuple, fault
from contact.settings import Accepted

Kind = TypeVar("Kind", bound=Section)


def one_or_more(kind: type[Section], key: str) -> Any:
    """Return what reads a table as one section, and a list of tables as several.

    Parameters
    ----------
    kind
        The section.
    key
        Its key in the case file.
    """
    entry: Any = kind
    many = Annotated[tuple[entry, ...], Field(min_length=1), as_tuple]

    def tag(given: Any) -> str:
        return "many" if isinstance(given, list | tuple) else kind.__name__

    read = Annotated[entry, Tag(kind.__name__)] | Annotated[many, Tag("many")]
    words = Accepted(f"a table [{key}], or tables [[{key}]]")
    return Annotated[read, Discriminator(tag), words]


def entries(key: str, given: Kind | tuple[Kind, ...]) -> tuple[tuple[str, Kind], ...]:
    """Return what `one_or_more` has read as several sections, each with its path."""
    if isinstance(given, tuple):
        return tuple((f"{key}.{i}", section) for i, section in enumerate(given))
    return ((key, given),)


def union_of(kinds: Iterable[type], *marks: Any) -> Any:
    """Return the union of classes that are read from tables, each tagged by its name."""
    return reduce(or_, (Annotated[kind, *marks, Tag(kind.__name__)] for kind in kinds))


def one_of(key: str, *kinds: type[Section], formula: Any = None) -> Any:
    """Return what reads a table as one of several sections.

    Parameters
    ----------
    key
        The key that tells them apart: each section has it with one value of its own.
    kinds
        The sections.
    formula
        What reads anything that is no table; by default nothing does.
    """
    by_value = {get_args(kind.model_fields[key].annotation)[0]: kind for kind in kinds}
    accepted = either([f'"{value}"' for value in by_value])

    def tag(given: Any) -> str | None:
        if isinstance(given, Mapping):
            return by_value[given[key]].__name__
        if isinstance(given, kinds):
            return type(given).__name__
        return None if formula is None else "formula"

    def check(given: Any) -> Any:
        if isinstance(given, Mapping):
            if key not in given:
                raise fault(key, Words("missing"), accepted)
            if not isinstance(given[key], str) or given[key] not in by_value:
                raise fault(key, given[key], accepted)
        return given

    read = union_of(kinds)
    words = "a table " + " or ".join(_table(key, *pair) for pair in by_value.items())
    if formula is not None:
        read |= Annotated[formula, Tag("formula")]
        words = f"{accepted_by(formula)}, or {words}"
    return Annotated[read, Discriminator(tag), BeforeValidator(check), Accepted(words)]


def _table(key: str, value: str, kind: type[Section]) -> str:
    """Write a section as a table, all but one of its keys without their values."""
    others = [name for name in kind.model_fields if name != key]
    return "{ " + ", ".join([f'{key} = "{value}"', *others]) + " }"
