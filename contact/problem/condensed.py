"""Static condensation of a linearised body onto its contact nodes.

The Schur complement takes the place of the operator: the condensed problem is a contact problem of
its own, solved in small dense steps.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from contact.body.equilibrium import ComponentNorms
from contact.history import BodyState, LinearisationPoint
from contact.interface.interface import Interface
from contact.interface.multipliers import Multipliers
from contact.interface.nodes import ContactNodes
from contact.linear import multigrid
from contact.linear.layout import Inclined, balance, masked
from contact.linear.operator import PREFIX, Counters
from contact.linear.petsc import check_overflow, petsc_options
from contact.linear.schur import DenseOperator, DenseStiffness, SchurComplement
from contact.linear.transformation import BorderedSolve, Transformation, TransformedBulk
from contact.problem.problem import ContactProblem
from contact.problem.state import Scales, State
from contact.ranks import summed
from contact.tolerances import ROUNDING
from contact.typing import Array

#: Most retained unknowns: the dense matrix then takes 130 MB.
LARGEST = 4200

#: Largest residual that is accepted as rounding at the contact nodes. Larger than for the whole
#: body, whose residuals are evaluated afterwards.
MOST_ROUNDING = 1e-3

#: Kept unknowns up to which condensation always pays.
ALWAYS = 1000

#: Speed of dense over sparse operations, times the ratio of the numbers of Newton steps.
DENSE_IS_FASTER = 50.0


@dataclass(frozen=True)
class CondensedEquilibrium:
    """Equilibrium of a linear body at its retained nodes, S (x - x_0) + r_0 = 0 without contact.

    It has the members of `BodyEquilibrium` that methods use, of unknowns (`zero_displacement`,
    `prescribe`, `updated`, `owned_part`), of forces on them (`internal_forces`, `external`,
    `unbalanced`, `reactions`) and of their norms; no mesh, no space and no stresses.

    Attributes
    ----------
    comm, dim
        Those of the body.
    free
        Which unknowns of the owned retained nodes are free, shape (nodes, block size).
    rows
        Owned rows of the Schur complement S.
    stiffness
        All of S, on the first rank.
    residual
        r_0: condensed internal forces minus loads at the linearisation, of all ranks.
    x_0, local_rows
        The owned retained unknowns there, and their slice among those of all ranks.
    acting
        `norms` of loads, reactions and coupling forces of the whole body.
    component_norms
        Norms of forces and charges of each connected component.
    inclined
        Inclined directions of supports at retained nodes; None for none.
    """

    comm: MPI.Intracomm
    dim: int
    free: NDArray[np.bool_]
    rows: Array
    stiffness: DenseStiffness
    residual: Array
    x_0: Array
    local_rows: slice
    acting: Array
    component_norms: ComponentNorms
    inclined: Inclined | None = None

    linear, symmetric, rounding_limit = True, True, MOST_ROUNDING

    @property
    def block_size(self) -> int:
        """Number of unknowns of a node."""
        return self.free.shape[1]

    @property
    def owned(self) -> int:
        """Number of unknowns that this rank owns."""
        return self.free.size

    def zero_displacement(self) -> Array:
        """Return zeros."""
        return np.zeros(self.owned)

    def prescribe(self, x: Array, time: float = 1.0) -> Array:
        """Return unknowns with the fixed ones of the linearisation."""
        fixed = self.x_0 - masked(self.free, self.inclined, self.x_0)
        return masked(self.free, self.inclined, x) + fixed

    def updated(self, x: Array, increment: Array) -> Array:
        """Return unknowns plus an increment."""
        return x + increment

    def owned_part(self, x: Array) -> Array:
        """Return all unknowns: there are no ghosts."""
        return x

    def internal_forces(self, state: LinearisationPoint) -> Array:
        """Return S (x - x_0) + r_0, r_0 the condensed F - f, which has the loads. Collective."""
        moved = np.concatenate(self.comm.allgather(state.x - self.x_0))
        return np.asarray(self.rows @ moved + self.residual[self.local_rows])

    #: A linear body is its own secant.
    secant_forces = internal_forces

    def external(self, time: float = 1.0) -> Array:
        """Return zero: loads are part of r_0."""
        return np.zeros(self.owned)

    def unbalanced(self, forces: Array) -> Array:
        """Return the forces on free unknowns."""
        return masked(self.free, self.inclined, forces)

    def reactions(self, forces: Array) -> Array:
        """Return the forces on fixed unknowns."""
        return forces - masked(self.free, self.inclined, forces)

    def norms(self, values: Array) -> Array:
        """Return norms of forces and charges, by connected component. Collective."""
        return self.component_norms.norms(values)

    def load_norms(self, time: float = 1.0) -> Array:
        """Return the `norms` of loads, reactions and coupling forces of the whole body."""
        return self.acting

    def piezo_norms(self, state: LinearisationPoint) -> Array:
        """Return zero: part of `load_norms`."""
        return np.zeros_like(self.acting)

    def norm(self, values: Array) -> float:
        """Return the Euclidean norm of owned values. Collective."""
        return float(np.sqrt(summed(self.comm, np.dot(values, values))))


@dataclass(frozen=True)
class CondensedProblem:
    """A contact problem of a condensed body."""

    body: CondensedEquilibrium
    interface: Interface
    scales: Scales
    time: float = 1.0

    def start(self) -> State:
        """Return the zero initial guess."""
        x = self.body.prescribe(self.body.zero_displacement())
        return State(x, Multipliers.zero(self.interface.nodes), self.time)

    def with_interface(self, interface: Interface) -> CondensedProblem:
        """Return the problem with another interface on the same contact nodes."""
        return replace(self, interface=interface)

    def operator(self, *, symmetric: bool, counters: Counters, solver: str) -> DenseOperator:
        """Return the dense operator, with blocks at all nodes."""
        body = self.body
        return DenseOperator(body.comm, body.free, body.stiffness, counters, body.inclined)


#: A contact problem of a whole body or of a condensed one: methods take either.
AnyProblem: TypeAlias = ContactProblem | CondensedProblem


def at_retained_nodes(interface: Interface) -> Interface:
    """Return an interface numbered by retained nodes."""
    count = interface.nodes.nodes.size
    first, others = np.split(np.arange(interface.operator_nodes.size, dtype=np.int32), [count])

    def retained(nodes: ContactNodes, positions: NDArray[np.int32]) -> ContactNodes:
        """Return nodes of other numbers, whose unknowns are the jumps."""
        return replace(nodes, nodes=positions, motion=None, coupling=None)

    nodes, fixed_conducting = retained(interface.nodes, first), interface.fixed_conducting
    if fixed_conducting is not None:
        fixed_conducting = replace(fixed_conducting, nodes=retained(fixed_conducting.nodes, others))
    law = replace(interface.foundation, nodes=nodes)
    return replace(interface, nodes=nodes, foundation=law, fixed_conducting=fixed_conducting)


class Condensation:
    """Linearisation of the whole problem and condensation onto the contact nodes.

    Jumps are the unknowns of these nodes (`contact.linear.transformation`); global unknowns q
    border the system, and are eliminated from the dense one. The counters are those of sparse
    factorisations and solves.
    """

    def __init__(self, problem: ContactProblem, counters: Counters) -> None:
        self.counters = counters
        self.nodes = problem.interface.operator_nodes
        self.set_load_step(problem)
        body = problem.body
        unknowns = body.global_unknowns
        none = Transformation(body.layout, None, unknowns.tied_motion, unknowns.free)
        self._transformation = problem.transformation or none
        reference = BodyState(body.zero_displacement())
        self._bulk = TransformedBulk(body, self._transformation, reference)
        self._free = np.flatnonzero(self._transformation.free)
        self._matrix = self._bulk.create_matrix()
        size = body.block_size
        retained = (self.nodes[:, None] * size + np.arange(size)).astype(np.int32).ravel()
        self._schur = SchurComplement(self._matrix, retained, PREFIX)
        begin = self._schur.offset
        self._local_rows = slice(begin, begin + retained.size)
        self._kind = ""
        self._rows: Array = np.zeros((0, 0))
        self._stiffness = DenseStiffness(self._rows)

    def set_load_step(self, problem: ContactProblem) -> None:
        """Take another load step of the same problem; factorisations remain."""
        self.whole_problem = problem
        self._interface = at_retained_nodes(problem.interface)

    def linearise(
        self,
        kind: str,
        state: State,
        reuse: bool = False,
        internal_forces: Array | None = None,
    ) -> CondensedProblem | None:
        """Linearise at a state of the whole problem, and condense. Collective.

        By the "secant" or the "tangent", or by the last factorisation in a chord step (`reuse`);
        `internal_forces` is F(x), if computed before. None with too many retained unknowns, or if
        the eliminated block is singular; InputError if numbers overflow.
        """
        body = self.whole_problem.body
        if not 0 < self._schur.size <= min(LARGEST, body.layout.unknowns - 1):
            return None
        if not self._kind or not (reuse or (body.linear and kind == self._kind)):
            self._factorise(kind, state)
        if internal_forces is None:
            internal_forces = body.secant_forces(state)
        residual = internal_forces - body.external(state.time)
        check_overflow(body.layout, self._size, body.norm(residual))
        if not self._regular:
            return None
        reactions = body.norms(body.reactions(residual))
        acting = body.load_norms(state.time) + reactions + body.piezo_norms(state)
        forces = self._condense(residual, acting)
        if not np.isfinite(forces).all():
            return None
        free, inclined = body.layout.at(self.nodes)
        nodes = self.whole_problem.interface.nodes
        others = body.nodal(state.x)[self.nodes[nodes.nodes.size :]]
        condensed_body = CondensedEquilibrium(
            comm=body.comm,
            dim=body.dim,
            free=free,
            rows=self._rows,
            stiffness=self._stiffness,
            residual=forces,
            x_0=np.concatenate([nodes.jump(state.x), others]).ravel(),
            local_rows=self._local_rows,
            acting=acting,
            component_norms=body.component_norms.at(self.nodes),
            inclined=inclined,
        )
        return CondensedProblem(
            condensed_body, self._interface, self.whole_problem.scales, state.time
        )

    def _condense(self, residual: Array, acting: Array) -> Array:
        """Return the residual condensed onto the retained unknowns, `acting` its scale. Collective.

        The right-hand sides of the eliminated unknowns and of q are kept for `expand`.
        """
        body = self.whole_problem.body
        restricted = self._transformation.restrict(-residual)
        self._rhs = body.layout.mask(restricted[: body.owned])
        # With loads along those before, nothing but rounding is left at the eliminated unknowns.
        nothing = ROUNDING * body.component_norms.spread(acting)[: body.owned]
        if body.comm.allreduce(bool(self._schur.exceeds(self._rhs, nothing)), op=MPI.LOR):
            retained = self._schur.condense(self._rhs)
        else:
            retained = self._schur.condense(self._rhs, np.zeros(body.owned))
        inside = summed(body.comm, self._bordered.responses.T @ self._rhs)
        self._on_q = restricted[body.owned :][self._free] - inside
        return np.asarray(self._border.T @ (self._bordered.inverse @ self._on_q) - retained)

    def stiffness(self, state: State) -> Array | None:
        """Return the Schur complement, on the first rank; None with too many rows, or if singular.

        Of the last linearisation, or else the tangent at a state. Collective.
        """
        if not 0 < self._schur.size <= min(LARGEST, self.whole_problem.body.layout.unknowns - 1):
            return None
        if not self._kind:
            self._factorise("tangent", state)
        return self._stiffness.matrix if self._regular else None

    def _factorise(self, kind: str, state: State) -> None:
        """Factorise at a state, and eliminate q from the Schur complement. Collective."""
        body, schur = self.whole_problem.body, self._schur
        self._rows = np.zeros((0, 0))
        self._stiffness = DenseStiffness(self._rows)  # room for a new one
        # LDL^T needs (K + K^T)/2, with which Newton's method converges linearly.
        part = "symmetric" if kind == "tangent" and not body.symmetric else kind
        self._bulk.assemble(self._matrix, part, state)
        balance(self._matrix, body.layout)
        with petsc_options(PREFIX):
            stiffness = schur.complement(self._matrix)
        self._kind, self._size = kind, self._matrix.norm()
        self.counters.factorizations += 1
        self._regular = body.comm.bcast(bool(np.isfinite(stiffness).all()))
        if not self._regular:
            return
        # q with the retained unknowns at 0.
        columns = self._bulk.columns[:, self._free].T
        responses = [schur.interior(np.asarray(column)) for column in columns]
        border = [schur.condense(*pair) for pair in zip([*columns], responses, strict=True)]
        corner = self._bulk.corner[np.ix_(self._free, self._free)]
        self._bordered = BorderedSolve(
            body.comm, columns.T, corner, np.reshape(responses, columns.shape).T
        )
        self._regular = self._bordered.regular
        #: Derivative of the forces on q by retained unknowns, shape (free, retained).
        self._border = np.reshape(border, (self._free.size, schur.size))
        if body.comm.rank == 0 and self._free.size:
            stiffness -= self._border.T @ (self._bordered.inverse @ self._border)
        self._rows, self._stiffness = self._scattered(stiffness), DenseStiffness(stiffness)

    def _scattered(self, stiffness: Array) -> Array:
        """Scatter the rows of a matrix on the first rank. Collective."""
        comm, local_rows = self.whole_problem.comm, self._local_rows
        all_rows = comm.gather(local_rows)
        if comm.rank > 0:
            rows = np.empty((local_rows.stop - local_rows.start, self._schur.size))
            comm.Recv(rows, 0)
            return rows
        for rank, rank_rows in enumerate(all_rows[1:], 1):
            comm.Send(np.ascontiguousarray(stiffness[rank_rows]), rank)
        return stiffness[local_rows]

    def expand(self, condensed_problem: CondensedProblem, x: Array) -> Array:
        """Return the increment of the whole body's owned unknowns. Collective.

        `x` is the solution of the condensed problem that `linearise` returned last.
        """
        self.counters.linear_solves += 1
        self.counters.linear_iterations += 1
        retained = np.concatenate(self.whole_problem.comm.allgather(x - condensed_problem.body.x_0))
        q = np.zeros(self._transformation.free.size)
        q[self._free] = self._bordered.inverse @ (self._on_q - self._border @ retained)
        rhs = self._rhs - self._bulk.columns @ q
        return self._transformation.expand(np.concatenate([self._schur.expand(rhs, retained), q]))


def condensation_pays(problem: ContactProblem, solver: str) -> bool:
    """Tell whether dense Newton steps on the condensed problem cost less than sparse ones.

    A dense factorisation costs k^3 operations with k retained unknowns, a sparse one n b^2 with n
    unknowns and fronts of b: in 2-D the body's depth, n/k nodes, in 3-D some n^(1/2). Large bodies
    in 3-D are left to multigrid, unless `solver` is a direct one.
    """
    layout = problem.body.layout
    if not condensable(problem, solver) or (solver == "auto" and multigrid.is_large(layout)):
        return False
    retained, unknowns = problem.nodes.size * layout.block_size, layout.unknowns
    front = unknowns / retained * layout.block_size if layout.dim == 2 else unknowns**0.5
    return retained <= ALWAYS or retained**3 <= DENSE_IS_FASTER * unknowns * front**2


def condensable(problem: ContactProblem, solver: str) -> bool:
    """Tell whether retained unknowns are few, and a direct solver has the memory and is allowed."""
    options = PETSc.Options(PREFIX)
    names = ("ksp_type", "pc_type", "pc_factor_mat_solver_type")
    chosen = any(options.hasName(name) for name in names)
    layout = problem.body.layout
    large = solver == "auto" and layout.dim == 3 and layout.unknowns > multigrid.DIRECT
    many = problem.nodes.size * layout.block_size > LARGEST
    return not (chosen or solver == "iterative" or large or many)
