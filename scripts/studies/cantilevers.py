"""Cantilevers over a stop: costs of contact beside linear solves of the same mesh.

`python3 -m scripts.studies.cantilevers [--out DIR] [--coarse]`, on one rank. A beam 100 x 1 bends
over a gap of half its height, under a load at its tip or all along it. Each problem has been solved
before, so that forms are compiled. Beside the solve stand the processor's time of one by
`dolfinx.fem.petsc.LinearProblem` on the same mesh, without contact, as a user writes it; that of an
assembly, a factorisation and a solve with forms and matrix at hand; and that of the same program
where nothing is in the way. The last two columns compare whole runs with the latter, meshes and
spaces included: as the program runs them, and all from zero, without nested iteration.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem.petsc import LinearProblem

from contact import build_problem, solve
from contact.case.file import parse_case
from contact.problem.problem import ContactProblem
from scripts.benchmarks.bench_one import one_linear_solve
from scripts.reporting import Report, parser

TIP = {"on": "right", "traction": [0.0, -1e-4]}
UNIFORM = {"on": "top", "traction": [0.0, -1e-5]}

#: Name, load, cells, degree, mu: each on a coarse mesh and on one with 4 times the cells a side.
PROBLEMS = [
    (name, load, [factor * cells for cells in mesh], degree, mu)
    for factor in (1, 4)
    for name, load, mesh, degree, mu in (
        ("tip", TIP, (200, 2), 1, 0.0),
        ("tip", TIP, (200, 2), 1, 0.3),
        ("tip", TIP, (200, 2), 2, 0.0),
        ("tip", TIP, (200, 2), 2, 0.3),
        ("uniform", UNIFORM, (400, 4), 1, 0.0),
    )
]

#: The gap, and one that nothing closes.
GAP, FAR = 0.5, 1e9

#: Repetitions, of which the median counts.
TIMES = 5

#: How dolfinx is told to take MUMPS.
MUMPS = {"ksp_type": "preonly", "pc_type": "lu", "pc_factor_mat_solver_type": "mumps"}


def cantilever(
    load: dict[str, Any], cells: list[int], degree: int, mu: float, gap: float
) -> dict[str, Any]:
    """Return the case of a beam clamped at its left end."""
    return {
        "mesh": {"generator": "rectangle", "size": [100.0, 1.0], "cells": cells},
        "space": {"degree": degree},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "left", "displacement": [0.0, 0.0]}],
        "load": [load],
        "contact": {"on": "bottom", "gap": gap},
        "friction": {"law": "coulomb", "mu": mu} if mu > 0 else {"law": "none"},
    }


def plain(problem: ContactProblem, load: dict[str, Any]) -> fem.Function:
    """Solve for the beam without contact, as a user of dolfinx does."""
    domain, degree = problem.domain, problem.body.degree
    space = fem.functionspace(domain.mesh, ("Lagrange", degree, (2,)))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    shear, lame = 1 / 2.6, 0.3 / (1.3 * 0.4)
    product = 2 * shear * ufl.inner(ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v)))
    stiffness = (product + lame * ufl.div(u) * ufl.div(v)) * ufl.dx
    traction = fem.Constant(domain.mesh, tuple(load["traction"]))
    work = ufl.inner(traction, v) * domain.ds(load["on"])
    nodes = fem.locate_dofs_topological(space, 1, domain.facets("left"))
    clamped = fem.dirichletbc(np.zeros(2), nodes, space)
    return LinearProblem(stiffness, work, bcs=[clamped], petsc_options=MUMPS).solve()


def median(work: Callable[[], Any]) -> float:
    """Return the processor's seconds of a repeated action."""
    taken = []
    for _ in range(TIMES):
        begin = time.process_time()
        work()
        taken.append(time.process_time() - begin)
    return float(np.median(taken))


def compare(
    name: str, load: dict[str, Any], cells: list[int], degree: int, mu: float
) -> dict[str, Any]:
    """Solve a problem, and time the linear solves beside it."""
    near, far = (parse_case(cantilever(load, cells, degree, mu, gap)) for gap in (GAP, FAR))
    problem, free = build_problem(near), build_problem(far)
    solution = solve(problem, near.solver)
    solve(free, far.solver)
    seconds = median(lambda: solve(problem, near.solver))
    others = {
        "dolfinx": median(lambda: plain(problem, load)),
        "bare": float(np.median([one_linear_solve(problem)[0] for _ in range(TIMES)])),
        "free": median(lambda: solve(free, far.solver)),
    }
    cold = near.solver.model_copy(update={"nested": False})
    run = median(lambda: solve(far, cold))
    runs = {"run": median(lambda: solve(near)), "run from zero": median(lambda: solve(near, cold))}
    return {
        "load": name,
        "cells": f"{cells[0]} x {cells[1]}",
        "degree": degree,
        "mu": mu,
        "nodes that touch": int(np.count_nonzero(solution.status != "open")),
        "force": float(solution.contact_force[1]),
        "converged": solution.converged,
        "factorisations": solution.counters.factorizations,
        "solves": solution.counters.linear_solves,
        "condensed iterations": solution.counters.contact_solves,
        "ms": 1e3 * seconds,
        **{f"over {other}": seconds / taken for other, taken in others.items()},
        **{f"{kind} over free run": taken / run for kind, taken in runs.items()},
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Solve all and say how they compare."""
    given = parser(__doc__, "cantilevers").parse_args(arguments)
    rows: dict[str, list[Any]] = {}
    for problem in PROBLEMS[: 4 if given.coarse else None]:
        for key, value in compare(*problem).items():
            rows.setdefault(key, []).append(value)
    caption = (
        "cantilevers over a stop: milliseconds of the processor for a solve, and these over a "
        "linear solve by dolfinx's LinearProblem, one with forms and matrix at hand, and the same "
        "program without contact, all from zero; whole runs over those without contact"
    )
    Report(given.out).table("cantilevers", caption, rows)


if __name__ == "__main__":
    main()
