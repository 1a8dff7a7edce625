"""Quasi-static load stepping with incremental friction.

A step is a static problem with the loads at its end and the history at its beginning. It starts
from a prediction, and a linear body is factorised once for all steps. A step that fails is halved;
the steps before it stay. Where the loads grow from zero this is continuation in the load.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from contact.linear.operator import Counters
from contact.methods.method import Method
from contact.methods.report import IterationHistory, Outcome
from contact.methods.signals import Interrupted
from contact.methods.unconstrained_modes import UnconstrainedModes, with_least_displacements
from contact.problem.limit_analysis import released, unilateral_supports
from contact.problem.problem import ContactProblem
from contact.problem.residuals import Residuals, evaluate
from contact.problem.state import State
from contact.typing import Array

logger = logging.getLogger("contact.solve")

#: How often a step that fails is halved.
HALVINGS = 4

#: Stands for residuals until they are measured.
NOTHING = Residuals(np.inf, np.inf, np.inf)


@dataclass(frozen=True)
class LoadStep:
    """A load step: its problem, its solution, and the way to it.

    Attributes
    ----------
    problem
        The problem with the loads of the step's end and the history at its beginning.
    state, outcome
        Its solution, and how that was found.
    history
        The outer iterations.
    counters
        Factorisations and solves of this step alone.
    """

    problem: ContactProblem
    state: State
    outcome: Outcome
    history: IterationHistory
    counters: Counters


class LoadStepping:
    """Quasi-static load stepping: solves the load steps of a problem one after the other.

    Parameters
    ----------
    problem
        The problem; its history is where friction begins.
    method
        Solves one step after the other.
    start
        State to go on from: that of an earlier step. The reference configuration by default.
    before
        The state of the step before it, for the prediction.
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
        # How supports constrain bodies is the same in all steps.
        self._modes = UnconstrainedModes(problem)

    def run(self, times: Sequence[float], begin: float = 0.0) -> Iterator[LoadStep]:
        """Take the steps; the last one given has not converged if that has ended them. Collective.

        Parameters
        ----------
        times
            Ends of the steps, increasing. Those that the start has passed are left out.
        begin
            Time of the reference configuration.
        """
        for k, end in enumerate(times):
            whole = end - (times[k - 1] if k > 0 else begin)
            while (now := begin if self._last is None else self._last.time) < end:
                step = self._step(now, end, whole)
                if step.outcome.converged:
                    self._before, self._last = self._last, step.state
                yield step
                if not step.outcome.converged:
                    return

    def _step(self, now: float, end: float, whole: float) -> LoadStep:
        """Take a step: all of the way to its end, or a half, a quarter ... of it.

        Where contact alone holds the body, loads that let it go are not tried.
        """
        left = end - now
        sizes = [whole / 2**k for k in range(HALVINGS + 1)]
        for size in [size for size in sizes if size <= left * (1 + 1e-9)] or [left]:
            time = end if size >= left * (1 - 1e-9) else now + size
            lost = released(self._unilateral, now, time)
            step = self._lost(time, lost) if lost else self._solve(time)
            if step.outcome.converged or step.outcome.signal:
                break
            logger.info("no step to %g: %s", time, step.outcome.reason)
        return step

    def _lost(self, time: float, why: str) -> LoadStep:
        """Return a step that is not taken: the last state under the loads of its end."""
        problem = self._at(time)
        start = problem.start() if self._last is None else self._last
        state, outcome = measured(
            problem, start, Outcome(NOTHING, self.method.options.allowed, why)
        )
        return LoadStep(problem, state, outcome, IterationHistory(), Counters())

    def _at(self, time: float) -> ContactProblem:
        """Return the problem of a step that ends at a time, with the history of the last one."""
        problem, last = self.problem, self._last
        if last is None:
            return problem.at(time)
        return problem.at(time, problem.commit(last), since=last.time)

    def _solve(self, time: float) -> LoadStep:
        last, method = self._last, self.method
        problem = self._at(time)
        method.set_load_step(problem)
        counted = replace(method.counters)
        start = linearised_at = None
        if last is not None:
            before = None if self._before is None else Reached.of(problem, self._before)
            start, linearised_at = predicted(problem, Reached.of(problem, last), before)
        self._modes.problem = problem
        state, outcome = solve_step(problem, method, start, linearised_at, self._modes)
        return LoadStep(problem, state, outcome, method.history, method.counters - counted)


def solve_step(
    problem: ContactProblem,
    method: Method,
    start: State | None,
    linearised_at: Array | None = None,
    modes: UnconstrainedModes | None = None,
) -> tuple[State, Outcome]:
    """Solve by a method, and evaluate the residuals once more. Collective.

    Of solutions that differ by a free rigid motion the one with the least displacements is taken.
    """
    try:
        state, outcome = method.solve(start, linearised_at)
    except Interrupted as interrupt:
        state = method.state
        outcome = Outcome(NOTHING, NOTHING, str(interrupt), interrupt.number)
    found = measured(problem, state, replace(outcome, allowed=method.options.allowed))
    return with_least_displacements(modes or UnconstrainedModes(problem), *found)


def measured(problem: ContactProblem, state: State, outcome: Outcome) -> tuple[State, Outcome]:
    """Evaluate the residuals of a method's state, as one of the problem. Collective.

    From scratch and at the whole load, whatever the method says and wherever it has stopped.
    """
    x = problem.equilibrium.prescribe(state.x, problem.time)
    state = replace(state, x=x, time=problem.time, history=problem.history)
    return state, replace(outcome, kkt=evaluate(problem, state))


#: Largest ratio of the predicted increment of the solution to that of the last step.
FARTHEST = 2.0


@dataclass(frozen=True)
class Reached:
    """A solution, with the loads and prescribed values that belong to it.

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


def predicted(
    problem: ContactProblem, last: Reached, before: Reached | None
) -> tuple[State, Array | None]:
    """Return the initial guess of a step, by extrapolation of the last two. Collective.

    Where loads turn round there is nothing to extrapolate. The material is then linearised at the
    last solution first, with the change of the prescribed values as an increment: set at once, they
    would strain the elements beside them alone.

    Parameters
    ----------
    problem
        The problem.
    last, before
        The solution that it follows, and the one before that; None where there is none.
    """
    x, body, factor = last.state.x, problem.equilibrium, 0.0
    if before is not None:
        factor = _extrapolation(problem, last, before)
        x = x + factor * (x - before.state.x)
    start = State(body.prescribe(x, problem.time), last.state.forces, problem.time, problem.history)
    return start, None if factor > 0 else x


def _extrapolation(problem: ContactProblem, last: Reached, before: Reached) -> float:
    """Return the increment of the loads over the last one, along that. Collective."""
    product, factors = problem.equilibrium.product, []
    now = _given(problem, problem.time)
    for first, second, third in zip(before.given, last.given, now, strict=True):
        come, going = second - first, third - second
        square = product(come, come)
        if square > 0:
            factors.append(product(come, going) / square)
    return float(np.clip(min(factors, default=0.0), 0.0, FARTHEST))


def _given(problem: ContactProblem, time: float) -> tuple[Array, Array]:
    body = problem.equilibrium
    return body.external(time), body.owned_part(body.prescribe(body.rest(), time))
