"""A contact problem with its body condensed onto the contact nodes.

Once the material is linearised, only the unknowns at Gamma_3 are left to be found: the
Schur complement of the body takes the place of its operator, and every method that solves a
contact problem solves this one too, in small dense steps.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc
from scipy import sparse
from scipy.linalg import lu_factor, lu_solve

from contact.body.component_norms import ComponentNorms
from contact.body.equilibrium import BodyEquilibrium
from contact.history import BodyState, Evaluated
from contact.interface.interface import Interface
from contact.interface.jump import Multipliers
from contact.interface.nodes import ContactNodes
from contact.linear import multigrid
from contact.linear.constraint import ConstrainedBulk, Constraint
from contact.linear.dense import DenseOperator, Factors
from contact.linear.faults import check_overflow, petsc_options
from contact.linear.layout import balance
from contact.linear.operator import Counters
from contact.linear.schur import SchurComplement
from contact.mesh.entities import between_ranks, owned_among
from contact.problem.problem import ContactProblem
from contact.problem.protocols import Scales
from contact.problem.state import State
from contact.typing import Array

#: Unknowns that are kept at most: the dense matrix then takes 130 MB.
LARGEST = 4200

#: Residual of equilibrium inside the body that counts as zero, over the forces that act on it.
ROUNDING = 1e-13

#: Most that counts as rounding at the contact nodes, over the loads. Not as little as for the whole
#: body, by which the solution is judged once more.
MOST_ROUNDING = 1e-3

PREFIX = "contact_"

#: Unknowns up to which dense steps take no time to speak of.
ALWAYS = 1000

#: How much faster dense operations are than those of a sparse factorisation, and how many more of
#: its steps Newton's method takes in the worst case.
DENSE_IS_FASTER = 50.0


@dataclass(frozen=True)
class CondensedBody:
    """A linear body seen from its kept nodes: an equilibrium of its own.

    Attributes
    ----------
    comm, dim
        As those of the body.
    free
        Which unknowns of the owned kept nodes are not fixed, shape (nodes, block size).
    rows
        The owned rows of the Schur complement.
    stiffness, factors
        All of it, and its factors where some have been made: on the first rank alone.
    residual
        Condensed internal forces minus loads where the body was linearised, all ranks.
    at, own
        The owned kept unknowns there, and where these are among those of all ranks.
    acting
        `sizes` of all that acts on the whole body: loads, reactions, and one field on the other.
    component_norms
        Which forces are compared with each other.
    """

    comm: MPI.Intracomm
    dim: int
    free: NDArray[np.bool_]
    rows: Array
    stiffness: Array
    factors: Factors
    residual: Array
    at: Array
    own: slice
    acting: Array
    component_norms: ComponentNorms

    linear, most_rounding = True, MOST_ROUNDING

    @property
    def block_size(self) -> int:
        """Number of unknowns of a node."""
        return self.free.shape[1]

    @property
    def owned(self) -> int:
        """Number of unknowns that this rank owns."""
        return self.free.size

    def rest(self) -> Array:
        """Return unknowns of zero."""
        return np.zeros(self.owned)

    def prescribe(self, x: Array, time: float = 1.0) -> Array:
        """Return unknowns with the fixed ones as they were: the load has been condensed."""
        return np.where(self.free.ravel(), x, self.at)

    def moved(self, x: Array, increment: Array) -> Array:
        """Return unknowns plus an increment."""
        return x + increment

    def owned_part(self, x: Array) -> Array:
        """Return all unknowns: there are no ghosts."""
        return x

    def internal_forces(self, state: Evaluated, secant_at: Array | None = None) -> Array:
        """Return the owned forces of the linear body, loads taken off. Collective."""
        moved = np.concatenate(self.comm.allgather(state.x - self.at))
        return np.asarray(self.rows @ moved + self.residual[self.own])

    def external(self, time: float = 1.0) -> Array:
        """Return zero: the loads are part of the forces."""
        return np.zeros(self.owned)

    def unbalanced(self, forces: Array) -> Array:
        """Return the forces on free unknowns."""
        return np.where(self.free.ravel(), forces, 0.0)

    def reactions(self, forces: Array) -> Array:
        """Return the forces on fixed unknowns."""
        return np.where(self.free.ravel(), 0.0, forces)

    def sizes(self, values: Array) -> Array:
        """Return the norms of forces, and of charges, of each component apart. Collective."""
        return self.component_norms.sizes(values)

    def load_sizes(self, time: float = 1.0) -> Array:
        """Return the `sizes` of all that acts on the whole body."""
        return self.acting

    def exchanged(self, state: Evaluated) -> Array:
        """Return zero: that is part of all that acts on the whole body."""
        return np.zeros_like(self.acting)

    def operator(
        self,
        nodes: NDArray[np.int32],
        constraint: Constraint | None = None,
        *,
        symmetric: bool,
        counters: Counters,
        kind: str,
    ) -> DenseOperator:
        """Return the dense operator; it has blocks at all nodes, in their order."""
        return DenseOperator(self, counters)

    def norm(self, values: Array) -> float:
        """Return the Euclidean norm of owned values. Collective."""
        return float(np.sqrt(self.comm.allreduce(np.dot(values, values), op=MPI.SUM)))


@dataclass(frozen=True)
class CondensedProblem:
    """The contact nodes of a problem, with a linear body behind them."""

    equilibrium: CondensedBody
    interface: Interface
    scales: Scales
    time: float = 1.0

    #: Its unknowns are the jumps themselves.
    constraint = None

    def start(self, time: float | None = None) -> State:
        """Return the state with the free unknowns at zero."""
        x = self.equilibrium.prescribe(self.equilibrium.rest())
        return State(x, Multipliers.zero(self.interface.jump), self.time)


class CondensedConstraint:
    """The constraint of a condensed body: its Schur complement in jumps, the rest eliminated.

    Kept unknowns x are those of contact nodes and of the nodes that their jumps are made of:
    opposite, or of the same quadratic facets. With the free global unknowns q behind them,

        [x; q] = C [j; z],  z = [y; q],

    where j are the jumps and y the others; a foundation that moves is seen by the jumps alone. The
    stiffness S becomes C^T S C, and z is eliminated from it: the rest has the size of the contact
    nodes of one body. Plates and electrodes, which nodes follow, border S by a solve each.

    Parameters
    ----------
    body, interface
        The body and its interface. Collective.

    Attributes
    ----------
    bulk
        The body with nodes that follow q taken out of its matrix.
    unknowns
        Kept unknowns that this rank owns, local numbers: those of coupled nodes first.
    offset
        Where the coupled unknowns of this rank begin among those of all ranks.
    """

    def __init__(self, body: BodyEquilibrium, interface: Interface) -> None:
        self._body, global_unknowns, layout, comm = (
            body,
            body.global_unknowns,
            body.layout,
            body.comm,
        )
        constraint = Constraint(layout, None, global_unknowns.ties, global_unknowns.free)
        self.bulk = ConstrainedBulk(body, constraint, BodyState(body.rest()))
        self._free = np.flatnonzero(global_unknowns.free)
        #: Free unknowns that nodes follow: the others have no columns.
        sizes = np.abs(global_unknowns.ties).sum(axis=0)
        followed = np.asarray(comm.allreduce(sizes, op=MPI.SUM)) > 0
        self._followed = [k for k, column in enumerate(self._free) if followed[column]]
        self._responses = np.zeros((body.owned, self._free.size))
        nodes = coupled = interface.coupled
        if interface.change is not None:
            _, here = owned_among(layout.index_map, interface.change.nodes)
            nodes = np.concatenate([coupled, np.setdiff1d(here, coupled)])
        size = layout.block_size
        own = np.arange(size, dtype=np.int32)
        self.unknowns: NDArray[np.int32] = (nodes[:, None] * np.int32(size) + own).ravel()
        self.offset = size * sum(comm.allgather(coupled.size)[: comm.rank])
        self._trivial = interface.change is None and global_unknowns.size == 0
        self._matrix = None if self._trivial else self._made(interface, nodes)

    def _made(self, interface: Interface, nodes: NDArray[np.int32]) -> sparse.csr_array:
        """Return C, given the kept nodes of this rank. Collective."""
        layout, comm = self._body.layout, self._body.comm
        size, count = layout.block_size, interface.coupled.size
        is_jump = np.repeat(np.concatenate(comm.allgather(np.arange(nodes.size) < count)), size)
        free = np.concatenate(comm.allgather(layout.free[nodes])).ravel()
        jumps, others = np.flatnonzero(is_jump), np.flatnonzero(~is_jump & free)
        self._jumps = jumps.size
        basis = sparse.eye_array(is_jump.size, format="csr")
        if interface.change is not None:
            numbers = np.concatenate(comm.allgather(layout.index_map.local_to_global(nodes)))
            basis = interface.change.among(numbers, size)
        moved = np.zeros((count * size, self._body.global_unknowns.size))
        motion = interface.jump.carried
        if motion is not None:
            moved[: motion.shape[0] * motion.shape[1]] = motion.reshape(-1, motion.shape[2])
        on_jumps = np.concatenate(comm.allgather(moved))[:, self._free]
        with_q = basis[:, jumps] @ sparse.csr_array(on_jumps)
        kept = sparse.hstack([basis[:, jumps], basis[:, others], with_q])
        below = sparse.csr_array((self._free.size, jumps.size + others.size))
        q = sparse.hstack([below, sparse.eye_array(self._free.size)])
        return sparse.csr_array(sparse.vstack([kept, q]))

    def eliminate(self, schur: SchurComplement, stiffness: Array) -> Array:
        """Return the stiffness against jumps, for a body that was condensed. Collective.

        It is not a number where z can move freely.
        """
        if self._matrix is None:
            return stiffness
        free, columns = self._free, self.bulk.columns[:, self._free]
        if free.size:
            across = np.zeros((stiffness.shape[0], free.size))
            for k in self._followed:
                across[:, k] = schur.condense(columns[:, k])
                self._responses[:, k] = schur.expand(np.zeros(stiffness.shape[0]))
            inside = self._body.comm.allreduce(columns.T @ self._responses, op=MPI.SUM)
            corner = self.bulk.corner[np.ix_(free, free)] - inside
            stiffness = np.block([[stiffness, across], [across.T, corner]])
        j, matrix = self._jumps, self._matrix
        made = np.asarray(matrix.T @ (matrix.T @ stiffness).T)
        self._factors = lu_factor(made[j:, j:], check_finite=False)
        self._answers = self._solve(made[j:, :j])
        return np.asarray(made[:j, :j] - made[:j, j:] @ self._answers)

    def _solve(self, values: Array) -> Array:
        return np.asarray(lu_solve(self._factors, values, check_finite=False))

    def forces(self, on_kept: Array, residual: Array) -> Array:
        """Return the forces on jumps, given those on kept unknowns, and all. Collective.

        `expand` has them then.
        """
        body = self._body
        self._residual = residual[: body.owned]
        if self._matrix is None:
            return on_kept
        inside = self._responses.T @ body.layout.mask(self._residual)
        on_q = body.unbalanced(residual)[body.owned :][self._free]
        on_q = on_q - body.comm.allreduce(inside, op=MPI.SUM)
        made = self._matrix.T @ np.concatenate([on_kept, on_q])
        self._forces = made[self._jumps :]
        return np.asarray(made[: self._jumps] - self._answers.T @ self._forces)

    def expand(self, schur: SchurComplement, jumps: Array) -> Array:
        """Return the increment of all owned unknowns and the global ones. Collective."""
        if self._matrix is None:
            return schur.expand(jumps)
        body = self._body
        others = -self._solve(self._forces) - self._answers @ jumps
        moved = self._matrix @ np.concatenate([jumps, others])
        kept, free = np.split(moved, [moved.size - self._free.size])
        q = np.zeros(body.global_unknowns.size)
        q[self._free] = free
        if self._followed:
            schur.condense(body.layout.mask(-self._residual) - self.bulk.columns @ q)
        return np.concatenate([schur.expand(kept) + body.global_unknowns.ties @ q, q])


def at_kept_nodes(interface: Interface) -> Interface:
    """Return an interface whose nodes are numbered among the kept ones."""
    count = interface.jump.nodes.size
    first, others = np.split(np.arange(interface.coupled.size, dtype=np.int32), [count])

    def kept(nodes: ContactNodes, positions: NDArray[np.int32]) -> ContactNodes:
        """Return nodes of other numbers, whose jumps are nodal values."""
        return replace(nodes, nodes=positions, motion=None, carried=None, coupling=None)

    law, held = interface.law, interface.held
    return replace(
        interface,
        jump=kept(interface.jump, first),
        law=replace(law, jump=kept(law.jump, first)),
        held=None if held is None else replace(held, jump=kept(held.jump, others)),
    )


class Condensation:
    """The body of a problem, linearised and condensed onto the contact nodes.

    Parameters
    ----------
    full
        The whole problem.
    counters
        Where sparse factorisations and solves are counted.
    """

    def __init__(self, full: ContactProblem, counters: Counters) -> None:
        self.counters = counters
        self.nodes = full.interface.coupled
        self.turn_to(full)
        body = full.equilibrium
        self._constraint = CondensedConstraint(body, full.interface)
        begin = self._constraint.offset
        self._own = slice(begin, begin + self.nodes.size * body.block_size)
        self._matrix = full.equilibrium.create_matrix()
        self._kind = ""
        self._schur: SchurComplement | None = None
        self._rows: Array = np.zeros((0, 0))
        self._stiffness: Array = np.zeros((0, 0))

    def turn_to(self, full: ContactProblem) -> None:
        """Go on with another step of the same problem; factorisations remain."""
        self.full = full
        self._interface = at_kept_nodes(full.interface)

    def linearise(self, kind: str, state: State, keep: bool = False) -> CondensedProblem | None:
        """Condense the body, linearised at a state of the full problem. Collective.

        Parameters
        ----------
        kind, state
            "secant" or "tangent", and where.
        keep
            Whether to take the last factorisation, wherever that was.

        Returns
        -------
        The condensed problem; None if it cannot be condensed: many unknowns are kept, or
        these do not hold the others.

        Raises
        ------
        InputError
            If numbers overflow.
        """
        body = self.full.equilibrium
        same = keep or (body.linear and kind == self._kind)
        if self._schur is None or not same:
            self._rows = self._stiffness = np.zeros((0, 0))  # room for new ones
            self._factors = Factors()
            self._constraint.bulk.assemble(self._matrix, kind, state)
            balance(self._matrix, body.layout)
            if self._schur is None:
                cut = np.repeat(between_ranks(body.space), body.block_size)
                self._schur = SchurComplement(self._matrix, self._constraint.unknowns, PREFIX, cut)
            if self._schur.dense_size > LARGEST:
                return None
            with petsc_options(PREFIX):
                self._stiffness = self._schur.factorise(self._matrix)
            self._stiffness = self._constraint.eliminate(self._schur, self._stiffness)
            # By columns, as LAPACK wants the copies of which factors are made.
            self._stiffness = np.asfortranarray(self._stiffness)
            self._regular = bool(np.isfinite(self._stiffness).all())
            self._rows = self._stiffness[self._own]
            if body.comm.rank > 0:  # the others keep no more than that
                self._rows, self._stiffness = self._rows.copy(), np.zeros((0, 0))
            self._kind, self._size = kind, self._matrix.norm()
            self.counters.factorizations += 1
        residual = body.internal_forces(state) - body.external(state.time)
        check_overflow(body.layout, self._size, body.norm(residual))
        reactions = body.sizes(body.reactions(residual))
        acting = body.load_sizes(state.time) + reactions + body.exchanged(state)
        # Where the loads go on as before, the prediction of a step is in equilibrium but for that.
        inside = body.layout.mask(-residual[: body.owned])
        nothing = ROUNDING * body.component_norms.spread(acting)[: body.owned]
        forces = -self._schur.condense(inside, nothing)
        forces = self._constraint.forces(forces, residual)
        if not (self._regular and np.isfinite(forces).all()):
            return None
        condensed = CondensedBody(
            body.comm,
            body.dim,
            body.free[self.nodes],
            self._rows,
            self._stiffness,
            self._factors,
            forces,
            self._at(state.x),
            self._own,
            acting,
            body.component_norms.at(self.nodes),
        )
        return CondensedProblem(condensed, self._interface, self.full.scales, state.time)

    def _at(self, x: Array) -> Array:
        """Return the owned kept unknowns: jumps, then values at the other kept nodes."""
        jump, body = self.full.interface.jump, self.full.equilibrium
        others = body.nodal(x)[self.nodes[jump.nodes.size :]]
        return np.concatenate([jump.apply(x), others]).ravel()

    def expand(self, condensed: CondensedProblem, x: Array) -> Array:
        """Return the increment of the full problem's owned unknowns. Collective.

        Parameters
        ----------
        condensed
            The condensed problem that was made last.
        x
            Its solution.
        """
        assert self._schur is not None
        self.counters.linear_solves += 1
        moved = x - condensed.equilibrium.at
        everywhere = np.concatenate(self.full.comm.allgather(moved))
        return self._constraint.expand(self._schur, everywhere)


def pays(problem: ContactProblem, kind: str) -> bool:
    """Tell whether dense steps at the contact nodes cost less than sparse ones of the body.

    Large bodies in 3-D are left to multigrid, unless a direct solver is asked for by `kind`.

    A dense factorisation costs k^3 operations with k kept unknowns. A sparse one costs n b^2 with
    n unknowns and fronts of b: in 2-D the body's depth, n/k nodes, in
    3-D some n^(1/2).
    Of a slender body the contact nodes are too large a part.
    """
    layout = problem.equilibrium.layout
    if kind == "auto" and multigrid.is_large(layout):
        return False
    kept, unknowns = problem.nodes.size * layout.block_size, layout.unknowns
    front = unknowns / kept * layout.block_size if layout.dim == 2 else unknowns**0.5
    return kept <= ALWAYS or kept**3 <= DENSE_IS_FASTER * unknowns * front**2


def condensable(problem: ContactProblem, kind: str) -> bool:
    """Tell whether a problem can be condensed onto its contact nodes.

    That is where the contact nodes are few and a direct solver has the memory, unless the user
    or his options of PETSc ask for another.
    """
    options = PETSc.Options(PREFIX)
    names = ("ksp_type", "pc_type", "pc_factor_mat_solver_type")
    chosen = any(options.hasName(name) for name in names)
    layout = problem.equilibrium.layout
    large = kind == "auto" and layout.dim == 3 and layout.unknowns > multigrid.DIRECT
    many = problem.nodes.size * layout.block_size > LARGEST
    return not (chosen or kind == "iterative" or large or many)
