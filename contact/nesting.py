"""Nested meshes: the solution of a case on coarser ones, each from the one before."""

from __future__ import annotations

from typing import Any

from contact.build import build_problem
from contact.case.file import Case
from contact.case.nesting import coarser_cases, has_coarser
from contact.linear import multigrid
from contact.methods.nested import prolong
from contact.methods.newton import Newton
from contact.methods.options import NewtonOptions
from contact.problem.problem import ContactProblem
from contact.problem.state import State

#: Tolerance on the coarser levels: their discretisation error is larger by far.
COARSE_TOLERANCE = 1e-3

#: Unknowns in space from which a start on coarser meshes saves more time than it takes.
MANY = 40_000


def pays(case: Case, problem: ContactProblem) -> bool:
    """Tell whether a start from coarser meshes saves time: where Newton's steps are many solves.

    Those of a body that is condensed onto its contact nodes are few in any case.
    """
    layout = problem.equilibrium.layout
    iterative = multigrid.is_large(layout) and case.solver.linear != "lu"
    enough = layout.dim == 3 and layout.unknowns >= MANY
    return iterative and enough and case.evolution is None and has_coarser(case)


def nested_start(case: Case, problem: ContactProblem, **replacements: Any) -> State:
    """Solve on all coarser meshes, each from the one before, and carry that to a problem's.

    Collective.
    """
    options = NewtonOptions(
        tolerance=max(COARSE_TOLERANCE, case.solver.tolerance), linear=case.solver.linear
    )
    levels = case.solver.nested_levels if isinstance(case.solver, NewtonOptions) else None
    last: tuple[ContactProblem, State] | None = None
    for level in coarser_cases(case, levels):
        coarse = build_problem(level, problem.comm, **replacements)
        start = None if last is None else prolong(*last, coarse)
        last = coarse, Newton(coarse, options).solve(start)[0]
    assert last is not None
    return prolong(*last, problem)
