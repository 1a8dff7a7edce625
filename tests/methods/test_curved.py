"""Rings and arches that are pressed flat."""

import numpy as np
import pytest
from mpi4py import MPI

from contact.case.file import parse_case
from contact.mesh.domain import Domain, from_mesh
from contact.mesh.grid import rectangle
from contact.results.solution import Solution
from contact.solving import solve
from tests.methods.test_slender import TIP, beam


def curved(thickness: float, begin: float, end: float, cells: list[int]) -> Domain:
    """Return a piece of a ring with the radius 10; left and right are its ends."""
    made = rectangle(MPI.COMM_SELF, [0.0, 0.0], [1.0, 1.0], cells)
    x = made.mesh.geometry.x
    angle, radius = begin + (end - begin) * x[:, 0], 10.0 + thickness * (x[:, 1] - 0.5)
    x[:, 0], x[:, 1] = radius * np.cos(angle), radius * np.sin(angle)
    return from_mesh(made.mesh, {name: made.facets(name) for name in made.names})


def flattened(kind: str, thickness: float, mu: float) -> Solution:
    """Press half a ring by 8 of 20, or an arch of 60 degrees with its feet held, on a plane."""
    case = beam(1.0, [200, 2], TIP, 0.0, mu)
    if kind == "ring":
        domain = curved(thickness, -np.pi / 2, np.pi / 2, [200, 2])
        held, part, level = [[0.0, "free"], [0.0, -8.0]], "top", -10.0 - thickness / 2
        case["load"] = []
    else:
        domain = curved(thickness, np.pi / 3, 2 * np.pi / 3, [200, 2])
        held, part, level = [[0.0, 0.0]] * 2, "bottom", 10.0 * np.sin(np.pi / 3) - thickness
        pressed = 0.6 * thickness * max(thickness, 0.1)
        case["load"] = [{"on": "top", "traction": [0.0, -pressed]}]
    ends = zip(("left", "right"), held, strict=True)
    case["fixed"] = [{"on": side, "displacement": given} for side, given in ends]
    plane = {"shape": "plane", "point": [0.0, level], "normal": [0.0, 1.0]}
    case["contact"] = {"on": part, "foundation": plane}
    return solve(parse_case(case), domain=domain)


@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("thickness", [0.1, 1.0])
@pytest.mark.parametrize("kind", ["ring", "arch"])
def test_rings_and_arches_pressed_flat(kind, thickness, mu):
    solution = flattened(kind, thickness, mu)
    assert solution.converged, solution.outcome.reason
    touching = np.count_nonzero(solution.status != "open")
    assert touching >= 2 if kind == "ring" else touching > 100
