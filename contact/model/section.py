"""Building blocks of descriptions: tables of a case file, and kinds of their values.

Each kind of value carries the accepted ones in words, and where it matters a mark by which `walk`
finds it: `SPATIAL`, `PART`, `AMPLITUDE`, `FilePath`.
"""

from __future__ import annotations

import inspect
import textwrap
from collections.abc import Callable, Iterator, Mapping
from dataclasses import is_dataclass
from functools import cache
from pathlib import Path
from typing import (
    Annotated,
    Any,
    ClassVar,
    Literal,
    Self,
    TypeAlias,
    TypeVar,
    cast,
    get_args,
    get_origin,
)

import numpy as np
from annotated_types import Predicate
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    PlainSerializer,
    PlainValidator,
    SerializerFunctionWrapHandler,
    Tag,
    ValidationError,
    ValidationInfo,
    WithJsonSchema,
    model_serializer,
    model_validator,
)
from pydantic import (
    Field as Bounds,
)
from pydantic.fields import FieldInfo
from pydantic_core import PydanticCustomError, PydanticOmit, core_schema
from ufl.core.expr import Expr

from contact import settings
from contact.arguments import OfTime
from contact.errors import InputError
from contact.mesh.domain import PART_ACCEPTED, part_name
from contact.model.fields import Amplitude, Field, GivenAmplitude, Moving, field, own_amplitude
from contact.model.formula import Expression, of_time
from contact.model.messages import (
    Words,
    accepted_by,
    describe,
    fault,
    fields_of,
    keys_of,
    shown,
)
from contact.settings import SPATIAL, Accepted, Number, ReadWith
from contact.typing import Array

Table = TypeVar("Table")


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
        arbitrary_types_allowed=True,  # objects of Python
        validate_default=False,
        use_attribute_docstrings=True,
        defer_build=True,  # the case's own is all that reads; each would take milliseconds
    )

    #: Unknown keys that a user may look for here, each with a hint to its place.
    hints: ClassVar[Mapping[str, str]] = {}

    @model_validator(mode="after")
    def _check_conditions(self) -> Self:
        return check_conditions(self)

    def __copy__(self) -> Self:
        """Return a copy without cached properties, which those of an update would not be."""
        made = super().__copy__()
        for name in made.__dict__.keys() - type(self).model_fields.keys():
            del made.__dict__[name]
        return made

    @model_serializer(mode="wrap")
    def _write(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        unread, keys = (
            without_effect(self),
            {n: f.alias or n for n, f in fields_of(type(self)).items()},
        )
        written = {keys.get(name, name): value for name, value in handler(self).items()}
        return {key: value for key, value in written.items() if key not in unread}


#: The context of a description that is made in Python, where values may be objects.
IN_PYTHON = {"python": True}


class Described(Section):
    """A section that is made in Python too: its `__init__` has the arguments of Python."""

    def __init_subclass__(cls, **options: Any) -> None:
        """Let tables be read without `__init__`, so that messages name their keys."""
        super().__init_subclass__(**options)
        cls.__init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Any) -> None:
        """Enter the keys under "Parameters" in the docstring, in the order of the arguments."""
        said = {key: field.description or "" for key, field in keys_of(cls).items()}
        own = [key for key in inspect.signature(cls.__init__).parameters if key in said] or [*said]
        lines = [line for key in own for line in (key, textwrap.indent(said[key], "    "))]
        text, _, examples = inspect.cleandoc(cls.__doc__ or "").partition("\n\nExamples\n")
        parts = [text, "\n".join(["Parameters", "----------", *lines])]
        cls.__doc__ = "\n\n".join([*parts, *([f"Examples\n{examples}"] if examples else [])])

    def __init__(self, **given: Any) -> None:
        try:
            self.__pydantic_validator__.validate_python(
                given, self_instance=self, context=IN_PYTHON
            )
        except ValidationError as error:
            raise describe(
                error, type(self), called(type(self).__name__, given.get("on"))
            ) from None


def called(title: Any, on: Any) -> str:
    """Return the name of a description in messages."""
    return f"{title} on {on!r}" if on else str(title)


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
    return {key for key, _, needs in conditions(of) if not needs.met(value_of(table, needs.key))}


def value_of(table: Any, key: str) -> Any:
    """Return the value of a key, whose attribute may have another name."""
    of: Any = type(table)
    return getattr(table, next(n for n, f in fields_of(of).items() if key in (n, f.alias)))


def check_conditions(table: Table) -> Table:
    """Return a table, if no key is without effect and none is missing."""
    of: Any = type(table)
    for key, info, needs in conditions(of):
        value, other = value_of(table, key), value_of(table, needs.key)
        if not needs.met(other):
            if value != info.default:
                raise fault(key, as_given(value), f"{key} with {needs}")
        elif needs.required and value is None:
            accepted = accepted_by(info.annotation, info.metadata)
            raise fault(key, Words("missing"), f"{accepted} with {needs.key} = {shown(other)}")
    return table


class Own:
    """Marks an object of Python's among kinds of values: no case file has it."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> core_schema.CoreSchema:
        """Take it as it is; who gives the kind its tag knows it."""
        return core_schema.any_schema()

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        """Leave it out."""
        raise PydanticOmit


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
        known = fields_of(source)
        inner["fields"] = [entry for entry in inner["fields"] if entry["name"] in known]
        for entry in inner["fields"]:
            if known[entry["name"]].is_required() and entry["schema"]["type"] == "default":
                entry["schema"] = entry["schema"]["schema"]
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
    return tuple(
        (name, field.alias or name, (*field.metadata, *_marks(field.annotation)))
        for name, field in fields_of(of).items()
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


One = TypeVar("One")
Many = TypeVar("Many")


class FilePath(str):
    """Path of a file that the case reads, relative to the working folder."""


def _placed(given: str, info: ValidationInfo) -> FilePath:
    # A name in a case file is relative to the folder of that file.
    return FilePath(Path((info.context or {}).get("folder", ".")) / given)


def _expression(given: Any) -> Expression:
    return given if isinstance(given, Expression) else Expression(given)


def _value(given: Any) -> Field | Moving:
    """Return a given function of position and time; of a case file a number or a formula."""
    plain = given is None or isinstance(given, bool | int | float | str | list | Mapping)
    return cast(Field | Moving, field(Expression(given) if plain else given))


def _static(given: Field | Moving, info: ValidationInfo) -> Field | Moving:
    """Return a value that is the same at all times; of a case file that is checked with others."""
    if isinstance(given, Moving) and info.context == IN_PYTHON:
        raise InputError(
            f"{given} depends on the time; accepted: a number or a function of position, the same "
            "at all times",
            "formula-variable",
        )
    return given


def _placeless(given: Field | Moving) -> Field | Moving:
    if not isinstance(given, Expression | Moving):
        raise InputError(
            f"{given} depends on the place; accepted: a number or a formula in t",
            "formula-variable",
        )
    return cast(Field | Moving, of_time(given))


def _timed(given: Any, info: ValidationInfo) -> Expression | OfTime:
    """Return a given number, formula in t, or function of time."""
    if callable(given):
        return (
            given
            if isinstance(given, OfTime)
            else OfTime(given, f"{_named(info)}: {info.field_name}")
        )
    given = float(given) if isinstance(given, np.number) else given
    return cast(Expression, of_time(_value(given)))


def _free(given: Any) -> Field | Moving | Literal["free"]:
    """Return a component, or "free" where it is not given."""
    unset = given is None or (isinstance(given, str) and given == "free")
    return "free" if unset else _value(given)


def _free_timed(given: Any, info: ValidationInfo) -> Expression | OfTime | Literal["free"]:
    unset = given is None or (isinstance(given, str) and given == "free")
    return "free" if unset else _timed(given, info)


def _factor(given: Any, info: ValidationInfo) -> GivenAmplitude | str:
    """Return an amplitude: of a case file its name, in Python a function of time."""
    if info.context == IN_PYTHON:
        return cast(Amplitude, own_amplitude(_named(info), given))
    if isinstance(given, str) and given:
        return given
    raise PydanticCustomError("amplitude", "amplitude")


def _named(info: ValidationInfo) -> str:
    """Return the same for the function that is validated."""
    return called((info.config or {}).get("title"), info.data.get("on"))


def _not_negative(expression: Any) -> Any:
    if isinstance(expression, Expression) and expression.is_constant and expression.value < 0:
        raise InputError(
            f"{expression} is negative; accepted: a number >= 0 or a formula", "negative"
        )
    return expression


def _part(given: Any) -> str:
    try:
        return part_name(given)
    except InputError:
        raise PydanticCustomError("part", "part") from None


#: Tell a list, "many", from a single value, "one".
one_or_many = Discriminator(
    lambda given: "many" if isinstance(given, list | tuple | np.ndarray) else "one"
)


def _components(given: Any) -> Any:
    """Return the components of a list, an array, or UFL of vectors."""
    if isinstance(given, Expr) and len(given.ufl_shape) == 1:
        return tuple(given[k] for k in range(given.ufl_shape[0]))
    if isinstance(given, np.ndarray) and given.ndim:
        given = [*given]
    return tuple(given) if isinstance(given, list) else given


def _in_time(given: Any, info: ValidationInfo) -> Any:
    """Return the components, functions of time with their names in messages."""
    given, name = _components(given), f"{_named(info)}: {info.field_name}"
    if not isinstance(given, tuple):
        return given
    return tuple(OfTime(v, f"{name}.{k}") if callable(v) else v for k, v in enumerate(given))


as_tuple = BeforeValidator(_components)
_as_source = PlainSerializer(lambda value: getattr(value, "source", value))

#: A list of 2 or 3, of one or more; a single value, or a list; one, or a list of the same.
Few: TypeAlias = Annotated[tuple[One, ...], Bounds(min_length=2, max_length=3), as_tuple]
FewTimed: TypeAlias = Annotated[
    tuple[One, ...], Bounds(min_length=2, max_length=3), BeforeValidator(_in_time)
]
Some: TypeAlias = Annotated[tuple[One, ...], Bounds(min_length=1), as_tuple]
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
Name: TypeAlias = Annotated[str, Bounds(min_length=1), Accepted("the name of a part")]
Names: TypeAlias = Annotated[
    tuple[Name, ...],
    Bounds(min_length=1),
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
    Accepted(PART_ACCEPTED),
    _NAMES,
]
Vector: TypeAlias = Annotated[settings.Vector, as_tuple]
Direction: TypeAlias = Annotated[settings.Direction, as_tuple]
Triple: TypeAlias = Annotated[
    tuple[Number, ...],
    Bounds(min_length=3, max_length=3),
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
#: The same; in Python a function of points of shape (n, d) too.
FormulaOrFunction: TypeAlias = Annotated[
    Expression | Callable[[Array], Array] | str,
    PlainValidator(_expression),
    _as_source,
    Accepted("a number or a formula"),
    WithJsonSchema(_FORMULA),
]
#: The same where Python may give functions, UFL and dolfinx Functions too.
Value: TypeAlias = Annotated[
    Field | Moving,
    PlainValidator(_value),
    _as_source,
    Accepted("a number or a formula"),
    WithJsonSchema(_FORMULA),
]
Values: TypeAlias = Annotated[
    Few[Value], SPATIAL, Accepted("a list of 2 numbers or formulas in 2-D, 3 in 3-D")
]
#: One that is the same at all times.
StaticValue: TypeAlias = Annotated[Value, AfterValidator(_static)]
NonNegativeValue: TypeAlias = Annotated[
    StaticValue,
    AfterValidator(_not_negative),
    Accepted("a number >= 0 or a formula"),
    WithJsonSchema({**_FORMULA, "minimum": 0}),
]
Placeless: TypeAlias = Annotated[
    Value, AfterValidator(_placeless), Accepted("a number or a formula in t")
]
Free: TypeAlias = Annotated[
    Field | Moving | Literal["free"],
    PlainValidator(_free),
    _as_source,
    Accepted('a number, a formula or "free"'),
    WithJsonSchema(_FORMULA),
]
Timed: TypeAlias = Annotated[
    Expression | OfTime,
    PlainValidator(_timed),
    _as_source,
    Accepted("a number or a formula in t"),
    WithJsonSchema(_FORMULA),
]
FreeTimed: TypeAlias = Annotated[
    Expression | OfTime | Literal["free"],
    PlainValidator(_free_timed),
    _as_source,
    Accepted('a number, a formula in t or "free"'),
    WithJsonSchema(_FORMULA),
]
FactorOfTime: TypeAlias = Annotated[
    Amplitude | str,
    PlainValidator(_factor),
    AMPLITUDE,
    Accepted('a name below evolution.amplitudes, or "constant"'),
    WithJsonSchema({"type": "string", "minLength": 1}),
]
