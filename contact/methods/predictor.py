"""Where a problem that follows others begins: their last state, moved on as its loads have."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.typing import Array

#: Largest part of the last step's way that the prediction adds to it.
FARTHEST = 2.0


@dataclass(frozen=True)
class Reached:
    """A solution, and what has led there.

    Attributes
    ----------
    state
        The solution.
    given
        The owned loads and prescribed values.
    """

    state: State
    given: tuple[Array, Array]

    @staticmethod
    def of(problem: ContactProblem, state: State) -> Reached:
        """Return the solution of a problem, at its time. Collective."""
        return Reached(state, _given(problem, state.time))


def predicted(problem: ContactProblem, last: Reached, before: Reached | None) -> State:
    """Return where the solution of a problem is looked for. Collective.

    Parameters
    ----------
    problem
        The problem.
    last, before
        The solution that it follows, and the one before that; None where there is none.
    """
    x, body = last.state.x, problem.equilibrium
    if before is not None:
        x = x + _share(problem, last, before) * (x - before.state.x)
    x = body.prescribe(x, problem.time)
    return State(x, last.state.forces, problem.time, problem.history)


def _share(problem: ContactProblem, last: Reached, before: Reached) -> float:
    """Return how far the loads go on the way they have come, over that way. Collective."""
    product, shares = problem.equilibrium.product, []
    now = _given(problem, problem.time)
    for first, second, third in zip(before.given, last.given, now, strict=True):
        come, going = second - first, third - second
        square = product(come, come)
        if square > 0:
            shares.append(product(come, going) / square)
    return float(np.clip(min(shares, default=0.0), 0.0, FARTHEST))


def _given(problem: ContactProblem, time: float) -> tuple[Array, Array]:
    body = problem.equilibrium
    return body.external(time), body.owned_part(body.prescribe(body.rest(), time))
