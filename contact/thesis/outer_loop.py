"""The frame of the thesis's outer loops, Algorithms 1, 3, 4, 6 and 8: freeze, solve, update.

An outer iteration freezes nonlinear terms (Kacanov's secant modulus, the friction bound), solves
the frozen problem by an inner iteration, and evaluates the residuals. `fixed_point` and `penalty`
differ in the step. A loop that fails ends with its best iterate, by the thesis's rules with the
last.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from contact.linear.operator import Counters
from contact.methods.options import LoopOptions
from contact.methods.report import Monitor, Outcome, Record, Recorder
from contact.methods.step_control import Best, Stagnation, undeformed_equilibrium
from contact.problem.problem import ContactProblem
from contact.problem.residuals import Residuals, evaluate
from contact.problem.state import State
from contact.typing import Array

#: Residual below which tangents take the place of frozen coefficients.
NEAR = 1e-2

#: Note of a step with a singular linear system.
LOST = "the body has been moved to where nothing constrains it"


@dataclass
class OuterLoop(ABC):
    """Outer loop of the algorithms of the thesis.

    Parameters
    ----------
    problem
        The contact problem.
    options
        Options of the loop, a `LoopOptions`.
    monitor
        Called after each outer iteration.

    Attributes
    ----------
    state, bound
        Last iterate, and its friction bound, shape (n,) (stress).
    """

    problem: ContactProblem
    options: LoopOptions
    monitor: Monitor | None = None
    counters: Counters = field(default_factory=Counters)

    #: Stagnation limit, and ratio of residuals that is progress.
    stagnation: ClassVar[tuple[int, float]]

    def __post_init__(self) -> None:
        """Start from zero with an empty history."""
        thesis = self.options.stopping == "thesis"
        self._norm = self.problem.equilibrium.l2_norm() if thesis else None
        self.set_load_step(self.problem)

    def set_load_step(self, problem: ContactProblem) -> None:
        """Take another load step of the same problem; factorisations remain."""
        self.problem, self.state = problem, problem.start()
        self.recorder = Recorder(self.monitor)
        self.bound: Array = np.zeros(problem.interface.nodes.gap.size)

    @property
    def history(self) -> list[Record]:
        """The outer iterations of the last solves."""
        return self.recorder.records

    @abstractmethod
    def _step(self, iteration: int) -> tuple[int, str]:
        """Solve a frozen problem for the state; return its inner iterations and a note."""

    @abstractmethod
    def _target(self, residuals: Residuals) -> float:
        """Return the residual that the loop controls."""

    @abstractmethod
    def _adapt(self, residual: float, best: float) -> None:
        """Choose the next linearisation by the last residual and the least one."""

    def _limit(self) -> int:
        """Return the stagnation limit."""
        return self.stagnation[0]

    def _advice(self, residual: float | None = None) -> str:
        """Return advice on failure; `residual`: where the loop stalled."""
        return ""

    def _iterate(self, first: int = 1) -> Outcome:
        """Iterate until convergence, stagnation or the limit; keep the best iterate."""
        begin, problem, options = time.perf_counter(), self.problem, self.options
        stagnation = Stagnation(*self.stagnation)
        best: Best[tuple[State, Residuals]] = Best()
        by_thesis = options.stopping == "thesis"
        for iteration in range(first, options.max_outer + 1):
            previous = self.state
            inner, note = self._step(iteration)
            residuals = evaluate(problem, self.state)
            residual = self._target(residuals)
            best.see((self.state, residuals), residual)
            change, seconds = self._update_bound(iteration), time.perf_counter() - begin
            self.recorder.add(Record(iteration, inner, residuals, change, seconds, note))
            if by_thesis and iteration > first and self._thesis_criterion(change, previous):
                return self._outcome(residuals, criterion="the thesis's criterion is met")
            if not by_thesis and residual <= options.tolerance:
                return self._outcome(residuals)
            if note == LOST:
                ended = LOST + self._advice()
                break
            if not np.isfinite(residual):
                ended = "the iteration diverged"
                break
            given_up = stagnation(residual, self._limit())
            self._adapt(residual, stagnation.best)
            if given_up and not by_thesis:
                ended = f"the residual stalled at {stagnation.best:.2e}"
                ended += self._advice(stagnation.best)
                break
        else:
            ended = f"not converged in {options.max_outer} outer iterations{self._advice()}"
        if best.found is not None and not by_thesis:
            if rest := undeformed_equilibrium(problem, options.tolerance):
                best.found, ended = rest, ""
            self.state, residuals = best.found
        return self._outcome(residuals, ended)

    def _update_bound(self, iteration: int) -> float:
        """Update the friction bound; return its relative change (3.46), NaN without friction."""
        interface, forces, old = self.problem.interface, self.state.forces, self.bound
        if not interface.friction.acts:
            return np.nan
        nodal = interface.nodes.apply(self.state.x)
        if iteration == 0:  # frictionless start: bound of zero slip
            pressure = interface.pressure(nodal, forces)
            self.bound = interface.friction.bound(pressure, np.zeros_like(pressure))
        else:
            self.bound = interface.bound(nodal, forces)
        size = interface.nodes.norm(self.bound)
        return interface.nodes.norm(self.bound - old) / size if size > 0 else 0.0

    def _thesis_criterion(self, change: float, previous: State) -> bool:
        """Tell whether (4.38) or (6.40) is met, on the change of the displacement."""
        assert self._norm is not None
        own = self.problem.equilibrium.owned_part
        now, before = own(self.state.x), own(previous.x)
        return self._norm(now - before) < self.options.eps_fp * self._norm(now)

    def _outcome(self, residuals: Residuals, ended: str = "", criterion: str = "") -> Outcome:
        return Outcome(residuals, self.options.allowed, ended, criterion=criterion)
