"""Linear operators: a bulk matrix plus small dense blocks at contact nodes, and its solver.

The blocks are derivatives of contact forces by the jumps of their node: Newton's linearised contact
laws with layer and charge, or the augmentation r of the Uzawa block relaxation, Step 1 in
Algorithms 2, 5, 7 and 9 of the thesis.

With a potential the operator [[K, E^T], [E, -L]] is indefinite. With L the permittivity's
Laplacian, diag(K, L) is positive definite and bounds the preconditioned spectrum by
+-[1, sqrt(1 + kappa)], kappa < 1 for PZT-5A (`forms.piezo.coupling_number`), whatever the mesh
and the units. An iterative solver replaces K and L by one V-cycle each (`BlockPreconditioner`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from petsc4py import PETSc

from contact.errors import InputError
from contact.history import LinearisationPoint
from contact.linear import multigrid
from contact.linear.layout import (
    Layout,
    balance,
    insert_blocks,
    masked_blocks,
    nodal_blocks,
    set_defaults,
    times,
)
from contact.linear.multigrid import TOUCH, Hierarchy, masked_motions, rigid_motions
from contact.linear.petsc import (
    Subsystems,
    check_overflow,
    mat_solve,
    no_solution,
    petsc_options,
    refine,
    set_up_with_workspace,
)
from contact.ranks import summed
from contact.typing import Array

#: Prefix of PETSc options, for instance ``-contact_ksp_type cg``.
PREFIX = "contact_"

#: Default options of the displacement's block, under ``fieldsplit_u_``. The W-cycle keeps the
#: counts flat; coarse levels have few unknowns.
MECHANICAL = {
    "pc_type": "gamg",
    **multigrid.DEFAULTS,
    "pc_mg_cycle_type": "w",
}

#: The same of the potential's block, under ``fieldsplit_phi_``, without hypre.
ELECTRIC = {
    "pc_type": "gamg",
    "pc_gamg_agg_nsmooths": "1",
    "pc_gamg_aggressive_coarsening": "0",
    "pc_mg_cycle_type": "w",
    "mg_levels_ksp_type": "chebyshev",
    "mg_levels_ksp_max_it": "2",
    "mg_levels_pc_type": "sor",
}


class BlockPreconditioner:
    """The block-diagonal preconditioner of a piezoelectric operator.

    For MINRES, or GMRES if the operator is not symmetric: K by GAMG with the rigid-body motions, L
    by hypre (or GAMG). It is assembled from a copy of the operator whose electric rows are negated:
    its diagonal blocks are K and L, and PETSc's fieldsplit looks at nothing else. Options under the
    solver's prefix come first, for instance ``-contact_fieldsplit_phi_pc_type gamg``.
    """

    def __init__(self, ksp: PETSc.KSP, layout: Layout, symmetric: bool) -> None:
        self._layout, self._ksp = layout, ksp
        self._matrix: PETSc.Mat | None = None
        self._signs: PETSc.Vec | None = None
        multigrid.iterate(ksp, "minres" if symmetric else "gmres")
        pc = ksp.getPC()
        pc.setType("fieldsplit")
        mechanical, electric = _fields(layout)
        mechanical.compose("nearnullspace", rigid_motions(layout))
        pc.setFieldSplitIS(("u", mechanical), ("phi", electric))
        pc.setFieldSplitType(PETSc.PC.CompositeType.ADDITIVE)
        prefix = ksp.getOptionsPrefix() or ""
        set_defaults(f"{prefix}fieldsplit_u_", MECHANICAL)
        hypre = PETSc.Sys.hasExternalPackage("hypre")
        electric_options = {"pc_type": "hypre"} if hypre else ELECTRIC
        set_defaults(f"{prefix}fieldsplit_phi_", electric_options)

    def set_goal(self, rhs: PETSc.Vec | None) -> None:
        """Set the absolute tolerance of MINRES to rtol |b|; to 0 for None. Collective."""
        if self._ksp.getType() != "minres":
            return
        size = 0.0
        if rhs is not None:
            solved = rhs.duplicate()
            self._ksp.getPC().apply(rhs, solved)
            size = np.sqrt(max(rhs.dot(solved), 0.0))
        self._ksp.setTolerances(atol=self._ksp.rtol * size)

    def matrix(self, operator: PETSc.Mat) -> PETSc.Mat:
        """Return the copy of an operator with negated electric rows. Collective."""
        if self._matrix is None:
            self._matrix = operator.copy()
            # The diagonal of fixed unknowns is positive, and stays so.
            sign = np.ones(self._layout.free.shape)
            sign[self._layout.free[:, -1], -1] = -1.0
            self._signs = operator.createVecLeft()
            self._signs.array[:] = sign.ravel()
        else:
            operator.copy(self._matrix, PETSc.Mat.Structure.SAME_NONZERO_PATTERN)
        self._matrix.diagonalScale(L=self._signs)
        return self._matrix


def _fields(layout: Layout) -> tuple[PETSc.IS, PETSc.IS]:
    """Return the global numbers of the owned mechanical and electric unknowns."""
    d, bs = layout.dim, layout.block_size
    start, end = layout.index_map.local_range
    numbers: NDArray[np.integer] = np.arange(start * bs, end * bs, dtype=PETSc.IntType)
    nodes = numbers.reshape(-1, bs)
    mechanical = PETSc.IS().createGeneral(nodes[:, :d].ravel(), layout.comm)
    mechanical.setBlockSize(d)
    electric = PETSc.IS().createGeneral(nodes[:, d].copy(), layout.comm)
    return mechanical, electric


class Bulk(Protocol):
    """Matrices of a body."""

    @property
    def layout(self) -> Layout:
        """The unknowns."""

    @property
    def linear(self) -> bool:
        """Whether the matrices of a kind are the same at all states."""

    def create_matrix(self) -> PETSc.Mat:
        """Return an empty matrix with the pattern of the body. Collective.

        It must not outlive the mesh, whose communicator it has (segmentation fault in PETSc).
        """

    def assemble(self, matrix: PETSc.Mat, kind: str, state: LinearisationPoint) -> None:
        """Assemble the "secant", the "tangent" or its "symmetric" part. Collective."""


class BorderedBulk(Bulk, Protocol):
    """Matrices of a body with global unknowns q."""

    def border(self, kind: str) -> tuple[Array, Array] | None:
        """Return the derivatives by q of the forces on x and q beyond K N_q, if any. Collective."""


@dataclass
class Counters:
    """Numbers of factorisations and solves.

    A direct solve counts as one of `linear_iterations`; `contact_solves` are those with the
    condensed body.
    """

    factorizations: int = 0
    linear_solves: int = 0
    linear_iterations: int = 0
    contact_solves: int = 0

    def __sub__(self, before: Counters) -> Counters:
        """Return the difference of two counts."""
        return Counters(**{name: count - vars(before)[name] for name, count in vars(self).items()})


class Operator(Protocol):
    """Bulk matrix plus blocks at nodes, sparse or dense."""

    @property
    def symmetric(self) -> bool:
        """Whether the blocks are symmetric too."""

    def update(
        self, kind: str, state: LinearisationPoint, blocks: Array, *, reuse: bool = False
    ) -> bool:
        """Assemble and factorise; see `SparseOperator.update`. Collective.

        The matrix of a condensed body is given: `kind`, `state` and `reuse` do not change it.
        """

    def solve(self, rhs: Array, rtol: float | None = None, guess: Array | None = None) -> Array:
        """Solve for the owned unknowns; see `SparseOperator.solve`. Collective."""


class SparseOperator:
    """Bulk matrix plus nodal blocks, with one factorisation until either changes.

    `nodes` are the owned nodes with blocks, by local numbers; `symmetric` blocks mean LDL^T instead
    of LU. `solver` is "lu", "iterative", or "auto": iterative for large problems; "many", for
    hundreds of solves with one matrix: iterative if LU has too little memory.
    """

    def __init__(
        self,
        bulk: Bulk,
        nodes: NDArray[np.int32],
        *,
        symmetric: bool = True,
        counters: Counters | None = None,
        solver: str = "auto",
        subsystems: Subsystems | None = None,
    ) -> None:
        self.bulk, self.layout, self._nodes = bulk, bulk.layout, nodes
        self.counters = counters or Counters()
        self.symmetric = symmetric
        self.matrix = bulk.create_matrix()
        self._subsystems = subsystems
        self._rhs, self._solution = self.matrix.createVecs()
        self.iterative = multigrid.is_chosen(solver, self.layout)
        self._modes: PETSc.NullSpace | None = None
        if self.iterative and not self.layout.piezoelectric:
            self._modes = masked_motions(self.layout)
        self._begin()

    def _begin(self) -> None:
        """Make a new solver, without a factorisation. Collective."""
        #: The matrix, or with global unknowns eliminated from it.
        self.system = self.matrix
        self._kind = ""
        self._blocks: Array | None = None
        self._split: BlockPreconditioner | None = None
        self._transposed: PETSc.KSP | None = None
        self._hierarchy: Hierarchy | None = None
        self.ksp = PETSc.KSP().create(self.layout.comm)
        self.ksp.setOptionsPrefix(PREFIX)
        if self.iterative and self.layout.piezoelectric:
            self._split = BlockPreconditioner(self.ksp, self.layout, self.symmetric)
        elif self.iterative:
            multigrid.configure(self.ksp, self.symmetric)
        else:
            self.ksp.setType("preonly")
            pc = self.ksp.getPC()
            pc.setType("cholesky" if self.symmetric else "lu")
            pc.setFactorSolverType("mumps")
        with petsc_options(PREFIX):
            self.ksp.setFromOptions()
        self._tolerance = self.ksp.getTolerances()[0]

    def multiply(self, values: Array, transposed: bool = False) -> Array:
        """Return the matrix, or its transpose, times owned values. Collective."""
        return times(self.matrix, values, transposed)

    def update(
        self, kind: str, state: LinearisationPoint, blocks: Array, *, reuse: bool = False
    ) -> bool:
        """Assemble the operator at a state; tell whether matrix or blocks have changed. Collective.

        `kind` is "secant" or "tangent", and the blocks are weighted, shape
        (n, block size, block size). With `reuse` the bulk matrix is that of the last call if its
        kind is the same; that of a linear body always is.
        """
        nodes, last = self._nodes, self._blocks
        same = kind == self._kind and (reuse or self.bulk.linear)
        if same and last is not None and self._all(np.array_equal(blocks, last)):
            return False
        self._kind, self._blocks, self._transposed = kind, blocks.copy(), None
        if not same:
            self.bulk.assemble(self.matrix, kind, state)
            if self._modes is not None:
                # Copies into a matrix drop its near null space.
                self.matrix.setNearNullSpace(self._modes)
            balance(self.matrix, self.layout)
            self._body_blocks = nodal_blocks(self.matrix, nodes)
        contact_blocks = masked_blocks(*self.layout.at(nodes), blocks)
        body_blocks = self._body_blocks
        # An empty insertion would bump the matrix state and trigger a refactorisation.
        inserts = same or not self._all(not contact_blocks.any())
        if self._multigrid and self._hierarchy is None:
            if inserts:
                insert_blocks(self.matrix, nodes, body_blocks + TOUCH * contact_blocks)
            self.matrix.setOption(PETSc.Mat.Option.SYMMETRIC, True)
            self.ksp.setOperators(self.system, self.matrix)
            self._hierarchy = Hierarchy(self.ksp, nodes, self._subsystems)
        if inserts:
            insert_blocks(self.matrix, nodes, body_blocks + contact_blocks)
        if self._hierarchy is None:
            self._set_up(self.symmetric)
            self.counters.factorizations += 1
        else:
            self.matrix.setOption(PETSc.Mat.Option.SYMMETRIC, self.symmetric)
            self.counters.factorizations += self._hierarchy.follow(body_blocks, contact_blocks)
        return True

    @property
    def _multigrid(self) -> bool:
        """Whether the solver is multigrid without a potential."""
        return self._split is None and self.ksp.getPC().getType() == "gamg"

    def _all(self, flag: bool) -> bool:
        return bool(summed(self.layout.comm, flag) == self.layout.comm.size)

    def _set_up(self, symmetric: bool) -> None:
        """Set up the solver for the present matrix."""
        self.matrix.setOption(PETSc.Mat.Option.SYMMETRIC, symmetric)
        split = self._split
        self.ksp.setOperators(self.system, split.matrix(self.matrix) if split else self.matrix)
        with petsc_options(PREFIX):
            set_up_with_workspace(self.ksp)

    def solve(self, rhs: Array, rtol: float | None = None, guess: Array | None = None) -> Array:
        """Solve for an owned right-hand side; fixed unknowns stay 0. Collective.

        `rtol` is the relative tolerance of an iterative solver, its own by default, and `guess` its
        initial guess, zero by default. SingularError if the operator is singular, InputError if its
        numbers overflow or the memory is too small.
        """
        self._rhs.array[:] = self.layout.mask(rhs)
        self.ksp.setTolerances(rtol=self._tolerance if rtol is None else rtol)
        if self.iterative:
            self.ksp.setInitialGuessNonzero(guess is not None)
            if self._split is not None:
                self._split.set_goal(None if guess is None else self._rhs)
            if guess is not None:
                self._solution.array[:] = guess
        if self._hierarchy is None:
            self.ksp.solve(self._rhs, self._solution)
            iterations = self.ksp.getIterationNumber()
            if self.iterative:
                iterations += self._refine()
        else:
            iterations, renewed = self._hierarchy.solve(self._rhs, self._solution)
            self.counters.factorizations += renewed
        self._solved(iterations, self._rhs.norm(), self._solution.norm())
        # Iterative solvers leave fixed unknowns within their tolerance.
        return self.layout.mask(self._solution.array)

    def solve_transposed(self, rhs: Array, rtol: float | None = None) -> Array:
        """Solve with the transposed matrix; see `solve`. Collective."""
        self._rhs.array[:] = self.layout.mask(rhs)
        ksp = self.ksp if self._split is None else self._transposed_solver()
        ksp.setTolerances(rtol=self._tolerance if rtol is None else rtol)
        ksp.setInitialGuessNonzero(False)
        if not self.iterative:
            ksp.solveTranspose(self._rhs, self._solution)
        elif self._split is not None:
            ksp.solve(self._rhs, self._solution)
        else:
            # By the preconditioner itself: PETSc's SOR of blocks has no transpose.
            system, preconditioned = ksp.getOperators()
            ksp.setOperators(PETSc.Mat().createTranspose(system), preconditioned)
            ksp.solve(self._rhs, self._solution)
            ksp.setOperators(system, preconditioned)
        self._solved(ksp.getIterationNumber(), self._rhs.norm(), self._solution.norm())
        return self.layout.mask(self._solution.array)

    def _transposed_solver(self) -> PETSc.KSP:
        """Return a solver of the transposed piezoelectric matrix. Collective.

        BoomerAMG has no transpose with its smoothers: PETSc's is wrong, and says nothing.
        """
        if self._transposed is None:
            self._transposed = PETSc.KSP().create(self.layout.comm)
            self._transposed.setOptionsPrefix(PREFIX)
            split = BlockPreconditioner(self._transposed, self.layout, self.symmetric)
            with petsc_options(PREFIX):
                self._transposed.setFromOptions()
                matrix = self.matrix.transpose(PETSc.Mat())
                system = PETSc.Mat().createTranspose(self.system)
                self._transposed.setOperators(system, split.matrix(matrix))
                set_up_with_workspace(self._transposed)
        return self._transposed

    def _refine(self) -> int:
        """Refine the solution; return the number of iterations. Collective."""
        taken = 0

        def solve(rhs: PETSc.Vec, correction: PETSc.Vec) -> None:
            nonlocal taken
            self.ksp.solve(rhs, correction)
            taken += self.ksp.getIterationNumber()

        refine(self.ksp, self._rhs, self._solution, solve, self._subsystems)
        return taken

    def solve_all(self, sides: Array) -> Array:
        """Solve for right-hand sides, (owned, k), as `solve`; counts as one solve. Collective."""
        rhs = np.column_stack([self.layout.mask(side) for side in sides.T])
        norm = float(np.sqrt(summed(self.layout.comm, np.sum(rhs**2))))
        if self.ksp.getPC().getFailedReason():
            raise self._fault(norm)
        solution = mat_solve(self.ksp, rhs)
        self._solved(1, norm, float(np.sqrt(summed(self.layout.comm, np.sum(solution**2)))))
        return np.column_stack([self.layout.mask(x) for x in solution.T])

    def _solved(self, iterations: int, rhs: float, solution: float) -> None:
        """Count a solve; raise InputError if it has failed. Collective."""
        self.counters.linear_solves += 1
        self.counters.linear_iterations += iterations
        failed = self.ksp.getConvergedReason() == PETSc.KSP.ConvergedReason.DIVERGED_PCSETUP_FAILED
        if failed or not np.isfinite(solution):
            raise self._fault(rhs)

    def _fault(self, rhs: float) -> InputError:
        """Return the error of a failure, from which MUMPS does not recover. Collective."""
        pc = self.ksp.getPC()
        self._begin()
        check_overflow(self.layout, self.matrix.norm(), rhs)
        return no_solution(pc, PREFIX)
