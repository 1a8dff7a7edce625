"""Static condensation: the dense Schur complement at kept unknowns, by MUMPS.

In 2-D the matrix has about as many entries as the mesh has nodes.
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

#: MUMPS's ICNTL(26): solve with the kept unknowns 0; reduce a right-hand side, by the first
#: substitution alone.
INTERIOR_SOLVE, REDUCE = (26, 0), (26, 1)

#: PETSc's MAT_FACTOR_SCHUR_INVERTED.
INVERTED = 2

#: MUMPS's ICNTL(19): form of the Schur complement; 0 for none.
SCHUR = 19

#: Columns that are copied at a time.
COLUMNS = 128

# petsc4py has no Schur complements of factorisations.
_petsc = ctypes.CDLL(PETSc.__file__)


def _check(code: int) -> None:
    if code != 0:
        raise PETSc.Error(code)


def _complement(factor: PETSc.Mat, size: int) -> Array:
    """Copy the Schur complement, stored by columns, out of a factorisation.

    PETSc multiplies reduced right-hand sides by the inverse of its own one: the identity is left.
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
    """Copy the lower triangle, which MUMPS fills, to the upper one."""
    for begin in range(0, len(matrix), COLUMNS):
        end = begin + COLUMNS
        matrix[begin:end, end:] = matrix[end:, begin:end].T
        corner = np.tril(matrix[begin:end, begin:end])
        matrix[begin:end, begin:end] = corner + np.tril(corner, -1).T


class SchurComplement:
    """Schur complement of a symmetric matrix at kept unknowns.

    Parameters
    ----------
    matrix
        The assembled matrix, for its pattern.
    kept
        Owned kept unknowns, local numbers; the result has them in rank order.
    prefix
        Prefix of PETSc options of the factorisation.

    Attributes
    ----------
    size, offset
        Number of kept unknowns, and offset of those of this rank.
    """

    def __init__(self, matrix: PETSc.Mat, kept: NDArray[np.int32], prefix: str) -> None:
        self._kept, self.comm = kept, lasting(matrix.getComm().tompi4py())
        begin, end = matrix.getOwnershipRange()
        own_kept = (begin + kept).astype(PETSc.IntType)
        # MUMPS orders by minimum degree, with ties by the given order: backwards along the fronts
        # of dolfinx's numbering is cheapest.
        self._backwards = PETSc.IS().createStride(end - begin, end - 1, -1, comm=matrix.comm)
        numbers = self.comm.allgather(begin + end - 1 - own_kept)
        self.size = sum(part.size for part in numbers)
        self.offset = sum(part.size for part in numbers[: self.comm.rank])
        # The Schur complement is on the first rank.
        own = np.concatenate(numbers)[: None if self.comm.rank == 0 else 0]
        self._numbers = PETSc.IS().createGeneral(own, matrix.comm)
        self._places = (
            PETSc.IS().createGeneral(own_kept, matrix.comm),
            PETSc.IS().createStride(end - begin, begin, 1, comm=matrix.comm),
        )
        #: Rows at kept unknowns, and the matrix numbered backwards.
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
        """Return the Schur complement on rank 0, by columns; NaN if singular. Collective.

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
        # On several ranks MUMPS fills the other triangle with an old analysis.
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
        """Tell MUMPS the kept unknowns before a factorisation."""
        pc.setFactorSetUpSolverType()
        pc.getFactorMatrix().setOptionsPrefix(pc.getOptionsPrefix())
        if self.size > 0:
            handles = (pc.getFactorMatrix().handle, self._numbers.handle)
            _check(_petsc.MatFactorSetSchurIS(*map(ctypes.c_void_p, handles)))

    def exceeds(self, rhs: Array, rounding: Array) -> bool:
        """Tell whether a right-hand side exceeds rounding at eliminated unknowns."""
        beyond = np.abs(rhs) > rounding
        beyond[self._kept] = False
        return bool(beyond.any())

    def interior(self, rhs: Array) -> Array:
        """Solve for an owned right-hand side with the kept unknowns 0. Collective."""
        inside = rhs.copy()
        inside[self._kept] = 0.0
        factor = self._ksp.getPC().getFactorMatrix()
        # PETSc refuses solves with a Schur complement on several ranks.
        form = factor.getMumpsIcntl(SCHUR)
        factor.setMumpsIcntl(SCHUR, 0)
        solution = mat_solve(factor, inside[::-1, None])[::-1, 0]
        factor.setMumpsIcntl(SCHUR, form)
        solution[self._kept] = 0.0
        return solution

    def reduce(self, rhs: Array) -> Array:
        """Return a right-hand side reduced to the kept unknowns of all ranks. Collective.

        On one rank by half a solve, which PETSc lacks on several.
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
        """Reduce a right-hand side, given its `interior` solution. Collective."""
        own = rhs[self._kept] - times(self._rows, interior)
        return np.concatenate(self.comm.allgather(own))

    def expand(self, rhs: Array, kept: Array) -> Array:
        """Return the owned solution from that at the kept unknowns of all ranks. Collective."""
        own = kept[self.offset : self.offset + self._kept.size]
        solution = self.interior(rhs - times(self._rows, own, transposed=True))
        solution[self._kept] = own
        return solution
