"""The records of the steps of an evolution: a row each, and the state at its end."""

from __future__ import annotations

from dataclasses import replace

from contact.methods.load_stepping import LoadStep
from contact.output.quantities import STEPS, values_of
from contact.output.resultants import DrivenPart
from contact.output.solution import Solution, StepRecord
from contact.problem.energy import StepEnd, balance, step_end
from contact.problem.problem import ContactProblem


class StepRecorder:
    """Makes the records of one step after the other.

    Parameters
    ----------
    problem
        The problem of the evolution.
    last
        The record to go on from; from the reference configuration by default. Collective.
    """

    def __init__(self, problem: ContactProblem, last: StepRecord | None = None) -> None:
        self._before = StepEnd.rest(problem)
        if last is not None:
            here = problem.at(last.state.time, last.state.history)
            self._before = step_end(here, last.state, self._before)
            self._before = replace(self._before, enthalpy=last.enthalpy)
        self._rounding = 0.0 if last is None else last.rounding
        self._driven = DrivenPart.of(problem)

    def record(self, step: LoadStep) -> StepRecord:
        """Return the record of a step that follows the last one. Collective."""
        problem, state = step.problem, step.state
        now = step_end(problem, state, self._before)
        energies = balance(problem, state, self._before, now)
        self._before = now
        solution = Solution(problem, state, step.outcome, step.history, step.counters, "", {})
        solution.energies = energies
        if self._driven is not None:
            way, force = (find(problem, state) for find in (self._driven.way, self._driven.force))
            solution.driven = way, force
        row = values_of(STEPS, solution)
        self._rounding = max(self._rounding, step.outcome.kkt.rounding)
        return StepRecord(state, row, now.enthalpy, self._rounding)
