"""One measurement of the benchmark, in a process of its own; prints one line of JSON.

Start it as `python3 -m scripts.benchmarks.bench_one` with one of::

    bar N MU                       Example 7.2, linear material, constant mu
    hertz DISC.msh MU              Example 7.1 on a mesh file, constant mu
    block N MU                     a block in 3-D, linear material, constant mu
    ratio DIM N [cold]             a nonlinear solve and one linear solve; cold: on that mesh alone
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from contact import Case, build_problem, load_case, solve
from contact.case.file import parse_case
from contact.case.mesh import Mesh
from contact.linear.operator import SparseOperator
from contact.problem.problem import ContactProblem
from contact.refining import default_start
from contact.solution import Solution
from scripts.cases import CASES, bar

COMM = MPI.COMM_WORLD


#: Materials of the block.
LINEAR = {"young": 1.0, "poisson": 0.3}
HENCKY = {**LINEAR, "law": "log", "yield_strain": 0.02}


def block(n: int, material: Mapping[str, Any] = HENCKY, mu: float = 0.3, **solver: Any) -> Case:
    """Return a block of 2 x 1 x 1 with Coulomb friction, in 3-D."""
    return parse_case(
        {
            "title": "block",
            "mesh": {"generator": "box", "size": [2.0, 1.0, 1.0], "cells": [2 * n, n, n]},
            "material": material,
            "fixed": [{"on": "left", "displacement": [0.0, 0.0, 0.0]}],
            "load": [{"on": "top", "traction": [0.0, 0.005, -0.02]}],
            "contact": {"on": "bottom"},
            "friction": {"law": "coulomb", "mu": mu},
            "solver": {"method": "newton", **solver},
        }
    )


def problem_case(dimension: int, n: int, *changes: str) -> Case:
    """Return the bar of Example 7.2 in the plane, the block in 3-D."""
    if dimension == 3:
        return block(n)
    return bar(n, -0.05, 1e5, "friction.mu=0.5", *changes)


def rank_memory() -> float:
    """Return the peak memory of this rank (bytes)."""
    # Not that of `getrusage`: it is at least that of the process that has started this one.
    status = Path("/proc/self/status").read_text()
    return float(status.split("VmHWM:")[1].split()[0]) * 1024


def memory() -> float:
    """Return the peak memory of all ranks (bytes)."""
    return float(COMM.allreduce(rank_memory(), op=MPI.SUM))


def unknowns(problem: ContactProblem) -> int:
    """Return the number of unknowns over all ranks."""
    return problem.body.layout.unknowns


def described(solution: Solution) -> dict[str, Any]:
    """Return the columns of a solution in the tables."""
    body = solution.problem.body
    u = solution.state.x.reshape(-1, body.block_size)[:, : body.dim]
    largest = float(np.linalg.norm(u, axis=1).max(initial=0.0))
    return {
        "unknowns": unknowns(solution.problem),
        "converged": solution.converged,
        "solves": solution.counters.linear_solves,
        "factorizations": solution.counters.factorizations,
        "linear_iterations": solution.counters.linear_iterations,
        "contact_solves": solution.counters.contact_solves,
        "solve": solution.seconds["solve"],
        "max_displacement": COMM.allreduce(largest, op=MPI.MAX),
    }


def beside_getfem(name: str, mesh: str, mu: str) -> dict[str, Any]:
    """Measure a problem that GetFEM solves too, once its forms are compiled."""
    friction = f"friction.mu={mu}"
    if name == "bar":
        case, small = (bar(n, -0.005, 1.0, "material.law=linear", friction) for n in (int(mesh), 4))
    elif name == "block":
        case, small = (block(n, LINEAR, float(mu)) for n in (int(mesh), 4))
    else:
        small = load_case(CASES / "hertz.toml", [friction])
        case = small.model_copy(update={"mesh": Mesh(file=mesh)})
    solve(build_problem(small), small.solver)
    return described(solve(build_problem(case), case.solver))


def one_linear_solve(problem: ContactProblem) -> tuple[float, int]:
    """Return the CPU seconds and iterations of a linear elasticity solve, setup included."""
    body, nodes = problem.body, problem.nodes.nodes
    COMM.Barrier()
    begin = time.process_time()
    operator = SparseOperator(body, nodes)
    blocks = np.zeros((nodes.size, body.block_size, body.block_size))
    operator.update("secant", problem.start(), blocks)
    operator.solve(body.external(), 1e-8)
    return time.process_time() - begin, operator.counters.linear_iterations


def solved(case: Case, problem: ContactProblem, start: str) -> tuple[Solution, float]:
    """Solve from zero: on the finest mesh alone if the start is cold, else as the program does.

    The second is the time of the review behind it: the error estimate and remarks (s).
    """
    begun = None if start == "cold" else default_start(case, problem)
    begin = time.perf_counter()
    solution = solve(problem, case.solver, start=begun)
    return solution, time.perf_counter() - begin - sum(solution.seconds.values())


def ratio(dimension: str, n: str, start: str = "") -> dict[str, Any]:
    """Measure a nonlinear solve in units of one linear solve on the same mesh, in CPU seconds.

    The medians of three runs, in which the two take turns; of large problems in 3-D of one.
    """
    case = problem_case(int(dimension), int(n))
    solve(build_problem(problem_case(int(dimension), 4)), case.solver)  # compiles the forms
    times = []
    for _ in range(1 if dimension == "3" and int(n) > 30 else 3):
        problem = build_problem(case)
        linear, iterations = one_linear_solve(problem)
        begin, computing = time.perf_counter(), time.process_time()
        solution, reviewed = solved(case, problem, start)
        computed, seconds = time.process_time() - computing, time.perf_counter() - begin
        without = (computed - reviewed) / linear
        times.append((seconds, computed, reviewed, linear, computed / linear, without))
        result = described(solution)
        del solution  # else it would lie beside the next
    seconds, computed, reviewed, linear, quotient, without = np.median(times, axis=0).tolist()
    return {
        "unknowns": result["unknowns"],
        "converged": result["converged"],
        "solves": result["solves"],
        "set-ups": result["factorizations"],
        "contact solves": result["contact_solves"],
        "iterations a solve": result["linear_iterations"] / result["solves"],
        "of one solve": iterations,
        "seconds": seconds,
        "CPU seconds": computed,
        "review": reviewed,
        "one": linear,
        "ratio": quotient,
        "without review": without,
        "bytes an unknown": memory() / result["unknowns"],
    }


def main() -> None:
    """Make the measurement that the command line names."""
    import logging

    logging.getLogger("contact").setLevel(logging.ERROR)
    name, *rest = sys.argv[1:]
    result = ratio(*rest) if name == "ratio" else beside_getfem(name, *rest)
    if COMM.rank == 0:
        print(json.dumps(result))


if __name__ == "__main__":
    main()
