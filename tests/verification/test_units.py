"""The same problem in other units: the same iterations, and the same numbers but for the units."""

from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from contact.case.file import parse_case
from contact.solving import solve

#: Lengths and stresses, from atoms to mountains, in the units of the first. They are powers of two,
#: which no number is rounded by: counts of one machine's rounding would not be those of another's.
UNITS = [
    (1.0, 1.0),
    (2.0**-30, 1.0),
    (2.0**20, 1.0),
    (1.0, 2.0**-30),
    (1.0, 2.0**44),
    (2.0**-20, 2.0**38),
    (2.0**10, 2.0**-20),
    (2.0**-30, 2.0**-30),
    (2.0**20, 2.0**44),
]


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


@pytest.mark.parametrize(
    ("dim", "solver"),
    [
        (2, {"method": "newton"}),
        (2, {"method": "uzawa"}),
        (2, {"method": "penalty"}),
        (3, {"method": "newton", "linear": "lu"}),
        (3, {"method": "newton", "linear": "iterative"}),
    ],
    ids=lambda given: given if isinstance(given, int) else "-".join(given.values()),
)
def test_counts_and_results_do_not_depend_on_the_units(dim, solver):
    found = []
    for length, stress in UNITS:
        case = parse_case(scaled(length, stress, dim, **solver))
        solution = solve(case, comm=MPI.COMM_SELF)
        assert solution.converged, (length, stress, solution.outcome.reason)
        counters = solution.counters
        numbers = [len(solution.history), counters.factorizations]
        if solver.get("linear") != "iterative":
            numbers += [counters.linear_solves, counters.contact_solves]
        values = np.concatenate(
            [solution.pressure / stress, solution.displacement.x.array / length]
        )
        found.append((numbers, values))
    first_counts, values = found[0]
    # The penalty's slip length leaves what its iterations leave.
    tolerance = 1e-6 if solver["method"] == "penalty" else 1e-7
    for other_counts, other_values in found[1:]:
        assert other_counts == first_counts
        assert np.abs(other_values - values).max() <= tolerance * np.abs(values).max()


def test_an_iterative_solver_leaves_less_than_the_relaxation_asks_for():
    # What left as much gave back what it began with: 269 to 821 solves, depending on the units.
    found = []
    for linear, (length, stress) in (("lu", UNITS[0]), *(("iterative", u) for u in UNITS[::4])):
        case = scaled(length, stress, 2, method="uzawa", linear=linear, tolerance=1e-10)
        case["mesh"]["cells"] = [16, 4]
        solution = solve(parse_case(case), comm=MPI.COMM_SELF)
        assert solution.converged
        found.append((solution.counters.linear_solves, solution.pressure / stress))
    solves, pressure = found[0]
    for other_solves, other in found[1:]:
        assert other_solves == solves
        assert np.abs(other - pressure).max() <= 1e-9 * pressure.max()
