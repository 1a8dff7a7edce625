"""The methods by name, and the solve of a static problem, or of a load step, by one of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
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
from contact.problem.state import State
from contact.thesis.fixed_point import FixedPoint
from contact.thesis.penalty import Penalty

#: Placeholder of residuals that `evaluated` replaces.
UNKNOWN = Residuals(np.inf, np.inf, np.inf)


class Method(Protocol):
    """A solver of one problem, from an initial guess to a state and its `Outcome`.

    A new one is a class made of a problem, its options and a monitor, with an entry in `METHODS`;
    and its options, with an entry in `contact.methods.options.OPTIONS`. One that uses others makes
    their options by `with_method`, and has their records in its history.
    """

    @property
    def problem(self) -> ContactProblem:
        """The problem, at its last load step."""

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
        """Take another load step; records start anew, factorisations remain.

        Not so at another geometry whose linear systems have other unknowns: then all is anew.
        """

    def solve(self, start: State | None = None) -> tuple[State, Outcome]:
        """Iterate from a guess, zero by default, until convergence or a limit. Collective.

        InputError if the linear system is singular.
        """


#: Name of a method -> its class.
METHODS: Mapping[str, Callable[[ContactProblem, Any, Monitor | None], Method]] = {
    "uzawa": FixedPoint,
    "penalty": Penalty,
    "newton": Newton,
}


def solve_step(
    problem: ContactProblem,
    method: Method,
    start: State | None,
    modes: UnconstrainedModes | None = None,
) -> tuple[State, Outcome]:
    """Solve by a method, and evaluate the residuals from scratch. Collective.

    Of solutions that differ by a free rigid motion, that of least norm is taken.
    """
    counted = replace(method.counters)
    try:
        state, outcome = method.solve(start)
    except Interrupted as interrupt:
        state = method.state
        outcome = Outcome(UNKNOWN, UNKNOWN, str(interrupt), interrupt.number)
    outcome = replace(
        outcome,
        allowed=method.options.allowed,
        records=tuple(method.history),
        counters=method.counters - counted,
    )
    end = evaluated(problem, state, outcome)
    return with_least_displacements(modes or UnconstrainedModes.of(problem), *end)


def evaluated(problem: ContactProblem, state: State, outcome: Outcome) -> tuple[State, Outcome]:
    """Evaluate the residuals of a state at the time and history of a problem. Collective."""
    x = problem.body.prescribe(state.x, problem.time)
    state = replace(state, x=x, time=problem.time, history=problem.history, secant_at=None)
    return state, replace(outcome, residuals=evaluate(problem, state))
