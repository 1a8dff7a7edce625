"""Overlaps of undeformed bodies: refused, or pressed out; none is dropped but that of chords."""

import re
from dataclasses import replace

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx.mesh import compute_midpoints
from mpi4py import MPI
from scipy.sparse.linalg import spsolve

from contact import (
    Body,
    Contact,
    Fixed,
    Linear,
    NewtonOptions,
    Paraboloid,
    Plane,
    Problem,
    Sphere,
    build_problem,
    evolve,
    parse_case,
    solve,
)
from contact._compat import geometry_dofmap
from contact.cli.check import expectations
from contact.cli.new import facing_parts
from contact.errors import InputError
from contact.interface.mortar.coupling import couple
from contact.interface.mortar.surface import Surface
from contact.mesh.domain import from_mesh
from contact.mesh.grid import box, rectangle
from contact.problem.checks import check_problem
from tests.problems import overlapping
from tests.problems.meshes import assembled, midpoints
from tests.problems.overlapping import (
    ELEMENTS,
    PLANE,
    POISSON,
    SPACE,
    UNIAXIAL,
    YOUNG,
    body,
    corner,
    layers,
    mean,
    pressure,
    told,
)

COMM = MPI.COMM_WORLD

#: Depths over the length of a facet.
SHARES = (0.001, 0.03, 0.3)

BETWEEN = {"on": "outer0", "against": "inner1"}


def forms(cell):
    """Return the forms of layers of these cells, with the length of their sides."""
    sides = {"flat": 1.0, "tube": 1.0, "ring": 1.5 * np.pi / 2}
    return sides if cell in PLANE else {name: sides[name] for name in ("flat", "ring")}


@pytest.mark.parallel(2)
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
                given, contact = body(form, domain.dim, 2), Contact(on, against=against)
                # Beside a facet's vertices a hundredth of its sagitta may be an error of the curve.
                least = 0.2 if form == "ring" else 0.999
                found = told(domain, given, contact, degree, 'overlap = "press"')
                assert least * depth < found < 1.05 * depth


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
            problem = Problem(domain, body(form, domain.dim, 2), contact, degree=degree)
            nodes, cut = problem.nodes, problem.geometries[0].cut
            if form != "ring":
                assert nodes.maximum(np.abs(nodes.gap)) < 1e-12 and cut < 1e-12
            elif order == 2:
                assert nodes.maximum(-nodes.gap) < 1e-4
            elif (on, degree) == ("outer0", 1):
                assert cut > 1e-3  # longer chords of the bore


@pytest.mark.parallel
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("cell", [*PLANE, *SPACE])
def test_a_body_that_is_drawn_twice_is_refused(cell, order):
    """No point of either boundary is within the other body, whatever the two meshes are."""
    for form in forms(cell):
        for counts in ((3, 3), (3, 4)):
            domain = layers(COMM, cell, order, form, 0.5, counts=counts)
            given = Body(Linear(YOUNG, POISSON), [])
            with pytest.raises(InputError, match=r"\[overlap\]"):
                Problem(domain, given, Contact("outer0", against="inner1", press=True))
            (found,) = Problem(domain, given, Contact("inner0", 0.1)).unpaired.values()
            assert 0.1 < found < 0.3


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
    supports = {"flat": [("inner0", [0.0, "free"]), ("outer1", [0.0, "free"])]}.get(form, [])
    supports += [
        ("below", ["free", 0.0]),
        ("above", [0.0, "free"] if form == "ring" else ["free", 0.0]),
    ]
    case = {
        "material": {"young": YOUNG, "poisson": POISSON},
        "fixed": [{"on": part, "displacement": given} for part, given in supports],
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
        supports = [Fixed("below", [None, 0.0]), Fixed("above", [None, 0.0])]
        supports += [Fixed(part, [0.0, None]) for part in ("outer0", "inner1")]
        ring = Body(Linear(YOUNG, POISSON), supports)
        with pytest.raises(InputError, match=r"\[overlap\]"):
            Problem(domain, ring, Contact("inner0", plane), degree=degree)
        for contact in (Contact("inner0", plane, press=True), Contact("inner0", -depth)):
            solution = solve(Problem(domain, ring, contact, degree=degree))
            np.testing.assert_allclose(solution.pressure, UNIAXIAL * depth / width, rtol=1e-7)


@pytest.mark.parallel
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", [*PLANE, *SPACE])
def test_rigid_shapes_within_a_facet(cell, degree):
    """What cuts a flat facet between its nodes is refused; of a press if none is to refine it."""
    d = 2 if cell in PLANE else 3
    make = rectangle if d == 2 else box
    domain = make(COMM, (0.0,) * d, (4.0,) * d, (4,) * d, cell=cell)
    down, given = -np.eye(d)[d - 1], Body(Linear(YOUNG, POISSON), [Fixed("top", [0.0] * d)])
    share = 1 / 4 if degree == 2 else 1 / 3 if d == 3 else 1 / 2
    radius = 0.3 if degree == 2 else 1.0
    for depth in (-0.1, 0.0, 0.01, 0.1):
        tip = np.array([1 + share] * (d - 1) + [depth])
        for shape in (Sphere(tip + radius * down, radius), Paraboloid(tip, down, 0.3)):
            for press in (False, True):
                contact = Contact("bottom", shape, press=press)
                if depth <= 0 or press:
                    problem = Problem(domain, given, contact, degree=degree)
                    assert problem.nodes.size > 0
                    if press and depth == 0.1 and isinstance(shape, Sphere):
                        for start in (check_problem, solve, lambda p: next(evolve(p, [1.0]))):
                            with pytest.raises(InputError, match=r"shorter facets.*\[overlap\]"):
                                start(problem)
                        check_problem(problem, refined=True)
                    continue
                with pytest.raises(InputError, match=r"shorter facets.*\[overlap\]"):
                    Problem(domain, given, contact, degree=degree)


@pytest.mark.parallel
def test_a_press_within_a_facet_is_refused_before_the_solve():
    """Unless the mesh is to be adapted: then on the last mesh, where it is still between nodes."""
    # The centre of a small ball within the body is beside all nodes: it was said to lie behind.
    small = {"shape": "sphere", "centre": [1.5, 0.1], "radius": 0.3}
    ball = {"shape": "sphere", "centre": [1.5, -0.9], "radius": 1.0}
    case = {
        "mesh": {"generator": "rectangle", "size": [4.0, 4.0], "cells": [4, 4]},
        "material": {"young": YOUNG, "poisson": POISSON},
        "fixed": [{"on": "top", "displacement": [0.0, 0.0]}],
        "contact": {"on": "bottom", "foundation": ball, "overlap": "press"},
    }
    refused = pytest.raises(InputError, match=r"shorter facets.*\[overlap\]")
    for given in (ball, small):
        for overlap in ("press", "refuse"):
            case["contact"] |= {"foundation": given, "overlap": overlap}
            with refused:
                build_problem(parse_case(case))
    case["contact"] |= {"foundation": ball, "overlap": "press"}
    case["evolution"] = {"times": [0.0, 1.0], "steps": [2]}
    with refused:
        build_problem(parse_case(case))
    del case["evolution"]
    case["mesh"]["adapt"] = {"error": 0.1, "max_unknowns": 60}
    build_problem(parse_case(case))
    with refused:
        solve(parse_case(case))
    case["mesh"]["adapt"]["max_unknowns"] = 2000
    solution = solve(parse_case(case))
    assert solution.converged and solution.contact_force[1] < 0
    # A coarser level, of 4 by 4 cells, does not resolve it.
    case["mesh"] = {"generator": "rectangle", "size": [4.0, 4.0], "cells": [8, 8]}
    solution = solve(parse_case(case), NewtonOptions(nested=True))
    assert solution.converged and solution.contact_force[1] < 0


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


def between(*angles):
    """Return edges of the length 1 at angles from the normal of a side, in degrees."""
    return [[np.sin(angle), np.cos(angle)] for angle in np.deg2rad(angles)]


#: Edges of parallelepipeds whose corner is in a side: square, blade, almost flat, aslant; a point,
#: and an edge that is in the side as a whole, or at one end alone.
CORNERS = {
    2: [between(-45, 45), between(-12, 12), between(-85, 85), between(-70, 20)],
    3: [
        [[1.0, 1.0, 0.0], [-0.5, 1.0, 0.8], [-0.5, 1.0, -0.8]],
        [[-0.3, 0.8, 0.0], [0.3, 0.8, 0.0], [0.0, 0.0, 1.0]],
        [[-0.8, 0.3, 0.0], [0.8, 0.3, 0.0], [0.0, 0.4, 1.0]],
    ],
}

#: Those of cones: along the axis, and from the tip.
CONES = [[[0.0, 1.0], *between(angle)] for angle in (20, 45, 85)]


def corners(cell, order):
    """Yield a function from the depth to a mesh, and the supports of its bodies."""
    d = 2 if cell in PLANE else 3
    numbers = [[4, 2], [2, 2]] if d == 2 else [[3, 1, 3], [2, 2, 2]]
    for edges in CORNERS[d] + (CONES if d == 2 else []):
        axis = edges in CONES
        supports = [
            Fixed(part, [None if axis else 0.0, *[0.0] * (d - 1)]) for part in ("base", "end")
        ]

        def mesh(depth, edges=edges, axis=axis):
            return corner(COMM, cell, order, edges, depth, numbers, axis)

        yield mesh, Body(Linear(YOUNG, POISSON), supports), axis


@pytest.mark.parallel(2)
@pytest.mark.parametrize("element", ELEMENTS)
@pytest.mark.parametrize(
    "cell", [*PLANE, *(pytest.param(cell, marks=pytest.mark.slow) for cell in SPACE)]
)
def test_corners_are_refused(cell, element):
    """Of any angle, within a facet, by shares of that; a corner that touches is none."""
    order, degree = element
    for mesh, given, axis in corners(cell, order):
        for share in (0.0, *SHARES):
            domain = mesh(share)
            for on, against in (("top", "sides"), ("sides", "top")):
                contact = Contact(on, against=against)
                if share == 0:
                    (found,) = Problem(domain, given, contact, degree=degree).geometries
                    assert found.cut < 1e-12 and np.isfinite(found.nodes.admissible_normal).all()
                    continue
                # That of a cone is measured along its normal.
                least = 0.3 if axis else 0.99
                assert least * share < told(domain, given, contact, degree) < 1.01 * share


@pytest.mark.parallel(2)
@pytest.mark.parametrize(
    "cell", [*PLANE, *(pytest.param(cell, marks=pytest.mark.slow) for cell in SPACE)]
)
def test_a_gap_below_0_is_refused_as_the_drawn_overlap(cell):
    """Of corners within a facet, that touch, or are less far away; what is apart is accepted."""
    depths = []
    for mesh, given, _ in corners(cell, 1):
        for on, against in (("top", "sides"), ("sides", "top")):
            drawn = Contact(on, against=against, press=True)
            pairs = [(mesh(0.01), drawn)]
            for share, gap in ((0.0, -0.01), (0.0, lambda x: -0.01 - 1e-5 * x[1]), (-0.02, -0.01)):
                pairs.append((mesh(share), Contact(on, gap, against=against)))
            reasons = []
            for domain, contact in pairs:
                try:
                    Problem(domain, given, contact)
                    reasons.append("")
                except InputError as error:
                    reasons.append(str(error))
            refused = ["on and against exchanged" in reason for reason in reasons]
            assert refused == [refused[0]] * 3 + [False] and reasons[3] == ""
            if refused[0]:
                depths.append(float(re.search(r"by up to (\S+) more", reasons[1])[1]))
    assert len(depths) > 1
    assert depths == pytest.approx([0.01] * len(depths))


@pytest.mark.parametrize("degree", [1, 2])
def test_a_corner_is_pressed_out_from_its_side(degree):
    """Its force is that of plain elasticity, the corner on the side that it was in."""
    depth = 0.01
    domain = corner(COMM, "quadrilateral", 1, between(-45, 45), depth, [[1, 1], [2, 2]])
    given = Body(Linear(YOUNG, POISSON), [Fixed(part, [0.0, 0.0]) for part in ("base", "end")])
    with pytest.raises(InputError, match=r"on and against exchanged.*\[overlap\]"):
        Problem(domain, given, Contact("top", against="sides", press=True), degree=degree)
    contact = Contact("sides", against="top", press=True)
    solution = solve(Problem(domain, given, contact, degree=degree))
    space = fem.functionspace(domain.mesh, ("Lagrange", degree, (2,)))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    strain = ufl.sym(ufl.grad(u))
    mu, bulk = YOUNG / 2 / (1 + POISSON), YOUNG * POISSON / (1 + POISSON) / (1 - 2 * POISSON)
    stress = 2 * mu * strain + bulk * ufl.tr(strain) * ufl.Identity(2)
    stiffness = (
        fem.assemble_matrix(fem.form(ufl.inner(stress, ufl.grad(v)) * ufl.dx)).to_scipy().tocsc()
    )
    x = space.tabulate_dof_coordinates()
    side, way = np.flatnonzero(np.abs(x[:, 1]) < 1e-9), np.zeros(2 * len(x))
    way[2 * np.argmin(np.abs(x[:, 0]) + np.abs(x[:, 1] + depth)) + 1] = 1.0
    assert side.size == degree + 1
    for node in side:  # Lagrange's functions at x = 0
        others = x[np.setdiff1d(side, node), 0]
        way[2 * node + 1] = -np.prod(-others / (x[node, 0] - others))
    free = np.ones(way.size, dtype=bool)
    for part in ("base", "end"):
        nodes = fem.locate_dofs_topological(space, 1, domain.facets(part))
        free[2 * nodes] = free[2 * nodes + 1] = False
    compliance = way[free] @ spsolve(stiffness[free][:, free], way[free])
    assert solution.converged
    force = solution.problem.nodes.sum(solution.pressure)
    assert force == pytest.approx(depth / compliance, rel=1e-9 if degree == 1 else 1e-5)


@pytest.mark.parallel
@pytest.mark.parametrize("cell", [*PLANE, pytest.param("hexahedron", marks=pytest.mark.slow)])
def test_a_press_beyond_the_end_of_one_side(cell):
    """Either side as slave has the force of a fine mesh: no node beyond the rim bears any."""
    d = 2 if cell in PLANE else 3

    def force(counts, degree, backwards, end=0.62):
        domain = layers(COMM, cell, 1, "flat", 0.002, counts=counts)
        x, second = domain.mesh.geometry.x, overlapping.of_layer(domain, 1)
        x[second, 1] = 0.12 + (end - 0.12) * x[second, 1]
        supports = [Fixed(part, [0.0] * d) for part in ("inner0", "outer1", "above")]
        given = Body(Linear(YOUNG, POISSON), supports)
        on, against = ("inner1", "outer0") if backwards else ("outer0", "inner1")
        contact = Contact(on, against=against, press=True)
        solution = solve(Problem(domain, given, contact, degree=degree))
        assert solution.converged
        return abs(solution.contact_force[0])

    exact = force((48, 32) if d == 2 else (12, 10), 2, True)
    for counts, backwards in (((7, 4), False), ((7, 4), True), ((9, 5), False)):
        assert force(counts, 2, backwards) == pytest.approx(exact, rel=0.07)
    # No facet of a coarse side is within the other one.
    with pytest.raises(InputError, match=r"shorter facets of on.*\[overlap\]"):
        force((2, 8), 2, False, 0.4)


def side_of(points, first):
    """Return a chain of straight facets along points from left to right, its left side outside."""
    corners = np.stack([points[:-1], points[1:]], axis=1)
    normal = np.diff(points, axis=0)[:, ::-1] * [-1.0, 1.0]
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    nodes = first + np.column_stack([np.arange(len(normal)), np.arange(1, len(points))])
    none = np.zeros((len(normal), 0))
    return Surface(nodes, corners, normal, none, none, none, 1).with_deviations()


@pytest.mark.parametrize("seed", range(10))
def test_random_polygons_in_a_flat_side(seed):
    """The depth is that of the lowest corner, whichever facets of the side it lies in."""
    rng = np.random.default_rng(seed)
    slopes = np.sort(rng.uniform(-8, 8, rng.integers(2, 7)))
    corners = np.cumsum(
        np.vstack([[0.0, 0.0], rng.uniform(0.2, 1.0, (slopes.size, 1)) * [[1, s] for s in slopes]]),
        axis=0,
    )
    ends = np.linspace(-2, corners[-1, 0] + 2, rng.integers(2, 12))
    turn, move = rng.uniform(0, 2 * np.pi), rng.uniform(-10, 10, 2)
    axes = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    side = side_of(np.column_stack([ends, 0 * ends]) @ axes + move, 0)
    for depth in (-0.1, 0.0, 1e-4, 1e-3, 0.01, 0.1):
        places = corners - [0.0, corners[:, 1].min() + depth]
        polygon = side_of(places[::-1] @ axes + move, 1000)
        found = [couple(*both, 100.0).depth for both in ((side, polygon), (polygon, side))]
        if depth <= 0:
            assert max(found) < 1e-12
        else:
            assert min(found) > 0.1 * depth
            assert max(found) == pytest.approx(depth, rel=1e-6)


@pytest.mark.parallel
@pytest.mark.parametrize("press", [False, True])
def test_overlaps_deeper_than_the_reach(press):
    """They are told from sides that are too far apart: other sides are in the bodies."""
    deep, far = (layers(COMM, "triangle", 1, "flat", depth) for depth in (0.6, -0.6))
    contact = Contact("outer0", against="inner1", press=press)
    with pytest.raises(InputError, match=r"overlap, by up to 0.1 more .*\[overlap\]"):
        Problem(deep, body("flat", 2, 2), contact)
    with pytest.raises(InputError, match=r"\[pair\]"):
        Problem(far, body("flat", 2, 2), contact)


@pytest.mark.parallel(2)
@pytest.mark.parametrize("element", ELEMENTS)
@pytest.mark.parametrize(
    "cell", [*PLANE, "hexahedron", pytest.param("tetrahedron", marks=pytest.mark.slow)]
)
def test_ribs_and_needles_are_refused(cell, element):
    """Whether their flanks face the other side or not, and if nearer facets are apart."""
    order, degree = element
    apart, radii, count = 0.05, (1.0, 2.0, 2.5), 24 if cell in PLANE else 8
    for form in forms(cell):
        for depth in (-0.01, 0.1, 0.45):
            rib = apart + depth
            domain = layers(COMM, cell, order, form, -apart, radii, (4, count), rib)
            for on, against in (("outer0", "inner1"), ("inner1", "outer0")):
                given, contact = body(form, domain.dim, 2), Contact(on, against=against)
                if depth < 0:
                    (found,) = Problem(domain, given, contact, degree=degree).geometries
                    assert found.nodes.maximum(-found.nodes.gap, -1.0) < 0 and found.cut < 1e-12
                    continue
                assert told(domain, given, contact, degree) == pytest.approx(depth, rel=0.1)


@pytest.mark.parallel
@pytest.mark.parametrize("cell", PLANE)
def test_an_overlap_beside_the_sides_of_a_pair(cell):
    """A pair of its own presses it apart, not one that is beside it."""
    domain = layers(COMM, cell, 1, "flat", 0.0, counts=(8, 8))
    x, second = domain.mesh.geometry.x, overlapping.of_layer(domain, 1)
    parts = dict(domain.parts)
    for name in ("outer0", "inner1"):
        facets = domain.facets(name)
        y = compute_midpoints(domain.mesh, 1, facets)[:, 1] if facets.size else np.zeros(0)
        parts |= {f"{name}_low": facets[y < 0.4], f"{name}_high": facets[y > 0.6]}
    x[second, 0] -= 0.01 * np.clip(8 * x[second, 1] - 5, 0.0, 1.0)
    domain, given = replace(domain, parts=parts), body("flat", 2, 2)

    def contacts(*press):
        names = zip(("low", "high"), press, strict=False)
        return [Contact(f"outer0_{n}", against=f"inner1_{n}", press=p) for n, p in names]

    for press in ((False,), (True,)):
        with pytest.raises(InputError, match=r"contact\.against.* up to 0.01 more.*\[overlap\]"):
            Problem(domain, given, contacts(*press))
    with pytest.raises(InputError, match=r"contact\.1\.against.* up to 0.01 more.*\[overlap\]"):
        Problem(domain, given, contacts(False, False))
    nodes = Problem(domain, given, contacts(False, True)).nodes
    assert nodes.maximum(-nodes.gap) == pytest.approx(0.01, rel=1e-6)
    # A press sees nothing of one beside it, though they are nearly alike.
    x[second, 0] -= 0.008 * np.clip(3 - 8 * x[second, 1], 0.0, 1.0)
    with pytest.raises(InputError, match=r"contact\.against.* up to 0.01 more.*\[overlap\]"):
        Problem(domain, given, contacts(True))
    assert Problem(domain, given, contacts(True, True)).nodes.size > 0


@pytest.mark.parallel
@pytest.mark.parametrize("element", ELEMENTS)
@pytest.mark.parametrize("cell", [*PLANE, *SPACE])
def test_an_overlap_of_bodies_in_no_pair_is_said(cell, element):
    """Whichever pairs there are beside it; bodies that touch, or share nodes, have none."""
    order, degree = element
    for form in forms(cell):
        for depth in (-0.01, 0.0, 0.01, 0.1):
            ends, counts = (1.0, 1.5, 2.0, 2.5), (5, 4, 6) if form == "ring" else (3, 4, 3)
            domain = layers(COMM, cell, order, form, (0.0, depth), ends, counts)
            given = body(form, domain.dim, 3)
            for pair in (Contact("outer0", against="inner1"), Contact("outer1", 0.1)):
                problem = Problem(domain, given, pair, degree=degree)
                assert bool(problem.unpaired) == (depth > 0)
                if depth > 0:
                    (found,) = problem.unpaired.values()
                    # Behind the chords of a facet alone where these are deeper than the overlap.
                    least = 0.3 if form == "ring" else 0.999
                    assert least * depth < found < 1.01 * depth


@pytest.mark.parallel
def test_an_overlap_in_no_pair_is_a_warning():
    """Of the set-up, and of the solution; the bodies have their names, or places."""
    domain, given = three((0.0, 0.01)), Body(Linear(YOUNG, POISSON), [Fixed("below", [0.0, 0.0])])
    contacts = [Contact("outer0", against="inner1"), Contact("outer2", 0.1)]
    cells = fem.functionspace(domain.mesh, ("DG", 0)).tabulate_dof_coordinates()
    owned = cells[: domain.mesh.topology.index_map(2).size_local, 0]
    numbers = [np.flatnonzero((owned > low) & (owned < low + 0.5)) for low in (1.0, 1.5, 2.0)]
    regions = dict(zip(("shaft", "hub", "ring"), np.asarray(numbers, dtype=object), strict=True))
    for names, first, second in (
        (domain.regions, r"the body about \(1.75, 0.5\)", r"the body about \(2.24, 0.5\)"),
        (regions, "hub", "ring"),
    ):
        problem = Problem(replace(domain, regions=names), given, contacts)
        said = rf"{first} and {second} overlap by up to 0.01 .*no contact.*\[overlap\]"
        for texts in (expectations(problem), solve(problem).warnings):
            assert sum(re.search(said, text) is not None for text in texts) == 1
    assert not [
        text
        for text in expectations(
            Problem(three((0.01, 0.0)), given, Contact("outer0", against="inner1", press=True))
        )
        if "[overlap]" in text
    ]


@pytest.mark.parallel
def test_a_gap_makes_up_for_a_drawn_overlap():
    domain = layers(COMM, "quadrilateral", 1, "flat", 0.01)
    given = body("flat", 2, 2)
    for on, against in (("outer0", "inner1"), ("inner1", "outer0")):
        nodes = Problem(domain, given, Contact(on, 0.03, against=against)).nodes
        np.testing.assert_allclose(nodes.gap, 0.02, rtol=1e-9)
        with pytest.raises(InputError, match=r"by up to 0.004 more .*\[overlap\]"):
            Problem(domain, given, Contact(on, 0.006, against=against))


@pytest.mark.parallel
@pytest.mark.parametrize("cell", PLANE)
def test_sides_of_one_body_that_overlap(cell):
    """The arms of a C, the upper one bent into the lower one."""
    grid = rectangle(MPI.COMM_SELF, (0.0, 0.0), (6.0, 6.0), (6, 6), cell=cell).mesh
    x, cells = grid.geometry.x[:, :2].copy(), geometry_dofmap(grid)
    centre = x[cells].mean(axis=1)
    notch = (np.abs(centre[:, 1] - 3) < 1) & (centre[:, 0] > 2)
    used, cells = np.unique(cells[~notch], return_inverse=True)
    mesh = assembled(COMM, x[used], cells.reshape(-1, 3 if cell == "triangle" else 4), cell, 1)
    facets, middle, *_ = midpoints(mesh)
    arms = middle[:, 0] > 3
    sides = {f"arm{y}": arms & (np.abs(middle[:, 1] - y) < 1e-9) for y in (2, 4)}
    sides["left"] = middle[:, 0] < 1e-9
    x, depth = mesh.geometry.x, 0.1
    x[(x[:, 1] > 3.5) & (x[:, 0] > 2.5), 1] -= 2 + depth
    domain = from_mesh(mesh, {name: facets[there] for name, there in sides.items()}, 6.0)
    given = Body(Linear(YOUNG, POISSON), Fixed("left", [0.0, 0.0]))
    with pytest.raises(InputError, match=r"overlap, by up to 0.1, .*press.*\[pair\]"):
        Problem(domain, given, Contact("arm4", against="arm2"))
    pressed = solve(Problem(domain, given, Contact("arm4", against="arm2", press=True)))
    assert pressed.converged and mean(pressed) > 0


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
