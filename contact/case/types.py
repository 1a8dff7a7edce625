"""Building blocks of the case file's models: sections, kinds of values, faults.

Each kind of value carries, in words, what it accepts: see `contact.case.accepted`.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, TypeAlias

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    PlainSerializer,
    SerializationInfo,
    ValidationInfo,
)
from pydantic_core import PydanticCustomError, core_schema

from contact.case import formula as expressions
from contact.case.showing import shown
from contact.errors import InputError
from contact.settings import Accepted


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


class FilePath(str):
    """Path of a file that the case reads, relative to the working folder."""


def _placed(given: str, info: ValidationInfo) -> FilePath:
    # A name in a case file is relative to the folder of that file.
    return FilePath(Path((info.context or {}).get("folder", ".")) / given)


def _path(path: str, info: SerializationInfo) -> str:
    return (info.context or {}).get("path", str)(path)  # type: ignore[no-any-return]


def _as_tuple(given: Any) -> Any:
    # TOML has lists, and strict models take tuples alone.
    return tuple(given) if isinstance(given, list) else given


def _not_negative(expression: expressions.Expression) -> expressions.Expression:
    if expression.is_constant and expression.value < 0:
        raise InputError(f"{expression} is negative; accepted: a number >= 0 or a formula")
    return expression


def _of_time(expression: expressions.Expression) -> expressions.Expression:
    if expression.names - {"t"}:
        raise InputError(f"{expression} depends on the place; accepted: a number or a formula in t")
    return expression


def _not_zero(vector: tuple[float, ...]) -> tuple[float, ...]:
    if not any(vector):
        raise InputError(f"given {shown(vector)}; accepted: a vector that is not zero")
    return vector


not_zero = AfterValidator(_not_zero)

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
#: A file, whose path a dump writes by the function ``path`` of its context.
File: TypeAlias = Annotated[str, AfterValidator(_placed), PlainSerializer(_path)]
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
#: A vector along which something points: of any length.
Direction: TypeAlias = Annotated[Vector, not_zero]
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


def as_given(value: Any) -> Any:
    """Return a value of the case as a message shows it."""
    if isinstance(value, tuple):
        return [as_given(entry) for entry in value]
    return value.source if isinstance(value, expressions.Expression) else value


def _as_names(given: Any) -> Any:
    return (given,) if isinstance(given, str) else _as_tuple(given)


Names: TypeAlias = Annotated[
    tuple[Name, ...],
    Field(min_length=1),
    BeforeValidator(_as_names),
    Accepted("a name, or a list of names"),
]
