"""The case file's sections on output: which files are written, and the names of the units."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Annotated, Literal, TypeAlias

from contact.settings import Accepted, Count, Switch

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


@dataclass(frozen=True, kw_only=True)
class OutputOptions:
    """The files that are written besides the summary and the tables.

    Attributes
    ----------
    fields
        Format of the fields: `vtu` (fields.vtu), which ParaView, pyvista and meshio open; `vtx`
        (fields.bp and cells.bp, by ADIOS2); `xdmf` (fields.xdmf); or none.
    every
        Steps of an evolution from one whose fields are written to the next.
    checkpoint
        `true`: write a checkpoint from which a computation can go on.
    """

    fields: Literal["vtu", "vtx", "xdmf", "none"] = "vtu"
    every: Count = 1
    checkpoint: Switch = False
