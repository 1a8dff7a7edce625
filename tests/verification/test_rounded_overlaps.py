"""What counts as rounding of overlaps: by the thinner body, and by the digits of files."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import Body, Contact, Fixed, Linear, Plane, Problem, Sphere, solve
from contact.errors import InputError
from tests.problems.overlapping import (
    ELEMENTS,
    PLANE,
    POISSON,
    RADII,
    SPACE,
    UNIAXIAL,
    YOUNG,
    body,
    layers,
    mean,
    of_layer,
    pressure,
    told,
)

COMM = MPI.COMM_WORLD

BETWEEN = {"on": "outer0", "against": "inner1"}

#: Ends of two layers of half a thousandth of the mesh, whose third layer reaches to 1.
SMALL = (1e-3, 1.5e-3, 2e-3, 1.0)


@pytest.mark.parallel
@pytest.mark.parametrize("element", ELEMENTS)
@pytest.mark.parametrize("cell", PLANE)
@pytest.mark.parametrize("form", ["flat", "tube", "ring"])
def test_overlaps_of_small_bodies_beside_a_large_one(form, cell, element):
    """What counts as rounding is measured by the thinner body, not by the whole mesh."""
    order, degree = element
    given, count = body(form, 2, 3), {"flat": 4, "tube": 8, "ring": 32}[form]
    if form == "flat":
        given = Body(given.materials, [*given.fixed, Fixed("outer1", [0.0, 0.0])])
    depth, stretch = 0.9e-6, 0.9e-6 / (SMALL[2] - SMALL[0])
    domain = layers(COMM, cell, order, form, [depth, -0.1], SMALL, (count, count + 1, 3))
    told(domain, given, Contact(**BETWEEN), degree, 'overlap = "press"')
    solution = solve(Problem(domain, given, Contact(**BETWEEN, press=True), degree=degree))
    assert solution.converged
    if form == "flat":
        assert mean(solution) == pytest.approx(UNIAXIAL * stretch, rel=1e-6)
    elif form == "tube":
        assert mean(solution) == pytest.approx(pressure(form, depth, SMALL[:3]), rel=0.01)


@pytest.mark.parallel
def test_depths_that_rounded_positions_may_have_are_said():
    """They may strain a small body: an interference is one by the user's word alone."""
    given = body("flat", 2, 3)
    given = Body(given.materials, [*given.fixed, Fixed("outer1", [0.0, 0.0])])
    for depth, words in ((1e-7, "overlap by up to 1e-07"), (1e-11, "")):
        domain = layers(COMM, "quadrilateral", 1, "flat", [depth, -0.1], SMALL, (4, 5, 3))
        solution = solve(Problem(domain, given, Contact(**BETWEEN)))
        assert any(words in warning for warning in solution.warnings)
        assert (words != "") == any("overlap" in warning for warning in solution.warnings)
        pressed = solve(Problem(domain, given, Contact(**BETWEEN, press=True)))
        stretch = depth / (SMALL[2] - SMALL[0])
        assert mean(pressed) == pytest.approx(UNIAXIAL * stretch, rel=1e-4)


@pytest.mark.parallel
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("loaded", [False, True])
@pytest.mark.parametrize("cell", [*PLANE, "hexahedron"])
def test_depths_that_strain_thin_tips_of_thick_bodies_are_said(cell, loaded, degree):
    """The thickness of a body is a mean: what is nothing to its bulk may strain a tip of it."""
    tip, heads = 1e-3, ["inner0", "outer1"]
    for depth, said in ((3e-7, True), (1e-12, False)):
        domain = layers(COMM, cell, 1, "flat", 0.0, counts=(4, 4))
        d, x = domain.dim, domain.mesh.geometry.x
        second = of_layer(domain, 1)
        along = 2 * np.abs(x[:, 0] - RADII[1])
        x[:, 1:d] *= np.where(along < 0.3, tip, 1.0)[:, None]
        place = np.interp(along, [0, 0.25, 1.0], [0.0, tip, 1.0])
        x[:, 0] = 1 + np.where(second, place - depth, -place)
        given = [Fixed(name, [0.0] * d) for name in heads]
        if loaded:
            given[0] = Fixed("inner0", [1e-6, *[0.0] * (d - 1)])
        body, axis = Body(Linear(YOUNG, POISSON), given), np.eye(d)[0]
        wall = Plane((1 - depth) * axis, -axis)
        for contact in (Contact(**BETWEEN), Contact("outer0", wall)):
            solution = solve(Problem(domain, body, contact, degree=degree))
            warnings = [text for text in solution.warnings if "overlap" in text]
            assert len(warnings) == said
            assert all(f"by up to {depth:.3g} at outer0" in text for text in warnings)


@pytest.mark.parallel
@pytest.mark.parametrize("cell", [*PLANE, *SPACE])
@pytest.mark.parametrize("thickness", [0.1, 1e-3])
def test_bodies_that_touch_in_files_of_seven_digits(cell, thickness):
    """A thin layer on a block, turned and moved away from the origin."""
    for degree, shift in ((1, 0.0), (2, 3.0)):
        domain = layers(COMM, cell, 1, "flat", 0.0, (1.0, 2.0, 2.0 + thickness), counts=(3, 4))
        d, x = domain.dim, domain.mesh.geometry.x
        turn = np.linalg.qr(np.random.default_rng(4).standard_normal((d, d)))[0]
        x[:, :d] = np.float32(x[:, :d] @ turn * np.linalg.det(turn) + shift)
        held = [Fixed("inner0", [0.0] * d), Fixed("outer1", [0.0] * d)]
        given = Body(Linear(YOUNG, POISSON), held)
        for on, against in (("outer0", "inner1"), ("inner1", "outer0")):
            nodes = Problem(domain, given, Contact(on, against=against), degree=degree).nodes
            assert nodes.maximum(np.abs(nodes.gap)) < 1e-6


@pytest.mark.parallel
@pytest.mark.parametrize("degree", [1, 2])
def test_depths_of_small_bodies_in_shapes(degree):
    """A rigid plane or tube in a body of half a thousandth of the mesh."""
    for form, shape in (("flat", Plane), ("ring", Sphere)):
        domain = layers(COMM, "quadrilateral", 2, form, [0.0, -0.1], SMALL, (16, 16, 3))
        given = body(form, 2, 3)
        given = Body(given.materials, [*given.fixed, Fixed("inner0", [0.0, 0.0])])
        end = SMALL[1] + 5e-6
        foundation = Plane((end, 0.0), (1.0, 0.0)) if shape is Plane else Sphere((0, 0), end)
        with pytest.raises(InputError, match=r"\[overlap\]"):
            Problem(domain, given, Contact("inner1", foundation), degree=degree)
