"""The active set: which contact nodes are open, stick or slip. This is its only definition.

The complementarity functions (`contact.interface.complementarity`) take their projections' pieces
from it: a node is in contact where p - c (gap - u_nu) > 0, and sticks where
|lambda_f + c u_tau| <= s.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from contact.tolerances import EPS
from contact.typing import Array


def constraint_active(
    pressure: Array, normal_gap: Array, c: float, rounding: float = 0.0
) -> NDArray[np.bool_]:
    """Return where the non-penetration constraint is active, p - c g_N > 0: shape (n,).

    Parameters
    ----------
    pressure, normal_gap
        Multiplier of the unilateral constraint, and g_N = gap - u_nu, shape (n,).
    c, rounding
        Complementarity parameter (stress/length), and tolerance (stress).
    """
    return np.greater(pressure - c * normal_gap, rounding)


@dataclass(frozen=True)
class ActiveSet:
    """The state of each contact node.

    Attributes
    ----------
    closed
        Where the non-penetration constraint is active, shape (n,).
    sticks, slips
        Where friction is below its bound, and at it, shape (n,). With a smoothed pressure or
        Tresca's law open nodes have a bound, and do either.
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
        rounding: float = 0.0,
    ) -> ActiveSet:
        """Return the states of nodes with friction: |lambda_f + c u_tau| <= s sticks.

        Parameters
        ----------
        closed
            Where the non-penetration constraint is active, shape (n,).
        friction, slip
            lambda_f and the slip of the step, shape (n, d).
        bound
            Friction bound s, shape (n,).
        c, rounding
            As in `constraint_active`.
        """
        # At the bound and without slip yet a node sticks, to rounding.
        allowed = bound * (1 + 100 * EPS) + rounding
        within = np.linalg.norm(friction + c * slip, axis=1) <= allowed
        acts = (bound > 0) | closed
        return ActiveSet(closed, within & acts, ~within & acts)

    @staticmethod
    def without_slip(closed: NDArray[np.bool_], friction: bool) -> ActiveSet:
        """Return nodes that stick where they touch, if there is friction."""
        return ActiveSet(closed, closed & friction, np.zeros_like(closed))

    def stopped(self, before: ActiveSet, friction: Array, slip: Array) -> ActiveSet:
        """Return this set with stick where slip reverses: lambda_f . u_tau < 0 after slip.

        Parameters
        ----------
        before
            Active set of the last step.
        friction, slip
            As in `of`.
        """
        stops = before.slips & self.slips & (np.einsum("ni,ni->n", friction, slip) < 0)
        return replace(self, sticks=self.sticks | stops, slips=self.slips & ~stops)

    def same(self, other: ActiveSet) -> bool:
        """Return whether another set is the same on this rank."""
        return (
            np.array_equal(self.closed, other.closed)
            and np.array_equal(self.sticks, other.sticks)
            and np.array_equal(self.slips, other.slips)
        )
