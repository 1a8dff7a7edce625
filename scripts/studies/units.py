"""The same problem in other units: equal counts, and equal numbers but for the units.

`python3 -m scripts.studies.units [--out DIR] [--coarse] [--methods newton uzawa penalty]`. A block
with friction is solved in twenty units of length and stress, from 1e-9 to 1e6 and from 1e-9 to
1e13, by every method with direct and with iterative linear solvers.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np

from contact import Solution, parse_case, solve
from contact.typing import Array
from scripts.reporting import Report, append, parser

METHODS, SOLVERS = ("newton", "uzawa", "penalty"), ("lu", "iterative")
#: Decimal powers of the units of length and of stress.
LENGTHS, STRESSES = (-9, 6), (-9, 13)
COUNT, COARSE_COUNT, SEED = 20, 5, 3
TOLERANCE = 1e-10
#: Largest difference of the numbers, over the largest of them.
AGREE = 1e-9


def scaled(length: float, stress: float, dim: int, **solver: Any) -> dict[str, Any]:
    """Return a block on a foundation, clamped at the left, pressed and pushed on top."""
    size = [4.0, 1.0] if dim == 2 else [2.0, 1.0, 1.0]
    cells = [32, 8] if dim == 2 else [8, 4, 4]
    force = [0.002, -0.01] if dim == 2 else [0.002, 0.001, -0.01]
    return {
        "mesh": {
            "generator": "rectangle" if dim == 2 else "box",
            "size": [side * length for side in size],
            "cells": cells,
        },
        "material": {"law": "log", "young": stress, "poisson": 0.3, "yield_strain": 0.01},
        "fixed": [{"on": "left", "displacement": [0.0] * dim}],
        "load": [{"on": "top", "traction": [component * stress for component in force]}],
        "contact": {"on": "bottom", "gap": 1e-3 * length},
        "friction": {"law": "coulomb", "mu": 0.4},
        "solver": solver,
    }


def units(count: int) -> list[tuple[float, float]]:
    """Return units of length and stress: 1, the corners of the ranges, and random ones."""
    rng = np.random.default_rng(SEED)
    found = [(1.0, 1.0), *((10.0**a, 10.0**b) for a in LENGTHS for b in STRESSES)]
    while len(found) < count:
        found.append((float(10 ** rng.uniform(*LENGTHS)), float(10 ** rng.uniform(*STRESSES))))
    return found[:count]


def numbers(solution: Solution, length: float, stress: float) -> Array:
    """Return pressures and displacements without units."""
    return np.concatenate([solution.pressure / stress, solution.displacement.x.array / length])


def counts(solution: Solution) -> tuple[int, ...]:
    """Return the quantities that must not depend on the units."""
    k = solution.counters
    return (len(solution.history), k.factorizations, k.linear_solves, k.contact_solves)


def main(arguments: Sequence[str] | None = None) -> int:
    """Solve in all units and compare."""
    command = parser(__doc__, "units")
    command.add_argument("--methods", nargs="+", default=list(METHODS), choices=METHODS)
    given = command.parse_args(arguments)
    names = ("method", "linear", "converged", "iterations", "factorisations", "solves")
    names += ("contact solves", "linear iterations", "equal counts", "largest difference")
    rows: dict[str, list[Any]] = {name: [] for name in names}
    for method in given.methods:
        for linear in SOLVERS:
            solutions, found = [], []
            for length, stress in units(COARSE_COUNT if given.coarse else COUNT):
                case = scaled(length, stress, 2, method=method, linear=linear, tolerance=TOLERANCE)
                case["mesh"]["cells"] = [16, 4]
                solutions.append(solve(parse_case(case)))
                found.append(numbers(solutions[-1], length, stress))
            far = max(float(np.abs(one - found[0]).max()) for one in found)
            inner = [solution.counters.linear_iterations for solution in solutions]
            append(
                rows,
                method,
                linear,
                sum(solution.converged for solution in solutions),
                *counts(solutions[0]),
                f"{min(inner)} to {max(inner)}",
                len({counts(solution) for solution in solutions}) == 1,
                far / float(np.abs(found[0]).max()),
            )
            print(*(column[-1] for column in rows.values()), flush=True)
    Report(given.out).table("units", f"A block in {len(solutions)} units", rows)
    whole = all(n == len(solutions) for n in rows["converged"]) and all(rows["equal counts"])
    return 0 if whole and max(rows["largest difference"]) <= AGREE else 1


if __name__ == "__main__":
    sys.exit(main())
