"""Random pairs of bodies: Newton's method converges, and Uzawa's agrees, or which do not.

``scripts/fx python3 -m scripts.studies.pairs [COUNT [COMPARED]]``

Sizes, meshes, moduli (a ratio of 1e-3 to 1e3), friction (0 to 1), gaps and motions are drawn from
a seed that is the number of the pair: any line can be had again.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Mapping
from typing import Any

import numpy as np

from contact import parse_case, solve
from contact.methods.options import FixedPointOptions, with_method

#: Largest difference of the displacements, relative to the largest of them, that agrees.
AGREES = 1e-7


def random_case(seed: int) -> dict[str, Any]:
    """Return a block that is pressed on another one and pushed along."""
    rng = np.random.default_rng(seed)
    width = rng.uniform(1.0, 4.0)
    upper = width * rng.uniform(0.3, 1.5)
    heights = rng.uniform(0.3, 2.0, 2)
    sizes = rng.uniform(0.06, 0.4, 2)
    ratio = 10 ** rng.uniform(-3, 3)
    press = rng.uniform(0.001, 0.03)
    gap: float | str = rng.choice([0.0, 0.5 * press])
    if rng.random() < 0.3:
        gap = f"{rng.uniform(0, 0.01):.4g}*x**2"
    on, against = ("upper_bottom", "lower_top") if rng.random() < 0.5 else (
        "lower_top", "upper_bottom",
    )  # fmt: skip
    return {
        "mesh": {
            "generator": "two_blocks",
            "lower_width": width,
            "upper_width": upper,
            "lower_height": heights[0],
            "upper_height": heights[1],
            "lower_size": sizes[0],
            "upper_size": sizes[1],
        },
        "space": {"degree": int(rng.integers(1, 3))},
        "material": [
            {"on": "upper", "young": ratio, "poisson": rng.uniform(0.0, 0.45)},
            {"on": "lower", "young": 1.0, "poisson": rng.uniform(0.0, 0.45)},
        ],
        "fixed": [
            {"on": "lower_bottom", "displacement": [0.0, 0.0]},
            {"on": "upper_top", "displacement": [rng.uniform(-1, 1) * press, -press]},
        ],
        "contact": {"on": on, "against": against, "gap": gap},
        "friction": {"law": "coulomb", "mu": rng.uniform(0.0, 1.0)},
    }


def converges(given: Mapping[str, Any], compared: bool) -> tuple[bool, str]:
    """Solve a pair; return whether all is well, and the remarks."""
    case = parse_case({**given, "solver": {"tolerance": 1e-10}})
    solution = solve(case)
    words = f"{len(solution.history)} iterations, {solution.outcome.reason}"
    if not solution.converged or not compared:
        return solution.converged, words
    other = solve(case, with_method(case.solver, FixedPointOptions))
    size = np.abs(solution.state.x).max()
    apart = float(np.abs(other.state.x - solution.state.x).max() / size)
    agrees = other.converged and apart <= AGREES
    return agrees, f"{words}; uzawa: {other.outcome.reason}, apart {apart:.1e}"


def main(arguments: list[str]) -> None:
    """Solve pairs, and say which fail."""
    count = int(arguments[0]) if arguments else 100
    compared = int(arguments[1]) if len(arguments) > 1 else 30
    # `contact solve` tells the warnings of each.
    logging.getLogger("contact").setLevel(logging.ERROR)
    failed = 0
    for seed in range(count):
        good, words = converges(random_case(seed), seed < compared)
        failed += not good
        if not good:
            print(f"pair {seed}: {words}", flush=True)
    print(f"{count - failed} of {count} pairs converge, {min(compared, count)} compared with uzawa")
    sys.exit(failed > 0)


if __name__ == "__main__":
    main(sys.argv[1:])
