"""Overlaps of undeformed bodies: refused, or pressed out; none is dropped but that of chords."""

import re

import numpy as np
import pytest
from mpi4py import MPI

from contact import Body, Contact, Fixed, Linear, Plane, Problem, parse_case, solve
from contact.cli.new import facing_parts
from contact.errors import InputError
from tests.problems import overlapping
from tests.problems.overlapping import POISSON, UNIAXIAL, YOUNG, body, layers, pressure

COMM = MPI.COMM_WORLD

#: Degrees of geometry and displacements.
ELEMENTS = ((1, 1), (1, 2), (2, 2))

#: Depths over the length of a facet.
SHARES = (0.001, 0.01, 0.1, 0.3)

PLANE, SPACE = ("triangle", "quadrilateral"), ("tetrahedron", "hexahedron")

BETWEEN = {"on": "outer0", "against": "inner1"}


def forms(cell):
    """Return the forms of layers of these cells, with the length of their sides."""
    sides = {"flat": 1.0, "tube": 1.0, "ring": 1.5 * np.pi / 2}
    return sides if cell in PLANE else {name: sides[name] for name in ("flat", "ring")}


def mean(solution):
    """Return the mean pressure."""
    nodes = solution.problem.nodes
    return nodes.sum(solution.pressure) / nodes.sum(np.ones_like(nodes.weight))


@pytest.mark.parallel
@pytest.mark.parametrize("element", ELEMENTS)
@pytest.mark.parametrize("cell", [*PLANE, *SPACE])
def test_overlaps_are_refused(cell, element):
    """Down to a thousandth of a facet; of rings that is a hundredth of the sagitta of a facet."""
    order, degree = element
    for form, side in forms(cell).items():
        for share in SHARES:
            depth = share * side / 4
            domain = layers(COMM, cell, order, form, depth)
            for on, against in (("outer0", "inner1"), ("inner1", "outer0")):
                contact = Contact(on, against=against)
                with pytest.raises(InputError, match=r"\[overlap\]") as raised:
                    Problem(domain, body(form, domain.dim, 2), contact, degree=degree)
                told = float(re.search(r"by up to (\S+) more", str(raised.value))[1])
                # Beside a facet's vertices a hundredth of its sagitta may be an error of the curve.
                least = 0.2 if form == "ring" else 0.999
                assert least * depth < told < 1.05 * depth
                assert 'overlap = "press"' in str(raised.value)


@pytest.mark.parallel
@pytest.mark.parametrize("element", ELEMENTS)
@pytest.mark.parametrize("cell", [*PLANE, *SPACE])
def test_bodies_that_touch_are_accepted(cell, element):
    """Chords of circles that are the same overlap, and unlike ones are apart elsewhere."""
    order, degree = element
    for form in forms(cell):
        domain = layers(COMM, cell, order, form, 0.0, counts=(5, 4))
        for on, against in (("outer0", "inner1"), ("inner1", "outer0")):
            contact = Contact(on, against=against)
            nodes = Problem(domain, body(form, domain.dim, 2), contact, degree=degree).nodes
            if form != "ring":
                assert nodes.maximum(np.abs(nodes.gap)) < 1e-12 and nodes.cut == 0
            elif order == 2:
                assert nodes.maximum(-nodes.gap) < 1e-4
            elif (on, degree) == ("outer0", 1):
                assert nodes.cut > 1e-3  # longer chords of the bore


@pytest.mark.parallel
@pytest.mark.parametrize("element", ELEMENTS)
@pytest.mark.parametrize("cell", PLANE)
def test_overlaps_are_pressed_out(cell, element):
    """The mean pressure is that of the closed form, of any depth."""
    order, degree = element
    table = [("flat", 0.3, 4), ("tube", 0.001, 8), ("tube", 0.3, 8), ("ring", 0.3, 16)]
    # Gaps of degree 1 are those of straight facets, which is said.
    table += [("ring", 0.001, 16)] if degree == 2 else []
    for form, share, count in table:
        depth = share * forms(cell)[form] / count
        domain = layers(COMM, cell, order, form, depth, counts=(count, count * 5 // 4))
        contact = Contact("outer0", against="inner1", press=True)
        solution = solve(Problem(domain, body(form, 2, 2), contact, degree=degree))
        assert solution.converged
        assert mean(solution) == pytest.approx(pressure(form, depth), rel=0.01)


@pytest.mark.parallel
@pytest.mark.parametrize("element", ELEMENTS)
@pytest.mark.parametrize("cell", SPACE)
def test_overlaps_are_pressed_out_in_space(cell, element):
    order, degree = element
    for form, share, count in (("flat", 0.1, 4), ("ring", 0.01, 6)):
        if form == "ring" and (degree == 1 or order == 1):
            continue
        depth = share * forms(cell)[form] / count
        domain = layers(COMM, cell, order, form, depth, counts=(count, count + 1))
        contact = Contact("outer0", against="inner1", press=True)
        solution = solve(Problem(domain, body(form, 3, 2), contact, degree=degree))
        assert solution.converged
        assert mean(solution) == pytest.approx(pressure(form, depth), rel=0.01)


@pytest.mark.parallel
@pytest.mark.parametrize(
    ("form", "element"), [("flat", (1, 1)), ("tube", (1, 2)), ("ring", (2, 2))]
)
def test_a_negative_gap_is_an_interference(form, element):
    """The case file says the same of meshes that touch as of those that overlap."""
    order, degree = element
    held = {"flat": [("inner0", [0.0, "free"]), ("outer1", [0.0, "free"])]}.get(form, [])
    held += [
        ("below", ["free", 0.0]),
        ("above", [0.0, "free"] if form == "ring" else ["free", 0.0]),
    ]
    case = {
        "material": {"young": YOUNG, "poisson": POISSON},
        "fixed": [{"on": part, "displacement": given} for part, given in held],
        "space": {"degree": degree},
    }
    depth, found = 1e-3, []
    for drawn, more in ((depth, {"overlap": "press"}), (0.0, {"gap": -depth})):
        domain = layers(COMM, "quadrilateral", order, form, drawn, counts=(8, 10))
        given = {**case, "contact": {**BETWEEN, **more}}
        if form == "tube":
            given["space"]["kinematics"] = "axisymmetric"
        solution = solve(parse_case(given), domain=domain)
        assert solution.converged
        assert mean(solution) == pytest.approx(pressure(form, depth), rel=0.01)
        found.append(mean(solution))
    assert found[0] == pytest.approx(found[1], rel=2e-3)


@pytest.mark.parallel
@pytest.mark.parametrize("degree", [1, 2])
def test_rigid_foundations(degree):
    """A flat side is not the chord of a curve, whatever other sides are."""
    domain = layers(COMM, "triangle", 1, "flat", 0.0)
    width = 0.5
    for share in SHARES:
        depth = share / 4
        plane = Plane((1.0 + depth, 0.0), (1.0, 0.0))
        held = [Fixed("below", [None, 0.0]), Fixed("above", [None, 0.0])]
        held += [Fixed(part, [0.0, None]) for part in ("outer0", "inner1")]
        ring = Body(Linear(YOUNG, POISSON), held)
        with pytest.raises(InputError, match=r"\[overlap\]"):
            Problem(domain, ring, Contact("inner0", plane), degree=degree)
        for contact in (Contact("inner0", plane, press=True), Contact("inner0", -depth)):
            solution = solve(Problem(domain, ring, contact, degree=degree))
            np.testing.assert_allclose(solution.pressure, UNIAXIAL * depth / width, rtol=1e-7)


@pytest.mark.parallel
@pytest.mark.parametrize("degree", [1, 2])
def test_flat_sides_beside_curved_ones(degree):
    """What the curvature of some facets explains is no overlap there, and one at flat facets."""
    for depth in (0.0, 1e-4):
        domain = layers(COMM, "quadrilateral", 1, "flat", 0.0, counts=(16, 12))
        x, second = domain.mesh.geometry.x, overlapping.of_layer(domain, 1)
        y = x[:, 1].copy()
        # The sagitta of a facet of the second is 9e-4.
        x[:, 0] += 1.0 - np.sqrt(1.0 - np.maximum(y - 0.5, 0.0) ** 2)
        x[second, 0] -= depth * np.clip(4 - 10 * y[second], 0.0, 1.0)
        given, contact = body("flat", 2, 2), Contact("outer0", against="inner1")
        if depth > 0:
            with pytest.raises(InputError, match=r"\[overlap\]"):
                Problem(domain, given, contact, degree=degree)
        else:
            assert Problem(domain, given, contact, degree=degree).nodes.size > 0


def three(depths):
    """Return three flat layers, each of two cells."""
    ends = (1.0, 1.5, 2.0, 2.5)
    return layers(COMM, "quadrilateral", 1, "flat", depths, ends, (4, 5, 4))


@pytest.mark.parallel
def test_several_pairs():
    """An assembly under load: the overlap of any pair is refused, and adds to the pressure."""
    push, depths = 0.02, (0.0, 0.004)
    domain = three(depths)
    fixed = [*list(body("flat", 2, 3).fixed)[:-1], Fixed("outer2", [-push, None])]
    given = Body(Linear(YOUNG, POISSON), fixed)
    pairs = [("outer0", "inner1"), ("outer1", "inner2")]

    def contacts(*press):
        return [Contact(a, against=b, press=p) for (a, b), p in zip(pairs, press, strict=True)]

    for press in ((False, False), (True, False)):
        with pytest.raises(InputError, match=r"contact\.1\.against.*\[overlap\]"):
            Problem(domain, given, contacts(*press))
    solution = solve(Problem(domain, given, contacts(False, True)))
    exact = UNIAXIAL * (sum(depths) + push) / 1.5
    np.testing.assert_allclose(solution.pressure, exact, rtol=1e-8)


@pytest.mark.parallel
@pytest.mark.parametrize("form", ["flat", "ring"])
def test_parts_that_face_each_other_may_overlap(form):
    """Sides that look away from each other are no pairs."""
    for depth in (0.0, 0.001, 0.05):
        ((gap, *pair),) = facing_parts(layers(COMM, "triangle", 1, form, depth, counts=(16, 16)))
        assert sorted(pair) == ["inner1", "outer0"]
        assert gap == pytest.approx(-depth, rel=0.5)


def test_the_closed_form_is_that_of_lame():
    """Both rings of one material as one: the sum of their ways is the interference."""
    a, c, b = overlapping.RADII
    p, way = pressure("ring", 1e-9), 0.0
    for inner, outer, sign in ((a, c, -1), (c, b, 1)):
        ratio = (outer**2 + inner**2) / (outer**2 - inner**2)
        way += c * (1 + POISSON) / YOUNG * ((1 - POISSON) * ratio + sign * POISSON) * p
    assert way == pytest.approx(1e-9)
