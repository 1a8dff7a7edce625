"""Types of settings with their bounds, and the accepted values in words.

A class of options is a frozen dataclass that states each setting once: name, type with bounds and
default in its field, the meaning under "Attributes" in its docstring. Python makes it unchecked;
the case file checks the bounds, and has its messages and its reference page from the same place.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Annotated, TypeAlias

from annotated_types import Ge, Gt, Le, Len, Lt, Predicate

from contact.tolerances import PRECISION


@dataclass(frozen=True)
class Accepted:
    """The accepted values of a type in words."""

    text: str


@dataclass(frozen=True)
class ReadWith:
    """Condition on another setting for this one to be read.

    Attributes
    ----------
    key
        The other setting.
    value
        Its value, or several; None for any that is given.
    required
        Whether this setting is then required.
    """

    key: str
    value: str | bool | tuple[str, ...] | None = None
    required: bool = False

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


@dataclass(frozen=True)
class Internal:
    """Mark of a setting for Python alone, not in the case file."""


@dataclass(frozen=True)
class Required:
    """Marks a setting that the case file requires, where Python has another one for it."""


#: Mark of a list with one number a dimension.
SPATIAL = "spatial"

Positive: TypeAlias = Annotated[float, Gt(0), Accepted("a number > 0")]
NonNegative: TypeAlias = Annotated[float, Ge(0), Accepted("a number >= 0")]
Number: TypeAlias = Annotated[float, Accepted("a number")]
Vector: TypeAlias = Annotated[
    tuple[Number, ...], Len(2, 3), SPATIAL, Accepted("a list of 2 numbers in 2-D, 3 in 3-D")
]
#: A direction, of any length but zero.
Direction: TypeAlias = Annotated[
    tuple[Number, ...],
    Len(2, 3),
    Predicate(any),
    SPATIAL,
    Accepted("a vector that is not zero, of 2 numbers in 2-D, 3 in 3-D"),
]
Tolerance: TypeAlias = Annotated[
    float,
    Ge(PRECISION),
    Lt(1),
    Accepted(f"a number from {PRECISION:g}, the precision of numbers, to 1, excluded"),
]
Count: TypeAlias = Annotated[
    int, Ge(1), Le(10_000_000), Accepted("a whole number from 1 to 10000000")
]
Switch: TypeAlias = Annotated[bool, Accepted("true or false")]
