"""Two boxes on each other in 3-D beside one box of the same size: iterations and time.

``python3 -m scripts.benchmarks.pair_space [--out DIR] [--coarse] [--size SIZE]``: SIZE is that of
the elements, 0.06 for some 25 000 unknowns, 0.028 for 230 000, 0.0212 for 500 000. Both are pressed
and pushed, with friction below, and solved by Newton's method with multigrid, one after the other;
seconds are those of the processor.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

from contact import build_problem, parse_case, solve
from scripts.reporting import Report, parser

FRICTION = {"law": "coulomb", "mu": 0.3}
TRACTION = [0.001, 0.0, -0.01]


def one(size: float) -> dict[str, Any]:
    """Return a box of 1 x 1 x 2 on a rigid foundation."""
    mesh = {"generator": "block", "height": 2.0, "size": size, "contact_size": size}
    foundation = {"shape": "plane", "point": [0, 0, 0], "normal": [0, 0, 1]}
    return {
        "mesh": mesh,
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "top", "displacement": ["free", 0.0, "free"]}],
        "load": [{"on": "top", "traction": TRACTION}],
        "contact": {"on": "bottom", "foundation": foundation},
        "friction": FRICTION,
    }


def two(size: float) -> dict[str, Any]:
    """Return two boxes of 1 x 1 x 1 whose meshes do not match, the lower one stiffer."""
    sizes = {"lower_width": 1.0, "lower_size": 1.03 * size, "upper_size": 0.97 * size}
    return {
        "mesh": {"generator": "two_boxes", **sizes},
        "material": [
            {"on": name, "young": young, "poisson": 0.3}
            for name, young in (("upper", 1.0), ("lower", 3.0))
        ],
        "fixed": [
            {"on": "upper_top", "displacement": ["free", 0.0, "free"]},
            {"on": "lower_bottom", "displacement": [0.0, 0.0, 0.0]},
        ],
        "load": [{"on": "upper_top", "traction": TRACTION}],
        "contact": {"on": "upper_bottom", "against": "lower_top"},
        "friction": FRICTION,
    }


def main(arguments: Sequence[str] | None = None) -> None:
    """Solve both, and write their costs."""
    made = parser(__doc__, "pair_space")
    made.add_argument("--size", type=float, default=0.06)
    given = made.parse_args(arguments)
    size, rows = 0.15 if given.coarse else given.size, []
    for name, data in (("one", one(size)), ("two", two(size))):
        case = parse_case(data)
        problem = build_problem(case)
        begin = time.process_time()
        solution = solve(problem, case.solver)
        seconds, counters = time.process_time() - begin, solution.counters
        rows.append(
            {
                "bodies": name,
                "unknowns": problem.body.layout.unknowns,
                "converged": solution.converged,
                "solves": counters.linear_solves,
                "iterations": counters.linear_iterations,
                "seconds": seconds,
            }
        )
    Report(given.out).table(
        "pair-space",
        "Two boxes in 3-D that are pressed and pushed, beside one of the same size",
        {key: [row[key] for row in rows] for key in rows[0]},
        "Friction, linear materials, meshes that do not match. Seconds of the processor.",
    )


if __name__ == "__main__":
    main()
