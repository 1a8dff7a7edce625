"""The case file's sections on output: which files are written, and the names of the units."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from contact.model.section import Described
from contact.settings import Accepted, Count, Switch

#: Quantities whose unit a label names.
Quantity: TypeAlias = Literal["length", "stress", "potential", "charge"]

Name: TypeAlias = Annotated[str, Accepted('a text, such as "mm"')]


class Units(Described):
    """Names of units, which label axes, columns and the summary, and change nothing."""

    length: Name | None = None
    """Unit of lengths and displacements, for instance "mm"."""
    stress: Name | None = None
    """Unit of stresses and pressures, for instance "MPa"."""
    potential: Name | None = None
    """Unit of the electric potential, for instance "GV"."""
    charge: Name | None = None
    """Unit of charges, for instance "C"."""

    def label(self, words: str, quantity: Quantity) -> str:
        """Return words with the unit of a quantity, where it has a name."""
        unit = getattr(self, quantity)
        return f"{words} ({unit})" if unit else words

    @property
    def given(self) -> dict[str, str]:
        """The names that are given."""
        return self.model_dump(exclude_none=True)


class OutputOptions(Described):
    """The files that are written besides the summary and the tables."""

    fields: Literal["vtu", "vtx", "xdmf", "none"] = "vtu"
    """Format of the fields: `vtu` (fields.vtu), which ParaView, pyvista and meshio open; `vtx`
    (fields.bp and cells.bp, by ADIOS2); `xdmf` (fields.xdmf); or none."""
    every: Count = 1
    """Steps of an evolution from one whose fields are written to the next."""
    checkpoint: Switch = False
    """`true`: write a checkpoint from which a computation can go on."""
