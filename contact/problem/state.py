"""The state of a contact problem, a frozen value."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from contact.history import History
from contact.interface.active_set import ActiveSet
from contact.interface.multipliers import Multipliers
from contact.typing import Array


@dataclass(frozen=True)
class State:
    """Unknowns and contact forces at a time; its arrays are read-only.

    Attributes
    ----------
    x
        Local unknowns, ghosts behind the owned ones: displacement and scaled potential by node.
    forces
        Contact pressure and friction at the contact nodes.
    time
        Time of loads and prescribed values; 1 of a static problem.
    history
        History at the beginning of the step; empty for the reference configuration.
    active_set
        Active set of the last Newton step; None without one.
    layer_pressure
        Pressure of the linearised layer after that step, shape (n,); None for the law's.
    """

    x: Array
    forces: Multipliers
    time: float = 1.0
    history: History = field(default_factory=History)
    active_set: ActiveSet | None = None
    layer_pressure: Array | None = None

    def __post_init__(self) -> None:
        """Mark the arrays as read-only."""
        for array in (self.x, self.forces.pressure, self.forces.friction):
            array.flags.writeable = False

    def near(self, other: State, rtol: float = 0.0, atol: float = 0.0) -> bool:
        """Tell whether another state has the same values on this rank."""
        pairs = (
            (self.x, other.x),
            (self.forces.pressure, other.forces.pressure),
            (self.forces.friction, other.forces.friction),
        )
        return (
            self.history.near(other.history, rtol, atol)
            and self.time == other.time
            and all(np.allclose(one, two, rtol=rtol, atol=atol) for one, two in pairs)
        )
