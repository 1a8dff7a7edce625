"""Kinds of values of descriptions: of a case file, and objects of Python in their places.

Each carries the accepted values in words, and where it matters a mark by which `section.walk` finds
it: `SPATIAL`, `PART`, `AMPLITUDE`, `FilePath`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import (
    Annotated,
    Any,
    Literal,
    TypeAlias,
    TypeVar,
    cast,
)

import numpy as np
from annotated_types import Predicate
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Discriminator,
    PlainSerializer,
    PlainValidator,
    Tag,
    ValidationInfo,
    WithJsonSchema,
)
from pydantic import (
    Field as Bounds,
)
from pydantic_core import PydanticCustomError
from ufl.core.expr import Expr

from contact import settings
from contact.arguments import OfTime
from contact.errors import InputError
from contact.mesh import parts as mesh_parts
from contact.model.fields import Amplitude, Field, GivenAmplitude, Moving, field, own_amplitude
from contact.model.formula import Expression, of_time
from contact.model.section import IN_PYTHON, called
from contact.settings import SPATIAL, Accepted, Number
from contact.typing import Array

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
        return mesh_parts.part(given)
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
    Accepted(mesh_parts.ACCEPTED),
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
