"""Hertz's cylinder and sphere: the script's measurements against the classical solution."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("gmsh")
from contact.model.obstacle import Sphere
from scripts.thesis import hertz


@pytest.mark.core
@pytest.mark.parallel
def test_small_load():
    solution, found = hertz.solved_and_measured(hertz.cylinder(160.0, fineness=16), 80.0)
    exact = hertz.Cylinder(160.0)
    assert exact.half_width == pytest.approx(0.86111, rel=1e-4)
    assert exact.half_width / found.h >= 12
    assert found.edge == pytest.approx(exact.half_width, rel=0.01)
    assert found.moment == pytest.approx(exact.half_width, rel=0.01)
    assert found.peak == pytest.approx(exact.peak, rel=0.01)
    assert found.force_error < 1e-8
    assert solution.outcome.residuals.largest <= 1e-8


@pytest.mark.core
@pytest.mark.parametrize(
    ("direction", "mu", "b", "p"),
    [
        ("foundation", "0.0", 1.011, 0.975),
        ("body", "0.0", 0.936, 1.063),
        ("foundation", "0.5", 0.966, 1.029),
        ("body", "0.5", 0.880, 1.081),
    ],
)
def test_example_7_1(direction, mu, b, p):
    """Ratios to Hertz at b/R = 0.34, where linear elasticity no longer gives Hertz's solution."""
    case = hertz.cylinder(1600.0, mu=mu, direction=direction, fineness=20)
    _, found = hertz.solved_and_measured(case, 800.0)
    exact = hertz.Cylinder(1600.0)
    assert exact.half_width == pytest.approx(2.7231, rel=1e-4)
    assert exact.peak == pytest.approx(374.05, rel=1e-4)
    width = found.edge if (direction, mu) == ("foundation", "0.0") else found.moment
    assert width / exact.half_width == pytest.approx(b, rel=0.01)
    assert found.peak / exact.peak == pytest.approx(p, rel=0.01)
    assert found.force_error < 1e-8


@pytest.mark.core
@pytest.mark.parametrize("shape", ["half_disc", "disc"])
def test_half_and_full_cylinder(shape):
    _, found = hertz.solved_and_measured(hertz.cylinder(160.0, shape=shape, fineness=12), 160.0)
    exact = hertz.Cylinder(160.0)
    assert found.moment == pytest.approx(exact.half_width, rel=0.01)
    assert found.peak == pytest.approx(exact.peak, rel=0.01)
    assert found.force_error < 1e-8


@pytest.mark.core
@pytest.mark.parametrize(("centre", "inside"), [(-20.0, False), (20.0, True)])
def test_round_foundation(centre, inside):
    """On a circle of radius 20, outside or inside, the curvatures 1/8 and 1/20 add up."""
    exact = hertz.Cylinder(160.0, radius=1 / (1 / 8 - np.sign(centre) / 20))
    circle = Sphere(shape="sphere", centre=(0.0, centre), radius=20.0, inside=inside)
    case = hertz.cylinder(160.0, fineness=20)
    contact = case.contact.model_copy(update={"foundation": circle})
    _, found = hertz.solved_and_measured(case.model_copy(update={"contact": contact}), 80.0)
    assert found.moment == pytest.approx(exact.half_width, rel=0.01)
    assert found.peak == pytest.approx(exact.peak, rel=0.01)
    assert found.force_error < 1e-8


def test_sphere():
    exact = hertz.Sphere()
    assert exact.contact_radius == pytest.approx(0.88044, rel=1e-4)
    assert exact.peak == pytest.approx(61.594, rel=1e-4)
    assert exact.approach == pytest.approx(0.077518, rel=1e-4)
    solution, found = hertz.solved_and_measured(hertz.sphere(4, degree=2), 25.0)
    assert found.force_error < 1e-8
    assert found.moment == pytest.approx(exact.contact_radius, rel=0.03)
    assert found.centre == pytest.approx(exact.peak, rel=0.03)
    assert hertz.approach(solution) == pytest.approx(exact.axial(exact.radius), rel=0.03)


def test_axial_displacement_of_hertz():
    """At the surface it is the approach's origin, far away it is that of a point load."""
    exact = hertz.Sphere()
    assert exact.axial(1e-9) == pytest.approx(0.0, abs=1e-4 * exact.approach)
    depth = 200.0
    nu = exact.poisson
    point = exact.force * (1 + nu) * (3 - 2 * nu) / (2 * np.pi * exact.young * depth)
    assert exact.approach - exact.axial(depth) == pytest.approx(point, rel=1e-3)
