"""The jump, and the values at the contact nodes that go with it: contact forces and slip history.

All laws of Gamma_3 are written in the jump T x of the unknowns. `Multipliers` are dual to it, and
`SlipHistory` is its history between the steps of an evolution: friction acts against the slip since
the end of the last step, and a coefficient mu(slip) looks at all slip so far. A static problem is
one step from zero.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.history import CONTACT_NODES
from contact.typing import Array


class Jump(Protocol):
    """Nodal values T x at the contact nodes, with their weights, directions and gaps.

    All that happens on Gamma_3 is written in them. In front of a rigid foundation T selects the
    nodes of the body (`contact.interface.nodes.ContactNodes`), and takes off how the foundation
    moves there.
    """

    @property
    def comm(self) -> MPI.Intracomm:
        """Communicator."""

    @property
    def nodes(self) -> NDArray[np.int32]:
        """Local numbers of the nodes that carry the blocks, shape (n,)."""

    @property
    def weight(self) -> Array:
        """Lumped surface mass: tributary areas, shape (n,)."""

    @property
    def normal(self) -> Array:
        """Contact directions, unit vectors out of the body, shape (n, d)."""

    @property
    def tangent(self) -> Array:
        """Projectors onto the free tangential directions, shape (n, d, d)."""

    @property
    def gap(self) -> Array:
        """Distances to the obstacle along the contact direction, shape (n,)."""

    @property
    def block_size(self) -> int:
        """Unknowns a node."""

    def apply(self, x: Array) -> Array:
        """Return T x of local or owned unknowns, shape (n, block size)."""

    def transpose(self, nodal: Array, into: Array) -> None:
        """Add T^T t of nodal vectors, shape (n, d) or (n, block size), to owned unknowns.

        Collective.
        """

    def normal_component(self, u: Array) -> Array:
        """Return u . nu, shape (n,), of vectors of shape (n, >= d)."""

    def tangential_component(self, u: Array) -> Array:
        """Return u_tau in the free tangential directions, shape (n, d)."""


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
    def zero(jump: Jump) -> Multipliers:
        """Return vanishing contact forces."""
        return Multipliers(np.zeros(jump.gap.size), np.zeros(jump.normal.shape))

    @staticmethod
    def of(jump: Jump, pressure: Array, friction: Array) -> Multipliers:
        """Return contact forces with the tangential part of vectors of shape (n, d).

        All methods hand over theirs by this: rounding along the normal is no friction.
        """
        return Multipliers(pressure, jump.tangential_component(friction))

    def vectors(self, jump: Jump) -> Array:
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
    def rest(jump: Jump) -> SlipHistory:
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
