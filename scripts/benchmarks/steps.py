"""Load steps beside one static solve: `python3 -m scripts.benchmarks.steps [--out DIR] [--coarse]`.

Example 7.2 in 100 steps and a block in space in 20, both of linear material with friction, loaded
from nothing to all. Seconds of the processor, with the problem's making; all in one process.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from contact import Case, build_problem
from contact.evolving import in_steps
from contact.methods.newton import Newton
from contact.methods.steps import Evolution
from scripts.benchmarks.bench_one import LINEAR, block, unknowns
from scripts.cases import bar
from scripts.reporting import Report, parser

#: Times that the static solve is measured, before the steps and after them.
REPEATED = 2


def measured(case: Case, count: int) -> dict[str, Any]:
    """Return what an evolution in so many steps takes."""
    begin = time.process_time()
    problem = build_problem(case)
    method = Newton(problem, in_steps(case.solver))
    solves, converged = 0, True
    for step in Evolution(problem, method).run([*(np.arange(1, count + 1) / count)]):
        solves += step.counters.contact_solves
        converged &= step.outcome.converged
    return {
        "unknowns": unknowns(problem),
        "converged": converged,
        "steps": count,
        "set-ups": method.counters.factorizations,
        "solves": method.counters.linear_solves,
        "contact solves": solves,
        "seconds": time.process_time() - begin,
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure both, and write what they took."""
    given = parser(__doc__, "steps").parse_args(arguments)
    rows = []
    for name, case, small, count in (
        ("plane", bar(16 if given.coarse else 128, -0.005, 1e5, "material.law=linear"),
         bar(4, -0.005, 1e5, "material.law=linear"), 100),
        ("space", block(8 if given.coarse else 32, LINEAR), block(4, LINEAR), 20),
    ):  # fmt: skip
        measured(small, 1)  # its forms are compiled
        before = [measured(case, 1)["seconds"] for _ in range(REPEATED)]
        found = measured(case, count)
        after = [measured(case, 1)["seconds"] for _ in range(REPEATED)]
        static = float(np.mean([*before, *after]))
        rows.append({"": name, **found, "static": static, "ratio": found["seconds"] / static})
    Report(given.out).table(
        "bench-steps",
        "Load steps beside one static solve",
        {key: [row[key] for row in rows] for key in rows[0]},
        "Example 7.2 and a block in space, linear material, friction. `static` is one step to the "
        f"full load, the mean of {REPEATED} before the steps and {REPEATED} after them; seconds of "
        "the processor, of one process.",
    )


if __name__ == "__main__":
    main()
