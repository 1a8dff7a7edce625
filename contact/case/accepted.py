"""What the case file's models accept, in words: for error messages and the reference page."""

from __future__ import annotations

import types
from collections.abc import Mapping
from dataclasses import is_dataclass
from typing import Annotated, Any, Literal, Union, get_args, get_origin

from pydantic.fields import FieldInfo

from contact.case.types import Section
from contact.settings import Accepted, settings_of


def sections_of(annotation: Any) -> Mapping[str, type]:
    """Return what reads tables in an annotation, by the names of pydantic's union tags.

    These are sections, and classes of options (`contact.settings`).
    """
    if isinstance(annotation, type) and (
        issubclass(annotation, Section) or is_dataclass(annotation)
    ):
        return {annotation.__name__: annotation}
    found: dict[str, type] = {}
    if get_origin(annotation) is not Literal:
        for argument in get_args(annotation):
            found |= sections_of(argument)
    return found


def keys_of(section: type) -> dict[str, FieldInfo]:
    """Return the keys of a section, or of a class of options, as in the case file."""
    if issubclass(section, Section):
        return {field.alias or name: field for name, field in section.model_fields.items()}
    keys = {}
    for name, setting in settings_of(section).items():
        keys[name] = FieldInfo.from_annotated_attribute(setting.annotation, setting.default)
        keys[name].description = setting.meaning
    return keys


def accepted_by(annotation: Any, metadata: tuple[Any, ...] | list[Any] = ()) -> str:
    """Say in words what an annotation accepts."""
    for item in metadata:
        if isinstance(item, Accepted):
            return item.text
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        return accepted_by(arguments[0], arguments[1:])
    if origin is Literal:
        return either([f'"{value}"' for value in arguments])
    if origin in (Union, types.UnionType):
        return either([accepted_by(a) for a in arguments if a is not type(None)])
    return "a table"


def either(options: list[str]) -> str:
    """Join options: ``a, b or c``."""
    return " or ".join([", ".join(options[:-1]), options[-1]] if len(options) > 1 else options)
