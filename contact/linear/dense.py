"""A dense operator at kept nodes, the same on all ranks, plus a small block at each node."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrf, dgetrs

from contact.linear.operator import Counters
from contact.typing import Array


class DenseBulk(Protocol):
    """A body seen from the kept nodes."""

    @property
    def comm(self) -> MPI.Intracomm:
        """Communicator."""

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which of the owned kept unknowns are not fixed, shape (nodes, block size)."""

    @property
    def stiffness(self) -> Array:
        """The dense matrix, on all ranks in rank order."""

    @property
    def own(self) -> slice:
        """Where this rank's unknowns are among those of all."""


class DenseOperator:
    """The dense matrix of a body plus nodal blocks; as `operator.SparseOperator`.

    Parameters
    ----------
    bulk
        The body, seen from the kept nodes.
    counters
        Where factorisations and solves are counted.
    """

    symmetric = False

    def __init__(self, bulk: DenseBulk, counters: Counters) -> None:
        self.bulk, self.counters = bulk, counters
        self._factors: tuple[Array, Array] | None = None

    def update(self, kind: str, x: Array, blocks: Array, *, constant: bool = False) -> bool:
        """Add up and factorise. Collective; see `operator.SparseOperator.update`."""
        bulk, free = self.bulk, self.bulk.free.astype(float)
        masked = _gather(bulk, blocks * free[:, :, None] * free[:, None, :])
        total = bulk.stiffness.copy(order="F")
        n, size = masked.shape[:2]
        rows = np.arange(n * size).reshape(n, size)
        total[rows[:, :, None], rows[:, None, :]] += masked
        factors, pivots, _ = dgetrf(total, overwrite_a=True)
        self._factors = factors, pivots
        self.counters.factorizations += 1
        return True

    def solve(self, rhs: Array, rtol: float | None = None, guess: Array | None = None) -> Array:
        """Solve for the owned unknowns. Collective; see `operator.SparseOperator.solve`."""
        assert self._factors is not None
        total = _gather(self.bulk, np.where(self.bulk.free.ravel(), rhs, 0.0))
        self.counters.linear_solves += 1
        solution, _ = dgetrs(*self._factors, total, overwrite_b=True)
        return np.asarray(solution[self.bulk.own])


def _gather(bulk: DenseBulk, values: Array) -> Array:
    return np.concatenate(bulk.comm.allgather(values))
