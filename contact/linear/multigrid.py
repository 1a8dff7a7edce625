"""Algebraic multigrid for contact problems: GAMG with the rigid-body modes as near null space.

Three things are added to it: a first coarse level that ranks make of their own rows
(`aggregation`), interpolation that knows contact nodes (`StiffNodes`), and coarse levels that are
renewed when iterations say so (`Hierarchy`).
"""

from __future__ import annotations

from math import ceil, log10

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from contact._compat import keeps_inverted_blocks
from contact.linear.aggregation import AGGREGATES, Aggregation, rows_of, tentative
from contact.linear.faults import petsc_options
from contact.linear.krylov import Components, refine
from contact.linear.layout import Layout, hidden, options, set_defaults
from contact.typing import Array

#: Unknowns from which an iterative solver pays, by dimension and whether the body is piezoelectric
#: (seen in `make bench`).
LARGE = {(2, False): 2_500_000, (2, True): 2_500_000, (3, False): 10_000, (3, True): 60_000}

#: Unknowns up to which a direct solver is thought of in 3-D: it then takes some gigabytes.
DIRECT = 150_000

#: A node in contact couples its components through the large gamma of the constraint: the smoother
#: has to invert the nodal blocks. SOR does so too, but takes longer.
SMOOTHER = (
    {"mg_levels_ksp_max_it": "2", "mg_levels_pc_type": "sor"}
    if keeps_inverted_blocks()
    else {"mg_levels_ksp_max_it": "3", "mg_levels_pc_type": "pbjacobi"}
)

#: Relative tolerance of a linear solve, in the norm of the preconditioner.
TOLERANCE = 1e-10

#: Options of MINRES. PETSc's own radius is a size, at which it ends as if it had converged; and the
#: norm of a right-hand side, to which it compares its residual, is in other units than that.
MINRES = {"ksp_minres_radius": "1e300", "ksp_converged_use_initial_residual_norm": "true"}

#: Options of GAMG where the user gives none.
DEFAULTS = {
    "pc_gamg_type": "agg",
    "pc_gamg_agg_nsmooths": "1",
    "pc_gamg_threshold": "0.01",
    "pc_gamg_reuse_interpolation": "true",
    "pc_gamg_coarse_eq_limit": "2000",
    "pc_gamg_aggressive_coarsening": "1",
    "mg_levels_ksp_type": "chebyshev",
    **SMOOTHER,
    "mg_coarse_pc_type": "redundant",
    "mg_coarse_redundant_pc_type": "lu",
    # PETSc's own is a size, and would call a body singular in units in which it is soft and small.
    "mg_coarse_redundant_pc_factor_zeropivot": "1e-300",
}


def is_large(layout: Layout) -> bool:
    """Tell whether an iterative solver pays for a system of this size."""
    return layout.unknowns >= LARGE[layout.dim, layout.coupled]


def is_chosen(kind: str, layout: Layout) -> bool:
    """Tell whether to solve by iterations; `kind` as of `operator.SparseOperator`.

    A factorisation is worth hundreds of solves by multigrid, but costs more than a few of them.
    """
    if kind == "many":
        return is_large(layout) and layout.unknowns > DIRECT
    return kind == "iterative" or (kind == "auto" and is_large(layout))


def configure(ksp: PETSc.KSP, symmetric: bool) -> None:
    """Set up CG (GMRES where friction makes the operator non-symmetric) with GAMG.

    Options given by the user under the solver's prefix come first.
    """
    iterate(ksp, "cg" if symmetric else "gmres")
    ksp.getPC().setType("gamg")
    set_defaults(ksp.getOptionsPrefix() or "", DEFAULTS)


def iterate(ksp: PETSc.KSP, method: str) -> None:
    """Let a Krylov method solve, with the tolerance and the limit of all of them."""
    ksp.setType(method)
    if method == "gmres":
        ksp.setGMRESRestart(80)
    if method == "minres":
        set_defaults(ksp.getOptionsPrefix() or "", MINRES)
    ksp.setTolerances(rtol=TOLERANCE, max_it=500)


def rigid_motions(layout: Layout) -> PETSc.NullSpace:
    """Return the rigid motions of the displacement, orthonormalised, fixed or not. Collective."""
    d, index_map = layout.dim, layout.index_map
    if layout.revolved:
        return _along_axis(layout)
    size = (index_map.size_local * d, index_map.size_global * d)
    coordinates = PETSc.Vec().createMPI(size, d, layout.comm)
    # Rotations about the middle, in units of the size: far from the origin they would be lost.
    total = layout.comm.allreduce(layout.points.sum(axis=0), op=MPI.SUM)
    middle = total / index_map.size_global
    coordinates.array[:] = ((layout.points - middle) / layout.size).ravel()
    return PETSc.NullSpace().createRigidBody(coordinates)


def _along_axis(layout: Layout) -> PETSc.NullSpace:
    """Return the only rigid motion of a body of revolution."""
    size = (layout.index_map.size_local * 2, layout.index_map.size_global * 2)
    motion = PETSc.Vec().createMPI(size, 2, layout.comm)
    motion.array[1::2] = 1.0
    motion.normalize()
    return PETSc.NullSpace().create(vectors=[motion], comm=layout.comm)


def held_motions(layout: Layout) -> PETSc.NullSpace:
    """Return the rigid motions, 0 where the displacement is fixed, orthonormalised. Collective."""
    vectors: list[PETSc.Vec] = []
    for motion in rigid_motions(layout).getVecs():
        vector = motion.copy()  # PETSc locks those of a null space
        vector.array[:] = layout.mask(vector.array)
        for other in vectors:
            vector.axpy(-vector.dot(other), other)
        vector.normalize()
        vectors.append(vector)
    return PETSc.NullSpace().create(vectors=vectors, comm=layout.comm)


#: Part of the contact blocks that is there when the interpolation is made: it alters nothing, but
#: where contact alone holds the body the coarsest operator would be singular without it.
TOUCH = 1e-8


class StiffNodes:
    """The contact nodes of a system that GAMG preconditions.

    Left to itself, GAMG takes a sliding node for one that is cut off, because its gamma outweighs
    all couplings, and leaves its motion along the foundation out of the coarse spaces; and a
    coarse function that moves one node against gamma is lost whole. Either way nothing but the
    smoother acts in a layer at the sliding zone, and the counts grow with its area in elements.

    So the interpolation is made for the body alone, once. At a contact node, where K is the
    body's nodal block and B the contact's, it is then multiplied by (K + |B|)^-1 K: the motion
    that is in equilibrium with the same neighbours. |B|, the root of B^T B, takes friction that
    falls with the slip for a stiffness too, and the factor stays bounded.

    Parameters
    ----------
    interpolation
        This rank's rows of the interpolation, made with the body's operator; None without one.
    block_size
        Unknowns of a node.
    nodes
        Owned nodes that may have contact blocks, local numbers, shape (n,).
    """

    def __init__(
        self, interpolation: PETSc.Mat | None, block_size: int, nodes: NDArray[np.int32]
    ) -> None:
        self._nodes, self._interpolation = nodes, interpolation
        if interpolation is None:
            return
        rows = block_size * nodes[:, None] + np.arange(block_size)
        self._rows = rows.astype(PETSc.IntType).ravel()
        of_body = rows_of(interpolation, self._rows)
        self._starts, self._columns, self._values = of_body.getValuesCSR()

    def follow(self, own: Array, blocks: Array) -> None:
        """Adapt the interpolation to contact blocks. Collective.

        Parameters
        ----------
        own, blocks
            Blocks of the body and of contact at the nodes, zero where an unknown is fixed, shape
            (n, block size, block size).
        """
        # Of K its diagonal will do.
        root = np.sqrt(np.abs(np.einsum("nii->ni", own)))
        scaled = blocks / root[:, :, None] / root[:, None, :]
        # Where numbers overflow the solver itself will say so.
        left, size, right = np.linalg.svd(np.where(np.isfinite(scaled), scaled, 0.0))
        yielding = np.einsum("nki,nk,nkj->nij", right, 1 / (1 + size), right)
        self._inverse = np.einsum("nki,nk,njk->nij", right, size / (1 + size**2), left)
        self._inverse /= root[:, :, None] * root[:, None, :]
        if self._interpolation is not None:
            values = self._mixed(yielding * root[:, None, :] / root[:, :, None])
            self._interpolation.setValuesIJV(self._starts, self._columns, values, rowmap=self._rows)
            self._interpolation.assemble()

    def _mixed(self, factor: Array) -> Array:
        """Return the values of the rows, those of each node multiplied by a matrix."""
        bs = factor.shape[1]
        row = np.repeat(np.arange(self._rows.size), np.diff(self._starts))
        within = np.arange(row.size) - self._starts[row]
        values = np.zeros_like(self._values)
        for k in range(bs):
            # The rows of a node have the same columns.
            same = self._starts[row // bs * bs + k] + within
            values += factor[row // bs, row % bs, k] * self._values[same]
        return values

    def jump(self, rhs: PETSc.Vec) -> PETSc.Vec:
        """Return a vector that balances the part of a right-hand side for the stiff blocks alone.

        With friction they carry forces in other directions than those in which they are stiff.
        These would pass to the coarse levels, where nothing resists them, and the first
        correction would be so large that a residual relative to it said nothing.
        """
        vector = rhs.duplicate()
        values = vector.array.reshape(-1, self._inverse.shape[1])
        values[self._nodes] = np.einsum(
            "nij,nj->ni", self._inverse, rhs.array.reshape(values.shape)[self._nodes]
        )
        return vector


#: Options of the user that are not those of the levels above GAMG's, whose matrices are made here.
NOT_ABOVE = ("pc_type", "pc_mg_galerkin")

#: A W-cycle visits the levels of GAMG twice: PETSc visits a coarsest level once.
TWICE = {"ksp_type": "richardson", "ksp_max_it": "2", "ksp_norm_type": "none"}


def _go_down(named: dict[str, str]) -> None:
    """Make options of GAMG those of the next level: counts of levels, and values of each."""
    squared = int(named["pc_gamg_aggressive_coarsening"])
    named["pc_gamg_aggressive_coarsening"] = str(max(squared - 1, 0))
    first, *others = named["pc_gamg_threshold"].split(",")
    factor = float(named.get("pc_gamg_threshold_scale", 1))
    named["pc_gamg_threshold"] = ",".join(others) or str(factor * float(first))


#: Cost of renewing the coarse levels, in iterations (seen in `scripts.benchmarks.phases`).
PRICE = 8


class Hierarchy:
    """The levels of GAMG, which follow an operator at little cost.

    To multiply out all coarse operators takes as long as `PRICE` iterations, and from one step of
    Newton's method to the next little changes. So the smoother of the finest level and the
    interpolation at the contact nodes follow the operator in each of them, the coarse levels only
    once the iterations that have been lost without them would have paid for that: the rule of
    those who do not know how often they will ski, and buy when they have paid as much for
    hiring. A solve that loses as many by itself goes on with new ones. No solve takes more
    iterations than `ksp_max_it` allows.

    Parameters
    ----------
    ksp
        A solver with GAMG, and the body's operator. It is not set up.
    nodes
        Owned nodes that may have contact blocks, local numbers, shape (n,).
    components
        As of `refine`.
    """

    def __init__(
        self, ksp: PETSc.KSP, nodes: NDArray[np.int32], components: Components | None = None
    ) -> None:
        self._ksp, self._components = ksp, components
        #: Options of PETSc for the levels below the first coarse one.
        self._below: dict[str, str] = {}
        self._levels: list[Aggregation] = []
        self._make_levels()
        rows = self._levels[0].rows if self._levels else None
        self._stiff = StiffNodes(rows, ksp.getOperators()[0].getBlockSize(), nodes)
        self._most = ksp.getTolerances()[3]
        self._lost = np.inf
        #: Iterations a digit with coarse levels of the operator itself, and whether they are that.
        self._rate, self._fresh = 0.0, False
        self._taken, self._renewed = 0, False

    def _make_levels(self) -> None:
        """Make coarse levels while ranks have many unknowns; GAMG makes those below. Collective."""
        pc, prefix = self._ksp.getPC(), self._ksp.getOptionsPrefix() or ""
        matrix = self._ksp.getOperators()[0]
        known, kinds = PETSc.Options(prefix), ("pc_gamg_", "pc_mg_", "mg_")
        # Read one by one: PETSc warns of options that nobody has read.
        named = {name: known.getString(name) for name in known.getAll() if name.startswith(kinds)}
        steps = int(named["pc_gamg_agg_nsmooths"])
        while named["pc_gamg_type"] == "agg":
            own = {name: value for name, value in named.items() if name.startswith("pc_gamg_")}
            with petsc_options(prefix), options(f"{prefix}aggregates_", own | AGGREGATES):
                found = tentative(matrix, f"{prefix}aggregates_")
            if found is None:
                break
            self._levels.append(Aggregation(matrix, found, steps))
            _go_down(named)
            # Of small matrices GAMG leaves some ranks without rows.
            if self._levels[-1].interpolation.getSize()[1] <= LARGE[3, False] * matrix.comm.size:
                break
            matrix = self._levels[-1].update()
        if not self._levels:
            return
        # The whole cycle is repeated, and not its lower part once more.
        named.pop("pc_mg_multiplicative_cycles", None)
        visits = TWICE if named.get("pc_mg_cycle_type") == "w" else {"ksp_type": "preonly"}
        self._below = named | visits | {"pc_type": "gamg"}
        pc.setType("mg")
        pc.setMGLevels(1 + len(self._levels))
        with petsc_options(prefix), hidden(prefix, NOT_ABOVE):
            pc.setFromOptions()
        for k, level in enumerate(reversed(self._levels), start=1):
            pc.setMGInterpolation(k, level.interpolation)
        pc.getMGCoarseSolve().setOptionsPrefix(f"{prefix}coarse_")

    def follow(self, own: Array, blocks: Array) -> bool:
        """Follow the operator, and tell whether its coarse levels are renewed. Collective.

        Parameters
        ----------
        own, blocks
            Blocks of the body and of contact at the nodes, zero where an unknown is fixed, shape
            (n, block size, block size).
        """
        self._stiff.follow(own, blocks)
        if self._lost >= PRICE:
            self._renew()
            return True
        self._fresh = False
        pc = self._ksp.getPC()
        pc.setReusePreconditioner(True)
        self._set_up()
        pc.getMGSmoother(pc.getMGLevels() - 1).getPC().setUp()
        return False

    def _renew(self) -> None:
        pc = self._ksp.getPC()
        pc.setReusePreconditioner(False)
        for k, level in enumerate(self._levels, start=1):
            operator = level.update()
            pc.getMGSmoother(len(self._levels) - k).setOperators(operator, operator)
        self._set_up()
        self._lost, self._rate, self._fresh, self._renewed = 0.0, 0.0, True, True

    def _set_up(self) -> None:
        self._ksp.setOperators(*self._ksp.getOperators())
        prefix = self._ksp.getOptionsPrefix() or ""
        with petsc_options(prefix), options(f"{prefix}coarse_", self._below):
            self._ksp.setUp()

    def solve(self, rhs: PETSc.Vec, solution: PETSc.Vec) -> tuple[int, bool]:
        """Solve. Collective.

        Returns
        -------
        The number of iterations, and whether the coarse levels have been renewed on the way.
        """
        self._taken, self._renewed = 0, False
        self._solve(rhs.copy(), solution)
        refine(self._ksp, rhs, solution, self._correct, self._components)
        return self._taken, self._renewed

    def _correct(self, rhs: PETSc.Vec, correction: PETSc.Vec) -> None:
        """Solve for the residual of a solution, which old coarse levels may not see."""
        if self._taken >= self._most:
            return
        if not self._fresh:
            self._renew()
        self._solve(rhs, correction)

    def _solve(self, rhs: PETSc.Vec, solution: PETSc.Vec) -> None:
        jump = self._stiff.jump(rhs)
        rhs.axpy(-1.0, self._ksp.getOperators()[0] * jump)
        solution.axpy(-1.0, jump)
        self._taken += self._iterate(rhs, solution, self._most - self._taken)
        solution.axpy(1.0, jump)

    def _iterate(self, rhs: PETSc.Vec, solution: PETSc.Vec, most: int) -> int:
        ksp, digits = self._ksp, -log10(self._ksp.getTolerances()[0])
        if self._fresh:
            ksp.setTolerances(max_it=most)
            ksp.setConvergenceHistory(length=most + 1, reset=True)
            ksp.solve(rhs, solution)
            taken, norms = ksp.getIterationNumber(), ksp.getConvergenceHistory()
            # Digits asked for are not digits gained: of few digits, or from a start.
            if not self._rate and taken > 0 and norms.size > 0 and norms[-1] > 0:
                self._rate = taken / max(log10(norms[0] / norms[-1]), 1.0)
            return taken
        fresh = self._rate * digits
        ksp.setTolerances(max_it=min(ceil(fresh) + PRICE, most))
        ksp.solve(rhs, solution)
        taken = ksp.getIterationNumber()
        if ksp.getConvergedReason() > 0 or taken >= most:
            self._lost += max(taken - fresh, 0.0)
            return taken
        begun = ksp.getConvergedReason() == PETSc.KSP.ConvergedReason.DIVERGED_MAX_IT
        self._renew()
        ksp.setInitialGuessNonzero(begun)
        return taken + self._iterate(rhs, solution, most - taken)
