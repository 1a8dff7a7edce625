"""The interior point on the whole body takes the same way on any number of ranks."""

import numpy as np
import pytest
from mpi4py import MPI

from contact.case.file import parse_case
from contact.methods.options import NewtonOptions
from contact.solving import solve

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
    together, alone = (
        solve(parse_case(plate(mu)), options, comm=comm) for comm in (MPI.COMM_WORLD, MPI.COMM_SELF)
    )
    for found in (together, alone):
        assert found.converged, found.outcome.reason
        assert any("interior point" in record.note for record in found.history)
    size = np.abs(alone.contact_force).max()
    assert np.allclose(together.contact_force, alone.contact_force, rtol=0, atol=1e-7 * size)
    steps = [len(found.history) for found in (together, alone)]
    assert abs(steps[0] - steps[1]) <= 2  # rounding of the linear solver
