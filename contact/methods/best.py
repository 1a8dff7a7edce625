"""The best of what a search has met: what it leaves where it fails."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

Met = TypeVar("Met")


@dataclass
class Best(Generic[Met]):
    """What had the least residual of all that was met.

    Attributes
    ----------
    found
        What it is; None before anything was met that has a residual.
    """

    found: Met | None = None
    _least: float = np.inf

    def see(self, met: Met, residual: float) -> None:
        """Remember what was met, if its residual is the least. No number is no residual."""
        if residual < self._least:
            self.found, self._least = met, residual
