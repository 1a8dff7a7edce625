"""Nested meshes: the solution of a case on coarser ones, each from the one before."""

from __future__ import annotations

from typing import Any

from mpi4py import MPI

from contact.build import build_problem
from contact.case.file import Case
from contact.case.nesting import coarser_cases
from contact.methods.nested import prolong
from contact.methods.newton import Newton
from contact.methods.options import NewtonOptions
from contact.problem.problem import ContactProblem
from contact.problem.state import State

#: Tolerance on the coarser levels: their discretisation error is larger by far.
COARSE_TOLERANCE = 1e-3


def coarse_solution(
    case: Case, comm: MPI.Intracomm, **replacements: Any
) -> tuple[ContactProblem, State]:
    """Solve on all meshes but the finest, each from the one before. Collective."""
    options = NewtonOptions(
        tolerance=max(COARSE_TOLERANCE, case.solver.tolerance), linear=case.solver.linear
    )
    last: tuple[ContactProblem, State] | None = None
    levels = case.solver.nested_levels if isinstance(case.solver, NewtonOptions) else None
    for level in coarser_cases(case, levels):
        problem = build_problem(level, comm, **replacements)
        method = Newton(problem, options)
        state, _ = method.solve(None if last is None else prolong(*last, problem))
        last = problem, state
    assert last is not None
    return last
