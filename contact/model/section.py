"""Building blocks of descriptions: tables of a case file, and kinds of their values.

Each kind of value carries the accepted ones in words. `walk` finds `FilePath` by its class, parts
and amplitudes by their keys.
"""

from __future__ import annotations

import inspect
import math
import textwrap
from collections.abc import Callable, Iterator, Mapping
from dataclasses import field, fields
from functools import cache, partial, reduce, wraps
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
    dataclass_transform,
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
from pydantic.dataclasses import dataclass as pydantic_dataclass
from pydantic.dataclasses import is_pydantic_dataclass
from pydantic.fields import FieldInfo
from pydantic_core import core_schema
from ufl.core.expr import Expr

from contact.arguments import OfTime, shorten
from contact.errors import InputError, nearest, shown
from contact.mesh.domain import PART_ACCEPTED, part_name
from contact.model.fields import (
    CONSTANT,
    Factor,
    Field,
    GivenAmplitude,
    Moving,
    Ramp,
    placeless,
    static,
    steady,
)
from contact.model.fields import field as given_field
from contact.model.formula import Expression
from contact.model.messages import accepted_by, describe, keys_of, table_fields, unknown
from contact.settings import MISSING, Accepted, Number, OrOwn, ReadWith, Words, fault
from contact.tolerances import HUGE
from contact.typing import Array

Kind = TypeVar("Kind")


#: Checks of values that are read: no unknown keys, NaN, infinity, or values of a similar type.
CONFIG = ConfigDict(
    extra="forbid",
    strict=True,
    allow_inf_nan=False,
    arbitrary_types_allowed=True,  # objects of Python
    populate_by_name=True,
    validate_default=False,
    use_attribute_docstrings=True,
)

#: The context of a description that is made in Python, where values may be objects. A copy has
#: "tables" besides: its own values, and no other table; amplitudes may have names there.
IN_PYTHON = {"python": True}


def in_python(info: ValidationInfo) -> bool:
    """Tell whether a value is given in Python, not by a table."""
    return "python" in (info.context or {})


class Section(BaseModel):
    """A table of the case file: frozen, without unknown keys, NaN or infinity.

    The docstring below a key is its description. A key with `ReadWith` is refused where it would
    have no effect, and left out where the case is written.
    """

    model_config = ConfigDict(
        frozen=True,
        defer_build=True,  # the case's own is all that reads; each would take milliseconds
        **CONFIG,
    )

    #: Unknown keys that a user may look for here, each with a hint to its place.
    hints: ClassVar[Mapping[str, str]] = {}

    @model_validator(mode="before")
    @classmethod
    def _read_keys(cls, given: Any, info: ValidationInfo) -> Any:
        return given if in_python(info) else with_known_keys(cls, given)

    @model_validator(mode="after")
    def _check_conditions(self) -> Self:
        for key, info, needs in conditions(type(self)):
            value, other = value_at(self, key), value_at(self, needs.key)
            if not needs.met(other):
                self.require(value == info.default, key, f"{key} with {needs}")
            elif needs.required and value is None:
                accepted = accepted_by(info.annotation, info.metadata)
                raise fault(key, MISSING, f"{accepted} with {needs.key} = {shown(other)}")
        return self

    def require(self, fits: object, path: str, accepted: str, identifier: str = "") -> None:
        """Raise a fault with the value at a dotted path, and the accepted ones, unless it fits."""
        if not fits:
            value = as_given(value_at(self, path))
            raise fault(path, MISSING if value is None else value, accepted, identifier)

    def require_either(
        self, one: tuple[str, ...], other: tuple[str, ...], identifier: str = "exclusive-keys"
    ) -> None:
        """Raise a fault unless all of some keys, or all of others, are given."""
        given = [key for key in (*one, *other) if getattr(self, key) is not None]
        if {*given} in ({*one}, {*other}):
            return
        missing = [key for key in (other if {*given} & {*other} else one) if key not in given]
        words = Words(f"given {', '.join(given)}") if given else MISSING
        accepted = f"{', '.join(one)}, or instead {', '.join(other)}"
        raise fault(missing[0] if missing else given[-1], words, accepted, identifier)

    @classmethod
    def _unknown(cls, name: str, source: str) -> InputError:
        """Return the error for an argument of another name than its keys."""
        return unknown(name, keys_of(cls), cls.hints.get(name, "")).within(f"{source}: ")

    @property
    def _called(self) -> str:
        """Its name in messages."""
        return called(type(self).__name__, getattr(self, "on", None))

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """Return a copy with other values of some keys, checked as those of a new description."""
        made = super().model_copy(deep=deep)
        private = made.__pydantic_private__
        keys = {name: info.alias or name for name, info in type(self).model_fields.items()}
        given = {keys[name]: getattr(made, name) for name in made.model_fields_set}
        for name, value in (update or {}).items():
            given[keys.get(name, name)] = value
            if name not in {*keys, *keys.values()}:
                raise self._unknown(str(name), self._called)
        context = IN_PYTHON | {"tables": [given] if isinstance(self, Described) else []}
        try:
            made.__pydantic_validator__.validate_python(given, self_instance=made, context=context)
        except ValidationError as error:
            raise describe(error, self._called) from None
        object.__setattr__(made, "__pydantic_private__", private)
        return made

    def __copy__(self) -> Self:
        """Return a copy without cached properties, which those of an update would not be."""
        made = super().__copy__()
        for name in made.__dict__.keys() - type(self).model_fields.keys():
            del made.__dict__[name]
        return made

    @model_serializer(mode="wrap")
    def _write(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        of = type(self)
        keys = {name: field.alias or name for name, field in of.model_fields.items()}
        unread = {k for k, _, needs in conditions(of) if not needs.met(value_at(self, needs.key))}
        written = {keys.get(name, name): value for name, value in handler(self).items()}
        return {k: value for k, value in written.items() if k not in unread and value != {}}


class Described(Section):
    """A section that is made in Python too: its `__init__` has the arguments of Python."""

    @classmethod
    def __pydantic_init_subclass__(cls, **options: Any) -> None:
        """Enter the keys in the docstring, in the order of the arguments."""
        # Tables are read without `__init__`, so that messages name their keys.
        cls.__pydantic_custom_init__ = False
        document(cls)

    @model_validator(mode="before")
    @classmethod
    def _refuse_tables(cls, given: Any, info: ValidationInfo) -> Any:
        """Refuse tables in a copy: units of a case file, as degrees, are not those of Python."""
        tables = (info.context or {}).get("tables")
        if isinstance(given, Mapping) and tables is not None:
            if not tables:
                raise fault("", Words("given a table"), f"{cls.__name__}(...)")
            tables.pop()
        return given

    def __init__(self, **given: Any) -> None:
        for name in given.keys() - {*type(self).model_fields, *keys_of(type(self))}:
            raise self._unknown(name, type(self).__name__)
        try:
            self.__pydantic_validator__.validate_python(
                given, self_instance=self, context=IN_PYTHON
            )
        except ValidationError as error:
            raise describe(error, called(type(self).__name__, given.get("on"))) from None


@dataclass_transform(frozen_default=True, field_specifiers=(Bounds, field))
def described(**options: Any) -> Callable[[type[Kind]], type[Kind]]:
    """Return a decorator for a frozen dataclass that is made in Python or read from a table."""

    def decorate(cls: type[Kind]) -> type[Kind]:
        cls.__get_pydantic_core_schema__ = classmethod(_read_table)  # type: ignore[attr-defined]
        made: Any = pydantic_dataclass(frozen=True, config=CONFIG, **options)(cls)
        init = made.__init__
        names = [field.name for field in fields(made) if not field.kw_only]

        @wraps(init)
        def __init__(self: Any, *given: Any, **named: Any) -> None:
            try:
                # By their names, which messages have.
                init(self, *given[len(names) :], **dict(zip(names, given)), **named)  # noqa: B905
            except ValidationError as error:
                raise describe(error, cls.__name__) from None

        made.__init__ = __init__
        document(made)
        return cast(type[Kind], made)

    return decorate


def _read_table(cls: type, source: Any, handler: Any) -> core_schema.CoreSchema:
    """Check the keys of a table; strictness, which the fields have, would take instances alone."""
    schema = handler(source) | {"strict": False}
    return core_schema.no_info_before_validator_function(partial(with_known_keys, source), schema)


def document(cls: Any) -> None:
    """Enter the keys of a table under "Parameters" in its docstring, in the order of `__init__`."""
    said = {key: field.description or "" for key, field in keys_of(cls).items()}
    first = [key for key in inspect.signature(cls.__init__).parameters if key in said]
    keys = dict.fromkeys([*first, *said])
    lines = [line for key in keys for line in (key, textwrap.indent(said[key], "    "))]
    text, _, examples = inspect.cleandoc(cls.__doc__ or "").partition("\n\nExamples\n")
    parts = [text, "\n".join(["Parameters", "----------", *lines])]
    cls.__doc__ = "\n\n".join([*parts, *([f"Examples\n{examples}"] if examples else [])])


def called(title: Any, on: Any) -> str:
    """Return the name of a description in messages."""
    return f"{title} on {on!r}" if on else str(title)


def with_known_keys(of: Any, given: Any) -> Any:
    """Return a table, if it has no unknown key, and all that are required."""
    if isinstance(given, Mapping):
        known = keys_of(of)
        for key in given:
            if key not in known:
                raise unknown(key, known, getattr(of, "hints", {}).get(key, ""))
        for key, info in known.items():
            if info.is_required() and key not in given:
                raise fault(key, MISSING, accepted_by(info.annotation, info.metadata))
    return given


@cache
def conditions(of: type) -> tuple[tuple[str, FieldInfo, ReadWith], ...]:
    """Return the keys of a kind of table that are read under a condition."""
    return tuple(
        (key, field, mark)
        for key, field in keys_of(of).items()
        for mark in field.metadata
        if isinstance(mark, ReadWith)
    )


def entries(value: Any) -> dict[str, Any]:
    """Return the values of a table by their keys, or of a list by their numbers; else nothing."""
    of: Any = type(value)
    if isinstance(value, BaseModel) or is_pydantic_dataclass(of):
        fields = table_fields(of).items()
        return {field.alias or name: getattr(value, name) for name, field in fields}
    if isinstance(value, tuple):
        return {str(i): entry for i, entry in enumerate(value)}
    return dict(value) if isinstance(value, Mapping) else {}


def value_at(table: BaseModel, path: str) -> Any:
    """Return the value at a dotted path below a table."""
    return reduce(lambda place, key: entries(place)[key], path.split("."), table)


def walk(value: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the paths and values of all tables, lists and values below a value of the case."""
    for key, entry in entries(value).items():
        place = f"{path}.{key}" if path else key
        yield place, entry
        yield from walk(entry, place)


def as_given(value: Any) -> Any:
    """Return a value of the case as a message shows it."""
    if isinstance(value, tuple):
        return [as_given(entry) for entry in value]
    if table := entries(value):
        return {key: as_given(entry) for key, entry in table.items() if entry is not None}
    return value.source if isinstance(value, Expression) else value


One = TypeVar("One")
Many = TypeVar("Many")


class FilePath(str):
    """Path of a file that the case reads, relative to the working folder."""


def _placed(given: str, info: ValidationInfo) -> FilePath:
    # A name in a case file is relative to the folder of that file.
    return FilePath(Path((info.context or {}).get("folder", ".")) / given)


def _value(given: Any) -> Field | Moving:
    """Return a given function of position and time; of a case file a number or a formula."""
    plain = given is None or isinstance(given, bool | int | float | str | list | Mapping)
    return given_field(Expression(given) if plain else given)


def _timed(given: Any, info: ValidationInfo) -> Expression | OfTime:
    """Return a given number, formula in t, or function of time."""
    if callable(given):
        return (
            given
            if isinstance(given, OfTime)
            else OfTime(given, f"{_named(info)}: {info.field_name}")
        )
    given = float(given) if isinstance(given, np.number) else given
    return cast(Expression, placeless(_value(given)))


def _factor(given: Any, info: ValidationInfo) -> GivenAmplitude | str:
    """Return an amplitude: of a case file its name, in Python a function of time."""
    if info.context != IN_PYTHON and isinstance(given, str) and given:
        return given
    if not in_python(info):
        raise fault("", given, NAMED)
    if given == CONSTANT:
        return steady
    if not callable(given):
        accepted = f'a function of time, such as lambda t: 2 * t, or "{CONSTANT}"'
        raise InputError(f"given {shorten(repr(given))}; accepted: {accepted}", "value")
    plain = given is steady or isinstance(given, Ramp | OfTime)
    return given if plain else OfTime(given, f"{_named(info)}: amplitude")


def _named(info: ValidationInfo) -> str:
    """Return the same for the function that is validated."""
    return called((info.config or {}).get("title"), info.data.get("on"))


def _free(given: Any) -> Any:
    """Return "free" for None, and others as they are but for "free" misspelt, no formula."""
    if isinstance(given, str) and given != "free" and nearest(given, ["free"]):
        raise fault("", given, 'a number, a formula or "free"')
    return "free" if given is None else given


def _not_negative(expression: Any) -> Any:
    if isinstance(expression, Expression) and expression.is_constant and expression.value < 0:
        raise InputError(
            f"{expression} is negative; accepted: a number >= 0 or a formula", "negative"
        )
    return expression


def _kind(given: Any) -> str:
    """Return the tag of a list, a table or a single value."""
    if isinstance(given, list | tuple | np.ndarray):
        return ":many"
    return ":table" if isinstance(given, Mapping | Section) else ":one"


#: Tells these apart.
by_kind = Discriminator(_kind)
one_or_many = Discriminator(lambda given: ":many" if _kind(given) == ":many" else ":one")


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


#: Components of a vector, in 2-D or 3-D, given as a list; in Python a function of the time too
#: (`FewTimed`). A list of one or more (`Some`). One value, or a list of another type (`Either`),
#: or of the same one (`OneOrSome`: [contact] or [[contact]]).
Few: TypeAlias = Annotated[tuple[One, ...], Bounds(min_length=2, max_length=3), as_tuple]
FewTimed: TypeAlias = Annotated[Few[One], BeforeValidator(_in_time)]
Some: TypeAlias = Annotated[tuple[One, ...], Bounds(min_length=1), as_tuple]
Either: TypeAlias = Annotated[
    Annotated[One, Tag(":one")] | Annotated[Many, Tag(":many")], one_or_many
]
OneOrSome: TypeAlias = Either[One, Some[One]]

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
    Bounds(min_length=1),
    AfterValidator(_placed),
    PlainSerializer(lambda path, info: (info.context or {}).get("path", str)(path)),
]
Part: TypeAlias = Annotated[
    str,
    PlainValidator(part_name),
    PlainSerializer(lambda name: [*getattr(name, "members", ())] or name),
    Accepted(PART_ACCEPTED),
    _NAMES,
]
Vector: TypeAlias = Annotated[Few[Number], Accepted("a list of 2 numbers in 2-D, 3 in 3-D")]
#: The square of its length is neither 0 nor infinite in floating point.
_directed = Predicate(lambda given: 1 / HUGE <= math.hypot(*given) <= HUGE)
Direction: TypeAlias = Annotated[
    Few[Number],
    _directed,
    Accepted("a vector of finite length, not zero, of 2 numbers in 2-D, 3 in 3-D"),
]
Triple: TypeAlias = Annotated[
    tuple[Number, ...],
    Bounds(min_length=3, max_length=3),
    as_tuple,
    Accepted("a list of 3 numbers"),
]
Axis: TypeAlias = Annotated[
    Triple, _directed, Accepted("a vector of finite length, not zero, of 3 numbers")
]

#: Read from a number or a formula, and written as that.
Given: TypeAlias = Annotated[One, PlainSerializer(as_given), WithJsonSchema(_FORMULA)]
#: In Python functions, UFL and dolfinx Functions too.
Value: TypeAlias = Annotated[
    Given[Annotated[Field | Moving, PlainValidator(_value)]], Accepted("a number or a formula")
]
Values: TypeAlias = Annotated[
    Few[Value], Accepted("a list of 2 numbers or formulas in 2-D, 3 in 3-D")
]
#: One that is the same at all times.
StaticValue: TypeAlias = Annotated[
    Given[Annotated[Field, PlainValidator(_value), AfterValidator(static)]],
    Accepted("a number or a formula"),
]
#: In Python a function of points of shape (n, d) too.
FormulaOrFunction: TypeAlias = Annotated[StaticValue | Callable[[Array], Array], OrOwn(callable)]
NonNegativeValue: TypeAlias = Annotated[
    StaticValue,
    AfterValidator(_not_negative),
    Accepted("a number >= 0 or a formula"),
    WithJsonSchema({**_FORMULA, "minimum": 0}),
]
Placeless: TypeAlias = Annotated[
    Value, AfterValidator(placeless), Accepted("a number or a formula in t")
]
Timed: TypeAlias = Annotated[
    Given[Annotated[Expression | OfTime, PlainValidator(_timed)]],
    Accepted("a number or a formula in t"),
]
#: A component that may be "free", in Python None.
Free: TypeAlias = Annotated[
    One | Literal["free"],
    OrOwn(lambda given: isinstance(given, str) and given == "free"),
    BeforeValidator(_free),
]
#: A name of an amplitude in words.
NAMED = 'a name below evolution.amplitudes, or "constant"'
FactorOfTime: TypeAlias = Annotated[
    Factor | str,
    PlainValidator(_factor),
    PlainSerializer(lambda given: CONSTANT if given is steady else given),
    Accepted(NAMED),
    WithJsonSchema({"type": "string", "minLength": 1}),
]
