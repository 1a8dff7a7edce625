"""Masters eliminated from a dense system, exactly: what is left acts on jumps alone.

The unknowns are those of slaves, s, and of masters, m. With s = j + P m the stiffness
[[S, C], [C^T, D]] becomes [[S, G], [G^T, H]], G = S P + C, H = P^T G + C^T P + D, and m
is eliminated: S_j = S - G H^-1 G^T, r_j = r_s - G H^-1 (r_m + P^T r_s). Rigid motions, potentials
of electrodes and the nodes of a second body are masters alike.
"""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.linalg import lu_factor, lu_solve

from contact.typing import Array


class Elimination:
    """Masters eliminated from a linear system, the same on all ranks.

    Parameters
    ----------
    stiffness
        S, shape (k, k).
    projection
        P, shape (k, m): sparse, few masters move slaves.
    coupling, corner
        C, shape (k, m), and D, shape (m, m).

    Attributes
    ----------
    stiffness
        S_j, shape (k, k); not numbers where the masters can move freely.
    """

    def __init__(
        self, stiffness: Array, projection: sparse.csr_array, coupling: Array, corner: Array
    ) -> None:
        border = stiffness @ projection + coupling
        inside = projection.T @ border + (projection.T @ coupling).T + corner
        self._projection = projection
        self._factors = lu_factor(inside, overwrite_a=True, check_finite=False)
        self._answers = self._solve(border.T)
        self.stiffness = stiffness - border @ self._answers

    def _solve(self, values: Array) -> Array:
        return np.asarray(lu_solve(self._factors, values, check_finite=False))

    def forces(self, on_slaves: Array, on_masters: Array) -> Array:
        """Return r_j, shape (k,), and remember the forces for `motion`."""
        self._forces = on_masters + self._projection.T @ on_slaves
        return np.asarray(on_slaves - self._answers.T @ self._forces)

    def motion(self, jumps: Array) -> tuple[Array, Array]:
        """Return how slaves and masters move, (k,) and (m,), given that the jumps do, (k,)."""
        masters = -self._solve(self._forces) - self._answers @ jumps
        return jumps + self._projection @ masters, masters
