"""The body seen from a few of its nodes: a dense Schur complement by static substructuring.

Each rank eliminates the nodes that are coupled to its own and to kept ones only, by a sparse
factorisation; what is left is dense, small, and the same on all ranks. In the plane the kept
nodes are so few that the dense matrix has about as many entries as the mesh has nodes.
"""

from __future__ import annotations

import ctypes

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.linalg import lu_factor, lu_solve

from contact.typing import Array

#: MUMPS's ICNTL(26): 0 solves with the eliminated unknowns, the kept ones being 0.
INTERIOR_SOLVE = (26, 0)

#: MUMPS's INFOG(1) where its workspace was too small: that of integers, and that of numbers.
TOO_SMALL = (-8, -9)

#: MUMPS's ICNTL(14): by how many percent its workspace exceeds the estimate, at most.
MOST_WORKSPACE = 50_000

# petsc4py has no Schur complements of factorisations.
_petsc = ctypes.CDLL(PETSc.__file__)


def _check(code: int) -> None:
    if code != 0:
        raise PETSc.Error(code)


def _set_kept(factor: PETSc.Mat, kept: PETSc.IS) -> None:
    _check(_petsc.MatFactorSetSchurIS(ctypes.c_void_p(factor.handle), ctypes.c_void_p(kept.handle)))


def _complement(factor: PETSc.Mat, size: int) -> Array:
    """Return a copy of the Schur complement that a factorisation holds."""
    if size == 0:
        return np.zeros((0, 0))
    handle, values = ctypes.c_void_p(), ctypes.c_void_p()
    _check(
        _petsc.MatFactorCreateSchurComplement(
            ctypes.c_void_p(factor.handle), ctypes.byref(handle), None
        )
    )
    _check(_petsc.MatDenseGetArrayRead(handle, ctypes.byref(values)))
    pointer = ctypes.cast(values, ctypes.POINTER(ctypes.c_double))
    # PETSc stores it by columns.
    matrix = np.ctypeslib.as_array(pointer, (size, size)).T.copy()
    _check(_petsc.MatDenseRestoreArrayRead(handle, ctypes.byref(values)))
    _check(_petsc.MatDestroy(ctypes.byref(handle)))
    return matrix


def _dense(matrix: PETSc.Mat) -> Array:
    """Return a small local matrix as an array."""
    dense = matrix.convert("dense", out=PETSc.Mat())
    return np.array(dense.getDenseArray(), order="C")


def _ordered(matrix: PETSc.Mat, inside: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return owned unknowns in the order of Cuthill and McKee.

    Where a Schur complement is asked for, MUMPS orders by minimum degree alone. That breaks its
    many ties by the order given, and this one leaves it a quarter less work than most.
    """
    rows = PETSc.IS().createGeneral(
        (inside + matrix.getOwnershipRange()[0]).astype(PETSc.IntType), PETSc.COMM_SELF
    )
    (part,) = matrix.createSubMatrices([rows], [rows])
    return inside[part.getOrdering("rcm")[0].getIndices()] if inside.size else inside


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
    """

    def __init__(self, matrix: PETSc.Mat, kept: NDArray[np.int32], prefix: str) -> None:
        self.comm = matrix.getComm().tompi4py()
        begin, end = matrix.getOwnershipRange()
        starts, columns, _ = matrix.getValuesCSR()
        shared = np.zeros(end - begin, dtype=bool)
        # Of two coupled unknowns of different ranks one has to stay: that of the higher rank.
        rows = np.repeat(np.arange(end - begin), np.diff(starts))
        shared[rows[columns < begin]] = True
        shared[kept] = False
        inside = np.ones(end - begin, dtype=bool)
        inside[kept] = inside[shared] = False
        self._inside = _ordered(matrix, np.flatnonzero(inside))
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
        self._left = PETSc.IS().createGeneral(left, PETSc.COMM_SELF)
        local = np.concatenate([eliminated, border])
        self._local = PETSc.IS().createGeneral(local, PETSc.COMM_SELF)
        self._eliminated, self._prefix, self._failed = eliminated.size, prefix, False
        self._factor: PETSc.PC | None = None
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
        total = self._eliminate(self._part)
        if self.comm.size > 1:
            total = self._assembled(matrix, total)
        k = self.size
        if self._between == 0:
            return total
        self._coupling = total[:k, k:].copy()
        self._lu = lu_factor(total[k:, k:], check_finite=False)
        through = self._coupling @ self._solve_between(total[k:, :k])
        return np.subtract(total[:k, :k], through, out=through)

    def _eliminate(self, part: PETSc.Mat) -> Array:
        """Eliminate the first unknowns of the local matrix; return what is left."""
        if self._eliminated == 0:
            return _dense(part)
        factor = self._factorised(part)
        factor.setMumpsIcntl(*INTERIOR_SOLVE)
        left = _complement(factor, self._met.size)
        self._failed = factor.getMumpsInfog(1) < 0
        return np.full_like(left, np.nan) if self._failed else left

    def _factorised(self, part: PETSc.Mat) -> PETSc.Mat:
        """Factorise the local matrix with as much workspace as it takes.

        MUMPS's estimate is far too low where few unknowns are eliminated and many kept.
        """
        if self._factor is None:
            self._factor = self._analysed(part)
        workspace = 10
        while True:
            self._factor.setOperators(part)
            self._factor.setUp()
            factor = self._factor.getFactorMatrix()
            workspace = 4 * max(workspace, factor.getMumpsIcntl(14))
            if factor.getMumpsInfog(1) not in TOO_SMALL or workspace > MOST_WORKSPACE:
                return factor
            # PETSc does not factorise again with one that has failed for want of memory.
            self._factor = self._analysed(part)
            self._factor.getFactorMatrix().setMumpsIcntl(14, workspace)

    def _analysed(self, part: PETSc.Mat) -> PETSc.PC:
        """Return a factorisation that keeps the last unknowns of a local matrix."""
        pc = PETSc.PC().create(PETSc.COMM_SELF)
        pc.setOptionsPrefix(self._prefix)
        pc.setOperators(part)
        pc.setType("cholesky")
        pc.setFactorSolverType("mumps")
        pc.setFromOptions()
        pc.setFactorSetUpSolverType()
        end = self._eliminated + self._met.size
        kept = np.arange(self._eliminated, end, dtype=PETSc.IntType)
        if kept.size > 0:
            _set_kept(pc.getFactorMatrix(), PETSc.IS().createGeneral(kept, PETSc.COMM_SELF))
        return pc

    def _assembled(self, matrix: PETSc.Mat, own: Array) -> Array:
        """Add up what the ranks have eliminated, and what they have left."""
        (left,) = matrix.createSubMatrices([self._left], [self._left])
        starts, columns, values = left.getValuesCSR()
        rows = np.repeat(np.arange(self.dense_size), np.diff(starts))
        total = np.zeros((self.dense_size, self.dense_size))
        total[np.ix_(self._met, self._met)] = own
        both = np.isin(rows, self._met) & np.isin(columns, self._met)
        total[rows[both], columns[both]] -= values[both]
        if self._failed:
            total[:] = np.nan
        self.comm.Allreduce(MPI.IN_PLACE, total, op=MPI.SUM)
        total[rows, columns] += values
        return total

    def _solve_inside(self, values: Array) -> Array:
        """Solve with the eliminated unknowns alone, the others being 0."""
        if self._eliminated == 0:
            return values
        assert self._factor is not None and self._part is not None
        solution, rhs = self._part.createVecs()
        rhs.array[: self._eliminated] = values
        self._factor.getFactorMatrix().solve(rhs, solution)
        return solution.array[: self._eliminated].copy()

    def _solve_between(self, values: Array) -> Array:
        """Solve with the unknowns between the ranks; what is no number remains none."""
        return np.asarray(lu_solve(self._lu, values, check_finite=False))

    def _times(self, inside: Array, left: Array) -> Array:
        """Return the local part of the matrix times values of its unknowns."""
        assert self._part is not None
        vector, image = self._part.createVecs()
        vector.array[:] = np.concatenate([inside, left])
        self._part.mult(vector, image)
        return image.array

    def condense(self, rhs: Array, rounding: float = 0.0) -> Array:
        """Return what an owned right-hand side becomes on the kept unknowns, on all ranks.

        It is remembered for `expand`. Collective.

        Parameters
        ----------
        rhs
            The right-hand side.
        rounding
            What counts as nothing at the eliminated unknowns: no solve is needed to see what is
            left of it elsewhere.
        """
        self._rhs = rhs
        total = np.zeros(self.dense_size)
        total[self._rows] = rhs[np.concatenate([self._kept, self._shared])]
        if np.abs(rhs[self._inside]).max(initial=0.0) > rounding:
            inside = self._solve_inside(rhs[self._inside])
            met = np.zeros(self._met.size)
            total[self._met] -= self._times(inside, met)[self._eliminated :]
        self.comm.Allreduce(MPI.IN_PLACE, total, op=MPI.SUM)
        if self._between == 0:
            return total
        self._rhs_between = total[self.size :]
        return total[: self.size] - self._coupling @ self._solve_between(self._rhs_between)

    def expand(self, kept: Array) -> Array:
        """Return the owned solution that goes with values of the kept unknowns on all ranks."""
        left = kept
        if self._between > 0:
            between = self._solve_between(self._rhs_between - self._coupling.T @ kept)
            left = np.concatenate([kept, between])
        coupled = self._times(np.zeros(self._eliminated), left[self._met])[: self._eliminated]
        solution = np.zeros(self._rhs.size)
        solution[self._inside] = self._solve_inside(self._rhs[self._inside] - coupled)
        solution[np.concatenate([self._kept, self._shared])] = left[self._rows]
        return solution
