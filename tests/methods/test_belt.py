"""A strap around a drum, pulled at both ends: friction multiplies the tension along it."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import build_problem, parse_case, solve
from contact.mesh.domain import Domain
from contact.mesh.grid import rectangle

#: Tension at the end that is pulled more, and Young's modulus.
PULL, YOUNG = 0.005, 1.0


def strap(cells: int, thickness: float) -> Domain:
    """Return a strap around the upper half of a drum of radius 1, with straight ends 0.5 long."""
    domain = rectangle(MPI.COMM_SELF, [0.0, 0.0], [np.pi + 1, thickness], [cells, 1])
    x = domain.mesh.geometry.x
    along, across = x[:, 0] - 0.5, x[:, 1].copy()
    angle = np.clip(along, 0.0, np.pi)
    beyond = np.minimum(along, 0.0) + np.minimum(np.pi - along, 0.0)
    x[:, 0] = -(1 + across) * np.cos(angle)
    x[:, 1] = (1 + across) * np.sin(angle) + beyond
    return domain


@pytest.mark.core
@pytest.mark.parametrize(
    ("cells", "ratio", "mu", "degree", "thickness"),
    [(37, 1.2, 0.4, 1, 0.08), (53, 1.5, 0.3, 1, 0.2), (50, 1.1, 0.4, 2, 0.08)],
)
def test_a_strap_around_a_drum(cells, ratio, mu, degree, thickness):
    """Friction bounds of Newton's cycling active sets came back for ever: residuals up to 0.8."""
    size = {"generator": "rectangle", "size": [np.pi + 1, thickness], "cells": [cells, 1]}
    case = {
        "mesh": size,
        "space": {"degree": degree},
        "material": {"young": YOUNG, "poisson": 0.2},
        "fixed": [{"on": "right", "displacement": [0.0, "free"]}],
        "load": [
            {"on": "left", "traction": [0.0, -PULL]},
            {"on": "right", "traction": [0.0, -PULL / ratio]},
        ],
        "contact": {
            "on": "bottom",
            "overlap": "press",
            "foundation": {"shape": "sphere", "centre": [0.0, 0.0], "radius": 1.0},
        },
        "friction": {"law": "coulomb", "mu": mu},
    }
    problem = build_problem(parse_case(case), MPI.COMM_SELF, domain=strap(cells, thickness))
    solution = solve(problem)
    assert solution.converged, solution.outcome.reason
    # The drum bears both pulls, and the moment of friction their difference.
    force = -solution.contact_force
    assert force[1] == pytest.approx(PULL * thickness * (1 + 1 / ratio), rel=1e-9)
