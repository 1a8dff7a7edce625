"""Building blocks of the case file's models: sections, kinds of values, faults.

Each kind of value carries, in words, what it accepts. Error messages and the reference page
are both made from these words.
"""

from __future__ import annotations

import types
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeAlias, Union, get_args, get_origin

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError, core_schema

from contact.case import formula as expressions
from contact.errors import InputError
from contact.tolerances import PRECISION


class Section(BaseModel):
    """A table of the case file: frozen, without unknown keys, NaN or infinity."""

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
        populate_by_name=True,
        validate_default=False,
    )


@dataclass(frozen=True)
class Accepted:
    """What a kind of value accepts, in words."""

    text: str


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


FORMULA = "a number or a formula"

Formula: TypeAlias = Annotated[expressions.Expression, _FormulaSchema, Accepted(FORMULA)]
NonNegativeFormula: TypeAlias = Annotated[
    expressions.Expression,
    _FormulaSchema,
    AfterValidator(_not_negative),
    Accepted("a number >= 0 or a formula"),
]
Number: TypeAlias = Annotated[float, Accepted("a number")]
Positive: TypeAlias = Annotated[float, Field(gt=0), Accepted("a number > 0")]
NonNegative: TypeAlias = Annotated[float, Field(ge=0), Accepted("a number >= 0")]
Tolerance: TypeAlias = Annotated[
    float,
    Field(ge=PRECISION, lt=1),
    Accepted(f"a number from {PRECISION:g}, the precision of numbers, to 1, excluded"),
]
Count: TypeAlias = Annotated[
    int, Field(ge=1, le=10_000_000), Accepted("a whole number from 1 to 10000000")
]
Switch: TypeAlias = Annotated[bool, Accepted("true or false")]
Text: TypeAlias = Annotated[str, Accepted("a text")]
Name: TypeAlias = Annotated[str, Field(min_length=1), Accepted("the name of a part")]
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


def sections_of(annotation: Any) -> Mapping[str, type[Section]]:
    """Return the models that an annotation holds, by the names of pydantic's union tags."""
    if isinstance(annotation, type) and issubclass(annotation, Section):
        return {annotation.__name__: annotation}
    found: dict[str, type[Section]] = {}
    if get_origin(annotation) is not Literal:
        for argument in get_args(annotation):
            found |= sections_of(argument)
    return found


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
