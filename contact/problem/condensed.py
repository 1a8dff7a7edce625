"""A contact problem with its body condensed onto the contact nodes.

Once the material is linearised, all that is left to be found is what happens at Gamma_3: the
Schur complement of the body takes the place of its operator, and every method that solves a
contact problem solves this one too, in small dense steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.body.shares import Shares
from contact.history import Evaluated
from contact.interface.interface import Interface
from contact.interface.multipliers import Multipliers
from contact.linear.balance import balance
from contact.linear.change import Change
from contact.linear.dense import DenseOperator, Factors
from contact.linear.faults import check_overflow, petsc_options
from contact.linear.operator import Bulk, Counters
from contact.linear.schur import SchurComplement
from contact.mesh.entities import between_ranks
from contact.problem.condensed_masters import CondensedMasters
from contact.problem.kept_unknowns import KeptUnknowns, at_kept_nodes
from contact.problem.problem import ContactProblem
from contact.problem.scales import Scales
from contact.problem.state import State
from contact.typing import Array

#: Unknowns that are kept at most: the dense matrix then takes 130 MB.
LARGEST = 4200

#: What is left of equilibrium inside the body that counts as nothing, over what acts on it.
ROUNDING = 1e-13

#: Most that counts as rounding at the contact nodes, over the loads. Not as little as for the whole
#: body, by which the solution is judged once more.
MOST_ROUNDING = 1e-3

PREFIX = "contact_"


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
        `sizes` of what acts on the whole body: loads, reactions, and one field on the other.
    shares
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
    shares: Shares

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
        """Return what of forces acts on free unknowns."""
        return np.where(self.free.ravel(), forces, 0.0)

    def reactions(self, forces: Array) -> Array:
        """Return what of forces acts on fixed unknowns."""
        return np.where(self.free.ravel(), 0.0, forces)

    def sizes(self, values: Array) -> Array:
        """Return the norms of forces, and of charges, of each piece apart. Collective."""
        return self.shares.sizes(values)

    def load_sizes(self, time: float = 1.0) -> Array:
        """Return the `sizes` of what acts on the whole body."""
        return self.acting

    def exchanged(self, state: Evaluated) -> Array:
        """Return zero: that is part of what acts on the whole body."""
        return np.zeros_like(self.acting)

    def operator(
        self,
        nodes: NDArray[np.int32],
        motion: Array | None = None,
        change: Change | None = None,
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

    def start(self, time: float | None = None) -> State:
        """Return the state with the free unknowns at zero."""
        x = self.equilibrium.prescribe(self.equilibrium.rest())
        return State(x, Multipliers.zero(self.interface.jump), self.time)


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
        self._kept = KeptUnknowns(body, full.interface)
        self._masters = CondensedMasters.of(body, full.interface, self._kept)
        self._bulk: Bulk = body if self._masters is None else self._masters.bulk
        begin = self._kept.offset
        self._own = slice(begin, begin + self.nodes.size * body.block_size)
        self._matrix = full.equilibrium.create_matrix()
        self._kind = ""
        self._schur: SchurComplement | None = None
        self._rows: Array = np.zeros((0, 0))
        self._stiffness: Array = np.zeros((0, 0))

    def turn_to(self, full: ContactProblem) -> None:
        """Go on with another step of the same problem; what is factorised remains."""
        self.full = full
        self._interface = at_kept_nodes(full.interface)

    def linearise(self, kind: str, state: State, keep: bool = False) -> CondensedProblem | None:
        """Condense the body, linearised at a state of the full problem. Collective.

        Parameters
        ----------
        kind, state
            "secant" or "tangent", and where.
        keep
            Whether to take what was factorised last, wherever that was.

        Returns
        -------
        What is left to be solved; None if it cannot be condensed: many unknowns are kept, or
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
            self._bulk.assemble(self._matrix, kind, state)
            balance(self._matrix, body.layout)
            if self._schur is None:
                cut = np.repeat(between_ranks(body.space), body.block_size)
                self._schur = SchurComplement(self._matrix, self._kept.unknowns, PREFIX, cut)
            if self._schur.dense_size > LARGEST:
                return None
            with petsc_options(PREFIX):
                self._stiffness = self._schur.factorise(self._matrix)
            if self._masters is not None:
                self._stiffness = self._masters.eliminate(self._schur, self._stiffness)
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
        nothing = ROUNDING * body.shares.spread(acting)[: body.owned]
        forces = -self._schur.condense(inside, nothing)
        if self._masters is not None:
            forces = self._masters.forces(forces, residual)
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
            body.shares.at(self.nodes),
        )
        return CondensedProblem(condensed, self._interface, self.full.scales, state.time)

    def _at(self, x: Array) -> Array:
        """Return the owned kept unknowns: jumps, then what is at the other kept nodes."""
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
        masters, schur = self._masters, self._schur
        return masters.expand(schur, everywhere) if masters else schur.expand(everywhere)
