"""Curved bodies with straight edges on curved rigid foundations: exact pressures."""

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from mpi4py import MPI

from contact import Body, Contact, Fixed, Linear, Plane, Problem, Sphere, parse_case, solve
from contact.mesh.grid import rectangle
from scripts.studies import curved_foundations as study
from tests.problems.overlapping import body, layers

COMM = MPI.COMM_WORLD


def check(ratios, mean, node):
    """Mean pressure and that of each node are the exact one but for these shares."""
    p, w = ratios
    assert p @ w / w.sum() == pytest.approx(1, abs=mean)
    assert np.abs(p - 1).max() < node


@pytest.mark.core
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("name", ["ring on a shaft", "ring in a bore"])
def test_rings(name, degree):
    """With mid-edge nodes on chords: 2.19 times the pressure, and nodes between 0 and 3 times."""
    check(study.rings(name, 0.1, degree), 0.005, 0.05)


@pytest.mark.core
@pytest.mark.parametrize("degree", [1, 2])
def test_hertz(degree):
    """With chords degree 2 is 7 % off."""
    check(study.hertz(0.1, degree), 0.004, 0.01)


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("kind", ["2-D", "revolution"])
@pytest.mark.parametrize("name", ["sphere", "formula", "punch edge"])
def test_hydrostatic_pressure_in_the_plane(name, kind, degree):
    check(study.hydrostatic(name, 0.05, degree, kind), 0.002, 0.02)


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("name", ["sphere", "cylinder", "triangles"])
def test_hydrostatic_pressure_in_space(name, degree, monkeypatch):
    coarse = replace(study.PROFILES["triangles"], shape=partial(study.triangulated, cells=400))
    monkeypatch.setitem(study.PROFILES, "triangles", coarse)
    check(study.hydrostatic(name, 0.1, degree, "3-D"), 0.007, 0.1)


@pytest.mark.slow
@pytest.mark.parametrize("order", [1, 2])
def test_nodes_at_a_punch_edge_in_space(order):
    """By the surface alone nodes beside the jump of its curvature are 0 to 2.2 times that."""
    check(study.hydrostatic("punch edge", 0.1, 2, "3-D", order=order), 0.002, 0.05)


@pytest.mark.parametrize("kind", ["2-D", "revolution", "3-D"])
@pytest.mark.parametrize("name", ["sphere", "formula"])
def test_bodies_that_move_along_curved_facets(name, kind):
    """With directions that are means over unlike facets nodes would be off by 6 to 12 %."""
    check(study.hydrostatic(name, 0.1, 2, kind, order=2), 0.002, 0.03)


def warnings(solution):
    """Return what is said about deviations of facets from curves."""
    words = "straight facets deviate", "straight edges tell", "straight edges of a curved"
    return [text for text in solution.warnings if any(some in text for some in words)]


def test_gaps_of_a_ring_are_exact_however_small_the_interference():
    """A parabola for the arc would be off by 7e-7: 1.7 times the pressure at 1e-6."""
    found = []
    for interference in (1e-3, 1e-6):
        problem, exact = study.ring("ring on a shaft", 0.1, 2, interference=interference)
        solution = solve(problem)
        found.append(study.ratios(solution, exact))
        # The vertices of a circle tell all of it.
        assert not [text for text in warnings(solution) if "edges tell" in text]
    check(found[0], 0.002, 0.06)
    np.testing.assert_allclose(found[1][0], found[0][0], rtol=1e-4)


def test_bodies_of_the_form_of_their_foundation_are_right_under_any_pressure(monkeypatch):
    """An ellipse under a hundredth of the pressure: by the surface alone nodes are 22 times off."""
    monkeypatch.setattr(study, "ALPHA", 1e-5)
    p, w = study.hydrostatic("formula", 0.1, 2, "2-D")
    check((100 * p, w), 0.002, 0.05)


def test_curves_that_vertices_do_not_tell_are_warned_of():
    """A side that is flat up to an arc meets a plane: neither it nor the gaps tell where."""
    found = []
    for cells in (44, 88):
        domain = rectangle(COMM, [-1.0, -1.0], [2.0, 1.0], [cells, 8])
        x = domain.mesh.geometry.x
        x[:, 1] -= (1 + x[:, 1]) * np.maximum(x[:, 0] - 0.03, 0) ** 2 / 2
        body = Body(Linear(1e3, 0.3), [Fixed("bottom", [0.0, 1e-3])])
        plane = Contact("top", Plane(point=(0.0, 0.0), normal=(0.0, -1.0)))
        solution = solve(Problem(domain, body, plane, degree=2))
        assert solution.converged
        found.append(warnings(solution))
    assert [len(texts) for texts in found] == [1, 0]
    assert re.search(r"edges tell .* nodal pressures scatter by about \d+% of", found[0][0])


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize(("cells", "most"), [(12, 0.05), (24, 0.03)])
def test_a_curvature_that_varies(cells, most):
    """A paraboloid: by the surface alone nodes were between .3 and 1.4 times the pressure."""
    domain = rectangle(COMM, [-0.8, -1.0], [1.6, 1.0], [cells, 20])
    x = domain.mesh.geometry.x
    x[:, 1] += (1 + x[:, 1]) * x[:, 0] ** 2 / 1.2
    sides = ("left", "right", "bottom")
    case = {
        "space": {"degree": 2},
        "material": {"young": 1000.0, "poisson": 0.3},
        "fixed": [{"on": side, "displacement": ["-1e-3*x", "-1e-3*y"]} for side in sides],
        "contact": {
            "on": "top", "overlap": "press",
            "foundation": {
                "shape": "paraboloid", "apex": [0.0, 0.0], "axis": [0.0, 1.0], "radius": 0.5994
            },
        },
    }  # fmt: skip
    solution = solve(parse_case(case), domain=domain)
    nodes, exact = solution.problem.nodes, 1e-3 * 1000 / (1.3 * 0.4)
    assert nodes.maximum(np.abs(solution.multipliers.contact / exact - 1)) < most


@pytest.mark.parametrize("degree", [1, 2])
def test_two_rings_with_a_small_interference(degree):
    """Gaps of degree 1 are those of the facets: a warning has both lengths."""
    solution, exact = study.two_rings(0.1, degree)
    check(study.ratios(solution, exact), *((0.01, 0.12) if degree == 2 else (0.3, 1.0)))
    found = warnings(solution)
    assert len(found) == 1
    if degree == 2:
        off = np.abs(study.ratios(solution, exact)[0] - 1).max()
        assert off / 1.7 < told(found[0]) < off
    else:
        assert "by up to 0.000803 " in found[0]
        assert "at most 0.000773" in found[0]


@pytest.mark.parallel
def test_a_small_interference_beside_a_large_one():
    """Chords decide the gaps of the first pair alone."""
    radii, counts = (1.0, 1.5, 2.0, 2.5), (16, 20, 16)
    domain = layers(COMM, "quadrilateral", 1, "ring", (0.003, 0.1), radii, counts)
    pairs = [Contact(f"outer{k}", against=f"inner{k + 1}", press=True) for k in range(2)]
    solution = solve(Problem(domain, body("ring", 2, 3), pairs))
    assert solution.converged
    (text,) = warnings(solution)
    assert "contact of outer0 closes gaps of at most 0.00" in text


def test_two_rings_are_right_however_small_their_interference():
    """Gaps along normals, of parabolas: nodes were between 0 and 2.0 times the pressure."""
    found = []
    for overlap in (1e-3, 1e-6):
        solution, exact = study.two_rings(0.05, 2, overlap)
        found.append(study.ratios(solution, exact))
        check(found[-1], 0.002, 0.06)
    np.testing.assert_allclose(found[1][0], found[0][0], rtol=0.01)


@pytest.mark.parallel
def test_straight_edges_that_turn_much_are_warned_of():
    """A ring on a shaft, whose interference is so large that its gaps are right."""
    for h, order, count in ((0.2, 1, 1), (0.2, 2, 0), (0.05, 1, 0)):
        problem, exact = study.ring("ring on a shaft", h, 2, order, 0.01)
        solution = solve(problem)
        off = np.abs(study.ratios(solution, exact)[0] - 1).max()
        assert off < 0.12 * count or off < 0.06
        found = warnings(solution)
        assert len(found) == count
        if count:
            assert told(found[0]) == 0.2
            assert off / 1.5 < told(found[0]) < 2 * off


def told(warning):
    """Return h/R, the share by which pressures of single nodes are said to be off."""
    return float(re.search(r"turn by up to (\S+) where it touches", warning)[1])


@pytest.mark.parallel
@pytest.mark.parametrize(("count", "node"), [(8, 0.14), (10, 0.1), (12, 0.08), (6, None)])
def test_pins_of_few_edges(count, node):
    """A body around half a pin: vertices of a hexagon are corners, with 20 times the pressure."""
    domain = rectangle(COMM, [0.0, 0.0], [1.0, 1.0], [count // 2, 8])
    x = domain.mesh.geometry.x
    angle, radius = np.pi * x[:, 0], 0.8 - 0.6 * x[:, 1]
    x[:, 0], x[:, 1] = -radius * np.cos(angle), -radius * np.sin(angle)
    given = [lambda x: -1e-3 * x[0], lambda x: -1e-3 * x[1]]
    fixed = [Fixed(side, given) for side in ("left", "right", "bottom")]
    pin = Contact("top", Sphere(centre=(0.0, 0.0), radius=0.1998), press=True)
    solution = solve(Problem(domain, Body(Linear(1e3, 0.3), fixed), pin, degree=2))
    p = solution.pressure / (1e-3 * 1e3 / (1.3 * 0.4))
    assert told(warnings(solution)[0]) == pytest.approx(2 * np.pi / count, rel=0.05)
    if node is None:
        assert solution.problem.nodes.maximum(p) > 10
    else:
        assert solution.problem.nodes.maximum(np.abs(p - 1)) < node
