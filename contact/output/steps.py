"""The records of the steps of an evolution: a row each, and the contact nodes at its end."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.methods.load_stepping import LoadStep
from contact.output.quantities import STEPS, values_of
from contact.output.resultants import driven_part, nodes_of
from contact.output.solution import Solution, StepRecord
from contact.output.surface import contact_table
from contact.problem.energy import StepEnd, balance, step_end
from contact.problem.problem import ContactProblem
from contact.typing import Array


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
        part = driven_part(problem)
        self._nodes = None if part is None else nodes_of(problem, part)

    def record(self, step: LoadStep) -> StepRecord:
        """Return the record of a step that follows the last one. Collective."""
        problem, state = step.problem, step.state
        now = step_end(problem, state, self._before)
        energies = balance(problem, state, self._before, now)
        self._before = now
        solution = Solution(problem, state, step.outcome, step.history, step.counters, "", {})
        solution.energies = energies
        if self._nodes is not None:
            solution.driven = _driven(problem, self._nodes, now)
        table, row = contact_table(solution), values_of(STEPS, solution)
        self._rounding = max(self._rounding, step.outcome.kkt.rounding)
        return StepRecord(state, row, table, now.enthalpy, self._rounding)


def _driven(problem: ContactProblem, nodes: NDArray[np.int32], now: StepEnd) -> tuple[Array, Array]:
    """Return the mean displacement of nodes, and the force that drives them. Collective."""
    body, d = problem.equilibrium, problem.dim
    x, given = body.nodal(now.x)[nodes, :d], body.nodal(now.given)[nodes, :d]
    local = np.concatenate([x.sum(axis=0), given.sum(axis=0), [nodes.size]])
    total = problem.comm.allreduce(local, op=MPI.SUM)
    return total[:d] / max(total[-1], 1.0), total[d:-1]
