"""Cells that are stretched away from the foundation hide no error of the pressure."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import parse_case, solve
from contact.mesh.entities import elongation
from contact.mesh.grid import box, rectangle

SELF = MPI.COMM_SELF


def column(**solver):
    """Solve a sheared column of four rows of cells, each a hundred times as high as wide."""
    case = {
        "mesh": {"generator": "rectangle", "size": [4.0, 16.0], "cells": [100, 4]},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "left", "displacement": [0.0, 0.0]}],
        "load": [{"on": "top", "traction": [2e-3, "-0.01*(1 + x/4)"]}],
        "contact": {"on": "bottom"},
        "solver": solver,
    }
    return solve(parse_case(case))


@pytest.mark.parametrize("r", [pytest.param(0.1, marks=pytest.mark.slow), 1.0])
def test_a_small_r_does_not_end_far_from_the_pressure(r):
    """It was 3e-5 off at a tolerance of 1e-8: E/size, of a body that high, weighed no gap."""
    exact = column(tolerance=1e-13).pressure
    found = column(method="uzawa", r=r, tolerance=1e-8, max_inner=20000)
    assert found.converged, found.outcome.reason
    assert np.abs(found.pressure - exact).max() <= 5e-6 * exact.max()


@pytest.mark.slow
@pytest.mark.parametrize("r", [0.1, 1.0])
def test_facets_that_are_thin_hide_nothing_either(r):
    """The pressure was 1.5e-4 off: facets of a grid in space were taken for as long as wide."""

    def thin(**solver):
        case = {
            "mesh": {"generator": "box", "size": [4.0, 16.0, 16.0], "cells": [60, 1, 2]},
            "material": {"young": 1.0, "poisson": 0.3},
            "fixed": [{"on": "left", "displacement": [0.0, 0.0, 0.0]}],
            "load": [{"on": "top", "traction": [2e-3, 0.0, "-0.01*(1 + x/4)"]}],
            "contact": {"on": "bottom"},
            "solver": {"linear": "lu", **solver},
        }
        return solve(parse_case(case), comm=SELF)

    exact = thin(tolerance=1e-13).pressure
    found = thin(method="uzawa", r=r, tolerance=1e-8, max_inner=20000)
    assert found.converged, found.outcome.reason
    assert np.abs(found.pressure - exact).max() <= 3e-6 * exact.max()


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        ((16, 4), 1.0),
        ((4, 400), 1.0),
        # (1/4) over twice 1/400, and in space by the shortest edge of facets
        ((1600, 4), 50.0),
        ((40, 40, 2), 0.5 / (2 / 40)),
        ((2, 2, 40), 1.0),
    ],
)
def test_how_much_longer_cells_are(cells, expected):
    if len(cells) == 2:
        domain = rectangle(SELF, (0.0, 0.0), (4.0, 1.0), cells)
    else:
        domain = box(SELF, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells)
    found = elongation(domain.mesh, domain.facets("bottom"))
    assert found == pytest.approx(expected, rel=0.01)
