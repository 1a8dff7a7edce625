"""The road of a body that touches at a few nodes: stops, tips, corners.

What bends over a gap mostly touches at one or two nodes. From the solution without contact on, the
node that is deepest joins those that may touch, and the contact of these alone is solved for sure,
on the columns of the flexibility that belong to them: one solve with the factors of the body each.
The energy rises from one set of nodes to the next, so that none comes twice.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from mpi4py import MPI

from contact.interface.multipliers import Multipliers
from contact.linear.dense import DenseOperator
from contact.linear.first_rank import with_questions
from contact.linear.operator import Operator, SparseOperator
from contact.methods.convex.haslinger import coulomb
from contact.methods.convex.interior import Point
from contact.methods.convex.reduced import NotConvexError
from contact.methods.convex.tresca import TrescaSolver
from contact.problem.kkt import evaluate, residual_forces
from contact.problem.protocols import Problem
from contact.problem.state import State
from contact.typing import Array

#: What the history says of this road.
FEW_NODES = "few nodes"

#: Nodes that may touch at most: beyond these the dense problem of all costs less. And those that
#: may penetrate once the deepest one touches.
MOST, CROWD = 4, 16

#: Penetration that is rounding, over the largest displacement without contact.
ROUNDING = 1e-13

#: Tolerance of the problems of the few, and of their friction bound over the one asked for.
INNER, SHARE = 1e-12, 1e-2

#: Refinements at most: one takes away what the deflection without contact was rounded by.
REFINEMENTS = 2


def at_few_nodes(
    problem: Problem, operator: Operator, free: State, tolerance: float
) -> State | None:
    """Return the solution of a body that touches at a few nodes, None for others. Collective.

    Parameters
    ----------
    problem
        A problem with a linear body.
    operator
        Its operator; what it holds is replaced, if there are blocks.
    free
        Where the body is in equilibrium; without contact, or this road is not for it.
    tolerance
        Of the residuals.
    """
    body, interface = problem.equilibrium, problem.interface
    # Masters and changed unknowns are what others solve for.
    if not isinstance(operator, (SparseOperator, DenseOperator)) or operator.iterative:
        return None
    if not body.linear or interface.response.active or interface.held is not None:
        return None
    # Tresca's law, and Coulomb's with a smoothed pressure, act on nodes that do not touch.
    forces, none = free.forces, np.zeros_like(interface.jump.weight)
    acts = forces.pressure, forces.friction, interface.friction.bound(none, none)
    acting = not interface.friction.local or any(values.any() for values in acts)
    if interface.comm.allreduce(acting, op=MPI.LOR):
        return None
    blocks = np.zeros((interface.coupled.size, body.block_size, body.block_size))
    operator.update("secant", free.x, blocks, constant=True)
    return FewNodes(problem, operator, free).solve(tolerance)


@dataclass
class FewNodes:
    """A linear body that is free but at a few nodes.

    Attributes
    ----------
    problem
        What is solved.
    operator
        The body without blocks, factorised.
    free
        The solution without contact.
    """

    problem: Problem
    operator: SparseOperator | DenseOperator
    free: State
    #: Rank and number of each node that may touch.
    places: list[tuple[int, int]] = field(default_factory=list)
    #: What the unknowns give way to a force in each direction at each of them, owned ones.
    columns: list[Array] = field(default_factory=list)

    @property
    def rank(self) -> int:
        """Number of this process."""
        return self.problem.interface.comm.rank

    def solve(self, tolerance: float) -> State | None:
        """Return the solution, where only a few nodes touch. Collective.

        Parameters
        ----------
        tolerance
            Of the residuals.
        """
        state, frictional = self.free, False
        while True:
            deepest, count = self._deepest(state)
            if count > 0 and deepest not in self.places:
                if len(self.places) == MOST or (self.places and count > CROWD):
                    return None
                self._join(deepest)
            elif not self.places:
                return None
            elif frictional == self.problem.interface.friction.acts:
                return self._refined(state, frictional, tolerance)
            else:  # friction mostly presses no further nodes down
                frictional = True
            solved = self._touching(state, frictional, tolerance)
            if solved is None:
                return None
            state = solved

    def _deepest(self, state: State) -> tuple[tuple[int, int], int]:
        """Return rank and number of the node that penetrates most, and how many do. Collective."""
        interface = self.problem.interface
        nodal, free = interface.jump.apply(state.x), interface.jump.apply(self.free.x)
        size = interface.jump.maximum(np.abs(free[:, : interface.dim]).max(axis=1, initial=0.0))
        opening = interface.opening(nodal)
        worst = int(np.argmax(opening)) if opening.size else 0
        count = int(np.count_nonzero(opening > ROUNDING * size))
        found = interface.comm.allgather((float(np.max(opening, initial=0.0)), worst, count))
        rank = max(range(len(found)), key=lambda rank: found[rank][0])
        return (rank, found[rank][1]), sum(own[2] for own in found)

    def _join(self, place: tuple[int, int]) -> None:
        """Let a node touch: ask how the body gives way to forces there."""
        jump, body = self.problem.interface.jump, self.problem.equilibrium
        self.places.append(place)
        sides = np.zeros((body.owned_part(self.free.x).size, jump.dim))
        for direction, side in enumerate(sides.T):
            nodal = np.zeros((jump.weight.size, jump.dim))
            if self.rank == place[0]:
                nodal[place[1], direction] = 1.0
            jump.transpose(nodal, side)
        self.columns.extend(self.operator.solve_all(sides).T)

    def _refined(self, state: State, frictional: bool, tolerance: float) -> State | None:
        """Take away what rounding has left of a solution."""
        found: State | None = state
        for _ in range(REFINEMENTS):
            left = self.operator.solve(-residual_forces(self.problem, state))
            balanced = replace(state, x=self.problem.equilibrium.moved(state.x, left))
            found = self._touching(balanced, frictional, tolerance)
            if found is None or evaluate(self.problem, found).largest <= tolerance:
                break
            state = found
        return found

    def _at_places(self, nodal: Array) -> Array:
        """Return what ranks have at the few nodes, on all of them."""
        values = np.zeros((len(self.places), *nodal.shape[1:]))
        for k, (rank, node) in enumerate(self.places):
            if rank == self.rank:
                values[k] = nodal[node]
        self.problem.interface.comm.Allreduce(MPI.IN_PLACE, values, op=MPI.SUM)
        return values

    def _on_nodes(self, values: Array) -> Array:
        """Return values at the few nodes among those of this rank's nodes; the rest is zero."""
        nodal = np.zeros((self.problem.interface.jump.weight.size, *values.shape[1:]))
        for value, (rank, node) in zip(values, self.places, strict=True):
            if rank == self.rank:
                nodal[node] = value
        return nodal

    def _touching(self, state: State, frictional: bool, tolerance: float) -> State | None:
        """Return the solution where nothing but these nodes may touch; None where there is none.

        Counted from a state, for what changes little is rounded little.
        """
        interface, body = self.problem.interface, self.problem.equilibrium
        jump, d = interface.jump, interface.dim
        gives = [self._at_places(jump.apply(column)[:, :d]).ravel() for column in self.columns]
        slips = jump.apply(state.x)[:, :d] - interface.friction.history.jump
        vectors = jump.weight[:, None] * state.forces.vectors(jump)
        at = (slips, vectors, jump.normal, jump.tangent, jump.gap, jump.weight)
        few = Few(np.column_stack(gives), interface.friction.acts, *map(self._at_places, at))
        if not np.all(few.weight > 0):
            return None

        def bound(pressure: Array, slip: Array) -> Array:
            on_nodes = self._on_nodes(pressure), self._on_nodes(slip)
            return self._at_places(interface.friction.bound(*on_nodes))

        def work(ask: Callable[[Array, Array], Array]) -> tuple[Array, Array]:
            return few.solve(ask if frictional else None, SHARE * tolerance)

        try:
            pressure, friction = with_questions(interface.comm, work, bound)
        except (NotConvexError, np.linalg.LinAlgError):
            return None  # a node is held, or only contact holds the body
        found = Multipliers(self._on_nodes(pressure), self._on_nodes(friction))
        change = few.weight[:, None] * self._at_places(found.vectors(jump)) - few.forces
        x = body.moved(state.x, -np.column_stack(self.columns) @ change.ravel())
        return replace(state, x=x, forces=found)


@dataclass(frozen=True)
class Few:
    """The problem of k nodes alone.

    Attributes
    ----------
    flexibility
        Displacements by forces, shape (k d, k d) (length/force).
    rubs
        Whether there is friction.
    displacement, forces
        Where they are, less what they have slipped before, and what acts on them there, (k, d).
    normal, tangent, gap, weight
        As of the jump.
    """

    flexibility: Array
    rubs: bool
    displacement: Array
    forces: Array
    normal: Array
    tangent: Array
    gap: Array
    weight: Array

    def solve(
        self, bound: Callable[[Array, Array], Array] | None, tolerance: float
    ) -> tuple[Array, Array]:
        """Return pressures, (k,), and friction, (k, d).

        Parameters
        ----------
        bound
            Friction bounds by pressures and lengths of slips; None without friction.
        tolerance
            Relative change of the bound that is left.

        Raises
        ------
        LinAlgError, NotConvexError
            If the flexibility is none.
        """
        k = len(self.displacement)
        stiffness = np.linalg.inv((self.flexibility + self.flexibility.T) / 2)
        solver = TrescaSolver(
            np.asarray(stiffness, dtype=float),
            self.normal,
            self.tangent,
            self.gap,
            self.weight,
            rubbing=np.full(k, self.rubs),
        )
        forces = self.forces.ravel()
        load = stiffness @ self.displacement.ravel() + forces
        # Those touch first that penetrate without contact.
        free = self.displacement + (self.flexibility @ forces).reshape(k, -1)
        body = solver.body
        slips = np.zeros(body.tangents.shape)
        start = Point(body.acting(free), np.zeros(body.touching.size), slips)
        if bound is None:
            result = solver.solve(load, np.zeros(k), tolerance=INNER, start=start)
        else:
            result = coulomb(
                solver, load, bound, tolerance=tolerance, inner=INNER, start=start
            ).result
        return result.pressure, result.friction
