"""The road with a frozen friction bound: Algorithm 1, with Newton's loop inside."""

from __future__ import annotations

from contact.methods.loop import UPDATE, NewtonLoop
from contact.methods.report import Outcome
from contact.methods.step import Iterate

#: What the history says of this road.
FROZEN_FRICTION = "frozen friction"

#: Updates of a frozen friction bound, and what the first of its problems is solved to.
MOST_UPDATES, FIRST_GOAL = 40, 1e-2


def frozen_friction(loop: NewtonLoop, iterate: Iterate) -> tuple[Iterate, Outcome]:
    """Update the friction bound outside of Newton's loop: each problem is then convex."""
    goal, interface = FIRST_GOAL, loop.search.problem.interface
    for _ in range(MOST_UPDATES):
        state = iterate.state
        bound = interface.bound(interface.jump.apply(state.x), state.forces)
        iterate, outcome = loop.run(iterate, FROZEN_FRICTION, bound, goal)
        if outcome.converged or outcome.ended != UPDATE:
            break
        goal = 0.1 * outcome.kkt.largest
    return iterate, outcome
