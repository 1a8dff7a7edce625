"""Fresh random problems of two and more bodies, judged by an assembly of its own.

Rings between plates, stacks, wedges, snap fits, bodies that lift off, tilted indenters, compliant
layers, small bodies with two contacts, unstructured meshes. Meshes are written by numpy, and each
result is looked at in its files by `fresh_check`, which knows nothing of the package.

`python3 -m scripts.studies.fresh_problems [--out DIR] [--coarse] [--count N] [--only NAME]`
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from contact import InputError, Solution, solve
from contact.case.file import Case, parse_case
from contact.case.text import to_toml
from contact.writing import write_outputs
from scripts.reporting import Report, append, parser
from scripts.studies.fresh_check import Mesh, recheck
from scripts.studies.fresh_families import FAMILIES, Bodies, Rng, Tables, draw

#: Largest error of a check that is not false, by its name; 1e-6 of all others.
ALLOWED = {"normal turned": 0.3, "status": 0.5}
SMALL = 1e-6
#: Largest component of friction along the normal, over the largest pressure.
ALONG = 1e-14
#: Linear solves of a step of a linear material that is slow.
SLOW = 20


def along_normal(solution: Solution) -> float:
    """Return the largest normal component of friction over the largest stress of both.

    That is the largest pressure but for bodies that touch nothing, where rounding is left of both.
    """
    nodes, forces = solution.problem.nodes, solution.forces
    stresses = np.abs(forces.pressure), np.abs(forces.friction)  # their squares may underflow
    scale = max(stress.max(initial=0.0) for stress in stresses)
    largest = np.abs(nodes.normal_component(forces.friction)).max(initial=0.0)
    return float(largest / max(scale, 1e-300))


def judge(mesh: Mesh, tables: Tables, solution: Solution, folder: Path) -> dict[str, float]:
    """Write the results of a solution, and return the errors that are more than allowed."""
    write_outputs(solution, folder)
    found = recheck(mesh, tables, folder)
    wrong = {name: value for name, value in found.items() if not value <= ALLOWED.get(name, SMALL)}
    if (off := along_normal(solution)) > ALONG:
        wrong["along the normal"] = off
    return wrong


def solves(solution: Solution) -> tuple[float, ...]:
    """Return the solves of the body, of its contact nodes, and both in linear solves, a step.

    A dense step of k unknowns has k^3 operations, a sparse factorisation of n with fronts of b
    n b^2, at a fiftieth of the speed (`contact.problem.condensed.condensation_pays`).
    """
    steps, counters, problem = max(1, len(solution.steps)), solution.counters, solution.problem
    n, k = problem.equilibrium.layout.unknowns, 2 * problem.nodes.size
    dense = min(1.0, k**3 / (50 * n * (2 * n / k) ** 2))
    whole = counters.linear_solves + counters.factorizations - 1
    numbers = counters.linear_solves, counters.contact_solves
    return tuple(number / steps for number in (*numbers, whole + dense * counters.contact_solves))


def main(arguments: Sequence[str] | None = None) -> int:
    """Solve the problems, and list those that are false, not converged, refused or slow."""
    command = parser(__doc__, "fresh_problems")
    command.add_argument("--count", type=int, help="number of problems of each family")
    command.add_argument("--only", help="a family, or one problem such as rings-7")
    given = command.parse_args(arguments)
    names = "problem", "end", "solves", "dense", "cost", "seconds", "words"
    rows: dict[str, list[Any]] = {name: [] for name in names}
    for family, count in FAMILIES.items():
        for number in range(given.count or (max(1, count // 20) if given.coarse else count)):
            name = f"{family.__name__}-{number}"
            if given.only in (None, name, family.__name__):
                append(rows, name, *_one(family, number, given.out / name))
                if rows["end"][-1] != "right":
                    print(*(rows[key][-1] for key in names), flush=True)
    Report(given.out).numbers("fresh-problems", rows)
    Report(given.out).table("fresh-problems-table", "Fresh problems", summary(rows))
    return 1 if "false" in rows["end"] else 0


def _one(family: Callable[[Rng, Bodies], Tables], number: int, kept: Path) -> tuple[Any, ...]:
    """Solve a problem; return its end, solves, seconds and words. Those not right are kept."""
    begin = time.perf_counter()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        mesh, tables = draw(family, number, folder)
        case: Case = parse_case(tables, source=f"{family.__name__}-{number}")
        try:
            solution = solve(case, comm=MPI.COMM_SELF)
        except InputError as error:
            end, numbers, words = "refused", (0.0, 0.0, 0.0), str(error)
        else:
            numbers = solves(solution)
            linear = all(one.get("law", "linear") == "linear" for one in tables["material"])
            end, words = "right", ""
            if not solution.converged:
                end, words = "not converged", solution.outcome.reason
            elif wrong := judge(mesh, tables, solution, folder / "out"):
                end, words = "false", ", ".join(f"{k} {v:.1e}" for k, v in wrong.items())
            elif linear and numbers[2] > SLOW:
                notes = {record.note for record in solution.history.records} - {""}
                end, words = "slow", "; ".join(sorted(notes))
        if end != "right":
            kept.mkdir(parents=True, exist_ok=True)
            (kept / "body.msh").write_bytes((folder / "body.msh").read_bytes())
            text = to_toml(case).replace(str(folder / "body.msh"), "body.msh")
            (kept / "case.toml").write_text(text)
    seconds = round(time.perf_counter() - begin, 2)
    return end, *(round(value, 1) for value in numbers), seconds, words


def summary(rows: dict[str, list[Any]]) -> dict[str, list[Any]]:
    """Count by family."""
    ends = ("right", "slow", "not converged", "refused", "false")
    table: dict[str, list[Any]] = {
        name: []
        for name in (
            "family",
            "problems",
            *ends,
            "median solves",
            "most",
            "most dense",
            "most cost",
        )
    }
    family = np.array([name.rsplit("-", 1)[0] for name in rows["problem"]])
    end = np.array(rows["end"])
    for name in [*dict.fromkeys(family), "all"]:
        chosen = (family == name) | (name == "all")
        keys = "solves", "dense", "cost"
        whole, dense, costs = (np.array(rows[key])[chosen] for key in keys)
        counts = [int(np.sum(end[chosen] == word)) for word in ends]
        append(
            table, str(name), int(chosen.sum()), *counts,
            float(np.median(whole)), whole.max(), dense.max(), costs.max(),
        )  # fmt: skip
    return table


if __name__ == "__main__":
    sys.exit(main())
