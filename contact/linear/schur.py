"""Static condensation: a dense Schur complement at kept nodes.

MUMPS makes it in a sparse factorisation that leaves out the kept unknowns. In 2-D the kept nodes
are so few that the dense matrix has about as many entries as the mesh has nodes.
"""

from __future__ import annotations

import ctypes

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from contact._compat import lasting
from contact.linear.faults import mat_solve, no_solution, out_of_memory, set_up_with_workspace
from contact.linear.layout import times
from contact.ranks import on_each
from contact.typing import Array

#: MUMPS's ICNTL(26): to solve with the eliminated unknowns, the kept ones being 0; to reduce a
#: right-hand side to the kept ones, which takes the first of the two substitutions alone.
INTERIOR_SOLVE, REDUCE = (26, 0), (26, 1)

#: PETSc's MAT_FACTOR_SCHUR_INVERTED.
INVERTED = 2

#: MUMPS's ICNTL(19): in which form it returns a Schur complement; 0 for none.
SCHUR = 19

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
    """Take the Schur complement, stored by columns, out of a factorisation.

    PETSc multiplies the right-hand sides that MUMPS reduces by the inverse of the one it holds. The
    identity is left there, so that they remain as they are.
    """
    if size == 0:
        return np.zeros((0, 0))
    handle, values, status = ctypes.c_void_p(), ctypes.c_void_p(), ctypes.c_int()
    held = ctypes.c_void_p(factor.handle), ctypes.byref(handle)
    _check(_petsc.MatFactorGetSchurComplement(*held, ctypes.byref(status)))
    _check(_petsc.MatDenseGetArray(handle, ctypes.byref(values)))
    pointer = ctypes.cast(values, ctypes.POINTER(ctypes.c_double))
    there = np.ctypeslib.as_array(pointer, (size, size))
    matrix = there.copy().T
    there[:] = 0.0
    np.fill_diagonal(there, 1.0)
    _check(_petsc.MatDenseRestoreArray(handle, ctypes.byref(values)))
    _check(_petsc.MatFactorRestoreSchurComplement(*held, INVERTED))
    _mirror(matrix)
    return matrix


def _mirror(matrix: Array) -> None:
    """Copy the entries below the diagonal, all that MUMPS promises, above it."""
    for begin in range(0, len(matrix), COLUMNS):
        end = begin + COLUMNS
        matrix[begin:end, end:] = matrix[end:, begin:end].T
        corner = np.tril(matrix[begin:end, begin:end])
        matrix[begin:end, begin:end] = corner + np.tril(corner, -1).T


class SchurComplement:
    """A symmetric matrix reduced to kept unknowns, some but not all.

    Parameters
    ----------
    matrix
        The assembled matrix, for its pattern; `factorise` takes its values.
    kept
        Owned unknowns that are kept, local numbers; the result has them in rank order.
    prefix
        Prefix of PETSc options of the factorisation.

    Attributes
    ----------
    size, offset
        Number of kept unknowns, and where those of this rank begin.
    """

    def __init__(self, matrix: PETSc.Mat, kept: NDArray[np.int32], prefix: str) -> None:
        self._kept, self.comm = kept, lasting(matrix.getComm().tompi4py())
        begin, end = matrix.getOwnershipRange()
        own_kept = (begin + kept).astype(PETSc.IntType)
        # With a Schur complement MUMPS orders by minimum degree alone, and breaks its many ties by
        # the order given. dolfinx numbers along fronts: backwards along these leaves least work.
        self._backwards = PETSc.IS().createStride(end - begin, end - 1, -1, comm=matrix.comm)
        numbers = self.comm.allgather(begin + end - 1 - own_kept)
        self.size = sum(part.size for part in numbers)
        self.offset = sum(part.size for part in numbers[: self.comm.rank])
        # MUMPS leaves the Schur complement to the first rank, and PETSc asks for its rows there.
        own = np.concatenate(numbers)[: None if self.comm.rank == 0 else 0]
        self._numbers = PETSc.IS().createGeneral(own, matrix.comm)
        self._places = (
            PETSc.IS().createGeneral(own_kept, matrix.comm),
            PETSc.IS().createStride(end - begin, begin, 1, comm=matrix.comm),
        )
        #: Rows of the matrix at kept unknowns, and the matrix numbered backwards.
        self._rows: PETSc.Mat | None = None
        self._reordered: PETSc.Mat | None = None
        self._ksp = PETSc.KSP().create(matrix.comm)
        self._ksp.setOptionsPrefix(prefix)
        self._ksp.setType("preonly")
        pc = self._ksp.getPC()
        pc.setType("cholesky")
        pc.setFactorSolverType("mumps")
        pc.setFromOptions()

    def factorise(self, matrix: PETSc.Mat) -> Array:
        """Eliminate; return the Schur complement on rank 0, on the others nothing. Collective.

        It is stored by columns; its entries are NaN where the eliminated block is singular.

        Raises
        ------
        InputError
            If there is too little memory.
        """
        first = self._rows is None
        self._rows = matrix.createSubMatrix(*self._places, self._rows)
        reordered = matrix.permute(self._backwards, self._backwards)
        if self._reordered is None:
            self._reordered = reordered
        else:  # into the one that has been analysed
            reordered.copy(self._reordered, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
            reordered.destroy()
        self._reordered.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        # On several ranks MUMPS writes the other triangle where it factorises with an old analysis.
        if first or self.comm.size > 1:
            self._ksp.getPC().reset()
            self._ksp.setOperators(self._reordered)
            self._prepare(self._ksp.getPC())
        self._ksp.setOperators(self._reordered)
        set_up_with_workspace(self._ksp, self._prepare)
        if out_of_memory(self._ksp.getPC()):
            raise no_solution(self._ksp.getPC(), self._ksp.getOptionsPrefix())
        factor = self._ksp.getPC().getFactorMatrix()
        factor.setMumpsIcntl(*INTERIOR_SOLVE)
        size = self.size if self.comm.rank == 0 else 0
        left = on_each(self.comm, lambda: _complement(factor, size))
        return np.full_like(left, np.nan) if factor.getMumpsInfog(1) < 0 else left

    def _prepare(self, pc: PETSc.PC) -> None:
        """Let a factorisation keep unknowns before it begins."""
        pc.setFactorSetUpSolverType()
        pc.getFactorMatrix().setOptionsPrefix(pc.getOptionsPrefix())
        if self.size > 0:
            _set_kept(pc.getFactorMatrix(), self._numbers)

    def exceeds(self, rhs: Array, rounding: Array) -> bool:
        """Tell whether this rank's right-hand side exceeds rounding at eliminated unknowns."""
        beyond = np.abs(rhs) > rounding
        beyond[self._kept] = False
        return bool(beyond.any())

    def interior(self, rhs: Array) -> Array:
        """Return the solution for an owned right-hand side, the kept unknowns being 0. Collective.

        It depends on no values at kept unknowns.
        """
        inside = rhs.copy()
        inside[self._kept] = 0.0
        factor = self._ksp.getPC().getFactorMatrix()
        # PETSc refuses solves on several ranks for the sake of those with the kept unknowns too.
        form = factor.getMumpsIcntl(SCHUR)
        factor.setMumpsIcntl(SCHUR, 0)
        solution = mat_solve(factor, inside[::-1, None])[::-1, 0]
        factor.setMumpsIcntl(SCHUR, form)
        solution[self._kept] = 0.0
        return solution

    def reduce(self, rhs: Array) -> Array:
        """Return a right-hand side reduced to the kept unknowns, those of all ranks. Collective.

        In runs on one rank that is half a solve; PETSc has none on several.
        """
        if self.comm.size > 1:
            return self.condense(rhs, self.interior(rhs))
        factor = self._ksp.getPC().getFactorMatrix()
        factor.setMumpsIcntl(*REDUCE)
        reduced, given = factor.createVecs()
        given.array[:] = rhs[::-1]
        factor.solve(given, reduced)
        factor.setMumpsIcntl(*INTERIOR_SOLVE)
        return reduced.array[::-1][self._kept]

    def condense(self, rhs: Array, interior: Array) -> Array:
        """Reduce a right-hand side as `reduce`, given `interior` of it. Collective."""
        own = rhs[self._kept] - times(self._rows, interior)
        return np.concatenate(self.comm.allgather(own))

    def expand(self, rhs: Array, kept: Array) -> Array:
        """Return the owned solution, given that at the kept unknowns of all ranks. Collective."""
        own = kept[self.offset : self.offset + self._kept.size]
        solution = self.interior(rhs - times(self._rows, own, transposed=True))
        solution[self._kept] = own
        return solution
