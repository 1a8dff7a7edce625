"""Types of settings with their bounds, and the accepted values in words."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, TypeAlias, TypeVar, get_args

from annotated_types import Ge, Gt, Le, Lt
from pydantic import Field, ValidationError, ValidatorFunctionWrapHandler
from pydantic.json_schema import SkipJsonSchema
from pydantic_core import CoreSchema, core_schema

from contact.errors import InputError, nearest, shown
from contact.tolerances import PRECISION


class Words(str):
    """Words for a message, as against a text given in the case file."""


#: Stands for the given value of a key that is missing.
MISSING = Words("missing")


class Fault(InputError):
    """Wrong value of a table: its words begin with the key, before which come those above."""


def fault(key: str, given: Any, accepted: str, identifier: str = "") -> InputError:
    """Return an error for a validator to raise.

    `key` is the dotted path below the model that raises it, empty for the model's own value;
    `given` the value of the case file, or words inside `Words`; `accepted` the accepted values in
    words, texts in quotes: the one nearest to a given text is its hint. By default the `identifier`
    of an `InputError` is that of a missing key, or of a wrong value.
    """
    identifier = identifier or ("missing" if given is MISSING else "value")
    words = given if isinstance(given, Words) else f"given {shown(given)}"
    if isinstance(given, str) and not isinstance(given, Words) and f'"{given}"' not in accepted:
        words += nearest(given, re.findall('"([^"]+)"', accepted), ', did you mean "{}"?')
    said = f"{words}; accepted: {accepted}"
    return Fault(f"{key}: {said}", identifier) if key else InputError(said, identifier)


One = TypeVar("One")


def keys_in(location: tuple[int | str, ...]) -> list[str]:
    """Return the keys of a location of pydantic's, without its tags of unions (`:list`)."""
    return [str(key) for key in location if not str(key).startswith((":", "["))]


@dataclass(frozen=True)
class Accepted:
    """The accepted values of a type in words, which its errors then have."""

    text: str
    key: str = ""  #: of kinds of tables: the key that tells them apart, its values last in `text`

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        """Wrap the validation of the type."""
        return core_schema.no_info_wrap_validator_function(self._check, handler(source))

    def _check(self, given: Any, handler: ValidatorFunctionWrapHandler) -> Any:
        try:
            return handler(given)
        except ValidationError as error:
            for one in error.errors(include_url=False):
                if keys_in(one["loc"]) or one["type"] == "value_error":
                    raise  # of a value inside, or complete
            if not (self.key and isinstance(given, Mapping)):
                raise fault("", given, self.text) from None
            values = self.text.partition(f"{self.key} = ")[2]
            raise fault(self.key, given.get(self.key, MISSING), values) from None


@dataclass(frozen=True)
class OrOwn:
    """Marks a union of a kind that a table has, the first one, with objects of Python."""

    #: Their class, or a function that tells them; these objects are taken as they are.
    own: Callable[[Any], object]

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        """Validate a table alone."""
        of_table = handler.generate_schema(get_args(source)[0])
        return core_schema.no_info_wrap_validator_function(self._take, of_table)

    def _take(self, given: Any, handler: ValidatorFunctionWrapHandler) -> Any:
        own = isinstance(given, self.own) if isinstance(self.own, type) else self.own(given)
        return given if own else handler(given)


@dataclass(frozen=True)
class ReadWith:
    """Condition on another setting for this one to be read."""

    key: str  #: the other setting
    #: Its value, or several; None for any that is given.
    value: str | bool | tuple[str, ...] | None = None
    required: bool = False  #: whether this setting is then required

    def met(self, value: object) -> bool:
        """Tell whether a value of the other setting meets the condition."""
        if self.value is None:
            return value is not None
        return value in self.value if isinstance(self.value, tuple) else value == self.value

    def __str__(self) -> str:
        """Return the condition as in a case file."""
        if self.value is None:
            return self.key
        values = self.value if isinstance(self.value, tuple) else (self.value,)
        return f"{self.key} = {' or '.join(map(json.dumps, values))}"


#: A setting for Python alone, not in the case file.
Internal: TypeAlias = Annotated[One, Field(exclude=True), SkipJsonSchema()]

Positive: TypeAlias = Annotated[float, Gt(0), Accepted("a number > 0")]
NonNegative: TypeAlias = Annotated[float, Ge(0), Accepted("a number >= 0")]
Number: TypeAlias = Annotated[float, Accepted("a number")]
Tolerance: TypeAlias = Annotated[
    float,
    Ge(PRECISION),
    Lt(1),
    Accepted(f"a number from {PRECISION:g}, the precision of numbers, to 1, excluded"),
]
#: Largest count.
MOST_COUNT = 10_000_000
Count: TypeAlias = Annotated[
    int, Ge(1), Le(MOST_COUNT), Accepted(f"a whole number from 1 to {MOST_COUNT}")
]
Switch: TypeAlias = Annotated[bool, Accepted("true or false")]
