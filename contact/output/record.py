"""What is kept of a step of an evolution."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from contact.problem.state import State

#: Columns of ``steps.csv`` that a look at a step shows.
SHOWN = ("t", "max_pressure", "contact_nodes", "max_displacement", "kkt")


@dataclass(frozen=True, repr=False)
class StepRecord:
    """What is kept of a step.

    Attributes
    ----------
    state
        Its solution.
    row
        The columns of ``steps.csv``.
    table
        The contact nodes, as `table.contact_table` returns them; None on ranks other than 0.
    enthalpy
        What the energy balance of the next step begins with, see `problem.energy.Moment`.
    unloaded
        Largest share of the body that has unloaded from beyond yield in a step so far.
    rounding
        Largest `rounding` of the residuals of a step so far, see `problem.kkt.KKT`.
    """

    state: State
    row: Mapping[str, float]
    table: Mapping[str, NDArray[Any]] | None
    enthalpy: float
    unloaded: float = 0.0
    rounding: float = 0.0

    def __repr__(self) -> str:
        """Return what a look at it should show; `row` has all."""
        shown = {name: self.row[name] for name in SHOWN if name in self.row}
        return f"<StepRecord: {', '.join(f'{name} = {v:.4g}' for name, v in shown.items())}>"
