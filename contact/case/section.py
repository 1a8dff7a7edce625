"""Building blocks of the case file's models: tables, and the kinds of values in them.

Each kind of value carries the accepted ones in words, and where it matters a mark by which `walk`
finds it: `SPATIAL`, `PART`, `AMPLITUDE`, `FilePath`.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias, TypeVar, get_args, get_origin

from annotated_types import Predicate
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    PlainSerializer,
    PlainValidator,
    SerializerFunctionWrapHandler,
    Tag,
    ValidationInfo,
    WithJsonSchema,
    model_serializer,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError, core_schema

from contact import settings
from contact.case.formula import Expression
from contact.case.messages import Words, accepted_by, fault, keys_of, shown
from contact.errors import InputError
from contact.mesh import together
from contact.settings import SPATIAL, Accepted, Number, ReadWith

Table = TypeVar("Table")
One = TypeVar("One")
Many = TypeVar("Many")


class Section(BaseModel):
    """A table of the case file: frozen, without unknown keys, NaN or infinity.

    The docstring below a key is its description. A key with `ReadWith` is refused where it would
    have no effect, and left out where the case is written.
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
        populate_by_name=True,
        validate_default=False,
        use_attribute_docstrings=True,
        defer_build=True,  # the case's own is all that reads; each would take milliseconds
    )

    #: Unknown keys that a user may look for here, each with a hint to its place.
    hints: ClassVar[Mapping[str, str]] = {}

    @model_validator(mode="after")
    def _check_conditions(self) -> Self:
        return check_conditions(self)

    @model_serializer(mode="wrap")
    def _write(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        unread = without_effect(self)
        return {key: value for key, value in handler(self).items() if key not in unread}


@cache
def conditions(of: type) -> tuple[tuple[str, FieldInfo, ReadWith], ...]:
    """Return the keys of a kind of table that are read under a condition."""
    return tuple(
        (key, field, mark)
        for key, field in keys_of(of).items()
        for mark in field.metadata
        if isinstance(mark, ReadWith)
    )


def without_effect(table: Any) -> set[str]:
    """Return the keys of a table that are not read, given the others."""
    of: Any = type(table)
    return {key for key, _, needs in conditions(of) if not needs.met(getattr(table, needs.key))}


def check_conditions(table: Table) -> Table:
    """Return a table, if no key is without effect and none is missing."""
    of: Any = type(table)
    for key, field, needs in conditions(of):
        value, other = getattr(table, key), getattr(table, needs.key)
        if not needs.met(other):
            if value != field.default:
                raise fault(key, as_given(value), f"{key} with {needs}")
        elif needs.required and value is None:
            accepted = accepted_by(field.annotation, field.metadata)
            raise fault(key, Words("missing"), f"{accepted} with {needs.key} = {shown(other)}")
    return table


class FromTable:
    """Lets pydantic read a frozen dataclass from a table, with all the checks of a section."""

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: Any) -> core_schema.CoreSchema:
        """Make the schema of the dataclass accept tables, without the fields for Python alone."""
        schema = handler.resolve_ref_schema(handler(source))
        # Strictness, which the fields are to have, would take instances alone here.
        schema["strict"] = False
        inner = schema["schema"]
        while "fields" not in inner:
            inner = inner["schema"]
        inner["fields"] = [field for field in inner["fields"] if field["name"] in keys_of(source)]
        return core_schema.no_info_before_validator_function(_with_tuples, schema)


def _with_tuples(given: Any) -> Any:
    # TOML has lists, and strict fields take tuples alone.
    if not isinstance(given, Mapping):
        return given
    return {key: tuple(v) if isinstance(v, list) else v for key, v in given.items()}


def walk(
    value: Any, path: tuple[str, ...] = (), marks: tuple[Any, ...] = ()
) -> Iterator[tuple[str, Any, tuple[Any, ...]]]:
    """Give all lists and values below a value of the case.

    Yields
    ------
    The dotted path, the value, and the marks of its type.
    """
    if isinstance(value, BaseModel) or is_dataclass(value):
        of: Any = type(value)
        for name, key, below in _marked(of):
            yield from walk(getattr(value, name), (*path, key), below)
        return
    if isinstance(value, Mapping):
        for key, entry in value.items():
            yield from walk(entry, (*path, key), marks)
        return
    yield ".".join(path), value, marks
    if isinstance(value, tuple):
        for i, entry in enumerate(value):
            yield from walk(entry, (*path, str(i)), marks)


@cache
def _marked(of: Any) -> tuple[tuple[str, str, tuple[Any, ...]], ...]:
    """Return the fields of a kind of table, their keys, and the marks of their types."""
    fields = of.model_fields if issubclass(of, BaseModel) else keys_of(of)
    return tuple(
        (name, field.alias or name, (*field.metadata, *_marks(field.annotation)))
        for name, field in fields.items()
    )


def _marks(annotation: Any) -> Iterator[Any]:
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Annotated:
        yield from arguments[1:]
    for argument in arguments[:1] if origin is Annotated else arguments:
        yield from _marks(argument)


def as_given(value: Any) -> Any:
    """Return a value of the case as a message shows it."""
    if isinstance(value, tuple):
        return [as_given(entry) for entry in value]
    return value.source if isinstance(value, Expression) else value


class FilePath(str):
    """Path of a file that the case reads, relative to the working folder."""


def _placed(given: str, info: ValidationInfo) -> FilePath:
    # A name in a case file is relative to the folder of that file.
    return FilePath(Path((info.context or {}).get("folder", ".")) / given)


def _expression(given: Any) -> Expression:
    return given if isinstance(given, Expression) else Expression(given)


def _not_negative(expression: Expression) -> Expression:
    if expression.is_constant and expression.value < 0:
        raise InputError(
            f"{expression} is negative; accepted: a number >= 0 or a formula", "negative"
        )
    return expression


def _of_time(given: Any) -> Any:
    if isinstance(given, Expression) and given.names - {"t"}:
        raise InputError(
            f"{given} depends on the place; accepted: a number or a formula in t",
            "formula-variable",
        )
    return given


def _part(given: Any) -> str:
    try:
        return together.part(given)
    except InputError:
        raise PydanticCustomError("part", "part") from None


#: Tell a list, "many", from a single value, "one"; and a law, by its name, from a formula.
one_or_many = Discriminator(lambda given: "many" if isinstance(given, list | tuple) else "one")
formula_or_law = Discriminator(
    lambda given: (
        given.get("law") if isinstance(given, Mapping) else getattr(given, "law", "formula")
    )
)

as_tuple = BeforeValidator(lambda given: tuple(given) if isinstance(given, list) else given)
_as_source = PlainSerializer(lambda value: getattr(value, "source", value))

#: A list of 2 or 3, of one or more; a single value, or a list; one, or a list of the same.
Few: TypeAlias = Annotated[tuple[One, ...], Field(min_length=2, max_length=3), as_tuple]
Some: TypeAlias = Annotated[tuple[One, ...], Field(min_length=1), as_tuple]
Either: TypeAlias = Annotated[
    Annotated[One, Tag("one")] | Annotated[Many, Tag("many")], one_or_many
]
OneOrSome: TypeAlias = Either[One, Some[One]]

#: Marks of a part of the mesh, and of a name below evolution.amplitudes.
PART, AMPLITUDE = "part", "amplitude"

#: Kinds of values that functions read, for the JSON schema: names, and a formula.
_NAME = {"type": "string", "minLength": 1}
_NAMES = WithJsonSchema({**_NAME, "type": ["string", "array"], "minItems": 1, "items": _NAME})
_FORMULA = {"type": ["number", "string"], "minLength": 1}

Text: TypeAlias = Annotated[str, Accepted("a text")]
Name: TypeAlias = Annotated[str, Field(min_length=1), Accepted("the name of a part")]
Names: TypeAlias = Annotated[
    tuple[Name, ...],
    Field(min_length=1),
    BeforeValidator(lambda given: (given,) if isinstance(given, str) else given),
    as_tuple,
    Accepted("a name, or a list of names"),
    _NAMES,
]
#: A file, whose path a dump writes by the function ``path`` of its context.
File: TypeAlias = Annotated[
    str,
    AfterValidator(_placed),
    PlainSerializer(lambda path, info: (info.context or {}).get("path", str)(path)),
]
Part: TypeAlias = Annotated[
    str,
    PlainValidator(_part),
    PlainSerializer(lambda name: [*getattr(name, "members", ())] or name),
    PART,
    Accepted(together.ACCEPTED),
    _NAMES,
]
AmplitudeName: TypeAlias = Annotated[
    str,
    Field(min_length=1),
    AMPLITUDE,
    Accepted('a name below evolution.amplitudes, or "constant"'),
]
Vector: TypeAlias = Annotated[settings.Vector, as_tuple]
Direction: TypeAlias = Annotated[settings.Direction, as_tuple]
Triple: TypeAlias = Annotated[
    tuple[Number, ...],
    Field(min_length=3, max_length=3),
    as_tuple,
    Accepted("a list of 3 numbers"),
]
#: One that is not zero.
Axis: TypeAlias = Annotated[
    Triple, Predicate(any), Accepted("a vector that is not zero, of 3 numbers")
]

Formula: TypeAlias = Annotated[
    Expression,
    PlainValidator(_expression),
    _as_source,
    Accepted("a number or a formula"),
    WithJsonSchema(_FORMULA),
]
NonNegativeFormula: TypeAlias = Annotated[
    Formula,
    AfterValidator(_not_negative),
    Accepted("a number >= 0 or a formula"),
    WithJsonSchema({**_FORMULA, "minimum": 0}),
]
TimeFormula: TypeAlias = Annotated[
    Formula, AfterValidator(_of_time), Accepted("a number or a formula in t")
]
Component: TypeAlias = Annotated[
    Expression | Literal["free"],
    PlainValidator(lambda given: given if given == "free" else _expression(given)),
    _as_source,
    Accepted('a number, a formula or "free"'),
    WithJsonSchema(_FORMULA),
]
TimeComponent: TypeAlias = Annotated[
    Component, AfterValidator(_of_time), Accepted('a number, a formula in t or "free"')
]
FormulaVector: TypeAlias = Annotated[
    Few[Formula], SPATIAL, Accepted("a list of 2 numbers or formulas in 2-D, 3 in 3-D")
]
