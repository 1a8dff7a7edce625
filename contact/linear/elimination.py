"""Unknowns of one rank eliminated from a sparse matrix by MUMPS, which stops before the others."""

from __future__ import annotations

import ctypes

import numpy as np
from petsc4py import PETSc
from scipy import sparse

from contact.linear.faults import no_solution, out_of_memory, set_up_with_workspace
from contact.typing import Array

#: MUMPS's ICNTL(26): to solve with the eliminated unknowns, the others being 0; to reduce a
#: right-hand side to the others, which takes the first of the two substitutions alone.
INTERIOR, REDUCE = (26, 0), (26, 1)

#: PETSc's MAT_FACTOR_SCHUR_INVERTED.
INVERTED = 2

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

    The identity is left in its place, as its inverse: PETSc multiplies reduced right-hand sides by
    that, which so remain as they are.
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
    mirror(matrix)  # MUMPS promises the entries below the diagonal alone
    return matrix


def mirror(matrix: Array) -> None:
    """Copy the entries of a matrix below the diagonal above it."""
    for begin in range(0, len(matrix), COLUMNS):
        end = begin + COLUMNS
        matrix[begin:end, end:] = matrix[end:, begin:end].T
        corner = np.tril(matrix[begin:end, begin:end])
        matrix[begin:end, begin:end] = corner + np.tril(corner, -1).T


def stride(begin: int, end: int) -> PETSc.IS:
    """Return the numbers from one to before another, on one rank."""
    return PETSc.IS().createStride(end - begin, begin, 1, PETSc.COMM_SELF)


def entries(matrix: PETSc.Mat) -> sparse.csr_array:
    """Return a copy of a matrix of one rank."""
    starts, columns, values = matrix.getValuesCSR()
    return sparse.csr_array((values, columns, starts), shape=matrix.getSize())


class Elimination:
    """The first unknowns of a symmetric matrix of one rank, eliminated by MUMPS.

    Parameters
    ----------
    matrix
        Whose values may change, but not its pattern.
    first
        How many are eliminated.
    prefix
        Prefix of PETSc options of the factorisation.

    Attributes
    ----------
    coupling
        Rows of the first unknowns at the others, where the matrix was factorised last.
    regular
        Whether they could be eliminated then.
    """

    def __init__(self, matrix: PETSc.Mat, first: int, prefix: str) -> None:
        self._matrix, self._first, self.regular = matrix, first, True
        self._others = matrix.getSize()[0] - first
        self._analysed = False
        self._ksp = PETSc.KSP().create(PETSc.COMM_SELF)
        self._ksp.setOptionsPrefix(prefix)
        self._ksp.setType("preonly")
        pc = self._ksp.getPC()
        pc.setType("cholesky")
        pc.setFactorSolverType("mumps")
        pc.setFromOptions()

    def factorise(self) -> Array:
        """Return the Schur complement, stored by columns; not a number where there is none.

        Raises
        ------
        InputError
            If there is too little memory.
        """
        first, behind = stride(0, self._first), stride(self._first, self._first + self._others)
        self.coupling = entries(self._matrix.createSubMatrix(first, behind))
        if self._first == 0:
            return np.asfortranarray(entries(self._matrix).toarray())
        pc = self._ksp.getPC()
        self._matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
        self._ksp.setOperators(self._matrix)
        if not self._analysed:
            self._prepare(pc)
            self._analysed = True
        set_up_with_workspace(self._ksp, self._prepare)
        if out_of_memory(pc):
            raise no_solution(pc, self._ksp.getOptionsPrefix())
        factor = pc.getFactorMatrix()
        self.regular = factor.getMumpsInfog(1) >= 0
        left = _complement(factor, self._others)
        return left if self.regular else np.full_like(left, np.nan)

    def _prepare(self, pc: PETSc.PC) -> None:
        """Let a factorisation stop before the other unknowns."""
        pc.setFactorSetUpSolverType()
        pc.getFactorMatrix().setOptionsPrefix(pc.getOptionsPrefix())
        if self._others > 0:
            _set_kept(pc.getFactorMatrix(), stride(self._first, self._first + self._others))

    def reduce(self, sides: Array) -> Array:
        """Reduce right-hand sides at the first unknowns, (first, k), to the others, (n, k)."""
        return self._solved(REDUCE, sides)[self._first :]

    def solve(self, sides: Array) -> Array:
        """Solve with the first unknowns, shape (first, k), the others being 0."""
        return self._solved(INTERIOR, sides)[: self._first]

    def _solved(self, mode: tuple[int, int], sides: Array) -> Array:
        """Return the result of a solve of MUMPS at all unknowns."""
        shape = (self._first + self._others, sides.shape[1])
        if not self.regular:
            return np.full(shape, np.nan)
        found = np.zeros(shape)
        if self._first == 0 or (mode == REDUCE and self._others == 0):
            return found
        factor = self._ksp.getPC().getFactorMatrix()
        factor.setMumpsIcntl(*mode)
        solution, rhs = factor.createVecs()
        for k, side in enumerate(sides.T):
            rhs.array[: self._first] = side
            factor.solve(rhs, solution)
            found[:, k] = solution.array
        return found
