"""The body seen from a few of its nodes: a dense Schur complement by static substructuring.

Each rank eliminates the nodes that are coupled to its own and to kept ones only, by a sparse
factorisation; what is left between the ranks is eliminated by the first one, and what is left then
is dense, small, and the same on all ranks. In the plane the kept nodes are so few that the dense
matrix has about as many entries as the mesh has nodes.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from contact._compat import lasting
from contact.linear.first_rank import from_first
from contact.linear.leftover import Leftover, send_to_first
from contact.linear.partial import PartialFactorisation
from contact.typing import Array


def _staying(
    matrix: PETSc.Mat,
    rows: NDArray[np.int64],
    columns: NDArray[np.int32],
    kept: NDArray[np.int32],
    cut: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Return which owned unknowns have to stay beside the kept ones, as others know of them.

    Of two coupled unknowns of different ranks one stays: that at the cut, or which knows more of
    other ranks', or else that of the higher rank. Collective.

    Parameters
    ----------
    matrix
        The matrix.
    rows, columns
        Owned rows and their columns, of all entries.
    kept, cut
        Owned unknowns that are kept anyway, and those at the cut.
    """
    begin, end = matrix.getOwnershipRange()
    outside = (columns < begin) | (columns >= end)
    others = np.bincount(rows[outside], minlength=end - begin).astype(float)
    others[kept] = others[cut] = np.inf
    vector = matrix.createVecRight()
    vector.array[:] = others
    of_columns = _values(vector, columns[outside])
    own = others[rows[outside]]
    less = (of_columns < own) | ((of_columns == own) & (columns[outside] < begin))
    staying = np.zeros(end - begin, dtype=bool)
    staying[rows[outside][less]] = True
    staying[kept] = False
    return staying


def _values(vector: PETSc.Vec, at: NDArray[np.int32]) -> Array:
    """Return a vector's values at places of any ranks. Collective."""
    places, back = np.unique(at, return_inverse=True)
    here = PETSc.Vec().createSeq(places.size, comm=PETSc.COMM_SELF)
    where = PETSc.IS().createGeneral(places.astype(PETSc.IntType), PETSc.COMM_SELF)
    PETSc.Scatter().create(vector, where, here, None).scatter(vector, here)
    return np.asarray(here.array)[back]


class SchurComplement:
    """A symmetric matrix reduced to kept unknowns.

    Parameters
    ----------
    matrix
        The assembled matrix, for its pattern; `factorise` takes its values.
    kept
        Owned unknowns that are kept, local numbers; the result has them in rank order.
    prefix
        Prefix of PETSc options of the factorisation.
    cut
        Which owned unknowns belong to cells of several ranks, shape (owned,). That these stay is
        enough for elements, and makes a straight rim of a straight cut: the order of elimination
        follows it, and takes a third less work than along a ragged one. Those are found that have
        to stay besides.
    """

    def __init__(
        self,
        matrix: PETSc.Mat,
        kept: NDArray[np.int32],
        prefix: str,
        cut: NDArray[np.bool_],
    ) -> None:
        self.comm = lasting(matrix.getComm().tompi4py())
        begin, end = matrix.getOwnershipRange()
        starts, columns, _ = matrix.getValuesCSR()
        rows = np.repeat(np.arange(end - begin), np.diff(starts))
        shared = _staying(matrix, rows, columns, kept, cut)
        inside = np.ones(end - begin, dtype=bool)
        inside[kept] = inside[shared] = False
        # Where a Schur complement is asked for, MUMPS orders by minimum degree alone, and breaks
        # its many ties by the order given. dolfinx numbers nodes along fronts: backwards along
        # these leaves it the least work, half of what other orders do.
        self._inside = np.flatnonzero(inside)[::-1]
        # The kept ones first, then those between the ranks, each in rank order.
        self._kept, self._shared = kept, np.flatnonzero(shared)
        mine = [(part + begin).astype(PETSc.IntType) for part in (kept, self._shared)]
        gathered = [self.comm.allgather(part) for part in mine]
        self.offset = sum(part.size for part in gathered[0][: self.comm.rank])
        self.size = sum(part.size for part in gathered[0])
        self._between = sum(part.size for part in gathered[1])
        offset = sum(part.size for part in gathered[1][: self.comm.rank])
        self._rows = np.concatenate(
            [
                self.offset + np.arange(kept.size),
                self.size + offset + np.arange(self._shared.size),
            ]
        )
        left = np.concatenate([part for parts in gathered for part in parts])
        eliminated = (self._inside + begin).astype(PETSc.IntType)
        # Those left that this rank's eliminated ones know of: its own share is no larger.
        met = np.isin(left, columns[inside[rows]]) if self.comm.size > 1 else left >= 0
        self._met, border = np.flatnonzero(met), left[met]
        #: Those that each rank's eliminated ones know of, on the first rank.
        self._mets = self.comm.gather(self._met)
        # The first rank adds up, and needs what is left; the others what they take off.
        self._left = np.arange(left.size) if self._mets else self._met
        self._left_set = PETSc.IS().createGeneral(left[self._left], PETSc.COMM_SELF)
        local = np.concatenate([eliminated, border])
        self._local = PETSc.IS().createGeneral(local, PETSc.COMM_SELF)
        self._inner = PartialFactorisation(eliminated.size, prefix)
        self._part: PETSc.Mat | None = None

    @property
    def dense_size(self) -> int:
        """Number of unknowns that no rank eliminates by itself."""
        return self.size + self._between

    def factorise(self, matrix: PETSc.Mat) -> Array:
        """Eliminate; return the Schur complement on all ranks, (size, size). Collective.

        It is not a number where what is to be eliminated is singular.
        """
        if self._part is None:
            (self._part,) = matrix.createSubMatrices([self._local], [self._local])
            self._part.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        else:
            matrix.createSubMatrices([self._local], [self._local], submats=[self._part])
        total = self._inner.factorise(self._part)
        if self.comm.size == 1:
            return total
        self._leftover = self._added(matrix, total)
        del total
        k = self.size
        # Both are stored by columns, and sent as what they are by rows.
        return from_first(self.comm, lambda: self._leftover.eliminate().T, k, k).T

    def _added(self, matrix: PETSc.Mat, own: Array) -> Leftover:
        """Add up what the ranks have eliminated, and what they have left, on the first one.

        The others have nothing of it. Collective.
        """
        (left,) = matrix.createSubMatrices([self._left_set], [self._left_set])
        starts, columns, values = left.getValuesCSR()
        rows = np.repeat(self._left, np.diff(starts))
        columns = self._left[columns]
        # Each rank has the matrix of what its eliminated ones know of in its share.
        place = np.full(self.dense_size, -1)
        place[self._met] = np.arange(self._met.size)
        row, column = place[rows], place[columns]
        both = (row >= 0) & (column >= 0)
        own[row[both], column[both]] -= values[both]
        if self._mets is None:
            send_to_first(self.comm, own)
            return Leftover(0, 0)
        leftover = Leftover(self.size, self._between)
        leftover.set(rows, columns, values)
        leftover.add(self._met, own)
        for rank, met in enumerate(self._mets[1:], 1):
            leftover.receive(self.comm, rank, met)
        return leftover

    def condense(self, rhs: Array, rounding: Array | None = None) -> Array:
        """Return what an owned right-hand side becomes on the kept unknowns, on all ranks.

        It is remembered for `expand`. Collective.

        Parameters
        ----------
        rhs
            The right-hand side.
        rounding
            What counts as nothing at the eliminated unknowns, of the owned ones: no solve is needed
            to see what is left of it elsewhere. Zero by default.
        """
        self._rhs = rhs
        total = np.zeros(self.dense_size)
        total[self._rows] = rhs[np.concatenate([self._kept, self._shared])]
        nothing = 0.0 if rounding is None else rounding[self._inside]
        if np.any(np.abs(rhs[self._inside]) > nothing):
            inside = self._inner.solve(rhs[self._inside])
            total[self._met] -= self._inner.to_last(inside)
        self.comm.Allreduce(MPI.IN_PLACE, total, op=MPI.SUM)
        if self._between == 0:
            return total
        kept, self._rhs_between = np.split(total, [self.size])
        leftover = self._leftover
        return from_first(
            self.comm,
            lambda: kept - leftover.to_kept(leftover.solve(self._rhs_between)),
            self.size,
        )

    def expand(self, kept: Array) -> Array:
        """Return the owned solution that goes with values of the kept unknowns on all ranks."""
        left = kept
        if self._between > 0:
            leftover = self._leftover
            between = from_first(
                self.comm,
                lambda: leftover.solve(self._rhs_between - leftover.to_others(kept)),
                self._between,
            )
            left = np.concatenate([kept, between])
        coupled = self._inner.to_first(left[self._met])
        solution = np.zeros(self._rhs.size)
        solution[self._inside] = self._inner.solve(self._rhs[self._inside] - coupled)
        solution[np.concatenate([self._kept, self._shared])] = left[self._rows]
        return solution
