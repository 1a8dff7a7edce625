"""Multipliers, slip history and active set at the contact nodes.

`Multipliers` are dual to the jump T x (`ContactNodes`). `SlipHistory` is (T x)_tau at the end of
the last step of an evolution, and the accumulated slip: friction acts against the slip since then,
and a coefficient mu(slip) depends on the accumulated one. A static problem is one step from zero.

The active set says which contact nodes are open, stick or slip. A node is in contact where
lambda_c - c (rho - u_nu) > 0 and sticks where |lambda_f + c u_tau| <= s: the pieces of the
complementarity functions (`contact.interface.complementarity`). Newton's method has the c of
(20), the results have c_b (`Interface`): the sets agree at the solution.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.history import CONTACT_NODES
from contact.interface.nodes import ContactNodes
from contact.tolerances import EPS
from contact.typing import Array


@dataclass(frozen=True)
class Multipliers:
    """Multipliers of contact and friction at the owned contact nodes.

    Attributes
    ----------
    contact
        lambda_c of the unilateral constraint, shape (n,); the contact pressure is
        p = -sigma_nu = lambda_c + p_l with that of the layer (`Interface.pressure`).
    friction
        lambda_f = -sigma_tau, tangential vectors, shape (n, d).
    """

    contact: Array
    friction: Array

    @staticmethod
    def zero(nodes: ContactNodes) -> Multipliers:
        """Return zero."""
        return Multipliers(np.zeros(nodes.weight.size), np.zeros(nodes.normal.shape))

    @staticmethod
    def of(nodes: ContactNodes, contact: Array, friction: Array) -> Multipliers:
        """Return multipliers, with the tangential part of vectors of shape (n, d) as friction."""
        return Multipliers(contact, nodes.tangential_component(friction))

    def vectors(self, nodes: ContactNodes) -> Array:
        """Return lambda_c nu + lambda_f, shape (n, d); of lambda_f the tangential part acts."""
        return self.contact[:, None] * nodes.normal + nodes.tangential_component(self.friction)


@dataclass(frozen=True)
class SlipHistory:
    """The tangential jump at the end of the last step, and the accumulated slip.

    Read-only arrays. Open nodes have them too: one that touches again slips from its jump at the
    end of the last step.

    Attributes
    ----------
    jump
        u_tau, the tangential part of T x, at the end of the last step, shape (n, d) (length).
    accumulated
        Sum of |Delta u_tau| over all steps, shape (n,) (length).
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


def constraint_active(
    lambda_c: Array, normal_gap: Array, c: float, rounding_stress: float = 0.0
) -> NDArray[np.bool_]:
    """Return where the non-penetration constraint is active, lambda_c - c g_N > 0: shape (n,).

    g_N = gap - u_nu; c is the complementarity parameter (stress/length), and `rounding_stress` a
    tolerance of lambda_c - c g_N (stress).
    """
    return np.greater(lambda_c - c * normal_gap, rounding_stress)


@dataclass(frozen=True)
class ActiveSet:
    """The state of each contact node: closed or open, and stick, slip or neither.

    Attributes
    ----------
    closed
        Where the non-penetration constraint is active, shape (n,).
    sticks, slips
        Where |lambda_f + c u_tau| <= s, and above, shape (n,), of nodes that are closed or have a
        friction bound s > 0. Open nodes have one by Tresca's law, by a smoothed pressure and by
        that of a compliant layer: they stick or slip too.
    """

    closed: NDArray[np.bool_]
    sticks: NDArray[np.bool_]
    slips: NDArray[np.bool_]

    @staticmethod
    def of(
        closed: NDArray[np.bool_],
        friction: Array,
        slip: Array,
        bound: Array,
        c: float,
        rounding_stress: float = 0.0,
    ) -> ActiveSet:
        """Return the states of nodes with friction: |lambda_f + c u_tau| <= s sticks.

        lambda_f and u_tau, the slip of the step, have the shape (n, d), the friction bound s has
        (n,); c and `rounding_stress` are those of `constraint_active`.
        """
        # At the bound and without slip yet a node sticks, to rounding.
        allowed = bound * (1 + 100 * EPS) + rounding_stress
        within = np.linalg.norm(friction + c * slip, axis=1) <= allowed
        acts = (bound > 0) | closed
        return ActiveSet(closed, within & acts, ~within & acts)

    @staticmethod
    def without_slip(closed: NDArray[np.bool_], friction: bool) -> ActiveSet:
        """Return nodes that stick where they touch, if there is friction."""
        return ActiveSet(closed, closed & friction, np.zeros_like(closed))

    def same(self, other: ActiveSet) -> bool:
        """Return whether another set is the same on this rank."""
        return (
            np.array_equal(self.closed, other.closed)
            and np.array_equal(self.sticks, other.sticks)
            and np.array_equal(self.slips, other.slips)
        )
