"""What ranks leave of a symmetric matrix, added up on the first one.

It has room for that once: what the ranks have is sent and added a few rows at a time.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.linalg import lu_factor, lu_solve
from scipy.linalg.blas import dgemm

from contact.typing import Array

#: Rows that are sent and added at a time.
ROWS = 128


def send_to_first(comm: MPI.Intracomm, share: Array) -> None:
    """Send a symmetric share to the first rank, which calls `Leftover.receive`.

    Parameters
    ----------
    comm
        The ranks.
    share
        Stored by columns.
    """
    for begin in range(0, share.shape[0], ROWS):
        comm.Send(share.T[begin : begin + ROWS], 0)


class Leftover:
    """A symmetric dense matrix, of which the first unknowns are kept and the others eliminated.

    Parameters
    ----------
    kept, others
        How many they are.
    """

    def __init__(self, kept: int, others: int) -> None:
        self._kept = np.zeros((kept, kept), order="F")
        self._coupling = np.zeros((kept, others), order="F")
        self._among = np.zeros((others, others), order="F")

    def set(self, rows: NDArray[np.int64], columns: NDArray[np.int64], values: Array) -> None:
        """Set entries, which have been zero."""
        k = self._kept.shape[0]
        for block, of_kept, with_kept in (
            (self._kept, True, True),
            (self._coupling, True, False),
            (self._among, False, False),
        ):
            here = ((rows < k) == of_kept) & ((columns < k) == with_kept)
            first, second = 0 if of_kept else k, 0 if with_kept else k
            block[rows[here] - first, columns[here] - second] = values[here]

    def add(self, at: NDArray[np.int64], share: Array) -> None:
        """Add a symmetric share of the unknowns at ascending places, stored by columns."""
        for begin in range(0, at.size, ROWS):
            self._add(at, begin, share.T[begin : begin + ROWS])

    def receive(self, comm: MPI.Intracomm, rank: int, at: NDArray[np.int64]) -> None:
        """Add what another rank sends of the unknowns at ascending places."""
        rows = np.empty((ROWS, at.size))
        for begin in range(0, at.size, ROWS):
            part = rows[: at.size - begin]
            comm.Recv(part, rank)
            self._add(at, begin, part)

    def _add(self, at: NDArray[np.int64], begin: int, rows: Array) -> None:
        k, here = self._kept.shape[0], at[begin : begin + len(rows)]
        split, above = np.searchsorted(at, k), np.searchsorted(here, k)
        # Matrix and share are symmetric: rows are added as columns, which lie together.
        self._kept.T[np.ix_(here[:above], at[:split])] += rows[:above, :split]
        self._coupling.T[np.ix_(here[above:] - k, at[:split])] += rows[above:, :split]
        self._among.T[np.ix_(here[above:] - k, at[split:] - k)] += rows[above:, split:]

    def eliminate(self) -> Array:
        """Return what is left of the kept unknowns once the others are eliminated.

        That is done in place: the matrix is gone then. The result is stored by columns.
        """
        if self._among.size == 0:
            return self._kept
        self._factors = lu_factor(self._among, overwrite_a=True, check_finite=False)
        through = self.solve(self._coupling.T)
        left = dgemm(-1.0, self._coupling, through, 1.0, self._kept, overwrite_c=True)
        del self._kept, self._among
        return np.asarray(left)

    def solve(self, values: Array) -> Array:
        """Solve with the others, once they are eliminated; what is no number remains none."""
        return np.asarray(lu_solve(self._factors, values, check_finite=False))

    def to_kept(self, others: Array) -> Array:
        """Return what values of the others are in the rows of the kept unknowns."""
        return np.asarray(self._coupling @ others)

    def to_others(self, kept: Array) -> Array:
        """Return what values of the kept unknowns are in the rows of the others."""
        return np.asarray(self._coupling.T @ kept)
