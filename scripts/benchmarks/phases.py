"""Where the time of a nonlinear solve goes, beside one linear solve on the same mesh.

``python3 -m scripts.benchmarks.phases DIM N [cold]``: seconds of this process by phase, with how
often each has been gone through, as JSON; cold: without coarser meshes. Calls alone that the
profiler sees are measured: a phase is a function of the program.
"""

from __future__ import annotations

import cProfile
import json
import pstats
import sys
import time
from collections.abc import Callable
from typing import Any, TypeVar

from contact import build_problem, solve
from scripts.benchmarks.bench_one import one_linear_solve, problem_case, solved, unknowns

#: Phase -> the end of the file's name, and the function. None of them calls another one, but that a
#: factorisation for a Schur complement is a set-up too.
PHASES = {
    "assembly of matrices": ("body/equilibrium.py", "assemble"),
    "set-up of multigrid, factorisation": ("~", "<method 'setUp' of 'petsc4py.PETSc.KSP' objects>"),
    "Schur complement, factorisation": ("linear/schur.py", "complement"),
    "contact in multigrid": ("linear/multigrid.py", "follow"),
    "iterations, solves": ("~", "<method 'solve' of 'petsc4py.PETSc.KSP' objects>"),
    "solves with the factors": ("~", "<method 'matSolve' of 'petsc4py.PETSc.Mat' objects>"),
    "residual forces": ("body/loads.py", "assembled"),
    "contact laws": ("interface/complementarity.py", "linearise"),
    "iterations on the condensed problem": ("methods/newton.py", "_on_contact_nodes"),
    "transfer from mesh to mesh": ("refining.py", "prolong"),
}

Result = TypeVar("Result")


def profiled(action: Callable[[], Result]) -> tuple[Result, float, dict[str, tuple[int, float]]]:
    """Return the value of an action, its seconds, and counts and seconds of the phases."""
    profile = cProfile.Profile(time.process_time)
    result = profile.runcall(action)
    stats: Any = pstats.Stats(profile)
    found = {}
    for (file, _, function), (_, count, _, seconds, _) in stats.stats.items():
        for phase, (place, name) in PHASES.items():
            if file.endswith(place) and function == name:
                found[phase] = (count, seconds)
    return result, stats.total_tt, found


def costs(dimension: int, n: int, start: str = "") -> dict[str, Any]:
    """Measure a nonlinear solve and one linear solve."""
    case = problem_case(dimension, n)
    solve(build_problem(problem_case(dimension, 4)), case.solver)  # compiles the forms
    problem = build_problem(case)

    _, one, linear = profiled(lambda: one_linear_solve(problem))
    (solution, _), whole, newton = profiled(lambda: solved(case, problem, start))
    if not solution.counters.contact_solves:
        newton.pop("iterations on the condensed problem", None)
    nothing = (0, 0.0)
    return {
        "unknowns": unknowns(problem),
        "phases": {p: (*linear.get(p, nothing), *newton.get(p, nothing)) for p in PHASES},
        "linear": one,
        "whole": whole,
    }


def main() -> None:
    """Print the measurements."""
    dimension, n, *start = sys.argv[1:]
    print(json.dumps(costs(int(dimension), int(n), *start)))


if __name__ == "__main__":
    main()
