"""The sure road: contact at the nodes of a condensed body as a sequence of convex problems.

With a given friction bound the problem is convex and solved to a duality gap
(`contact.methods.convex`); Haslinger's loop updates the bound, and one around it what the layer
and the current answer. Moduli are not compared anywhere, so that bodies that bend, whose
flexibilities differ by many orders of magnitude, are solved like any other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from contact.interface.interface import Interface
from contact.interface.multipliers import Multipliers
from contact.linear.first_rank import with_questions
from contact.methods.convex.haslinger import coulomb
from contact.methods.convex.reduced import NotConvexError, without_potential
from contact.methods.convex.tresca import TrescaSolver
from contact.problem.condensed import CondensedProblem
from contact.problem.kkt import evaluate, residual_forces
from contact.problem.state import State
from contact.typing import Array

#: What the history says of this road.
INTERIOR_POINT = "interior point"

#: Times that a layer and a current are linearised anew, and the change that ends it.
MOST_ANSWERS, SETTLED = 200, 1e-10

#: Tolerance of a Tresca problem within Haslinger's loop.
INNER = 1e-10

#: Residual from which on Newton's loop, which follows what they answer, is surely better.
NEAR = 0.02

#: Least share of a step that is taken between two of these times.
LEAST_SHARE = 1 / 64

Bound = Callable[[Array, Array], Array]


@dataclass(frozen=True)
class Found:
    """What the road led to.

    Attributes
    ----------
    state
        Unknowns and contact forces.
    steps
        Steps of the interior-point method.
    words
        How it ended.
    """

    state: State
    steps: int
    words: str


def solve_convex(
    problem: CondensedProblem,
    state: State,
    poll: Callable[[], None],
    friction: bool = True,
    tolerance: float = 1e-8,
) -> Found | None:
    """Solve a condensed problem; None where it is not convex. Collective.

    Parameters
    ----------
    problem, state
        The contact nodes with their linear body, and where layer, current and the first friction
        bound are taken.
    poll
        Called between the convex problems, on all ranks.
    friction
        Whether friction acts. Without it there is one small problem, of the normals alone.
    tolerance
        Relative change of the friction bound that is left.
    """
    steps, found, last, share = 0, None, np.inf, 1.0
    for _ in range(MOST_ANSWERS):
        found = _solve_linearised(
            problem, state, poll, friction and problem.interface.friction.acts, tolerance
        )
        if found is None:
            return None
        steps += found.steps
        if not problem.interface.response.active:
            break
        change = _largest(problem, found.state.x - state.x)
        if change <= SETTLED * _largest(problem, found.state.x):
            break
        kkt = evaluate(problem, found.state)
        if max(kkt.equilibrium, kkt.contact) < NEAR:
            break
        # What the current answers may open a gap that closes it: go there more carefully.
        share = max(share / 2, LEAST_SHARE) if change > last else share
        last = change
        x = state.x + share * (found.state.x - state.x)
        state = replace(found.state, x=x)
    assert found is not None
    return Found(found.state, steps, found.words)


def _largest(problem: CondensedProblem, values: Array) -> float:
    comm = problem.equilibrium.comm
    return float(np.abs(np.concatenate(comm.allgather(values))).max(initial=0.0))


def _solve_linearised(
    problem: CondensedProblem,
    state: State,
    poll: Callable[[], None],
    friction: bool,
    tolerance: float,
) -> Found | None:
    """Solve with layer and current linearised at a state; rank 0 does it for all."""
    body, interface, comm = problem.equilibrium, problem.interface, problem.equilibrium.comm
    gathered = Gathered.of(problem, state)
    layer = interface.response.layer_pressure(interface.jump.apply(state.x))

    def own_bound(pressure: Array, slip: Array) -> Array:
        """Return the friction bound of this rank's nodes, held ones included."""
        poll()
        begin = body.own.start // body.block_size
        own = slice(begin, begin + layer.size)
        bound = interface.friction.bound(pressure[own] + layer, slip[own])
        return np.concatenate([bound, np.zeros(body.free.shape[0] - layer.size)])

    def bound(pressure: Array, slip: Array) -> Array | None:
        parts = comm.gather(own_bound(pressure, slip))
        return None if parts is None else np.concatenate(parts)

    def work(ask: Bound) -> tuple[Array, Array, Array, int, str]:
        assert gathered is not None
        return gathered.solve(ask, friction, tolerance)

    try:
        answer = with_questions(comm, work, bound)
    except NotConvexError:
        return None
    x, pressure, tangential, steps, words = answer
    begin = body.own.start // body.block_size
    own = slice(begin, begin + layer.size)
    forces = Multipliers(pressure[own].copy(), tangential[own].copy())
    return Found(replace(state, x=x[body.own].copy(), forces=forces), steps, words)


@dataclass(frozen=True)
class Gathered:
    """The linearised problem of all ranks: kept nodes in rank order, counted from `origin`."""

    stiffness: Array
    load: Array
    origin: Array
    free: NDArray[np.bool_]
    normal: Array
    tangent: Array
    gap: Array
    weight: Array

    @staticmethod
    def of(problem: CondensedProblem, state: State) -> Gathered | None:
        """Gather a problem with layer and current linearised at a state. Collective.

        The first rank has it, the others None.
        """
        body, interface = problem.equilibrium, problem.interface
        response, jump = interface.response, interface.jump
        nodal = jump.apply(state.x)
        blocks = response.block(nodal, interface.pressure(nodal, state.forces))
        base = residual_forces(problem, state)
        jump.transpose(-jump.weight[:, None] * state.forces.vectors(jump), base)
        # Slips are counted from where the step begins: there u_tau = 0 for the convex problem.
        origin = body.prescribe(body.rest())
        jump.transpose(interface.friction.history.jump, origin)
        kept = _kept_nodes(interface, body.free.shape[0])
        weighted = interface.weighted(blocks, state.x)
        local = (state.x - origin, base, origin, body.free, weighted, *kept)
        moved, base, origin, free, weighted, normal, tangent, gap, weight = (
            np.concatenate(body.comm.allgather(part)) for part in local
        )
        if body.comm.rank > 0:
            return None
        total = body.stiffness.copy()
        n, size = free.shape
        rows = np.arange(n * size).reshape(n, size)
        masked = weighted * free[:, :, None] * free[:, None, :]
        total[rows[:, :, None], rows[:, None, :]] += masked
        load = np.where(free.ravel(), total @ moved - base, 0.0)
        return Gathered(total, load, origin, free, normal, tangent, gap, weight)

    def solve(
        self, bound: Bound, frictional: bool, tolerance: float
    ) -> tuple[Array, Array, Array, int, str]:
        """Return unknowns, pressure, friction, steps and words."""
        n, d = self.normal.shape
        stiffness, load, complete = self.stiffness, self.load, None
        if self.free.shape[1] > d:
            stiffness, load, complete = without_potential(stiffness, load, self.free)
        rubbing = np.full(n, frictional) & (self.weight > 0) & np.isfinite(self.gap)
        free = self.free[:, :d]
        solver = TrescaSolver(
            stiffness, self.normal, self.tangent, self.gap, self.weight, free, rubbing
        )
        if frictional:
            inner = min(INNER, 0.01 * tolerance)
            loop = coulomb(solver, load, bound, tolerance=tolerance, inner=inner)
            result, steps, words = loop.result, loop.iterations, loop.message
        else:
            result = solver.solve(load, np.zeros(n))
            steps, words = result.iterations, result.message
        moved = result.displacement if complete is None else complete(result.displacement)
        x = self.origin + moved.ravel()
        return x, result.pressure, result.friction, steps, words


def _kept_nodes(interface: Interface, count: int) -> tuple[Array, Array, Array, Array]:
    """Return normals, tangents, gaps and weights of kept nodes; held ones touch nothing."""
    jump, d = interface.jump, interface.dim
    rest = count - jump.gap.size
    aside = np.zeros((rest, d))
    aside[:, 0] = 1.0
    return (
        np.concatenate([jump.normal, aside]),
        np.concatenate([jump.tangent, np.zeros((rest, d, d))]),
        np.concatenate([jump.gap, np.full(rest, np.inf)]),
        np.concatenate([jump.weight, np.ones(rest)]),
    )
