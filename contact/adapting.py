"""Adaptive refinement: solve, estimate, mark, refine, from the solution on the mesh before."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
from mpi4py import MPI

from contact.case.build import build_problem
from contact.case.file import Case
from contact.case.mesh import Adapt
from contact.mesh.domain import Domain, Indices
from contact.mesh.transfer import with_parents
from contact.methods.report import tell
from contact.nesting import prolong
from contact.results.error_estimate import estimated
from contact.results.intervals import intervals
from contact.results.quantities import values_of
from contact.results.quantity import ADAPT
from contact.results.solution import Remark, Solution
from contact.tolerances import ROUNDING
from contact.typing import Array

logger = logging.getLogger("contact.adapt")

#: Solves a problem from an initial guess, `start`; the solution is not reviewed.
Solver = Callable[..., Solution]

#: Cells whose indicator is within that of the last one marked are marked too: rounding, which
#: differs by the number of ranks, decides nothing.
TIE = 1e-6

#: A mesh has so many times the cells of the one before, half as many at least and twice as many at
#: most where that reaches the goal: all solves together take about one and a half times the last.
GROWTH = 4

#: Least factor of the cells, where the room for unknowns ends: a last mesh with hardly more would
#: cost as much again.
LEAST = 1.5


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
        solution = solve(problem, start=start)
        if solution.outcome.signal:
            break
        if solution.converged:
            solution.error = estimated(solution.problem, solution.state)
        rows.append(values_of(ADAPT, solution))
        if before is not None:
            for phase, seconds in before.seconds.items():
                solution.seconds[phase] += seconds
        if not solution.converged:
            break
        squares, error = indicators(solution)
        tell(logger, 0.0, "%d unknowns, estimated error %.2g %%", unknowns, 100 * error)
        # A first mesh may have seen nothing of a narrow load, or of contact between its nodes.
        seen = error > ROUNDING or before is not None
        if asked.error is not None and error <= asked.error and seen:
            break
        goal = (asked.error / error) ** 2 if asked.error is not None and seen else 0.0
        room = asked.max_unknowns / unknowns
        finer = grown(domain, squares, asked.fraction, goal, room, problem.equilibrium.degree)
        if _cells(finer) < LEAST * _cells(domain):
            break
        domain = finer
    solution.adaptation = rows
    for identifier, remarks in {"adapt": missed(asked, rows if solution.converged else ())}.items():
        solution.warnings += [f"{text} [{identifier}]" for text in remarks]
    if asked.fraction == 1 and solution.converged:
        solution.intervals = intervals(rows)
    return solution


def missed(asked: Adapt, rows: Sequence[Mapping[str, float]]) -> Iterator[Remark]:
    """Say that the error that was asked for has not been reached."""
    error = rows[-1]["error"] if rows else 0.0
    if asked.error is not None and error > asked.error:
        yield (
            f"the estimated discretisation error is {error:.2g}, and mesh.adapt.error = "
            f"{asked.error:g}: the next mesh would have more unknowns than mesh.adapt.max_unknowns"
        )


def _cells(domain: Domain) -> int:
    return int(domain.mesh.topology.index_map(domain.dim).size_global)


def grown(
    domain: Domain, squares: Array, fraction: float, goal: float, room: float, degree: int
) -> Domain:
    """Refine until the cells are several times as many, by predicted indicators. Collective.

    A last mesh with few more cells than the one before would cost as much again.

    Those of cut cells fall with the mesh size as they do where solutions are smooth (Melenk and
    Wohlmuth, Adv. Comput. Math. 15, 2001); singular corners are seen by the next estimate. Squares
    are eta_K^2 of the owned cells, goal and room the shares of their sum that is asked for, and of
    the cells that there may be.
    """
    comm, d = domain.comm, domain.dim
    first, asked = (comm.allreduce(value, op=MPI.SUM) for value in (squares.size, squares.sum()))
    enough: Domain | None = None
    while True:
        every = np.arange(squares.size, dtype=np.int32)
        cells = every if fraction == 1 else marked(comm, squares, fraction)
        finer, parents = with_parents(domain, cells)
        count = comm.allreduce(parents.size, op=MPI.SUM)
        before = comm.allreduce(squares.size, op=MPI.SUM)
        if before > first and (count > room * first or count > 2 * GROWTH * first):
            return enough or domain
        pieces = np.bincount(parents, minlength=squares.size)
        # Of 2^d pieces each edge is half as long.
        shares = pieces[parents] ** (-1 - 2 * degree / d)
        domain, squares = finer, squares[parents] * shares
        left = comm.allreduce(squares.sum(), op=MPI.SUM)
        if left <= goal * asked and count >= GROWTH / 2 * first:
            return domain
        if count >= 2 * GROWTH * first:
            return enough or domain
        if count >= GROWTH * first:
            enough = enough or domain


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
    """Return the fewest owned cells that have a share of the sum (Doerfler, 1996). Collective."""
    share = (1 - ROUNDING) * fraction * comm.allreduce(float(squares.sum()), op=MPI.SUM)
    most = comm.allreduce(float(squares.max(initial=0.0)), op=MPI.MAX)
    # Bisection for the least of them: numbers >= 0 are in the order of their bits.
    low, high = 0, int(np.float64(most).view(np.int64))
    while low < high:
        middle = (low + high + 1) // 2
        above = float(squares[squares >= np.int64(middle).view(np.float64)].sum())
        if comm.allreduce(above, op=MPI.SUM) >= share:
            low = middle
        else:
            high = middle - 1
    last = np.int64(low).view(np.float64)
    return np.flatnonzero(squares >= (1 - TIE) * last).astype(np.int32)
