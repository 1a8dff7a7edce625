"""Quasi-static load stepping by any method, with incremental friction.

A step is a static problem with the loads at its end and the history at its beginning. It starts
from a prediction, and a linear body is assembled, and a condensed one factorised, once for
all steps. A step that fails is halved;
the steps before it stay. Where the loads grow from zero this is continuation in the load.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from contact.methods.method import UNKNOWN, Method, evaluated, solve_step
from contact.methods.report import Outcome
from contact.methods.unconstrained_modes import UnconstrainedModes
from contact.problem.problem import ContactProblem
from contact.problem.rigid_modes import release_message, unilateral_supports
from contact.problem.state import State
from contact.typing import Array

logger = logging.getLogger("contact.solve")

#: Most halvings of a step that fails.
HALVINGS = 4


class LoadStepping:
    """Load steps of a problem, from its history, by one method.

    `start` is the state at the end of an earlier step, the reference configuration by default;
    `before` that of the step before it, for the extrapolation.
    """

    def __init__(
        self,
        problem: ContactProblem,
        method: Method,
        start: State | None = None,
        before: State | None = None,
    ) -> None:
        self.problem, self.method = problem, method
        self._last, self._before = start, before
        self._unilateral = unilateral_supports(problem)
        # Supports are the same in all steps.
        self._modes = UnconstrainedModes.of(problem)

    def steps(self, times: Sequence[float], begin: float = 0.0) -> Iterator[tuple[State, Outcome]]:
        """Yield state and outcome of each step; a step that fails is the last one. Collective.

        The ends of the steps increase, and those before the time of the start are left out; `begin`
        is the time of the reference configuration.
        """
        for k, end in enumerate(times):
            whole = end - (times[k - 1] if k > 0 else begin)
            while (now := begin if self._last is None else self._last.time) < end:
                state, outcome = self._step(now, end, whole)
                if outcome.converged:
                    self._before, self._last = self._last, state
                yield state, outcome
                if not outcome.converged:
                    return

    def _step(self, now: float, end: float, whole: float) -> tuple[State, Outcome]:
        """Step to a time, or halve the step; loads that release a body are not tried."""
        remaining = end - now
        sizes = [whole / 2**k for k in range(HALVINGS + 1)]
        for size in [size for size in sizes if size <= remaining * (1 + 1e-9)] or [remaining]:
            time = end if size >= remaining * (1 - 1e-9) else now + size
            state, outcome = self._solve(time, release_message(self._unilateral, now, time))
            if outcome.converged or outcome.signal:
                break
            logger.info("no step to %g: %s", time, outcome.reason)
        return state, outcome

    def _solve(self, time: float, released: str) -> tuple[State, Outcome]:
        """Solve the step to a time; where a body is released, leave the last state."""
        problem, last, before = self.problem, self._last, self._before
        if last is None:
            problem = problem.at(time)
        else:
            problem = problem.at(time, problem.commit(last), since=last.time)
        if released:
            outcome = Outcome(UNKNOWN, self.method.options.allowed, released)
            return evaluated(problem, problem.start() if last is None else last, outcome)
        self.method.set_load_step(problem)
        ends = [(problem, state) for state in (before, last) if state is not None]
        start = predicted(problem, ends) if ends else None
        modes = replace(self._modes, problem=problem)
        return solve_step(problem, self.method, start, modes)


#: Largest ratio of the predicted increment of the solution to that of the last step.
FARTHEST = 2.0


def predicted(problem: ContactProblem, ends: Sequence[tuple[ContactProblem, State]]) -> State:
    """Return the initial guess by extrapolation of the last two solutions. Collective.

    Where the loads turn round it is the last solution. The first secant is then that there, with
    the change of the prescribed values as an increment: set at once, they would strain the
    elements beside them alone. `ends`: the last solution, behind the one before it if there is one,
    with their problems.
    """
    last, body, factor = ends[-1][1], problem.body, 0.0
    x = last.x
    if len(ends) > 1:
        factor = _extrapolation(problem, ends)
        x = x + factor * (x - ends[-2][1].x)
    start = State(body.prescribe(x, problem.time), last.multipliers, problem.time, problem.history)
    return start if factor > 0 else replace(start, secant_at=x)


def _extrapolation(problem: ContactProblem, ends: Sequence[tuple[ContactProblem, State]]) -> float:
    """Return the least of df.df0/df0.df0: increments of loads and prescribed values."""
    product, factors = problem.body.product, []
    before, last = (_loading(earlier, state.time) for earlier, state in ends[-2:])
    now = _loading(problem, problem.time)
    for first, second, third in zip(before, last, now, strict=True):
        come, going = second - first, third - second
        square = product(come, come)
        if square > 0:
            factors.append(product(come, going) / square)
    return float(np.clip(min(factors, default=0.0), 0.0, FARTHEST))


def _loading(problem: ContactProblem, time: float) -> tuple[Array, Array]:
    """Return the owned loads and prescribed values at a time."""
    body = problem.body
    return body.external(time), body.owned_part(body.prescribe(body.zero_displacement(), time))
