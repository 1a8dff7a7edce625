"""Adaptive refinement: solve, estimate, mark, refine, from the solution on the mesh before."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np
from mpi4py import MPI

from contact.case.build import build_problem
from contact.case.file import Case
from contact.mesh.entities import Indices
from contact.mesh.transfer import refined
from contact.methods.report import tell
from contact.nesting import prolong
from contact.output.error_estimate import estimated
from contact.output.quantities import ADAPT, values_of
from contact.output.solution import Solution
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.typing import Array

logger = logging.getLogger("contact.adapt")

#: Solves a problem from an initial guess.
Solver = Callable[[ContactProblem, State | None], Solution]

#: Cells whose indicator is within that of the last one marked are marked too: rounding, which
#: differs by the number of ranks, decides nothing.
TIE = 1e-6


def adapted(case: Case, comm: MPI.Intracomm, solve: Solver) -> Solution:
    """Solve a case on finer and finer meshes, until its `[mesh.adapt]` is met. Collective.

    Of an evolution all steps are solved on each mesh, and the largest indicator of each cell
    counts.
    """
    asked = case.mesh.adapt
    assert asked is not None
    domain, solution, rows = case.mesh.build(comm), None, []
    while True:
        problem = build_problem(case, comm, domain=domain)
        unknowns = problem.equilibrium.layout.unknowns
        if solution is not None and unknowns > asked.max_unknowns:
            break
        start = None
        if solution is not None and not solution.steps:
            start = prolong(solution.problem, solution.state, problem)
        before = solution
        solution = solve(problem, start)
        squares, error = indicators(solution)
        rows.append(values_of(ADAPT, solution))
        tell(logger, 0.0, "%d unknowns, estimated error %.2g %%", unknowns, 100 * error)
        if before is not None:
            for phase, seconds in before.seconds.items():
                solution.seconds[phase] += seconds
        if not solution.converged or (asked.error is not None and error <= asked.error):
            break
        domain = refined(domain, marked(comm, squares, asked.fraction))
    solution.adaptation = rows
    return solution


def indicators(solution: Solution) -> tuple[Array, float]:
    """Return eta_K^2 of the owned cells and the relative error, the largest of all steps.

    Collective.
    """
    assert solution.error is not None
    squares, error = solution.error.squares, solution.error.relative
    for record in solution.steps[:-1]:
        step = estimated(solution.problem.at(record.state.time, record.state.history), record.state)
        squares, error = np.maximum(squares, step.squares), max(error, step.relative)
    return squares, error


def marked(comm: MPI.Intracomm, squares: Array, fraction: float) -> Indices:
    """Return the fewest owned cells that have a share of the sum (Doerfler, 1996). Collective.

    Parameters
    ----------
    comm
        Communicator of the mesh.
    squares
        eta_K^2 of the owned cells.
    fraction
        The share of the sum over all ranks.
    """
    every = np.sort(np.concatenate(comm.allgather(squares)))[::-1]
    sums = np.cumsum(every)
    last = every[min(np.searchsorted(sums, fraction * sums[-1]), every.size - 1)]
    return np.flatnonzero(squares >= (1 - TIE) * last).astype(np.int32)
