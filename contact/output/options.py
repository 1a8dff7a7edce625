"""What is written besides the summary and the tables: the case file's `[output]`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from contact.settings import Switch


@dataclass(frozen=True, kw_only=True)
class OutputOptions:
    """What is written besides the summary and the tables.

    Attributes
    ----------
    fields
        Format of the fields: `vtx` (fields.bp), `xdmf` or none.
    checkpoint
        `true`: write a checkpoint from which a computation can go on.
    """

    fields: Literal["vtx", "xdmf", "none"] = "vtx"
    checkpoint: Switch = False
