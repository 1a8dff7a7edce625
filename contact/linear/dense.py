"""A dense operator at kept nodes, the same on all ranks, plus a small block at each node.

The first rank factorises it, and solves for all: factors are as large as the operator. From one
step of a contact problem to the next some nodes change their status, mostly the same ones: those
that slip, in their tangential rows. The factors are kept until most have, and corrected for the
others (Sherman, Morrison and Woodbury), with columns of the inverse that are kept as well.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.linalg.lapack import dgetrf, dgetrs
from scipy.sparse import csr_array

from contact.history import Evaluated
from contact.linear.first_rank import from_first, together
from contact.linear.operator import Counters
from contact.typing import Array

#: Part of the rows that may differ from those that were factorised. So many columns of
#: the inverse cost 1.5 times as much as new factors, and further steps with the same ones an
#: eighth.
MOST = 1 / 2


@dataclass
class Factors:
    """The factors of a dense matrix with those nodal blocks that it had at the time.

    Attributes
    ----------
    lower_upper, pivots
        As LAPACK leaves them; None before the first factorisation.
    blocks
        The nodal blocks that are in them, shape (nodes, block size, block size).
    known, columns
        Numbers of the columns of the inverse that have been asked for, and these, one below the
        other.
    """

    lower_upper: Array | None = None
    pivots: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    blocks: Array = field(default_factory=lambda: np.zeros((0, 0, 0)))
    known: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    columns: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def make(self, matrix: Array, blocks: Array) -> None:
        """Factorise a matrix plus blocks."""
        total = matrix.copy(order="F")
        rows = np.arange(matrix.shape[0]).reshape(blocks.shape[:2])
        total[rows[:, :, None], rows[:, None, :]] += blocks
        self.lower_upper, self.pivots, _ = dgetrf(total, overwrite_a=True)
        self.blocks = blocks
        self.known, self.columns = np.zeros(0, dtype=np.int64), np.zeros((0, matrix.shape[0]))

    def know(self, numbers: NDArray[np.int64]) -> None:
        """Have these columns of the inverse among those that are known."""
        new = np.setdiff1d(numbers, self.known)
        unit = np.zeros((self.columns.shape[1], new.size), order="F")
        unit[new, np.arange(new.size)] = 1.0
        self.known = np.concatenate([self.known, new])
        self.columns = np.concatenate([self.columns, self.solve(unit).T])

    def solve(self, rhs: Array) -> Array:
        """Solve for one or several columns."""
        return np.asarray(dgetrs(self.lower_upper, self.pivots, rhs)[0])


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
        """The dense matrix, in rank order: on the first rank alone."""

    @property
    def factors(self) -> Factors:
        """Its factors, where some have been made: there too."""

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

    symmetric, iterative = False, False

    def __init__(self, bulk: DenseBulk, counters: Counters) -> None:
        self.bulk, self.counters = bulk, counters
        self._changes = False

    def update(self, kind: str, state: Evaluated, blocks: Array, *, constant: bool = False) -> bool:
        """Add up and factorise. Collective; see `operator.SparseOperator.update`."""
        bulk, free = self.bulk, self.bulk.free.astype(float)
        self._blocks = _gather(bulk, blocks * free[:, :, None] * free[:, None, :])
        together(bulk.comm, self._factorise if bulk.comm.rank == 0 else lambda: None)
        self.counters.factorizations += 1
        return True

    def _factorise(self) -> None:
        """Factorise, or correct the factors that there are."""
        factors, stiffness = self.bulk.factors, self.bulk.stiffness
        if factors.lower_upper is None or not self._correct():
            factors.make(stiffness, self._blocks)
            self._changes = False

    def _correct(self) -> bool:
        """Correct the factors for blocks that differ from those that are in them.

        Returns
        -------
        Whether they can be corrected: not where too many differ, nor where they are singular, or
        would be.
        """
        factors = self.bulk.factors
        change = self._blocks - factors.blocks
        count, size = self.bulk.stiffness.shape[0], change.shape[1]
        node, row, column = np.nonzero(change)
        rows = node * size + row
        changed = np.unique(rows)
        self._changes = changed.size > 0
        if not self._changes:
            return True
        missing = np.setdiff1d(changed, factors.known).size
        if factors.known.size + missing > MOST * count:
            return False
        factors.know(changed)
        known = factors.known
        place = np.full(count, -1)
        place[known] = np.arange(known.size)
        among = place[rows], node * size + column
        self._change = csr_array((change[node, row, column], among), shape=(known.size, count))
        inner = np.eye(known.size) + self._change @ factors.columns.T
        self._inner, self._pivots, info = dgetrf(inner)
        return bool(info == 0 and np.isfinite(self._inner).all())

    def solve(self, rhs: Array, rtol: float | None = None, guess: Array | None = None) -> Array:
        """Solve for the owned unknowns. Collective; see `operator.SparseOperator.solve`."""
        total = _gather(self.bulk, np.where(self.bulk.free.ravel(), rhs, 0.0))
        self.counters.linear_solves += 1
        return from_first(self.bulk.comm, lambda: self._refined(total), total.size)[self.bulk.own]

    def solve_all(self, sides: Array) -> Array:
        """Solve for columns of owned unknowns. Collective."""
        return np.column_stack([self.solve(side) for side in sides.T])

    def _refined(self, rhs: Array) -> Array:
        solution = self._solve(rhs)
        if self._changes:  # stiff blocks that were taken away have left their rounding
            solution += self._solve(rhs - self._times(solution))
        return solution

    def _solve(self, rhs: Array) -> Array:
        factors = self.bulk.factors
        solution = factors.solve(rhs)
        if self._changes:
            values = self._change @ solution
            solution -= dgetrs(self._inner, self._pivots, values)[0] @ factors.columns
        return solution

    def _times(self, values: Array) -> Array:
        """Return the matrix, blocks included, times values of all ranks."""
        nodal = values.reshape(self._blocks.shape[:2])
        added = np.einsum("nij,nj->ni", self._blocks, nodal).ravel()
        return np.asarray(self.bulk.stiffness @ values + added)


def _gather(bulk: DenseBulk, values: Array) -> Array:
    return np.concatenate(bulk.comm.allgather(values))
