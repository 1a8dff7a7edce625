"""Safeguarded Anderson acceleration of a fixed-point iteration z -> G(z)."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np

from contact.projections import Array


class Anderson:
    """Anderson mixing (type II) with a restart when the residual grows.

    Parameters
    ----------
    inner
        Global inner products: maps two matrices (n, k) and (n, l) of local values to the
        (k, l) matrix of sums over all ranks.
    depth
        Number of differences kept; 0 gives the plain iteration.
    growth
        The residual may grow by this factor over the smallest seen; beyond it the history is
        dropped and a plain step is taken from the best point.

    References
    ----------
    Walker and Ni, Anderson acceleration for fixed-point iterations, SIAM J. Numer. Anal. 49
    (2011).
    """

    def __init__(
        self, inner: Callable[[Array, Array], Array], depth: int = 8, growth: float = 2.0
    ) -> None:
        self._inner, self._depth, self._growth = inner, depth, growth
        self._steps: deque[Array] = deque(maxlen=max(depth, 1))
        self._changes: deque[Array] = deque(maxlen=max(depth, 1))
        self._last: tuple[Array, Array] | None = None
        self._best: tuple[float, Array] | None = None

    def next(self, z: Array, image: Array) -> Array:
        """Return the next point, given z and G(z) as flat arrays. Collective."""
        if self._depth == 0:
            return image
        residual = image - z
        size = float(np.sqrt(self._inner(residual[:, None], residual[:, None])[0, 0]))
        if self._best is not None and size > self._growth * self._best[0]:
            image = self._best[1]
            self.restart()
            return image
        if self._best is None or size < self._best[0]:
            self._best = (size, image.copy())
        if self._last is not None:
            self._steps.append(z - self._last[0])
            self._changes.append(residual - self._last[1])
        self._last = (z.copy(), residual.copy())
        if not self._changes:
            return image
        changes = np.column_stack(self._changes)
        gram = self._inner(changes, changes)
        load = self._inner(changes, residual[:, None])[:, 0]
        # Columns of very different length: scale them before the small least-squares solve.
        scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        theta = np.linalg.lstsq(gram / np.outer(scale, scale), load / scale, rcond=1e-14)[0] / scale
        return image - (np.column_stack(self._steps) + changes) @ theta

    def restart(self) -> None:
        """Forget the history."""
        self._steps.clear()
        self._changes.clear()
        self._last = None
        self._best = None
