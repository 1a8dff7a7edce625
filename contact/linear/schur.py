"""Static condensation: a dense Schur complement at kept nodes, by substructuring.

Each rank eliminates the nodes that are coupled to its own and to kept ones only, by a sparse
factorisation of MUMPS that stops before the others; the first rank adds up the remainders and
eliminates the nodes between the ranks. The result is dense, small, and the same on all ranks. In
2-D the kept nodes are so few that the dense matrix has about as many entries as the mesh has nodes.
"""

from __future__ import annotations

import ctypes

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.linalg import lu_factor, lu_solve
from scipy.linalg.blas import dgemm

from contact._compat import lasting
from contact.linear.faults import MOST_WORKSPACE, TOO_SMALL, WORKSPACE
from contact.linear.first_rank import from_first
from contact.typing import Array

#: MUMPS's ICNTL(26): 0 solves with the eliminated unknowns, the kept ones being 0.
INTERIOR_SOLVE = (26, 0)

#: Columns that are copied at a time.
COLUMNS = 128

# petsc4py has no Schur complements of factorisations.
_petsc = ctypes.CDLL(PETSc.__file__)


def _check(code: int) -> None:
    if code != 0:
        raise PETSc.Error(code)


def _set_kept(factor: PETSc.Mat, kept: PETSc.IS) -> None:
    _check(_petsc.MatFactorSetSchurIS(ctypes.c_void_p(factor.handle), ctypes.c_void_p(kept.handle)))


def _complement(factor: PETSc.Mat, size: int) -> Array:
    """Return a copy of the Schur complement that a factorisation holds, stored by columns."""
    if size == 0:
        return np.zeros((0, 0))
    handle, values, status = ctypes.c_void_p(), ctypes.c_void_p(), ctypes.c_int()
    held = ctypes.c_void_p(factor.handle), ctypes.byref(handle)
    _check(_petsc.MatFactorGetSchurComplement(*held, ctypes.byref(status)))
    _check(_petsc.MatDenseGetArrayRead(handle, ctypes.byref(values)))
    pointer = ctypes.cast(values, ctypes.POINTER(ctypes.c_double))
    matrix = np.ctypeslib.as_array(pointer, (size, size)).copy().T
    _check(_petsc.MatDenseRestoreArrayRead(handle, ctypes.byref(values)))
    _check(_petsc.MatFactorRestoreSchurComplement(*held, status))
    _mirror(matrix)
    return matrix


def _mirror(matrix: Array) -> None:
    """Copy the entries below the diagonal, all that MUMPS writes, above it."""
    for begin in range(0, len(matrix), COLUMNS):
        end = begin + COLUMNS
        matrix[begin:end, end:] = matrix[end:, begin:end].T
        corner = np.tril(matrix[begin:end, begin:end])
        matrix[begin:end, begin:end] = corner + np.tril(corner, -1).T


def _range(begin: int, end: int) -> PETSc.IS:
    """Return the numbers from one to before another."""
    return PETSc.IS().createStride(end - begin, begin, 1, PETSc.COMM_SELF)


def _dense(matrix: PETSc.Mat) -> Array:
    """Return a small local matrix as an array."""
    dense = matrix.convert("dense", out=PETSc.Mat())
    return np.array(dense.getDenseArray(), order="F")


class PartialFactorisation:
    """The first unknowns of a symmetric matrix of this rank, eliminated.

    Parameters
    ----------
    first
        How many they are.
    prefix
        Prefix of PETSc options of the factorisation.
    """

    def __init__(self, first: int, prefix: str) -> None:
        self._first, self._prefix = first, prefix
        self._factor: PETSc.PC | None = None

    def factorise(self, matrix: PETSc.Mat) -> Array:
        """Eliminate them; return the Schur complement, which is no number if they are singular.

        Another matrix has the same pattern.
        """
        first, end = self._first, matrix.getSize()[0]
        inside, rest = (_range(*ends) for ends in ((0, first), (first, end)))
        (self._coupling,) = matrix.createSubMatrices([rest], [inside])
        if self._first == 0:
            return _dense(matrix)
        factor = self._factorised(matrix)
        factor.setMumpsIcntl(*INTERIOR_SOLVE)
        left = _complement(factor, end - first)
        return np.full_like(left, np.nan) if factor.getMumpsInfog(1) < 0 else left

    def _factorised(self, matrix: PETSc.Mat) -> PETSc.Mat:
        """Factorise the local matrix with as much workspace as it takes.

        MUMPS's estimate is far too low where few unknowns are eliminated and many kept.
        """
        if self._factor is None:
            self._factor = self._analysed(matrix)
        workspace = WORKSPACE
        while True:
            self._factor.setOperators(matrix)
            self._factor.setUp()
            factor = self._factor.getFactorMatrix()
            workspace = 4 * max(workspace, factor.getMumpsIcntl(14))
            if factor.getMumpsInfog(1) not in TOO_SMALL or workspace > MOST_WORKSPACE:
                return factor
            # PETSc does not factorise again with one that has failed for want of memory.
            self._factor = self._analysed(matrix)
            self._factor.getFactorMatrix().setMumpsIcntl(14, workspace)

    def _analysed(self, matrix: PETSc.Mat) -> PETSc.PC:
        """Return a factorisation that keeps the last unknowns of a local matrix."""
        pc = PETSc.PC().create(PETSc.COMM_SELF)
        pc.setOptionsPrefix(self._prefix)
        pc.setOperators(matrix)
        pc.setType("cholesky")
        pc.setFactorSolverType("mumps")
        pc.setFromOptions()
        pc.setFactorSetUpSolverType()
        kept = _range(self._first, matrix.getSize()[0])
        if kept.getSize() > 0:
            _set_kept(pc.getFactorMatrix(), kept)
        return pc

    def solve(self, values: Array) -> Array:
        """Solve with the first unknowns alone, the others being 0."""
        if self._first == 0:
            return values
        assert self._factor is not None
        factor = self._factor.getFactorMatrix()
        solution, rhs = factor.createVecs()
        rhs.array[: self._first] = values
        factor.solve(rhs, solution)
        return solution.array[: self._first].copy()

    def to_last(self, first: Array) -> Array:
        """Return the coupling block times values of the first unknowns."""
        vector, image = self._coupling.createVecs()
        vector.array[:] = first
        self._coupling.mult(vector, image)
        return np.asarray(image.array)

    def to_first(self, last: Array) -> Array:
        """Return the coupling block, transposed, times values of the last unknowns."""
        image, vector = self._coupling.createVecs()
        vector.array[:] = last
        self._coupling.multTranspose(vector, image)
        return np.asarray(image.array)


#: Rows that are sent and added at a time.
ROWS = 128


def send_to_first(comm: MPI.Intracomm, share: Array) -> None:
    """Send a symmetric share to the first rank, which calls `Remainder.receive`.

    Parameters
    ----------
    comm
        The ranks.
    share
        Stored by columns.
    """
    for begin in range(0, share.shape[0], ROWS):
        comm.Send(share.T[begin : begin + ROWS], 0)


class Remainder:
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
        """Add the share that another rank sends of the unknowns at ascending places."""
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
        """Return the Schur complement of the kept unknowns.

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
        """Solve with the others, once they are eliminated; not a number where they are singular."""
        return np.asarray(lu_solve(self._factors, values, check_finite=False))

    def to_kept(self, others: Array) -> Array:
        """Return the coupling block times values of the others."""
        return np.asarray(self._coupling @ others)

    def to_others(self, kept: Array) -> Array:
        """Return the coupling block, transposed, times values of the kept unknowns."""
        return np.asarray(self._coupling.T @ kept)


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
        # these leaves it the least work, half of that of other orders.
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
        # The first rank adds up, and needs the remainders; the others their own shares.
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

        It is not a number where the eliminated block is singular.
        """
        if self._part is None:
            (self._part,) = matrix.createSubMatrices([self._local], [self._local])
            self._part.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        else:
            matrix.createSubMatrices([self._local], [self._local], submats=[self._part])
        total = self._inner.factorise(self._part)
        if self.comm.size == 1:
            return total
        self._remainder = self._added(matrix, total)
        del total
        k = self.size
        # Both are stored by columns, and sent as their transposes by rows.
        return from_first(self.comm, lambda: self._remainder.eliminate().T, k, k).T

    def _added(self, matrix: PETSc.Mat, own: Array) -> Remainder:
        """Add up the shares of the ranks, and the remainders between them, on the first one.

        The others have nothing of it. Collective.
        """
        (left,) = matrix.createSubMatrices([self._left_set], [self._left_set])
        starts, columns, values = left.getValuesCSR()
        rows = np.repeat(self._left, np.diff(starts))
        columns = self._left[columns]
        # The share of each rank has the matrix of the unknowns that its eliminated ones know of.
        place = np.full(self.dense_size, -1)
        place[self._met] = np.arange(self._met.size)
        row, column = place[rows], place[columns]
        both = (row >= 0) & (column >= 0)
        own[row[both], column[both]] -= values[both]
        if self._mets is None:
            send_to_first(self.comm, own)
            return Remainder(0, 0)
        remainder = Remainder(self.size, self._between)
        remainder.set(rows, columns, values)
        remainder.add(self._met, own)
        for rank, met in enumerate(self._mets[1:], 1):
            remainder.receive(self.comm, rank, met)
        return remainder

    def condense(self, rhs: Array, rounding: Array | None = None) -> Array:
        """Return the condensed right-hand side at the kept unknowns, on all ranks.

        `expand` has it then. Collective.

        Parameters
        ----------
        rhs
            The right-hand side.
        rounding
            Zero to rounding at the eliminated unknowns, of the owned ones: no solve is needed
            to condense it. Zero by default.
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
        remainder = self._remainder
        return from_first(
            self.comm,
            lambda: kept - remainder.to_kept(remainder.solve(self._rhs_between)),
            self.size,
        )

    def expand(self, kept: Array) -> Array:
        """Return the owned solution that goes with values of the kept unknowns on all ranks."""
        left = kept
        if self._between > 0:
            remainder = self._remainder
            between = from_first(
                self.comm,
                lambda: remainder.solve(self._rhs_between - remainder.to_others(kept)),
                self._between,
            )
            left = np.concatenate([kept, between])
        coupled = self._inner.to_first(left[self._met])
        solution = np.zeros(self._rhs.size)
        solution[self._inside] = self._inner.solve(self._rhs[self._inside] - coupled)
        solution[np.concatenate([self._kept, self._shared])] = left[self._rows]
        return solution
