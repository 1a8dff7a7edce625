"""Acceleration of the Uzawa block relaxation: nonlinear GMRES over all its solves.

Affine combinations of forces and displacements in equilibrium are in equilibrium: only
complementarity is nonlinear. The combination of least defect of complementarity costs no linear
solve, and is the next iterate. With the right active set this is GMRES.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

import numpy as np

from contact.typing import Array

#: Trial lengths: of a Gauss-Newton step, between two points, beyond the last one.
DAMPED = 0.5 ** np.arange(5)
BETWEEN = np.linspace(0, 1, 5)
BEYOND = 2.0 ** np.arange(1, 21)

#: Most Gauss-Newton steps of a search.
SWEEPS = 20


class ResidualMinimiser:
    """Nonlinear GMRES for lambda = P(z), z = lambda + r u, with u affine in lambda.

    Points are pairs (lambda, z), arrays of shape (2, m) with m values on this rank. `inner` maps
    matrices (m, k) and (m, l) to the (k, l) inner products over all ranks, `project` z to P, shape
    (..., m), `derivative` z and directions (m, k) to the derivatives of P; `depth` directions stay.

    References
    ----------
    Washio and Oosterlee, Krylov subspace acceleration for nonlinear multigrid schemes,
    Electron. Trans. Numer. Anal. 6 (1997); Walker and Ni, Anderson acceleration for
    fixed-point iterations, SIAM J. Numer. Anal. 49 (2011).
    """

    def __init__(
        self,
        inner: Callable[[Array, Array], Array],
        project: Callable[[Array], Array],
        derivative: Callable[[Array, Array], Array],
        depth: int,
    ) -> None:
        self._inner, self._project, self._derivative = inner, project, derivative
        self._directions: deque[Array] = deque(maxlen=depth)
        self._best: Array | None = None

    def next(self, force: Array, z: Array, image: Array) -> Array:
        """Return the next z, (m,). Collective.

        `force` and `z` are lambda and lambda + r u, `image` is the z of the plain relaxation.
        """
        new, old = np.stack([force, z]), self._best
        if old is None:
            self._best = new
            return z
        self._append(new - old)
        # Without contact there is no slope: try points in between.
        starts = [old + t * (new - old) for t in BETWEEN]
        norms = self._defect_norms(starts)
        first = int(np.argmin(norms))
        point, norm = self._descend(starts[first], float(norms[first]))
        if norm < (1 - 1e-9) * norms[0]:
            self._best = point
            return point[1]
        beyond = self._extrapolated(old, new)
        if beyond is not None:
            self._best = beyond
            return beyond[1]
        # No descent: a plain step, which contracts.
        self._directions.clear()
        self._best = new
        return image

    def _defect(self, point: Array) -> Array:
        return point[0] - self._project(point[1])

    def _defect_norms(self, points: Sequence[Array]) -> Array:
        """Return the norms of lambda - P(z) at several points."""
        defects = self._defect(np.stack(points, axis=1)).T
        return np.sqrt(np.maximum(np.diag(self._inner(defects, defects)), 0.0))

    def _append(self, direction: Array) -> None:
        """Add a direction, orthonormal in z to the others, unless it depends on them."""
        length = self._norm(direction)
        for _ in range(2):  # twice is enough, in spite of cancellation
            if self._directions:
                basis = np.stack(self._directions, axis=-1)
                direction = direction - basis @ self._inner(basis[1], direction[1][:, None])[:, 0]
        rest = self._norm(direction)
        if rest > 1e-10 * length:
            self._directions.append(direction * (1 / rest))

    def _norm(self, direction: Array) -> float:
        column = direction[1][:, None]
        return float(np.sqrt(self._inner(column, column)[0, 0]))

    def _descend(self, point: Array, norm: float) -> tuple[Array, float]:
        """Minimise the residual over the directions by damped Gauss-Newton steps."""
        if not self._directions:
            return point, norm
        basis = np.stack(self._directions, axis=-1)
        for _ in range(SWEEPS):
            slopes = basis[0] - self._derivative(point[1], basis[1])
            load = self._inner(slopes, self._defect(point)[:, None])[:, 0]
            step = -basis @ least_squares(self._inner(slopes, slopes), load)
            trials = [point + t * step for t in DAMPED]
            norms = self._defect_norms(trials)
            k = int(np.argmin(norms))
            if not norms[k] < (1 - 1e-6) * norm:
                break
            point, norm, old = trials[k], float(norms[k]), norm
            if norm > 0.99 * old:
                break
        return point, norm

    def _extrapolated(self, old: Array, new: Array) -> Array | None:
        """Extrapolate a rigid motion, in which no force changes, up to contact; else None.

        A body that contact alone constrains moves freely until it touches.
        """
        before, after = self._defect(old), self._defect(new)
        changes = np.column_stack([after - before, after])
        change, norm = np.sqrt(np.maximum(np.diag(self._inner(changes, changes)), 0.0))
        if change > 1e-6 * norm:
            return None
        trials = [new, *(new + t * (new - old) for t in BEYOND)]
        norms = self._defect_norms(trials)
        level = (1 + 1e-6) * np.min(norms)
        return trials[int(np.flatnonzero(norms <= level)[-1])]


def least_squares(gram: Array, load: Array) -> Array:
    """Solve the normal equations, without singular values below 1e-6: free motions."""
    values, vectors = np.linalg.eigh(gram)
    kept = values > 1e-12
    return vectors[:, kept] @ ((vectors[:, kept].T @ load) / values[kept])
