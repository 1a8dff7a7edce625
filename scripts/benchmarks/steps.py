"""Load steps beside one static solve: `python3 -m scripts.benchmarks.steps [--out DIR] [--coarse]`.

Example 7.2 in 100 steps and a block in 3-D in 20, both of linear material with friction, loaded
from nothing to all. Then Example 7.2 by Hencky's law under 20 loads, swept from one solution to the
next and each from zero. Seconds of the processor, with the problem's making; all in one process.
`--only steps` or `--only sweep` measures the one.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from contact import Case, build_problem
from contact.methods.load_stepping import LoadStepping
from contact.methods.newton import Newton
from contact.sweeping import Axis, sweep
from scripts.benchmarks.bench_one import LINEAR, block, unknowns
from scripts.cases import CASES, bar
from scripts.reporting import Report, parser

#: Loads of the sweep.
LOADS = 20

#: Times that the static solve is measured, before the steps and after them.
REPEATED = 2


def measured(case: Case, count: int) -> dict[str, Any]:
    """Return the costs of an evolution in so many steps."""
    begin = time.process_time()
    problem = build_problem(case)
    method = Newton(problem, case.solver)
    solves, converged = 0, True
    for _, outcome in LoadStepping(problem, method).steps([*(np.arange(1, count + 1) / count)]):
        solves += outcome.counters.contact_solves
        converged &= outcome.converged
    return {
        "unknowns": unknowns(problem),
        "converged": converged,
        "steps": count,
        "set-ups": method.counters.factorizations,
        "solves": method.counters.linear_solves,
        "contact solves": solves,
        "seconds": time.process_time() - begin,
    }


def swept(cells: int, warm: bool) -> dict[str, Any]:
    """Return the costs of Example 7.2 under `LOADS` loads, with a warm start or from zero."""
    loads = tuple(f"[0.0, {-0.005 * (k + 1) / LOADS}]" for k in range(LOADS))
    settings = [f"mesh.cells=[{4 * cells}, {cells}]", "solver.method=newton"]
    with tempfile.TemporaryDirectory() as folder:
        begin = time.process_time()
        axes = [Axis("load.0.traction", loads)]
        rows = sweep(CASES / "bar.toml", axes, Path(folder), settings, warm=warm)
        seconds = time.process_time() - begin
    return {
        "": "from the last" if warm else "from the zero initial guess",
        "converged": all(row["converged"] for row in rows),
        "loads": len(rows),
        "set-ups": sum(int(row["factorizations"]) for row in rows),
        "seconds": seconds,
    }


def stepped(coarse: bool) -> list[dict[str, Any]]:
    """Return the costs of the evolutions beside static solves."""
    rows = []
    for name, case, small, count in (
        ("plane", bar(16 if coarse else 128, -0.005, 1e5, "material.law=linear"),
         bar(4, -0.005, 1e5, "material.law=linear"), 100),
        ("space", block(8 if coarse else 32, LINEAR), block(4, LINEAR), 20),
    ):  # fmt: skip
        measured(small, 1)  # its forms are compiled
        before = [measured(case, 1)["seconds"] for _ in range(REPEATED)]
        found = measured(case, count)
        after = [measured(case, 1)["seconds"] for _ in range(REPEATED)]
        static = float(np.mean([*before, *after]))
        rows.append({"": name, **found, "static": static, "ratio": found["seconds"] / static})
    return rows


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure both, and write their costs."""
    options = parser(__doc__, "steps")
    options.add_argument("--only", choices=["steps", "sweep"], help="measure this alone")
    given = options.parse_args(arguments)
    report = Report(given.out)
    if given.only != "sweep":
        rows = stepped(given.coarse)
        report.table(
            "bench-steps",
            "Load steps beside one static solve",
            rows,
            "Example 7.2 and a block in 3-D, linear material, friction. `static` is one step to "
            f"the full load, the mean of {REPEATED} before the steps and {REPEATED} after them; "
            "seconds of the processor, of one process.",
        )
    if given.only != "steps":
        swept(4, warm=True)
        rows = [swept(16 if given.coarse else 64, warm) for warm in (False, True)]
        share = rows[1]["seconds"] / rows[0]["seconds"]
        report.table(
            "bench-sweep",
            f"{LOADS} loads swept, each from the one before or from the zero initial guess",
            rows,
            f"Example 7.2, Hencky's law; {share:.2f} of the seconds of the processor.",
        )


if __name__ == "__main__":
    main()
