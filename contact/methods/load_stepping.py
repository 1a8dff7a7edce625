"""The methods by name, and quasi-static load stepping by any of them, with incremental friction.

A step is a static problem with the loads at its end and the history at its beginning. It starts
from a prediction, and a linear body is factorised once for all steps. A step that fails is halved;
the steps before it stay. Where the loads grow from zero this is continuation in the load.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from contact.linear.operator import Counters
from contact.methods.newton import Newton
from contact.methods.report import Monitor, Outcome, Record
from contact.methods.signals import Interrupted
from contact.methods.unconstrained_modes import UnconstrainedModes, with_least_displacements
from contact.problem.problem import ContactProblem
from contact.problem.residuals import Residuals, evaluate
from contact.problem.rigid_modes import released, unilateral_supports
from contact.problem.state import State
from contact.thesis.fixed_point import FixedPoint
from contact.thesis.penalty import Penalty
from contact.typing import Array


class Method(Protocol):
    """A solver of one problem, from an initial guess to a state and its `Outcome`.

    A new one is a class made of a problem, its options and a monitor, with an entry in `METHODS`;
    and its options, with an entry in `contact.methods.options.OPTIONS`. One that uses others makes
    their options by `with_method`, and has their records in its history.
    """

    @property
    def options(self) -> Any:
        """Its options; `allowed` is the tolerance of each residual."""

    @property
    def history(self) -> list[Record]:
        """Records of the outer iterations."""

    @property
    def counters(self) -> Counters:
        """Factorisations and solves."""

    @property
    def state(self) -> State:
        """The last iterate: the end of a solve after a signal."""

    def set_load_step(self, problem: ContactProblem) -> None:
        """Take another load step of the same problem; factorisations remain, records start anew."""

    def solve(
        self, start: State | None = None, secant_at: Array | None = None
    ) -> tuple[State, Outcome]:
        """Iterate until convergence or a limit. Collective.

        Parameters
        ----------
        start
            Initial guess; zero by default.
        secant_at
            Unknowns of the first secant of the material; those of the start by default. Prescribed
            values that have changed strain the elements beside them alone.

        Raises
        ------
        InputError
            If the linear system is singular.
        """


#: Name of a method -> its class.
METHODS: Mapping[str, Callable[[ContactProblem, Any, Monitor | None], Method]] = {
    "uzawa": FixedPoint,
    "penalty": Penalty,
    "newton": Newton,
}


logger = logging.getLogger("contact.solve")

#: Most halvings of a step that fails.
HALVINGS = 4

#: Placeholder of residuals that `evaluated` replaces.
UNKNOWN = Residuals(np.inf, np.inf, np.inf)


class LoadStepping:
    """Load steps of a problem by one method.

    Parameters
    ----------
    problem
        The problem; friction begins with its history.
    method
        Solver of the steps.
    start
        State at the end of an earlier step; the reference configuration by default.
    before
        State at the end of the step before `start`, for the extrapolation.
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
        self._modes = UnconstrainedModes(problem)

    def steps(self, times: Sequence[float], begin: float = 0.0) -> Iterator[tuple[State, Outcome]]:
        """Yield state and outcome of each step; a step that fails is the last one. Collective.

        Parameters
        ----------
        times
            Ends of the steps, increasing; those before the time of the start are left out.
        begin
            Time of the reference configuration.
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
        left = end - now
        sizes = [whole / 2**k for k in range(HALVINGS + 1)]
        for size in [size for size in sizes if size <= left * (1 + 1e-9)] or [left]:
            time = end if size >= left * (1 - 1e-9) else now + size
            state, outcome = self._solve(time, released(self._unilateral, now, time))
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
        start = secant_at = None
        if last is not None:
            ends = [(problem, state) for state in (before, last) if state is not None]
            start, secant_at = predicted(problem, ends)
        self._modes.problem = problem
        return solve_step(problem, self.method, start, secant_at, self._modes)


def solve_step(
    problem: ContactProblem,
    method: Method,
    start: State | None,
    secant_at: Array | None = None,
    modes: UnconstrainedModes | None = None,
) -> tuple[State, Outcome]:
    """Solve by a method, and evaluate the residuals from scratch. Collective.

    Of solutions that differ by a free rigid motion, that of least norm is taken.
    """
    counted = replace(method.counters)
    try:
        state, outcome = method.solve(start, secant_at)
    except Interrupted as interrupt:
        state = method.state
        outcome = Outcome(UNKNOWN, UNKNOWN, str(interrupt), interrupt.number)
    outcome = replace(
        outcome,
        allowed=method.options.allowed,
        records=tuple(method.history),
        counters=method.counters - counted,
    )
    found = evaluated(problem, state, outcome)
    return with_least_displacements(modes or UnconstrainedModes(problem), *found)


def evaluated(problem: ContactProblem, state: State, outcome: Outcome) -> tuple[State, Outcome]:
    """Evaluate the residuals of a state at the time and history of a problem. Collective."""
    x = problem.body.prescribe(state.x, problem.time)
    state = replace(state, x=x, time=problem.time, history=problem.history)
    return state, replace(outcome, residuals=evaluate(problem, state))


#: Largest ratio of the predicted increment of the solution to that of the last step.
FARTHEST = 2.0


def predicted(
    problem: ContactProblem, ends: Sequence[tuple[ContactProblem, State]]
) -> tuple[State, Array | None]:
    """Extrapolate the last two solutions: initial guess, place of the first secant. Collective.

    Where the loads turn round the last solution is taken. The material is then linearised there,
    with the change of the prescribed values as an increment: set at once, they would strain the
    elements beside them alone.

    Parameters
    ----------
    problem
        The problem.
    ends
        The last solution, behind the one before it if there is one, with their problems.
    """
    last, body, factor = ends[-1][1], problem.body, 0.0
    x = last.x
    if len(ends) > 1:
        factor = _extrapolation(problem, ends)
        x = x + factor * (x - ends[-2][1].x)
    start = State(body.prescribe(x, problem.time), last.forces, problem.time, problem.history)
    return start, None if factor > 0 else x


def _extrapolation(problem: ContactProblem, ends: Sequence[tuple[ContactProblem, State]]) -> float:
    """Return the least of df.df0/df0.df0: increments of loads and prescribed values."""
    product, factors = problem.body.product, []
    before, last = (_given(there, state.time) for there, state in ends[-2:])
    now = _given(problem, problem.time)
    for first, second, third in zip(before, last, now, strict=True):
        come, going = second - first, third - second
        square = product(come, come)
        if square > 0:
            factors.append(product(come, going) / square)
    return float(np.clip(min(factors, default=0.0), 0.0, FARTHEST))


def _given(problem: ContactProblem, time: float) -> tuple[Array, Array]:
    """Return the owned loads and prescribed values at a time."""
    body = problem.body
    return body.external(time), body.owned_part(body.prescribe(body.zero_displacement(), time))
