"""One message for a wrong case file: the file, the key, what was given, what is accepted."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Literal, get_args, get_origin

from pydantic import ValidationError
from pydantic_core import ErrorDetails, PydanticCustomError

from contact.case.accepted import accepted_by, keys_of, sections_of
from contact.case.body import Load
from contact.case.showing import listed, path_of, shown
from contact.case.types import UNKNOWN, Section, Words

#: What a user may look for in a load, and where it is.
FORCES = {
    key: "a load is given per area, traction = resultant / area of the part, or per volume, "
    "body_force; a resultant goes to a part that is rigid, force of [[rigid]]"
    for key in ("force", "resultant", "forces")
}

#: What pydantic calls an unknown key, of a section and of a class of options.
UNKNOWN_KEY = ("extra_forbidden", "unexpected_keyword_argument")


def describe(error: ValidationError, root: type[Section], source: str) -> str:
    """Return the one-line message for the first mistake of a case.

    An unknown key comes before all else: what is missing or wrong elsewhere is often but its
    consequence.
    """
    errors = sorted(error.errors(), key=lambda e: e["type"] not in UNKNOWN_KEY)
    return f"{source}: {_message(errors[0], root)}"


def describe_fault(error: PydanticCustomError) -> str:
    """Return the message for a fault that was raised outside of pydantic's validation."""
    return _fault([], **(error.context or {}))


def _fault(keys: list[str], key: str, given: Any, accepted: str) -> str:
    keys = [*keys, *key.split(".")]
    if given is UNKNOWN:
        return _unknown(keys, accepted.split(", "))
    return f"{path_of(keys)}: {_given(given)}; accepted: {accepted}"


def _message(error: ErrorDetails, root: type[Section]) -> str:
    keys, sections, accepted = _locate(error["loc"], root)
    kind, context = error["type"], error.get("ctx", {})
    given = _given(error["input"])
    if kind == "fault":
        return _fault(keys, **context)
    if kind in UNKNOWN_KEY:
        key = str(error["loc"][-1])
        options = dict.fromkeys(key for section in sections for key in keys_of(section))
        others = _locate(error["loc"][:-2], root)[1]
        return _unknown([*keys, key], options, _hint(key, sections, others, root))
    if kind == "value_error":
        # Raised by a formula, whose message is complete.
        return f"{path_of(keys)}: {context['error']}"
    if kind == "missing":
        given = "missing"
    return f"{path_of(keys)}: {given}; accepted: {accepted}"


def _given(value: Any) -> str:
    if isinstance(value, Words):
        return str(value)
    if isinstance(value, Mapping | Section):
        return "given a table"
    return f"given {shown(value)}"


def _unknown(keys: list[str], accepted: Iterable[str], hint: str = "") -> str:
    options = list(accepted)
    near = difflib.get_close_matches(keys[-1], options, n=1)
    if near and not hint:
        hint = f", did you mean {near[0]}?"
    return f"{path_of(keys)}: unknown key{hint}; accepted: {listed(options)}"


def _hint(key: str, sections: list[type], others: list[type], root: type[Section]) -> str:
    """Return what there is to say of an unknown key that has a meaning elsewhere.

    Parameters
    ----------
    key
        The key.
    sections, others
        What it was given to; what could stand there as well.
    root
        The whole case.
    """
    field = keys_of(root).get(key)
    if field is not None and sections_of(field.annotation):
        table = _table(key, field.annotation)
        return f" here: {table} is a table of its own, at the top level"
    if Load in sections and key in FORCES:
        return f": {FORCES[key]}"
    kinds = {_kind(section): section for section in sections if _kind(section)}
    for kind, section in kinds.items():
        for other in others:
            if other is not section and key in keys_of(other):
                return f" with {kind}: it belongs to {_kind(other)}"
    homes = dict.fromkeys(table for table, section in _tables(root) if key in keys_of(section))
    if homes:
        return f" here: it belongs to {' or '.join(homes)}"
    if not kinds:
        return ""
    kind, section = next(iter(kinds.items()))
    near = difflib.get_close_matches(key, keys_of(section), n=1)
    return f" with {kind}" + (f", did you mean {near[0]}?" if near else "")


def _tables(root: type[Section]) -> Iterator[tuple[str, type]]:
    """Give the tables of a case at its top level with the sections that read them."""
    for key, field in keys_of(root).items():
        for section in sections_of(field.annotation).values():
            yield _table(key, field.annotation), section


def _table(key: str, annotation: Any) -> str:
    return f"[[{key}]]" if get_origin(annotation) is tuple else f"[{key}]"


def _kind(section: type) -> str:
    """Return the key that tells a section from others in its place, with its value."""
    for key, field in keys_of(section).items():
        if get_origin(field.annotation) is Literal and len(get_args(field.annotation)) == 1:
            return f"{key} = {shown(get_args(field.annotation)[0])}"
    return ""


def _locate(
    location: tuple[int | str, ...], root: type[Section]
) -> tuple[list[str], list[type], str]:
    """Follow a location of pydantic's through the sections.

    Returns
    -------
    The keys as in the case file (without pydantic's tags of unions), the sections that can
    stand there, and what is accepted there, in words.
    """
    keys: list[str] = []
    options: Mapping[str, type] = {root.__name__: root}
    accepted = "tables"
    named = False  # the next item is a name chosen by the user
    for item in location:
        if isinstance(item, int) or named:
            keys.append(str(item))
            named = False
        elif item in options:
            options = {item: options[item]}
        else:
            fields = {k: f for s in options.values() for k, f in keys_of(s).items()}
            if item not in fields:
                continue
            field = fields[item]
            keys.append(item)
            options = sections_of(field.annotation)
            accepted = accepted_by(field.annotation, field.metadata)
            named = get_origin(field.annotation) is dict
    return keys, list(options.values()), accepted
