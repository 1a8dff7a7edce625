"""Random problems: how many are solved, by which method, at which cost, and whether they are right.

`python3 -m scripts.studies.robustness KIND [--out DIR] [--coarse] [--methods newton uzawa]
[--only NAME] [--seed N]`. Kinds: plain (300 problems like those of the thesis), hard (340 that
bend, stick, stretch and harden), cells (200 on cells of all shapes and degrees), bodies (500 of
several bodies, checked by an independent assembly), held (400 that friction alone holds), plastic
(60 evolutions of metals, checked by their energies), pairs (100 blocks on each other). All but
bodies and held also run under mpirun. docs/robustness.md has the tables.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from contact import InputError, Solution, build_problem, solve
from contact.methods.options import OPTIONS, with_method
from contact.writing import write_outputs
from scripts.reporting import Report, parser
from scripts.studies.robustness.check import recheck
from scripts.studies.robustness.problems import KINDS, Problem, problems

METHODS = ("newton", "uzawa")
#: Largest errors of the checks by their names, and of all others.
ALLOWED = {"normal turned": 0.3, "status": 0.5, "energies": 0.05, "along the normal": 1e-14}
SMALL = 1e-6
#: Difference of the displacements from which on two methods do not agree.
AGREE = 1e-7
#: Notes on steps of Newton's method itself.
OWN = "chord step", "tangent", "rejected", "initial guess"


def along_normal(solution: Solution) -> float:
    """Return the largest normal component of friction over the largest stress."""
    nodes, multipliers = solution.problem.nodes, solution.multipliers
    # Of bodies that touch nothing both are rounding; their squares may underflow.
    scale = max(np.abs(f).max(initial=0.0) for f in (multipliers.contact, multipliers.friction))
    largest = np.abs(nodes.normal_component(multipliers.friction)).max(initial=0.0)
    return float(largest / max(scale, 1e-300))


def energies(solution: Solution) -> float:
    """Return work less stored energy, friction and plastic flow, over the work; 0 without flow."""
    rows = [step.row for step in solution.steps]
    if not rows or "plastic_dissipation" not in rows[-1]:
        return 0.0
    names = "work", "dissipation", "plastic_dissipation"
    work, friction, plastic = (np.array([float(row[name]) for row in rows]) for name in names)
    left = work.sum() - friction.sum() - plastic.sum() - float(rows[-1]["energy"])
    return float(abs(left) / np.abs(work).sum())


def judge(problem: Problem, solution: Solution, folder: Path) -> dict[str, float]:
    """Return the errors that are more than allowed; write the results of several bodies."""
    found = {"energies": energies(solution)}
    if problem.mesh is not None:
        write_outputs(solution, folder)
        found |= recheck(problem.mesh, problem.tables, folder)
        found["along the normal"] = along_normal(solution)
    return {name: value for name, value in found.items() if not value <= ALLOWED.get(name, SMALL)}


def solved(
    problem: Problem, method: str, first: Solution | None, folder: Path
) -> tuple[dict[str, Any], Solution | None]:
    """Solve a problem; return its row, and the solution unless it is refused. Collective."""
    begin, case = time.perf_counter(), problem.case
    row = {"problem": problem.name, "method": method, "end": "refused", "solves": 0}
    alone = problem.mesh is not None or problem.domain is not None
    comm = MPI.COMM_SELF if alone else MPI.COMM_WORLD
    try:
        given = case if case.evolution else build_problem(case, comm, domain=problem.domain)
        solution = solve(given, with_method(case.solver, OPTIONS[method]), comm=comm)
    except InputError as error:
        seconds = round(time.perf_counter() - begin, 2)
        return row | {"seconds": seconds, "why": str(error), "difference": 0.0}, None
    end, why = "right", ", ".join(sorted(_fallbacks(solution)))
    if not solution.converged:
        end, why = "not converged", solution.outcome.reason
    elif wrong := judge(problem, solution, folder):
        end, why = "false", ", ".join(f"{k} {v:.1e}" for k, v in wrong.items())
    return row | {
        "end": end,
        "solves": -(-solution.counters.linear_solves // max(1, len(solution.steps))),
        "seconds": round(time.perf_counter() - begin, 2),
        "why": why,
        "difference": _difference(solution, first or solution),
    }, solution


def _fallbacks(solution: Solution) -> set[str]:
    """Return the fallbacks of a history, whose notes also name the times of an evolution."""
    notes = {record.note for record in solution.history}
    for word in OWN:
        notes = {note.replace(word, "") for note in notes}
    words = {word.strip() for note in notes for word in note.split(",")}
    return {word for word in words if word and not word.startswith("t = ")}


def _difference(solution: Solution, other: Solution) -> float:
    """Return the largest difference of displacements over the largest one. Collective."""
    u, v = solution.displacement.x.array, other.displacement.x.array
    sizes = np.array([np.abs(u - v).max(initial=0.0), np.abs(v).max(initial=0.0)])
    solution.problem.comm.Allreduce(MPI.IN_PLACE, sizes, op=MPI.MAX)
    return float(sizes[0] / (sizes[1] or 1.0))


def summary_rows(rows: Sequence[Mapping[str, Any]], methods: Sequence[str]) -> list[dict[str, Any]]:
    """Count by family and method."""
    groups: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for row in rows:
        groups.setdefault((row["problem"].rsplit("-", 1)[0], row["method"]), []).append(row)
    ends = {row["end"] for row in rows}
    others = [end for end in ("not converged", "refused", "false") if end in ends]
    made = []
    for (family, method), group in groups.items():
        right = [row for row in group if row["end"] == "right"]
        solves = [row["solves"] for row in group]
        taken = Counter(word for row in right for word in row["why"].split(", ") if word)
        line = {
            "family": family,
            "method": method,
            "problems": len(group),
            "right": len(right),
            **{end: sum(row["end"] == end for row in group) for end in others},
            "median solves": int(np.median(solves)),
            "most solves": max(solves),
            "largest difference": max((row["difference"] for row in right), default=0.0),
            "fallbacks": ", ".join(f"{word} {n}" for word, n in taken.most_common()) or "none",
        }
        if len(methods) == 1:
            del line["method"], line["largest difference"]
        made.append(line)
    return made


def main(arguments: Sequence[str] | None = None) -> int:
    """Solve problems by some methods and write the results."""
    command = parser(__doc__, "robustness")
    command.add_argument("kind", choices=KINDS)
    command.add_argument("--methods", nargs="+", default=["newton"], choices=METHODS)
    command.add_argument("--only", help="a family, or one problem such as bar-7")
    command.add_argument("--seed", type=int, help="of the drawn problems")
    given = command.parse_args(arguments)
    found = []
    with tempfile.TemporaryDirectory() as scratch:
        drawn = problems(given.kind, given.only, given.coarse, given.seed, Path(scratch))
        for problem in drawn:
            first: Solution | None = None
            for method in given.methods:
                row, solution = solved(problem, method, first, Path(scratch, problem.name))
                first = first or solution
                found.append(row)
                if row["end"] != "right" or row["why"] or not row["difference"] <= AGREE:
                    if MPI.COMM_WORLD.rank == 0:
                        print(*row.values(), flush=True)
    if not found:
        command.error(f"--only {given.only}: no such problem of this kind")
    name, caption = given.kind, KINDS[given.kind].caption
    if given.seed is not None:
        name, caption = f"{name}-{given.seed}", f"{caption}, drawn anew"
    report = Report(given.out)
    report.numbers(f"{name}-problems", found)
    report.table(name, caption, summary_rows(found, given.methods))
    return int(any(row["end"] == "false" for row in found))


if __name__ == "__main__":
    sys.exit(main())
