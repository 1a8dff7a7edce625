"""Static condensation: a dense Schur complement at kept unknowns, by substructuring.

Each rank eliminates its interior: the unknowns that are coupled to its own and to kept ones alone.
A dense matrix of its border is left. Groups of ranks add up their matrices pair by pair, and
eliminate the unknowns that no other group has in its border: the multifrontal method, its tree that
of the ranks. In 2-D the kept unknowns are so few that the dense matrix has about as many entries as
the mesh has nodes.

References
----------
Smith, Bjorstad and Gropp, Domain Decomposition, Cambridge (1996), section 4.1.
Liu, The multifrontal method for sparse matrix solution, SIAM Review 34 (1992).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.linalg.blas import dgemm
from scipy.linalg.lapack import dgetrf, dgetrs

from contact._compat import lasting
from contact.linear.elimination import Elimination, entries, mirror, stride
from contact.ranks import on_each, summed
from contact.typing import Array


class Merge:
    """The borders of two groups of ranks put together, without unknowns of no other group.

    Parameters
    ----------
    other
        The first rank of the other group.
    own, others
        Places of the unknowns of each border among those of both.
    done
        Which of those of both are eliminated.
    """

    def __init__(
        self,
        other: int,
        own: NDArray[np.intp],
        others: NDArray[np.intp],
        done: NDArray[np.bool_],
    ) -> None:
        self.other, self._parts, self._size = other, (own, others), done.size
        self._done, self._rest = np.flatnonzero(done), np.flatnonzero(~done)

    @property
    def size(self) -> int:
        """Number of unknowns in the border of the other group."""
        return self._parts[1].size

    @property
    def eliminated(self) -> int:
        """Number of unknowns that are eliminated."""
        return self._done.size

    def eliminate(self, *matrices: Array) -> Array:
        """Return the Schur complement of the sum of symmetric matrices of both groups."""
        total = np.zeros((self._size, self._size))
        for part, matrix in zip(self._parts, matrices, strict=True):
            total[np.ix_(part, part)] += matrix
        self._coupling = total[np.ix_(self._rest, self._done)]
        rest = total[np.ix_(self._rest, self._rest)].T
        if self._done.size:
            # A potential makes it indefinite.
            self._factors = dgetrf(total[np.ix_(self._done, self._done)].T, overwrite_a=True)
        if self._coupling.size:
            through = self._solve(self._coupling.T)
            rest = dgemm(-1.0, self._coupling, through, 1.0, rest, overwrite_c=True)
            mirror(rest)  # symmetric but for rounding
        return np.asarray(rest)

    def reduce(self, *sides: Array) -> tuple[Array, Array]:
        """Return right-hand sides of both groups added up: reduced to the rest, and eliminated."""
        total = np.zeros((self._size, sides[0].shape[1]))
        for part, side in zip(self._parts, sides, strict=True):
            total[part] += side
        inside = total[self._done]
        return total[self._rest] - self._coupling @ self._solve(inside), inside

    def expand(self, inside: Array, rest: Array) -> tuple[Array, Array]:
        """Return the values in each group, given those of the rest and right-hand sides inside."""
        total = np.empty((self._size, rest.shape[1]))
        total[self._rest] = rest
        total[self._done] = self._solve(inside - self._coupling.T @ rest)
        own, others = self._parts
        return total[own], total[others]

    def _solve(self, sides: Array) -> Array:
        return np.asarray(dgetrs(*self._factors[:2], sides)[0]) if sides.size else sides


class SchurComplement:
    """A symmetric matrix reduced to kept unknowns, some but not all.

    Parameters
    ----------
    comm
        Communicator.
    kept
        Owned unknowns that are kept, local numbers; the result has them in rank order.
    shared
        Owned unknowns that other ranks know, local numbers, none on one rank. Unknowns of two ranks
        that finite elements couple are among these; those that constraints couple are found.
    prefix
        Prefix of PETSc options of the factorisation.

    Attributes
    ----------
    size, offset
        Number of kept unknowns, and where those of this rank begin.
    """

    def __init__(
        self,
        comm: MPI.Intracomm,
        kept: NDArray[np.integer[Any]],
        shared: NDArray[np.integer[Any]],
        prefix: str,
    ) -> None:
        self.comm, self._kept, self._shared, self._prefix = lasting(comm), kept, shared, prefix
        sizes = self.comm.allgather(kept.size)
        self.size, self.offset = sum(sizes), sum(sizes[: self.comm.rank])
        self._part: list[PETSc.Mat] = []

    def _divide(self, matrix: PETSc.Mat) -> None:
        """Divide the unknowns of a matrix among the ranks. Collective."""
        begin, end = matrix.getOwnershipRange()
        row, column = self._outside(matrix)
        known = self._gathered(begin + np.union1d(self._kept, self._shared))
        # Of two unknowns of two ranks that a constraint couples one joins the border.
        others = row[(column < begin) & ~np.isin(column, known)]
        between = np.setdiff1d(np.union1d(self._shared, others), self._kept)
        self._left = np.concatenate([between, self._kept])
        inside = np.ones(end - begin, dtype=bool)
        inside[self._left] = False
        # With a Schur complement MUMPS orders by minimum degree alone, and breaks its many ties by
        # the order given. dolfinx numbers along fronts: backwards along these leaves least work.
        self._inside = np.flatnonzero(inside)[::-1]
        left = np.concatenate([self._gathered(begin + part) for part in (between, self._kept)])
        owned = (left >= begin) & (left < end)
        places = np.flatnonzero(owned | np.isin(left, column))
        self._owned = owned[places]
        part = np.concatenate([begin + self._inside, left[places]]).astype(PETSc.IntType)
        self._local = [PETSc.IS().createGeneral(part, PETSc.COMM_SELF)]
        self._part = matrix.createSubMatrices(self._local, self._local)
        self._elimination = Elimination(self._part[0], self._inside.size, self._prefix)
        self._plan(places, left.size)

    def _outside(self, matrix: PETSc.Mat) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the owned rows, local numbers, and columns of entries in columns of others."""
        if self.comm.size == 1:
            return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
        begin, end = matrix.getOwnershipRange()
        starts, column, _ = matrix.getValuesCSR()
        outside = np.flatnonzero((column < begin) | (column >= end))
        return np.searchsorted(starts, outside, side="right") - 1, column[outside]

    def _gathered(self, numbers: NDArray[np.integer[Any]]) -> NDArray[np.integer[Any]]:
        """Return the numbers of all ranks, in rank order. Collective."""
        return np.concatenate(self.comm.allgather(numbers))

    def _plan(self, places: NDArray[np.intp], total: int) -> None:
        """Plan how groups of ranks are merged, pair by pair. Collective.

        Parameters
        ----------
        places
            Of this rank's border, ascending, among the borders of all ranks, kept unknowns last.
        total
            Number of unknowns in all borders.
        """
        comm, ranks = self.comm, np.ones(places.size)
        every = np.zeros(total)
        every[places] = 1.0
        every[:] = summed(comm, every)
        self._merges: list[Merge] = []
        #: The rank that this one's group is merged with the group of, after its own merges.
        self._above: int | None = None
        distance = 1
        while distance < comm.size and self._above is None:
            other = comm.rank + distance
            if comm.rank % (2 * distance):
                self._above = comm.rank - distance
                comm.send((places, ranks), self._above)
            elif other < comm.size:
                others, of_others = comm.recv(source=other)
                both = np.union1d(places, others)
                here, there = np.searchsorted(both, places), np.searchsorted(both, others)
                have = np.zeros(both.size)
                have[here] += ranks
                have[there] += of_others
                done = (both < total - self.size) & (have == every[both])
                self._merges.append(Merge(other, here, there, done))
                places, ranks = both[~done], have[~done]
            distance *= 2
        self._sent = places.size

    def factorise(self, matrix: PETSc.Mat) -> Array:
        """Eliminate; return the Schur complement, of which the other ranks have nothing.

        It is symmetric, and not a number where an eliminated block is singular. Collective.

        Parameters
        ----------
        matrix
            Another one has the same pattern.

        Raises
        ------
        InputError
            If there is too little memory.
        """
        if self._part:
            matrix.createSubMatrices(self._local, self._local, submats=self._part)
        else:
            self._divide(matrix)
        (part,) = self._part
        left = on_each(self.comm, self._elimination.factorise)
        regular = summed(self.comm, self._elimination.regular) == self.comm.size
        if not self._owned.all():
            # An entry of two ranks counts half for each of them, and those of others not at all.
            beyond = stride(self._inside.size, part.getSize()[0])
            corner = entries(part.createSubMatrix(beyond, beyond)).tocoo()
            row, column = corner.coords
            owners = self._owned[row].astype(float) + self._owned[column]
            left[row, column] -= (1 - owners / 2) * corner.data
        for merge in self._merges:
            other = np.empty((merge.size, merge.size))
            self.comm.Recv(other, merge.other)
            left = merge.eliminate(left, other)
        if self._above is not None:
            self.comm.Send(np.ascontiguousarray(left), self._above)
            return np.zeros((0, 0))
        return left if regular else np.full_like(left, np.nan)

    def condense(self, rhs: Array, rounding: Array | float = 0.0) -> Array:
        """Reduce owned right-hand sides, shape (owned, k), to the kept unknowns. Collective.

        Parameters
        ----------
        rhs
            The right-hand sides.
        rounding
            Values that count as zero in an interior, shape (owned, 1); a rank that has no others
            there solves nothing.

        Returns
        -------
        Those at the kept unknowns of all ranks, the same on all, and behind them those at the
        unknowns that this rank eliminates from borders, shape (size + n, k).
        """
        left = np.zeros((self._owned.size, rhs.shape[1]))
        left[self._owned] = rhs[self._left]
        if (np.abs(rhs) > rounding)[self._inside].any():
            left += self._elimination.reduce(rhs[self._inside])
        insides = []
        for merge in self._merges:
            other = np.empty((merge.size, rhs.shape[1]))
            self.comm.Recv(other, merge.other)
            left, inside = merge.reduce(left, other)
            insides.append(inside)
        if self._above is not None:
            self.comm.Send(left, self._above)
            left = np.zeros((self.size, rhs.shape[1]))
        return np.concatenate([summed(self.comm, left), *insides])

    def expand(self, rhs: Array, condensed: Array, kept: Array) -> Array:
        """Return the owned solutions that go with values of the kept unknowns. Collective.

        Parameters
        ----------
        rhs, condensed
            Right-hand sides, shape (owned, k), and their result of `condense`.
        kept
            Values of all ranks, shape (size, k).
        """
        left = kept
        if self._above is not None:
            left = np.empty((self._sent, rhs.shape[1]))
            self.comm.Recv(left, self._above)
        end = len(condensed)
        for merge in reversed(self._merges):
            inside = condensed[end - merge.eliminated : end]
            end -= merge.eliminated
            left, other = merge.expand(inside, left)
            self.comm.Send(other, merge.other)
        solution = np.empty_like(rhs)
        inside = rhs[self._inside] - self._elimination.coupling @ left
        solution[self._inside] = self._elimination.solve(inside)
        solution[self._left] = left[self._owned]
        return solution
