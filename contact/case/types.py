"""Building blocks of the case file's models: sections, kinds of values, faults.

Each kind of value carries, in words, what it accepts. Error messages and the reference page
are both made from these words.
"""

from __future__ import annotations

import types
from collections.abc import Iterable, Mapping
from dataclasses import is_dataclass
from functools import reduce
from operator import or_
from typing import Annotated, Any, Literal, TypeAlias, TypeVar, Union, get_args, get_origin

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
)
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError, core_schema

from contact.case import formula as expressions
from contact.errors import InputError
from contact.settings import Accepted, settings_of


class Section(BaseModel):
    """A table of the case file: frozen, without unknown keys, NaN or infinity."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
        populate_by_name=True,
        validate_default=False,
        defer_build=True,  # the case's own is all that reads; each would take milliseconds
    )


class FromTable:
    """Lets pydantic read a frozen dataclass from a table, with all the checks of a section."""

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> core_schema.CoreSchema:
        """Make the schema of the dataclass accept tables."""
        schema = handler.resolve_ref_schema(handler(source))
        # Strictness, which the fields are to have, would take instances alone here.
        schema["strict"] = False
        return schema


class _FormulaSchema:
    """Lets pydantic read numbers and formulas as `Expression`."""

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> core_schema.CoreSchema:
        return core_schema.no_info_plain_validator_function(
            lambda v: v if isinstance(v, expressions.Expression) else expressions.Expression(v),
            serialization=core_schema.plain_serializer_function_ser_schema(lambda e: e.source),
        )


def _as_tuple(given: Any) -> Any:
    # TOML has lists, and strict models take tuples alone.
    return tuple(given) if isinstance(given, list) else given


def _not_negative(expression: expressions.Expression) -> expressions.Expression:
    if expression.is_constant and expression.value < 0:
        raise InputError(f"{expression} is negative; accepted: a number >= 0 or a formula")
    return expression


Kind = TypeVar("Kind", bound=Section)


def _of_time(expression: expressions.Expression) -> expressions.Expression:
    if expression.names - {"t"}:
        raise InputError(f"{expression} depends on the place; accepted: a number or a formula in t")
    return expression


FORMULA = "a number or a formula"

Formula: TypeAlias = Annotated[expressions.Expression, _FormulaSchema, Accepted(FORMULA)]
NonNegativeFormula: TypeAlias = Annotated[
    expressions.Expression,
    _FormulaSchema,
    AfterValidator(_not_negative),
    Accepted("a number >= 0 or a formula"),
]
TimeFormula: TypeAlias = Annotated[
    expressions.Expression,
    _FormulaSchema,
    AfterValidator(_of_time),
    Accepted("a number or a formula in t"),
]
Number: TypeAlias = Annotated[float, Accepted("a number")]
NonNegative: TypeAlias = Annotated[float, Field(ge=0), Accepted("a number >= 0")]
Text: TypeAlias = Annotated[str, Accepted("a text")]
Name: TypeAlias = Annotated[str, Field(min_length=1), Accepted("the name of a part")]
AmplitudeName: TypeAlias = Annotated[
    str, Field(min_length=1), Accepted("a name below evolution.amplitudes")
]
Vector: TypeAlias = Annotated[
    tuple[Number, ...],
    Field(min_length=2, max_length=3),
    BeforeValidator(_as_tuple),
    Accepted("a list of 2 numbers in the plane, 3 in space"),
]
Triple: TypeAlias = Annotated[
    tuple[Number, ...],
    Field(min_length=3, max_length=3),
    BeforeValidator(_as_tuple),
    Accepted("a list of 3 numbers"),
]
FormulaVector: TypeAlias = Annotated[
    tuple[Formula, ...],
    Field(min_length=2, max_length=3),
    BeforeValidator(_as_tuple),
    Accepted("a list of 2 numbers or formulas in the plane, 3 in space"),
]
as_tuple = BeforeValidator(_as_tuple)


class Words(str):
    """Words for a message, as against a text given in the case file."""


#: Stands for what was given where a key itself is wrong.
UNKNOWN = Words("unknown key")


def fault(key: str, given: Any, accepted: str) -> PydanticCustomError:
    """Return an error for a validator to raise.

    Parameters
    ----------
    key
        Dotted path below the model that raises it.
    given
        What was given: a value of the case file, words inside `Words`, or `UNKNOWN`.
    accepted
        What is accepted, in words.
    """
    return PydanticCustomError("fault", "fault", {"key": key, "given": given, "accepted": accepted})


def _as_names(given: Any) -> Any:
    return (given,) if isinstance(given, str) else _as_tuple(given)


Names: TypeAlias = Annotated[
    tuple[Name, ...],
    Field(min_length=1),
    BeforeValidator(_as_names),
    Accepted("a name, or a list of names"),
]


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
