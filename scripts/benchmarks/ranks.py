"""Memory and messages of ranks in a nonlinear solve.

``mpirun -n P python3 -m scripts.benchmarks.ranks DIM N``: the sum of the ranks' peak memory beyond
that of the libraries once they are loaded, and in 3-D the messages and reductions of the linear
solves, as PETSc counts them. Counts do not depend on the machine, nor on how many cores it has.
"""

from __future__ import annotations

import json
import sys
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

from contact import build_problem, solve
from scripts.benchmarks.bench_one import block, memory, problem_case, unknowns

COMM = MPI.COMM_WORLD


def told(event: str) -> dict[str, float]:
    """Return the bytes that a rank sends on average in all calls of one of PETSc's events."""
    info = PETSc.Log.Event(event).getPerfInfo()
    sums = {
        name: COMM.allreduce(float(info[name]), op=MPI.SUM) / COMM.size
        for name in ("numMessages", "messageLength", "numReductions", "count")
    }
    return {
        "messages": sums["numMessages"],
        "bytes": sums["messageLength"],
        "reductions": sums["numReductions"],
        "calls": sums["count"],
    }


def costs(dimension: int, n: int) -> dict[str, Any]:
    """Measure a nonlinear solve."""
    PETSc.Log.begin()
    # Multigrid also on meshes that a direct solver would take less time for: they are the samples.
    case = block(n, linear="iterative") if dimension == 3 else problem_case(dimension, n)
    solve(build_problem(problem_case(dimension, 4)), case.solver)  # compiles the forms
    libraries = memory()
    problem = build_problem(case)
    before = told("KSPSolve"), told("PCSetUp")
    solution = solve(problem, case.solver)
    size = unknowns(problem)
    result = {
        "ranks": COMM.size,
        "unknowns": size,
        "converged": solution.converged,
        "bytes an unknown": (memory() - libraries) / size,
        "libraries (MB)": libraries / 1e6,
    }
    iterations = solution.counters.linear_iterations
    if iterations == 0:
        return result
    for name, then, event in zip(
        ("an iteration", "a set-up"), before, ("KSPSolve", "PCSetUp"), strict=True
    ):
        now = told(event)
        rest = {key: now[key] - then[key] for key in now}
        by = iterations if event == "KSPSolve" else max(rest["calls"], 1.0)
        result[f"messages of a rank in {name}"] = rest["messages"] / by
        result[f"bytes of a message in {name}"] = rest["bytes"] / max(rest["messages"], 1.0)
        result[f"reductions in {name}"] = rest["reductions"] / by
    return {**result, "iterations": iterations, "solves": solution.counters.linear_solves}


if __name__ == "__main__":
    found = costs(int(sys.argv[1]), int(sys.argv[2]))
    if COMM.rank == 0:
        print(json.dumps(found))
