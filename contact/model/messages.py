"""One message for wrong input: its place, the given value, the accepted values.

The words come with the error: each kind of value has the accepted ones (`settings.Accepted`), and
checks of a table raise a `settings.fault`.
"""

from __future__ import annotations

import types
from collections.abc import Iterable, Mapping
from dataclasses import is_dataclass
from functools import cache
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, PydanticCustomError

from contact.errors import InputError, clipped, nearest, shown
from contact.settings import MISSING, Accepted, Words, fault, keys_in

#: Most characters of a list of accepted names.
LIST = 300


def unknown(key: str, known: Iterable[str], hint: str = "") -> PydanticCustomError:
    """Return the error for an unknown key of a table: with a hint, or the nearest known one."""
    words = Words(f"unknown key{nearest(key, known, ', did you mean {}?')}")
    return fault(clipped(key), words, hint or listed(known), "unknown-key")


def listed(options: Iterable[str]) -> str:
    """List accepted names; of very many the first ones."""
    return clipped(", ".join(options), LIST)


def either(options: Iterable[str]) -> str:
    """Join options: ``a, b or c``."""
    *first, last = options
    return f"{', '.join(first)} or {last}" if first else last


def describe(error: ValidationError, source: str) -> InputError:
    """Return the error, of a one-line message, for the first mistake of a case.

    An unknown key comes before all else: a missing key or a wrong value elsewhere is often but
    its consequence.
    """
    errors = error.errors(include_url=False)
    own = [e for e in errors if e.get("ctx", {}).get("identifier") == "unknown-key"]
    return _message([*own, *errors][0]).within(f"{source}: ")


def describe_fault(error: PydanticCustomError) -> InputError:
    """Return the error for a fault that was raised outside of pydantic's validation."""
    return _line([], **(error.context or {}))


def _message(error: ErrorDetails) -> InputError:
    keys, context = keys_in(error["loc"]), error.get("ctx", {})
    if error["type"] == "fault":
        return _line(keys, **context)
    if error["type"] == "value_error":  # of a formula, say: its message is complete
        whole: InputError = context["error"]
        return whole.within(f"{clipped('.'.join(keys))}: " if keys else "")
    if error["type"] == "missing":
        return _line(keys, "", MISSING, "a value", "missing")
    # Of pydantic's own errors those of a literal have the accepted values.
    accepted = str(context.get("expected", "a table")).replace("'", '"')
    return _line(keys, "", f"given {shown(error['input'])}", accepted)


def _line(
    keys: list[str], key: str, given: str, accepted: str, identifier: str = "value"
) -> InputError:
    """Return the error for a fault of a key below others; see `fault`."""
    path = clipped(".".join([*keys, key] if key else keys))
    return InputError(f"{path}: {given}; accepted: {accepted}", identifier)


def sections_of(annotation: Any) -> dict[str, type]:
    """Return the classes that read tables in an annotation, by their names.

    These are sections, and dataclasses (`section.described`).
    """
    if isinstance(annotation, type) and (
        issubclass(annotation, BaseModel) or is_dataclass(annotation)
    ):
        return {annotation.__name__: annotation}
    found: dict[str, type] = {}
    if get_origin(annotation) is not Literal:
        for argument in get_args(annotation):
            found |= {} if is_own(argument) else sections_of(argument)
    return found


def is_own(annotation: Any) -> bool:
    """Tell whether it stands for objects of Python, see `section.Own`."""
    return any(getattr(mark, "tag", "") == ":own" for mark in get_args(annotation))


@cache
def table_fields(table: Any) -> Mapping[str, FieldInfo]:
    """Return the fields of a table that a case file has, by the names of the attributes."""
    every = table.model_fields if issubclass(table, BaseModel) else table.__pydantic_fields__
    return {name: field for name, field in every.items() if not field.exclude}


@cache
def keys_of(table: Any) -> Mapping[str, FieldInfo]:
    """Return the same by their keys."""
    return {field.alias or name: field for name, field in table_fields(table).items()}


def kinds_of(sections: Iterable[type]) -> tuple[str, dict[str, type]]:
    """Return the key that tells sections of one place apart, and its value for each.

    Nothing for sections without such a key: one with a single literal as its value.
    """
    found: dict[str, type] = {}
    name = ""
    for section in sections:
        for key, field in keys_of(section).items():
            if get_origin(field.annotation) is Literal and len(get_args(field.annotation)) == 1:
                name = key
                found[get_args(field.annotation)[0]] = section
                break
    return name, found


def accepted_by(annotation: Any, metadata: Iterable[Any] = ()) -> str:
    """Return the accepted values of an annotation in words, tables after other kinds."""
    others: list[str] = []
    for item in reversed([*metadata]):  # the last one is of the narrower type
        if isinstance(item, Accepted):
            return item.text
    if get_origin(annotation) is Annotated:
        return accepted_by(get_args(annotation)[0], get_args(annotation)[1:])
    if get_origin(annotation) is Literal:
        return either(shown(value) for value in get_args(annotation))
    if get_origin(annotation) in (Union, types.UnionType):
        known = (kind for kind in get_args(annotation) if not is_own(kind))
        some = [kind for kind in known if kind is not type(None)]
        if len(some) == 1:  # a value that may be missing
            return accepted_by(some[0])
        others += [accepted_by(kind) for kind in some if not sections_of(kind)]
    key, kinds = kinds_of(sections_of(annotation).values())
    table = f"a table with {key} = {either(map(shown, kinds))}" if kinds else "a table"
    return ", or ".join([*others, table])
