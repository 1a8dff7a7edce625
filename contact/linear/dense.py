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


class DenseStiffness:
    """A dense matrix of the first rank, and the factors of its last sum with nodal blocks.

    Chord steps that change no active set take the same sum again.

    Parameters
    ----------
    matrix
        The matrix, in rank order.
    """

    def __init__(self, matrix: Array) -> None:
        self.matrix = matrix
        self._blocks: Array | None = None

    def factorise(self, blocks: Array) -> bool:
        """Add blocks at the nodes and factorise, unless the last ones were the same.

        By Cholesky where that is possible: in each step of an interior point.
        """
        if self._blocks is not None and np.array_equal(blocks, self._blocks):
            return False
        self._blocks = None  # no factors are left where memory does not do for new ones
        total = self.matrix.copy(order="F")
        rows = np.arange(len(total)).reshape(blocks.shape[:2])
        total[rows[:, :, None], rows[:, None, :]] += blocks
        fault = 1
        if np.array_equal(blocks, blocks.transpose(0, 2, 1)):
            lower, fault = dpotrf(total, lower=True, clean=False)
            self._solve = partial(dpotrs, lower, lower=True)
        if fault:  # a potential makes it indefinite
            lower_upper, pivots, _ = dgetrf(total, overwrite_a=True)
            self._solve = partial(dgetrs, lower_upper, pivots)
        self._blocks = blocks
        return True

    def solve(self, blocks: Array, rhs: Array) -> Array:
        """Solve with the sum with some blocks."""
        self.factorise(blocks)
        return np.asarray(self._solve(rhs)[0])


class DenseOperator:
    """A dense matrix plus nodal blocks; as `operator.SparseOperator`.

    Parameters
    ----------
    comm
        Communicator.
    free
        Which of the owned kept unknowns are not fixed, shape (nodes, block size).
    stiffness
        The matrix, of which the other ranks have nothing.
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
        stiffness: DenseStiffness,
        counters: Counters,
        inclined: Inclined | None = None,
    ) -> None:
        self._comm, self._free, self._stiffness = comm, free, stiffness
        self._inclined = inclined
        self.counters = counters

    def update(self, kind: str, state: Evaluated, blocks: Array, *, constant: bool = False) -> bool:
        """Add up and factorise. Collective; see `operator.SparseOperator.update`."""
        gathered = self._comm.gather(masked_blocks(self._free, self._inclined, blocks))
        self._blocks = np.concatenate(gathered or [blocks])
        made = on_root(self._comm, lambda: self._stiffness.factorise(self._blocks))
        self.counters.factorizations += made
        return made

    def solve(self, rhs: Array, rtol: float | None = None, guess: Array | None = None) -> Array:
        """Solve for the owned unknowns. Collective; see `operator.SparseOperator.solve`."""
        total = self._comm.gather(masked(self._free, self._inclined, rhs))
        self.counters.linear_solves += 1
        begin = self._comm.scan(rhs.size) - rhs.size
        solution = on_root(
            self._comm, lambda: self._stiffness.solve(self._blocks, np.concatenate(total))
        )
        return solution[begin : begin + rhs.size]
