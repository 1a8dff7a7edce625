"""Static condensation: the dense Schur complement at retained unknowns, and operators with it.

MUMPS makes it on the first rank. In 2-D it has about as many entries as the mesh has nodes.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dgetrf, dgetrs, dpotrf, dpotrs

from contact import _compat
from contact.history import LinearisationPoint
from contact.linear.layout import Inclined, masked, masked_blocks, times
from contact.linear.operator import Counters
from contact.linear.petsc import mat_solve, no_solution, out_of_memory, set_up_with_workspace
from contact.ranks import on_each, on_root
from contact.typing import Array

#: MUMPS's ICNTL(26): solve with the retained unknowns 0; reduce a right-hand side, by the first
#: substitution alone.
INTERIOR_SOLVE, REDUCE = (26, 0), (26, 1)

#: MUMPS's ICNTL(7): order by minimum degree. METIS, the choice of some builds, doubles the time.
ORDERING = (7, 0)

#: MUMPS's ICNTL(19): form of the Schur complement; 0 for none.
SCHUR = 19

#: Columns that are copied at a time.
COLUMNS = 128


def _complement(factor: PETSc.Mat, size: int) -> Array:
    """Take the Schur complement, stored by columns, out of a factorisation."""
    if size == 0:
        return np.zeros((0, 0))
    matrix = _compat.take_schur_complement(factor, size)
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
    """Schur complement of a symmetric matrix at retained unknowns.

    A first matrix gives the pattern. The retained unknowns are owned, by local numbers; the result
    has them in rank order: `size` on all ranks, those of this rank from `offset`. `prefix` is that
    of PETSc options of the factorisation.
    """

    def __init__(self, matrix: PETSc.Mat, retained: NDArray[np.int32], prefix: str) -> None:
        self._retained, self.comm = retained, _compat.lasting(matrix.getComm().tompi4py())
        begin, end = matrix.getOwnershipRange()
        retained_rows = (begin + retained).astype(PETSc.IntType)
        # MUMPS orders by minimum degree, with ties by the given order: backwards along the fronts
        # of dolfinx's numbering is cheapest.
        self._backwards = PETSc.IS().createStride(end - begin, end - 1, -1, comm=matrix.comm)
        numbers = self.comm.allgather(begin + end - 1 - retained_rows)
        self.size = sum(part.size for part in numbers)
        self.offset = sum(part.size for part in numbers[: self.comm.rank])
        # The Schur complement is on the first rank.
        root_numbers = np.concatenate(numbers)[: None if self.comm.rank == 0 else 0]
        self._numbers = PETSc.IS().createGeneral(root_numbers, matrix.comm)
        self._places = (
            PETSc.IS().createGeneral(retained_rows, matrix.comm),
            PETSc.IS().createStride(end - begin, begin, 1, comm=matrix.comm),
        )
        #: Rows at retained unknowns, and the matrix numbered backwards.
        self._rows: PETSc.Mat | None = None
        self._reordered: PETSc.Mat | None = None
        self._ksp = PETSc.KSP().create(matrix.comm)
        self._ksp.setOptionsPrefix(prefix)
        self._ksp.setType("preonly")
        pc = self._ksp.getPC()
        pc.setType("cholesky")
        pc.setFactorSolverType("mumps")
        pc.setFromOptions()

    def complement(self, matrix: PETSc.Mat) -> Array:
        """Factorise, and return S on rank 0, by columns; NaN if singular. Collective.

        Too little memory is an `InputError`.
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
        complement = on_each(self.comm, lambda: _complement(factor, size))
        return np.full_like(complement, np.nan) if factor.getMumpsInfog(1) < 0 else complement

    def _prepare(self, pc: PETSc.PC) -> None:
        """Tell MUMPS the retained unknowns before a factorisation."""
        pc.setFactorSetUpSolverType()
        pc.getFactorMatrix().setOptionsPrefix(pc.getOptionsPrefix())
        if self.size > 0:
            pc.getFactorMatrix().setMumpsIcntl(*ORDERING)
            _compat.set_schur_unknowns(pc.getFactorMatrix(), self._numbers)

    def exceeds(self, rhs: Array, rounding_force: Array) -> bool:
        """Tell whether a right-hand side exceeds rounding at eliminated unknowns."""
        beyond = np.abs(rhs) > rounding_force
        beyond[self._retained] = False
        return bool(beyond.any())

    def interior(self, rhs: Array) -> Array:
        """Solve for an owned right-hand side with the retained unknowns 0. Collective."""
        inside = rhs.copy()
        inside[self._retained] = 0.0
        factor = self._ksp.getPC().getFactorMatrix()
        # PETSc refuses solves with a Schur complement on several ranks.
        form = factor.getMumpsIcntl(SCHUR)
        factor.setMumpsIcntl(SCHUR, 0)
        solution = mat_solve(factor, inside[::-1, None])[::-1, 0]
        factor.setMumpsIcntl(SCHUR, form)
        solution[self._retained] = 0.0
        return solution

    def condense(self, rhs: Array, interior: Array | None = None) -> Array:
        """Return a right-hand side condensed onto the retained unknowns of all ranks. Collective.

        With its `interior` solution, if that is known. Else on one rank by half a solve, which
        PETSc lacks on several.
        """
        if interior is None and self.comm.size == 1:
            factor = self._ksp.getPC().getFactorMatrix()
            factor.setMumpsIcntl(*REDUCE)
            reduced, reversed_rhs = factor.createVecs()
            reversed_rhs.array[:] = rhs[::-1]
            factor.solve(reversed_rhs, reduced)
            factor.setMumpsIcntl(*INTERIOR_SOLVE)
            return reduced.array[::-1][self._retained]
        interior = self.interior(rhs) if interior is None else interior
        condensed = rhs[self._retained] - times(self._rows, interior)
        return np.concatenate(self.comm.allgather(condensed))

    def expand(self, rhs: Array, retained: Array) -> Array:
        """Return the owned solution from that at the retained unknowns of all ranks. Collective."""
        owned = retained[self.offset : self.offset + self._retained.size]
        solution = self.interior(rhs - times(self._rows, owned, transposed=True))
        solution[self._retained] = owned
        return solution


class DenseStiffness:
    """A dense matrix on the first rank, and the factors of its last sum with nodal blocks.

    Unknowns without a block so far are eliminated once for all sums: tangential ones without
    friction, and those of open nodes. The matrix is in rank order.
    """

    def __init__(self, matrix: Array) -> None:
        self.matrix = matrix
        self._blocks: Array | None = None
        self._solve: Callable[[Array], Array] | None = None
        #: Number of each unknown among the remaining ones, negative if eliminated.
        self._place: NDArray[np.intp] | None = None

    def factorise(self, blocks: Array) -> bool:
        """Add blocks at the nodes and factorise, unless they are the last ones.

        By Cholesky if possible: in each step of an interior point.
        """
        if self._blocks is not None and np.array_equal(blocks, self._blocks):
            return False
        self._blocks = self._solve = None  # room for new factors
        acted = (blocks.any(axis=1) | blocks.any(axis=2)).ravel()
        if self._place is None or (self._place[acted] < 0).any():
            self._eliminate(acted if self._place is None else acted | (self._place >= 0))
        self._solve = self._factors(blocks)
        self._blocks = blocks
        return True

    def _factors(self, blocks: Array) -> Callable[[Array], Array]:
        """Return the solver of the reduced matrix plus the blocks."""
        if not self._rows.size:
            return lambda rhs: rhs
        if np.array_equal(blocks, blocks.transpose(0, 2, 1)):
            lower, fault = dpotrf(self._sum(blocks), lower=True, clean=False, overwrite_a=True)
            if not fault:
                return lambda rhs: np.asarray(dpotrs(lower, rhs, lower=True)[0])
        # A potential makes it indefinite.
        factors, pivots, _ = dgetrf(self._sum(blocks), overwrite_a=True)
        return lambda rhs: np.asarray(dgetrs(factors, pivots, rhs)[0])

    def _sum(self, blocks: Array) -> Array:
        """Return the reduced matrix plus the blocks."""
        assert self._place is not None
        total = self._reduced.copy(order="F")
        node, i, j = np.nonzero(blocks)
        first = node * blocks.shape[1]
        total[self._place[first + i], self._place[first + j]] += blocks[node, i, j]
        return np.asarray(total)

    def _eliminate(self, acted: NDArray[np.bool_]) -> None:
        """Eliminate the unknowns without a block so far."""
        matrix, rows, others = self.matrix, np.flatnonzero(acted), np.flatnonzero(~acted)
        self._place, self._reduced, self._border = None, matrix[:0], matrix[:0]
        lower, fault = _cholesky(matrix, others)
        if fault:  # indefinite by a potential, or singular without contact
            rows, others = np.arange(acted.size), others[:0]
            lower, _ = _cholesky(matrix, others)
        border = _forward(lower, matrix[np.ix_(others, rows)])
        self._reduced = matrix[np.ix_(rows, rows)] - border.T @ border if others.size else matrix
        self._rows, self._others, self._lower, self._border = rows, others, lower, border
        self._place = np.full(acted.size, -1)
        self._place[rows] = np.arange(rows.size)

    @np.errstate(over="ignore", invalid="ignore")  # of a singular sum
    def solve(self, blocks: Array, rhs: Array) -> Array:
        """Solve with the matrix plus blocks."""
        self.factorise(blocks)
        assert self._solve is not None
        inner = _forward(self._lower, rhs[self._others])
        solution = np.empty_like(rhs)
        solution[self._rows] = self._solve(rhs[self._rows] - self._border.T @ inner)
        inner -= self._border @ solution[self._rows]
        solution[self._others] = solve_triangular(
            self._lower, inner, lower=True, trans="T", check_finite=False
        )
        return solution


def _cholesky(matrix: Array, rows: NDArray[np.intp]) -> tuple[Array, int]:
    """Return the lower Cholesky factor of a principal submatrix, and the fault of LAPACK."""
    if not rows.size:
        return np.zeros((0, 0)), 0
    lower, fault = dpotrf(matrix[np.ix_(rows, rows)].T, lower=True, clean=False, overwrite_a=True)
    return lower, fault


def _forward(lower: Array, rhs: Array) -> Array:
    """Return L^-1 b."""
    return np.asarray(solve_triangular(lower, rhs, lower=True, check_finite=False))


class DenseOperator:
    """A dense matrix plus nodal blocks; as `operator.SparseOperator`.

    The matrix is on the first rank, and belongs to the retained unknowns of all ranks; `free` is
    the mask of the free ones among those that this rank owns, shape (nodes, block size).
    """

    symmetric, iterative = False, False

    def __init__(
        self,
        comm: MPI.Intracomm,
        free: NDArray[np.bool_],
        stiffness: DenseStiffness,
        counters: Counters,
        inclined: Inclined | None = None,
    ) -> None:
        self._comm, self._free, self._stiffness = comm, free, stiffness
        self._inclined = inclined
        self.counters = counters

    def update(
        self, kind: str, state: LinearisationPoint, blocks: Array, *, reuse: bool = False
    ) -> bool:
        """Factorise with blocks, the matrix being that of all kinds and states. Collective."""
        gathered = self._comm.gather(masked_blocks(self._free, self._inclined, blocks))
        self._blocks = np.concatenate(gathered or [blocks])
        factorised = on_root(self._comm, lambda: self._stiffness.factorise(self._blocks))
        self.counters.factorizations += factorised
        return factorised

    def solve(self, rhs: Array, rtol: float | None = None, guess: Array | None = None) -> Array:
        """Solve for the owned unknowns; see `operator.SparseOperator.solve`. Collective."""
        total = self._comm.gather(masked(self._free, self._inclined, rhs))
        self.counters.linear_solves += 1
        begin = self._comm.scan(rhs.size) - rhs.size
        solution = on_root(
            self._comm, lambda: self._stiffness.solve(self._blocks, np.concatenate(total))
        )
        return solution[begin : begin + rhs.size]
