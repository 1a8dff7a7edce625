"""One message for wrong input: its place, the given value, the accepted values.

The words come with the error: each kind of value has the accepted ones (`settings.Accepted`), and
checks of a table raise a `settings.fault`.
"""

from __future__ import annotations

import types
from collections.abc import Iterable, Mapping
from functools import cache
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.dataclasses import is_pydantic_dataclass
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from contact.errors import InputError, clipped, nearest, shown
from contact.settings import MISSING, Accepted, Fault, OrOwn, Words, fault, keys_in

#: Most characters of a list of accepted names.
LIST = 300


def unknown(key: str, known: Iterable[str], hint: str = "") -> InputError:
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
    """Return the first mistake of a case: an unknown key, of which others may be consequences."""
    errors = error.errors(include_url=False)
    made = [_message(e) for e in errors]
    own = [e for e in made if e.identifier == "unknown-key"]
    return [*own, *made][0].within(f"{source}: ")


def _message(error: ErrorDetails) -> InputError:
    path, context = clipped(".".join(keys_in(error["loc"]))), error.get("ctx", {})
    if error["type"] == "value_error":  # its words are complete
        whole: InputError = context["error"]
        return whole.within(path and path + ("." if isinstance(whole, Fault) else ": "))
    if error["type"] == "missing":
        return fault(path, MISSING, "a value")
    # Of pydantic's own errors those of a literal have the accepted values.
    accepted = str(context.get("expected", "a table")).replace("'", '"')
    return fault(path, error["input"], accepted)


def sections_of(annotation: Any) -> dict[str, type]:
    """Return the sections, and dataclasses that read tables, in an annotation, by their names."""
    if isinstance(annotation, type):
        reads = issubclass(annotation, BaseModel) or is_pydantic_dataclass(annotation)
        return {annotation.__name__: annotation} if reads else {}
    found: dict[str, type] = {}
    if get_origin(annotation) is not Literal:
        for argument in get_args(annotation):
            found |= sections_of(argument)
    return found


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
    """Return the key that tells sections of one place apart by a literal, and its values."""
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
        if isinstance(item, OrOwn):
            return accepted_by(get_args(annotation)[0])
    if get_origin(annotation) is Annotated:
        return accepted_by(get_args(annotation)[0], get_args(annotation)[1:])
    if get_origin(annotation) is Literal:
        return either(shown(value) for value in get_args(annotation))
    if get_origin(annotation) in (Union, types.UnionType):
        some = [kind for kind in get_args(annotation) if kind is not type(None)]
        if len(some) == 1:  # a value that may be missing
            return accepted_by(some[0])
        others += [accepted_by(kind) for kind in some if not sections_of(kind)]
    key, kinds = kinds_of(sections_of(annotation).values())
    table = f"a table with {key} = {either(map(shown, kinds))}" if kinds else "a table"
    return ", or ".join([*others, table])
