"""What is written besides the summary and the tables: the case file's `[output]`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from contact.settings import Count, Switch


@dataclass(frozen=True, kw_only=True)
class OutputOptions:
    """What is written besides the summary and the tables.

    Attributes
    ----------
    fields
        Format of the fields: `vtu` (fields.vtu), which ParaView, pyvista and meshio open; `vtx`
        (fields.bp and cells.bp, by ADIOS2); `xdmf` (fields.xdmf); or none.
    every
        Steps of an evolution from one whose fields are written to the next.
    checkpoint
        `true`: write a checkpoint from which a computation can go on.
    mirror
        `true`: figures show both halves of a body of revolution.
    """

    fields: Literal["vtu", "vtx", "xdmf", "none"] = "vtu"
    every: Count = 1
    checkpoint: Switch = False
    mirror: Switch = False
