"""Multipliers and slip history at the contact nodes.

`Multipliers` are dual to the jump T x (`ContactNodes`). `SlipHistory` is (T x)_tau at the end of
the last step of an evolution, and the accumulated slip: friction acts against the slip since then,
and a coefficient mu(slip) depends on the accumulated one. A static problem is one step from zero.
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
    """Multipliers of contact and friction at the owned contact nodes.

    Attributes
    ----------
    pressure
        lambda_c = -sigma_nu less the pressure of the layer, shape (n,).
    friction
        lambda_f = -sigma_tau, tangential vectors, shape (n, d).
    """

    pressure: Array
    friction: Array

    @staticmethod
    def zero(nodes: ContactNodes) -> Multipliers:
        """Return zero."""
        return Multipliers(np.zeros(nodes.weight.size), np.zeros(nodes.normal.shape))

    @staticmethod
    def of(nodes: ContactNodes, pressure: Array, friction: Array) -> Multipliers:
        """Return multipliers, with the tangential part of vectors of shape (n, d) as friction."""
        return Multipliers(pressure, nodes.tangential_component(friction))

    def vectors(self, nodes: ContactNodes) -> Array:
        """Return lambda_c nu + lambda_f, shape (n, d); of lambda_f the tangential part acts."""
        return self.pressure[:, None] * nodes.normal + nodes.tangential_component(self.friction)


@dataclass(frozen=True)
class SlipHistory:
    """The tangential jump at the end of the last step, and the accumulated slip.

    Read-only arrays. Open nodes have them too: one that touches again slips from its jump at the
    end of the last step.

    Attributes
    ----------
    jump
        j_tau at the end of the last step, shape (n, d) (length).
    accumulated
        Sum of |Delta j_tau| over all steps, shape (n,) (length).
    """

    jump: Array
    accumulated: Array

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        self.jump.flags.writeable = self.accumulated.flags.writeable = False

    @staticmethod
    def rest(nodes: ContactNodes) -> SlipHistory:
        """Return zero."""
        return SlipHistory(np.zeros(nodes.normal.shape), np.zeros(nodes.weight.size))

    @property
    def place(self) -> str:
        """The contact nodes."""
        return CONTACT_NODES

    @property
    def arrays(self) -> Mapping[str, Array]:
        """Both arrays by name."""
        return {"jump": self.jump, "accumulated": self.accumulated}

    def replaced(self, arrays: Mapping[str, Array]) -> SlipHistory:
        """Return a slip history with other arrays."""
        return SlipHistory(arrays["jump"], arrays["accumulated"])
