"""What the numbers of a case stand for: names of units, for labels alone."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Annotated, Literal, TypeAlias

from contact.settings import Accepted

#: Quantities whose unit a label names.
Quantity: TypeAlias = Literal["length", "stress", "potential", "charge"]

Name: TypeAlias = Annotated[str, Accepted('a text, such as "mm"')]


@dataclass(frozen=True, kw_only=True)
class Units:
    """Names of the units of a case: they label axes, columns and the summary, and change nothing.

    Attributes
    ----------
    length
        Unit of lengths and displacements, for instance "mm".
    stress
        Unit of stresses and pressures, for instance "MPa".
    potential
        Unit of the electric potential, for instance "GV".
    charge
        Unit of charges, for instance "C".
    """

    length: Name | None = None
    stress: Name | None = None
    potential: Name | None = None
    charge: Name | None = None

    def label(self, words: str, quantity: Quantity) -> str:
        """Return words with the unit of a quantity, where it has a name."""
        unit = getattr(self, quantity)
        return f"{words} ({unit})" if unit else words

    @property
    def given(self) -> dict[str, str]:
        """The names that are given."""
        names = {field.name: getattr(self, field.name) for field in fields(self)}
        return {key: name for key, name in names.items() if name is not None}
