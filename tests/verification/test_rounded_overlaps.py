"""What counts as rounding of overlaps: by the thinner body, and by the digits of files."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from contact import Body, Contact, Fixed, Linear, Material, Plane, Problem, Sphere, solve
from contact.cli.check import expectations
from contact.errors import InputError
from contact.mesh.domain import cells_in, from_mesh
from contact.results.remarks import rounded_overlaps
from tests.problems.meshes import midpoints
from tests.problems.overlapping import (
    ELEMENTS,
    PLANE,
    POISSON,
    RADII,
    SPACE,
    UNIAXIAL,
    YOUNG,
    body,
    boxes,
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
@pytest.mark.parametrize(("loaded", "width"), [(False, 1e-3), (True, 1e-3), (True, 1.0)])
@pytest.mark.parametrize("cell", [*PLANE, "hexahedron"])
def test_depths_that_strain_thin_tips_of_thick_bodies_are_said(cell, loaded, width, degree):
    """What is nothing to the bulk of a body may strain a tip of it, or one layer of its cells."""
    tip, heads = 1e-3, ["inner0", "outer1"]
    for depth, said in ((3e-7, True), (1e-12, False)):
        domain = layers(COMM, cell, 1, "flat", 0.0, counts=(4, 4))
        d, x = domain.dim, domain.mesh.geometry.x
        second = of_layer(domain, 1)
        along = 2 * np.abs(x[:, 0] - RADII[1])
        x[:, 1:d] *= np.where(along < 0.6, width, 1.0)[:, None]
        place = np.interp(along, [0, 0.5, 1.0], [0.0, tip, 1.0])
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
            lines = expectations(solution.problem)
            assert any("surfaces overlap by up to" in line for line in lines) == said


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
        supports = [Fixed("inner0", [0.0] * d), Fixed("outer1", [0.0] * d)]
        given = Body(Linear(YOUNG, POISSON), supports)
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


def distant(shift, depth):
    """Return two blocks side by side, `depth` in each other and moved by `shift`, and a body."""
    domain = layers(COMM, "quadrilateral", 1, "flat", depth)
    domain.mesh.geometry.x[:, :2] += shift
    return domain, Body(Linear(YOUNG, POISSON), [Fixed("inner0", [0, 0]), Fixed("outer1", [0, 0])])


@pytest.mark.parallel
def test_overlaps_beside_soft_parts_of_a_side():
    """A soft half of both sides is strained by 0.1; of the stiff half the overlap is told."""
    domain, _ = distant(0.0, 3e-7)
    soft = cells_in(domain.mesh, lambda x: x[1] < 0.5)
    stiff = cells_in(domain.mesh, lambda x: x[1] >= 0.5)
    domain = replace(domain, regions={"soft": soft, "stiff": stiff})
    moduli = {"soft": 1e-3, "stiff": YOUNG}
    given = Body([Material(on=on, young=E, poisson=POISSON) for on, E in moduli.items()], [])
    problem, said = Problem(domain, given, Contact(**BETWEEN)), []
    start = problem.start()
    x = start.x.copy()
    u = problem.body.nodal(x)
    place = problem.body.space.tabulate_dof_coordinates()[: len(u)]
    u[place[:, 1] < 0.5, 0] = 0.1 * place[place[:, 1] < 0.5, 0]
    for pressed in (1e-4, 1e-2):
        multipliers = replace(
            start.multipliers, contact=np.full_like(start.multipliers.contact, pressed)
        )
        said.append(len([*rounded_overlaps(problem, replace(start, x=x, multipliers=multipliers))]))
    assert said == [1, 0]


@pytest.mark.parallel
@pytest.mark.parametrize("gap", [0.0, 1e-3])
def test_the_overlap_is_that_of_the_bodies_and_their_gap(gap):
    """A positive gap makes up for it."""
    domain, given = distant(0.0, 3e-7)
    problem = Problem(domain, given, Contact(**BETWEEN, gap=gap))
    assert problem.geometries[0].cut == pytest.approx(0.0 if gap else 3e-7, rel=1e-6)
    said = [text for text in solve(problem).warnings if "overlap by up to 3e-07" in text]
    assert len(said) == (gap == 0)


@pytest.mark.parallel
@pytest.mark.parametrize(("shift", "depth"), [(1e3, 1.9e-3), (5e5, 0.09)])
def test_overlaps_far_from_the_origin(shift, depth):
    """Where positions may be rounded by more than a thousandth of a body, overlaps are refused."""
    domain, given = distant(shift, depth)
    assert told(domain, given, Contact(**BETWEEN)) == pytest.approx(depth, rel=1e-6)
    wall = Plane((RADII[1] - depth + shift, shift), (-1.0, 0.0))
    with pytest.raises(InputError, match=r"\[overlap\]"):
        Problem(domain, given, Contact("outer0", wall))


@pytest.mark.parallel
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", [*PLANE, "hexahedron"])
@pytest.mark.parametrize("form", ["edge", "round"])
def test_edges_and_round_bodies_that_overlap_by_rounding_touch(form, cell, degree):
    """Their gaps are those of bodies that touch: no force, and the depth is told."""
    depth, gaps = 3e-7, []
    for on, against in (("outer0", "inner1"), ("inner1", "outer0")):
        for drawn in (0.0, depth):
            domain = layers(COMM, cell, 1, "flat", drawn, counts=(4, 4))
            x, second = domain.mesh.geometry.x, of_layer(domain, 1)
            apart = np.abs(x[:, 1] - 0.5)
            x[:, 0] += second * (0.2 * apart if form == "edge" else 0.5 * apart**2)
            given = Body(Linear(YOUNG, POISSON), [])
            problem = Problem(domain, given, Contact(on, against=against), degree=degree)
            gaps.append(problem.nodes.gap)
            assert problem.geometries[0].cut == pytest.approx(drawn, rel=0.1, abs=1e-12)
        touching, found = gaps[-2:]
        assert np.all(found >= np.minimum(touching, 0.0) - 1e-12)


def test_squares_whose_corners_and_middles_are_in_line_touch():
    """The nearest facet of a point is found although its centre and nodes are on one line."""
    mesh = boxes(COMM, "quadrilateral", 1, [[2, 2], [2, 2]])
    facets, middle, *_ = midpoints(mesh)
    ends = {"outer0": 1.0, "inner1": 2.0}
    sides = {name: facets[np.abs(middle[:, 0] - end) < 1e-9] for name, end in ends.items()}
    turn = np.linalg.qr(np.random.default_rng(4).standard_normal((2, 2)))[0]
    turn[0] *= np.sign(np.linalg.det(turn))
    x = mesh.geometry.x
    x[:, 0] -= np.where(x[:, 0] > 1.5, 2.0, 1.0)
    x[:, :2] = x[:, :2] @ turn.T + 10
    given = Body(Linear(YOUNG, POISSON), [])
    problem = Problem(from_mesh(mesh, sides, 1.0), given, Contact(**BETWEEN))
    assert problem.geometries[0].cut < 1e-12
