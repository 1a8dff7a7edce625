"""Dense operators: a Schur complement plus blocks at its nodes, solved on the first rank."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dgetrf, dgetrs, dpotrf, dpotrs

from contact.history import LinearisationPoint
from contact.linear.layout import Inclined, masked, masked_blocks
from contact.linear.operator import Counters
from contact.ranks import on_root
from contact.typing import Array


class DenseStiffness:
    """A dense matrix on the first rank, and the factors of its last sum with nodal blocks.

    Unknowns without a block so far are eliminated once for all sums: tangential ones without
    friction, and those of open nodes.

    Parameters
    ----------
    matrix
        The matrix, in rank order.
    """

    def __init__(self, matrix: Array) -> None:
        self.matrix = matrix
        self._blocks: Array | None = None
        self._solve: Callable[[Array], Array] | None = None
        #: Number of each unknown among the remaining ones, negative if eliminated.
        self._place: NDArray[np.intp] | None = None

    def factorise(self, blocks: Array) -> bool:
        """Add blocks at the nodes and factorise, unless they are the last ones.

        By Cholesky if possible: in each step of an interior point.
        """
        if self._blocks is not None and np.array_equal(blocks, self._blocks):
            return False
        self._blocks = self._solve = None  # room for new factors
        acted = (blocks.any(axis=1) | blocks.any(axis=2)).ravel()
        if self._place is None or (self._place[acted] < 0).any():
            self._eliminate(acted if self._place is None else acted | (self._place >= 0))
        self._solve = self._factors(blocks)
        self._blocks = blocks
        return True

    def _factors(self, blocks: Array) -> Callable[[Array], Array]:
        """Return the solver of the reduced matrix plus the blocks."""
        if not self._rows.size:
            return lambda rhs: rhs
        if np.array_equal(blocks, blocks.transpose(0, 2, 1)):
            lower, fault = dpotrf(self._sum(blocks), lower=True, clean=False, overwrite_a=True)
            if not fault:
                return lambda rhs: np.asarray(dpotrs(lower, rhs, lower=True)[0])
        # A potential makes it indefinite.
        factors, pivots, _ = dgetrf(self._sum(blocks), overwrite_a=True)
        return lambda rhs: np.asarray(dgetrs(factors, pivots, rhs)[0])

    def _sum(self, blocks: Array) -> Array:
        """Return the reduced matrix plus the blocks."""
        assert self._place is not None
        total = self._reduced.copy(order="F")
        node, i, j = np.nonzero(blocks)
        first = node * blocks.shape[1]
        total[self._place[first + i], self._place[first + j]] += blocks[node, i, j]
        return np.asarray(total)

    def _eliminate(self, acted: NDArray[np.bool_]) -> None:
        """Eliminate the unknowns without a block so far."""
        matrix, rows, others = self.matrix, np.flatnonzero(acted), np.flatnonzero(~acted)
        self._place, self._reduced, self._border = None, matrix[:0], matrix[:0]
        lower, fault = _cholesky(matrix, others)
        if fault:  # indefinite by a potential, or singular without contact
            rows, others = np.arange(acted.size), others[:0]
            lower, _ = _cholesky(matrix, others)
        border = _forward(lower, matrix[np.ix_(others, rows)])
        self._reduced = matrix[np.ix_(rows, rows)] - border.T @ border if others.size else matrix
        self._rows, self._others, self._lower, self._border = rows, others, lower, border
        self._place = np.full(acted.size, -1)
        self._place[rows] = np.arange(rows.size)

    @np.errstate(over="ignore", invalid="ignore")  # of a singular sum
    def solve(self, blocks: Array, rhs: Array) -> Array:
        """Solve with the matrix plus blocks."""
        self.factorise(blocks)
        assert self._solve is not None
        inner = _forward(self._lower, rhs[self._others])
        solution = np.empty_like(rhs)
        solution[self._rows] = self._solve(rhs[self._rows] - self._border.T @ inner)
        inner -= self._border @ solution[self._rows]
        solution[self._others] = solve_triangular(
            self._lower, inner, lower=True, trans="T", check_finite=False
        )
        return solution


def _cholesky(matrix: Array, rows: NDArray[np.intp]) -> tuple[Array, int]:
    """Return the lower Cholesky factor of a principal submatrix, and the fault of LAPACK."""
    if not rows.size:
        return np.zeros((0, 0)), 0
    lower, fault = dpotrf(matrix[np.ix_(rows, rows)].T, lower=True, clean=False, overwrite_a=True)
    return lower, fault


def _forward(lower: Array, rhs: Array) -> Array:
    """Return L^-1 b."""
    return np.asarray(solve_triangular(lower, rhs, lower=True, check_finite=False))


class DenseOperator:
    """A dense matrix plus nodal blocks; as `operator.SparseOperator`.

    Parameters
    ----------
    comm
        Communicator.
    free
        Which of the owned kept unknowns are free, shape (nodes, block size).
    stiffness
        The matrix, on the first rank.
    counters
        Counters of factorisations and solves.
    inclined
        Inclined directions of supports at kept nodes; None for none.
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

    def update(
        self, kind: str, state: LinearisationPoint, blocks: Array, *, constant: bool = False
    ) -> bool:
        """Factorise with blocks; see `operator.SparseOperator.update`. Collective."""
        gathered = self._comm.gather(masked_blocks(self._free, self._inclined, blocks))
        self._blocks = np.concatenate(gathered or [blocks])
        made = on_root(self._comm, lambda: self._stiffness.factorise(self._blocks))
        self.counters.factorizations += made
        return made

    def solve(self, rhs: Array, rtol: float | None = None, guess: Array | None = None) -> Array:
        """Solve for the owned unknowns; see `operator.SparseOperator.solve`. Collective."""
        total = self._comm.gather(masked(self._free, self._inclined, rhs))
        self.counters.linear_solves += 1
        begin = self._comm.scan(rhs.size) - rhs.size
        solution = on_root(
            self._comm, lambda: self._stiffness.solve(self._blocks, np.concatenate(total))
        )
        return solution[begin : begin + rhs.size]
