"""A dense operator at kept nodes plus a small block at each: the first rank solves for all."""

from __future__ import annotations

from functools import partial

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrf, dgetrs, dpotrf, dpotrs

from contact.history import Evaluated
from contact.linear.layout import Inclined, masked, masked_blocks
from contact.linear.operator import Counters
from contact.ranks import on_root
from contact.typing import Array


class DenseOperator:
    """A dense matrix plus nodal blocks; as `operator.SparseOperator`.

    Parameters
    ----------
    comm
        Communicator.
    free
        Which of the owned kept unknowns are not fixed, shape (nodes, block size).
    stiffness
        The matrix, in rank order: on the first rank alone.
    counters
        Where factorisations and solves are counted.
    inclined
        Directions in which supports hold kept nodes, by their places; None for none.
    """

    symmetric, iterative = False, False

    def __init__(
        self,
        comm: MPI.Intracomm,
        free: NDArray[np.bool_],
        stiffness: Array,
        counters: Counters,
        inclined: Inclined | None = None,
    ) -> None:
        self._comm, self._free, self._stiffness = comm, free, stiffness
        self._inclined = inclined
        self.counters = counters

    def update(self, kind: str, state: Evaluated, blocks: Array, *, constant: bool = False) -> bool:
        """Add up and factorise. Collective; see `operator.SparseOperator.update`."""
        gathered = self._comm.gather(masked_blocks(self._free, self._inclined, blocks))
        on_root(self._comm, lambda: self._factorise(np.concatenate(gathered)))
        self.counters.factorizations += 1
        return True

    def _factorise(self, blocks: Array) -> Array:
        """Factorise, by Cholesky where that is possible: in each step of an interior point."""
        total = self._stiffness.copy(order="F")
        rows = np.arange(len(total)).reshape(blocks.shape[:2])
        total[rows[:, :, None], rows[:, None, :]] += blocks
        fault = 1
        if np.array_equal(blocks, blocks.transpose(0, 2, 1)):
            lower, fault = dpotrf(total, lower=True, clean=False)
            self._solve = partial(dpotrs, lower, lower=True)
        if fault:  # a potential makes it indefinite
            lower_upper, pivots, _ = dgetrf(total, overwrite_a=True)
            self._solve = partial(dgetrs, lower_upper, pivots)
        return np.zeros(0)

    def solve(self, rhs: Array, rtol: float | None = None, guess: Array | None = None) -> Array:
        """Solve for the owned unknowns. Collective; see `operator.SparseOperator.solve`."""
        total = self._comm.gather(masked(self._free, self._inclined, rhs))
        self.counters.linear_solves += 1
        begin = self._comm.scan(rhs.size) - rhs.size
        solution = on_root(self._comm, lambda: self._solve(np.concatenate(total))[0])
        return np.asarray(solution)[begin : begin + rhs.size]
