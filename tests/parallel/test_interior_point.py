"""The interior point on the whole body takes the same way on any number of ranks."""

import pytest

from contact import NewtonOptions, parse_case, solve
from tests.problems.everywhere import agree

pytestmark = pytest.mark.parallel(alone=False)


def plate(mu: float) -> dict:
    """Return a plate clamped at its left over a gap, on which it has to lie down."""
    return {
        "mesh": {"generator": "box", "size": [30.0, 30.0, 1.0], "cells": [6, 6, 1]},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "left", "displacement": [0.0, 0.0, 0.0]}],
        "load": [{"on": "top", "traction": [0.0, 0.0, -1e-4]}],
        "contact": {"on": "bottom", "gap": 0.5},
        "friction": {"law": "coulomb", "mu": mu} if mu > 0 else {"law": "none"},
    }


@pytest.mark.core
@pytest.mark.parametrize("linear", ["lu", "iterative"])
@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_a_plate_lies_down_alike(linear, mu):
    options = NewtonOptions(linear=linear, condense=False, tolerance=1e-9)
    steps = []

    def quantities(solution):
        assert solution.converged, solution.outcome.reason
        assert any("interior point" in record.note for record in solution.history)
        steps.append(len(solution.history))
        return {"force": solution.contact_force}

    agree(lambda comm: solve(parse_case(plate(mu)), options, comm=comm), quantities, 1e-7)
    assert abs(steps[0] - steps[1]) <= 2  # rounding of the linear solver
