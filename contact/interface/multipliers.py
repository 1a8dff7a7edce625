"""Values at the contact nodes that go with the jump: contact forces and slip history.

All laws of Gamma_3 are written in the jump T x (`ContactNodes`). `Multipliers` are dual to it, and
`SlipHistory` is its history between the steps of an evolution: friction acts against the slip since
the end of the last step, and a coefficient mu(slip) looks at all slip so far. A static problem is
one step from zero.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from contact.history import CONTACT_NODES
from contact.interface.nodes import ContactNodes
from contact.typing import Array


@dataclass(frozen=True)
class Multipliers:
    """Contact forces at the owned contact nodes.

    Attributes
    ----------
    pressure
        lambda_c = -sigma_nu without the layer's part, shape (n,).
    friction
        lambda_f = -sigma_tau, tangential vectors, shape (n, d).
    """

    pressure: Array
    friction: Array

    @staticmethod
    def zero(jump: ContactNodes) -> Multipliers:
        """Return vanishing contact forces."""
        return Multipliers(np.zeros(jump.gap.size), np.zeros(jump.normal.shape))

    @staticmethod
    def of(jump: ContactNodes, pressure: Array, friction: Array) -> Multipliers:
        """Return contact forces with the tangential part of vectors of shape (n, d).

        All methods hand over theirs by this: rounding along the normal is no friction.
        """
        return Multipliers(pressure, jump.tangential_component(friction))

    def vectors(self, jump: ContactNodes) -> Array:
        """Return lambda_c nu + lambda_f, shape (n, d); of lambda_f the tangential part acts."""
        return self.pressure[:, None] * jump.normal + jump.tangential_component(self.friction)


@dataclass(frozen=True)
class SlipHistory:
    """The tangential jump at the end of the last step, and the way that it has gone.

    Its arrays are not to be written to (they are marked so). Open nodes have them too: one that
    touches again slips from where it was at the end of the last step.

    Attributes
    ----------
    jump
        j_tau at the end of the last step, tangential vectors, shape (n, d) (length).
    accumulated
        Sum of |Delta j_tau| over all steps, shape (n,) (length).
    """

    jump: Array
    accumulated: Array

    def __post_init__(self) -> None:
        """Keep whoever holds it from changing it."""
        self.jump.flags.writeable = self.accumulated.flags.writeable = False

    @staticmethod
    def rest(jump: ContactNodes) -> SlipHistory:
        """Return that of a body that has never slipped."""
        return SlipHistory(np.zeros(jump.normal.shape), np.zeros(jump.gap.size))

    @property
    def place(self) -> str:
        """Its arrays live at the contact nodes."""
        return CONTACT_NODES

    @property
    def arrays(self) -> Mapping[str, Array]:
        """Both arrays by name."""
        return {"jump": self.jump, "accumulated": self.accumulated}

    def replaced(self, arrays: Mapping[str, Array]) -> SlipHistory:
        """Return a slip history with other arrays."""
        return SlipHistory(arrays["jump"], arrays["accumulated"])
