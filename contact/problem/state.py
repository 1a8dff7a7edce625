"""The state of a contact problem: a value, which queries take and methods return."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from contact.history import History
from contact.interface.active_set import ActiveSet
from contact.interface.multipliers import Multipliers
from contact.typing import Array


@dataclass(frozen=True)
class State:
    """Unknowns and contact forces at a time.

    Its arrays are not to be written to (they are marked so): a new state has new ones.

    Attributes
    ----------
    x
        Local unknowns, those of the ghosts behind the owned ones: displacement and scaled
        potential, node by node.
    forces
        Multipliers of the unilateral constraint and of friction.
    time
        When: loads and prescribed values are those of this time. A value without an amplitude
        grows with it, so that 1 stands for all of it (`contact.model.fields`).
    history
        That at the beginning of the step that led here; empty for a step from the reference
        configuration.
    active_set
        Which nodes were open, stick or slip in the Newton step that led here; None after none.
    layer_pressure
        Pressure of the linearised layer after it, shape (n,); None for that of the unknowns.
    """

    x: Array
    forces: Multipliers
    time: float = 1.0
    history: History = field(default_factory=History)
    active_set: ActiveSet | None = None
    layer_pressure: Array | None = None

    def __post_init__(self) -> None:
        """Keep whoever holds the state from changing it."""
        for array in (self.x, self.forces.pressure, self.forces.friction):
            array.flags.writeable = False

    def near(self, other: State, rtol: float = 0.0, atol: float = 0.0) -> bool:
        """Tell whether another state of the same problem has the same values on this rank."""
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
