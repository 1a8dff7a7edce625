"""Robustness sweep: some 300 problems, how many converge by each method, and their costs.

`python3 -m scripts.studies.sweep [--out DIR] [--coarse] [--methods newton uzawa] [--only NAME]
[--hard | --cells] [--seed N]`, also under mpirun. The problems are drawn once, with a fixed seed,
from the ranges below; with --hard from those of `hard_problems`, with --cells on all shapes of
cells from those of `cell_problems`. With several methods the table says how far
their displacements are from those of the first, relative to the largest.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from mpi4py import MPI

from contact import Solution, build_problem, solve
from contact.case.file import Case, parse_case
from contact.methods.options import OPTIONS, with_method
from scripts.reporting import Report, append, parser
from scripts.studies import cell_problems, hard_problems

METHODS = ("newton", "uzawa")
#: How many problems of each family; --coarse takes a tenth.
COUNTS = {"bar": 120, "piezo": 60, "layer": 40, "hertz": 30, "block": 50}
SEED = 20240229
NOTE = (
    "Problems are drawn with a fixed seed: loads, friction, cells, degrees and geometries. A "
    "fallback is any method that Newton's method takes beside its own steps; solves are linear "
    "ones. The difference is that of displacements to those of the first method, over the largest "
    "displacement."
)
#: Difference from which on two methods are said not to agree.
AGREE = 1e-7


def _rectangle(rng: np.random.Generator, size: list[float], n: int) -> dict[str, Any]:
    return {
        "generator": "rectangle",
        "size": size,
        "cells": [round(n * size[0] / size[1]), n],
        "rotation": float(rng.choice([0.0, 0.0, 30.0])),
    }


def _turned(force: tuple[float, float], degrees: float) -> list[float]:
    angle = np.deg2rad(degrees)
    c, s = np.cos(angle), np.sin(angle)
    return [float(c * force[0] - s * force[1]), float(s * force[0] + c * force[1])]


def _friction(rng: np.random.Generator, slip_length: float, radius: float = 0.0) -> dict[str, Any]:
    """Draw mu from 0 to 1, constant or falling with the slip, rho from 0 to 6e7 a length."""
    mu = float(rng.choice([0.0, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0]))
    if mu == 0.0:
        return {"law": "none"}
    rho = float(rng.choice([0.0, 1e2, 1e4, 1e5, 1e6, 6e7])) / slip_length
    law = {"law": "slip", "a": mu * 5 / 6, "b": mu / 3, "rho": rho}
    return {"law": "coulomb", "mu": law if rho > 0 else mu, "radius": radius}


def bar(rng: np.random.Generator) -> dict[str, Any]:
    """Draw Example 7.2: loads 1 to 10 times the printed ones, P1 and P2, gaps."""
    mesh = _rectangle(rng, [4.0, 1.0], int(rng.choice([8, 16, 32])))
    mesh["parts"] = {"loaded": {"side": "top", "from": 2.0, "to": 4.0}}
    load = -0.005 * float(rng.choice([1, 3, 10]))
    direction = str(rng.choice(["body", "foundation"]))
    angle = np.deg2rad(mesh["rotation"])
    gap = float(rng.choice([0.0, 0.0, 0.002]))
    normal = [float(-np.sin(angle)), float(np.cos(angle))]
    plane = {"shape": "plane", "point": [-gap * normal[0], -gap * normal[1]], "normal": normal}
    return {
        "mesh": mesh,
        "space": {"degree": int(rng.choice([1, 1, 2]))},
        "material": {
            "law": str(rng.choice(["log", "log", "linear"])),
            "young": 1.0,
            "poisson": float(rng.choice([0.1, 0.3, 0.45])),
            "yield_strain": 0.05,
        },
        "fixed": [{"on": "left", "displacement": [0.0, 0.0]}],
        "load": [{"on": "loaded", "traction": _turned((0.0, load), mesh["rotation"])}],
        "contact": {"on": "bottom", "foundation": plane, "direction": direction},
        "friction": _friction(rng, 1.0, float(rng.choice([0.0, 0.0, 0.1]))),
    }


def _pzt() -> dict[str, float]:
    return {"e31": -5.4, "e33": 15.8, "e15": 12.3, "beta11": 8.13866, "beta33": 7.37455}


def piezo(rng: np.random.Generator) -> dict[str, Any]:
    """Draw Examples 8.1 and 8.2: k_e 0 to 10, phi_F 0 to 32, loads to 15 x."""
    n = int(rng.choice([8, 16]))
    case = {
        "mesh": {"generator": "rectangle", "size": [8.0, 4.0], "cells": [2 * n, n]},
        "space": {"degree": int(rng.choice([1, 1, 2]))},
        "material": {
            "law": str(rng.choice(["linear", "log"])),
            "young": 58.7102,
            "poisson": 0.3912,
            "yield_strain": 1.8,
            "piezo": _pzt(),
        },
        "fixed": [{"on": "left", "displacement": [0.0, 0.0], "potential": 0.0}],
        "load": [{"on": "top", "traction": [0.0, f"{-float(rng.choice([5, 10, 15]))}*x"]}],
        "contact": {"on": "bottom"},
        "friction": _friction(rng, 1e4),
    }
    k_e = float(rng.choice([0.0, 1e-3, 1e-1, 1.0, 10.0]))
    if k_e > 0:
        phi_f = float(rng.choice([0.0, 8.0, 32.0]))
        case["electric"] = {"law": "shifted", "k_e": k_e, "phi_f": phi_f}
    return case


def layer(rng: np.random.Generator) -> dict[str, Any]:
    """Draw Examples 8.3 and 8.4: a compliant layer or none, mu = k_e from 0 to 0.6."""
    n = int(rng.choice([8, 16]))
    small = float(rng.choice([0.0, 1e-6, 1e-4, 1e-2, 0.2, 0.6]))
    piece = [{"side": "top"}, {"side": "bottom", "to": 2.0}, {"side": "bottom", "from": 10.0}]
    case = {
        "mesh": {
            "generator": "rectangle",
            "size": [12.0, 2.0],
            "cells": [6 * n, n],
            "parts": {
                "foundation": {"side": "bottom", "from": 2.0, "to": 10.0},
                "grounded": piece,
            },
        },
        "material": {
            "law": "log",
            "young": 58.7102,
            "poisson": 0.3912,
            "yield_strain": 1.8,
            "piezo": _pzt(),
        },
        "fixed": [
            {"on": "left", "displacement": [0.0, 0.0]},
            {"on": "right", "displacement": [0.0, 0.0]},
            {"on": "grounded", "potential": 0.0},
        ],
        "load": [{"on": "grounded", "traction": [0.0, -float(rng.choice([3.0, 5.0, 8.0]))]}],
        "contact": {
            "on": "foundation",
            "law": "compliance",
            "gap": float(rng.choice([0.3, 0.5])),
            "layer": float(rng.choice([0.0, 0.1])),
            "stiffness": float(rng.choice([1.0, 10.0, 100.0])),
            "limit": 0.1,
            "potential_factor": float(rng.choice([1.0, 2.0])),
        },
        "friction": {"law": "coulomb", "mu": small} if small > 0 else {"law": "none"},
    }
    if small > 0:
        case["electric"] = {"law": "shifted", "k_e": small, "phi_f": 32.0}
    return case


def hertz(rng: np.random.Generator) -> dict[str, Any]:
    """Draw Example 7.1: both contact directions, loads 160 to 1600, mu 0 to 1."""
    load = float(rng.choice([160.0, 800.0, 1600.0])) / 16
    plane = {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
    fine = float(rng.choice([0.1, 0.2]))
    return {
        "mesh": {"generator": "quarter_disc", "radius": 8.0, "contact_size": fine},
        "material": {
            "law": "linear",
            "young": 2000.0,
            "poisson": float(rng.choice([0.1, 0.3, 0.45])),
        },
        "fixed": [{"on": "symmetry", "displacement": [0.0, "free"]}],
        "load": [{"on": "top", "traction": [0.0, -load]}],
        "contact": {
            "on": "contact",
            "foundation": plane,
            "direction": str(rng.choice(["foundation", "body"])),
        },
        "friction": _friction(rng, 1.0),
    }


def block(rng: np.random.Generator) -> dict[str, Any]:
    """Draw a block in 3-D, clamped on one side, pressed and pushed aside on top."""
    n = int(rng.choice([4, 6]))
    push, press = 0.005 * float(rng.choice([0, 1, 2])), -0.01 * float(rng.choice([1, 3]))
    return {
        "mesh": {"generator": "box", "size": [2.0, 1.0, 1.0], "cells": [2 * n, n, n]},
        "space": {"degree": int(rng.choice([1, 1, 1, 2])) if n == 4 else 1},
        "material": {
            "law": str(rng.choice(["linear", "log"])),
            "young": 1.0,
            "poisson": float(rng.choice([0.1, 0.3, 0.45])),
            "yield_strain": 0.02,
        },
        "fixed": [{"on": "left", "displacement": [0.0, 0.0, 0.0]}],
        "load": [{"on": "top", "traction": [0.0, push, press]}],
        "contact": {"on": "bottom", "gap": float(rng.choice([0.0, 0.0, 0.005]))},
        "friction": _friction(rng, 1.0),
    }


FAMILIES = {"bar": bar, "piezo": piezo, "layer": layer, "hertz": hertz, "block": block}


def problems(
    coarse: bool,
    only: str | None = None,
    hard: bool = False,
    cells: bool = False,
    seed: int = SEED,
) -> Iterator[tuple[str, Case]]:
    """Draw the problems, the same ones on every machine and rank."""
    families, counts, key = FAMILIES, COUNTS, [seed]
    if hard:
        families, counts, key = hard_problems.FAMILIES, hard_problems.COUNTS, [seed, 1]
    if cells:
        families = cell_problems.families((bar, piezo, layer), (block,))
        counts, key = dict.fromkeys(families, cell_problems.COUNT), [seed, 2]
    for number, (name, draw) in enumerate(families.items()):
        rng = np.random.default_rng([*key, number])
        for k in range(counts[name] // 10 if coarse else counts[name]):
            case = parse_case(draw(rng), source=f"{name}-{k}")
            if only is None or case.source == only or name == only:
                yield name, case


def on_cells(case: Case, cell: str) -> Case:
    """Return a problem on a grid with cells of another shape."""
    return case.model_copy(update={"mesh": case.mesh.model_copy(update={"cell": cell})})


def main(arguments: Sequence[str] | None = None) -> None:
    """Solve all problems by all methods and write the results."""
    command = parser(__doc__, "sweep")
    command.add_argument("--methods", nargs="+", default=list(METHODS), choices=METHODS)
    command.add_argument("--only", help="a family, or one problem such as bar-7")
    kinds = command.add_mutually_exclusive_group()
    kinds.add_argument("--hard", action="store_true", help="those that bend, stick and stretch")
    kinds.add_argument("--cells", action="store_true", help="those on cells of all shapes")
    command.add_argument("--seed", type=int, default=SEED, help="of the drawn problems")
    given = command.parse_args(arguments)
    keys = (
        "problem",
        "method",
        "converged",
        "solves",
        "seconds",
        "why",
        "difference",
        "mu",
        "critical",
    )
    rows: dict[str, list[Any]] = {key: [] for key in keys}
    drawn = problems(given.coarse, given.only, given.hard, given.cells, given.seed)
    for _, case in drawn:
        problem, first = build_problem(case), None
        law = problem.interface.friction.law
        for method in given.methods:
            begin = time.perf_counter()
            settings = with_method(case.solver, OPTIONS[method])
            solution = solve(problem, settings)
            notes = {r.note for r in solution.history.records}
            own = "chord step", "tangent", "rejected", "initial guess"
            for word in own:
                notes = {note.replace(word, "").strip(" ,") for note in notes}
            fallback = ", ".join(sorted(notes - {""}))
            row = (
                case.source,
                method,
                solution.converged,
                solution.counters.linear_solves,
                round(time.perf_counter() - begin, 2),
                fallback if solution.converged else solution.outcome.reason,
                _difference(solution, first or solution),
                0.0 if law is None else float(np.max(law.maximum)),
                solution.critical_factor,
            )
            first = first or solution
            append(rows, *row)
            if MPI.COMM_WORLD.rank == 0 and (
                not solution.converged or fallback or not row[-3] <= AGREE or row[-1] <= 1
            ):
                print(*row, flush=True)
    report = Report(given.out)
    name = "sweep-hard" if given.hard else "sweep-cells" if given.cells else "sweep"
    report.numbers(name, rows)
    report.table(f"{name}-summary", "Robustness sweep", summary(rows, given.methods), NOTE)


def _difference(solution: Solution, other: Solution) -> float:
    """Return the largest difference of displacements over the largest one. Collective."""
    u, v = solution.displacement.x.array, other.displacement.x.array
    sizes = np.array([np.abs(u - v).max(initial=0.0), np.abs(v).max(initial=0.0)])
    MPI.COMM_WORLD.Allreduce(MPI.IN_PLACE, sizes, op=MPI.MAX)
    return float(sizes[0] / (sizes[1] or 1.0))


def summary(rows: dict[str, list[Any]], methods: Sequence[str]) -> dict[str, list[Any]]:
    """Count by family and method."""
    table: dict[str, list[Any]] = {
        "family": [],
        "method": [],
        "problems": [],
        "converged": [],
        "without fallback": [],
        "median solves": [],
        "most solves": [],
        "largest difference": [],
    }
    family = np.array([name.rsplit("-", 1)[0] for name in rows["problem"]])
    for name in dict.fromkeys(family):
        for method in methods:
            chosen = (family == name) & (np.array(rows["method"]) == method)
            converged = np.array(rows["converged"])[chosen]
            plain = np.array([why == "" for why in rows["why"]])[chosen]
            solves = np.array(rows["solves"])[chosen]
            values = (name, method, chosen.sum(), converged.sum(), (converged & plain).sum())
            both = np.array(rows["difference"])[chosen & np.array(rows["converged"])]
            values += (int(np.median(solves)), solves.max(), both.max(initial=0.0))
            append(table, *values)
    return table


if __name__ == "__main__":
    main()
