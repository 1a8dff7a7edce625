"""A sparse factorisation that stops before the last unknowns: MUMPS's Schur complement."""

from __future__ import annotations

import ctypes

import numpy as np
from petsc4py import PETSc

from contact.linear.workspace import MOST_WORKSPACE, TOO_SMALL, WORKSPACE
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
    """Copy what is below the diagonal, all that MUMPS writes, above it."""
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
        """Return what values of the first unknowns are in the last rows."""
        vector, image = self._coupling.createVecs()
        vector.array[:] = first
        self._coupling.mult(vector, image)
        return np.asarray(image.array)

    def to_first(self, last: Array) -> Array:
        """Return what values of the last unknowns are in the first rows."""
        image, vector = self._coupling.createVecs()
        vector.array[:] = last
        self._coupling.multTranspose(vector, image)
        return np.asarray(image.array)
