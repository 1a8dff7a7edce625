"""The dual mortar operator by itself: exact on any pair of meshes."""

import time
from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scipy.spatial import Delaunay

from contact import Contact, Problem
from contact.body.equilibrium import BodyEquilibrium
from contact.interface.mortar.coupling import couple
from contact.interface.mortar.segments import clipped
from contact.interface.mortar.surface import Surface, dual_basis_transformation, surface_of
from contact.mesh.cells import INTERVAL, QUADRILATERAL, TRIANGLE, rule
from contact.mesh.deviation import deviations
from contact.mesh.domain import from_mesh
from contact.mesh.grid import box, rectangle
from contact.model.body import Body, Fixed
from forms.hencky import Linear
from tests.problems.mechanics import constant
from tests.problems.meshes import midpoints
from tests.problems.overlapping import PLANE, SPACE, boxes
from tests.problems.sides import FIRST, KINDS, NAMES, bowed, flat, oriented

UNLIKE = [
    ((TRIANGLE, 1), (QUADRILATERAL, 1)),
    ((QUADRILATERAL, 2), (TRIANGLE, 2)),
    ((TRIANGLE, 2), (QUADRILATERAL, 2)),
    ((QUADRILATERAL, 2), (QUADRILATERAL, 1)),
]
CURVED = [(TRIANGLE, 2), (QUADRILATERAL, 2)]
CURVED_NAMES = ["triangle", "quadrilateral"]
PAIRS = [*((kind, kind) for kind in KINDS), *UNLIKE]
PAIR_NAMES = [f"{a.name}-{p}-{b.name}-{q}" for (a, p), (b, q) in PAIRS]


def loads(side, nodes):
    """Return the nodal loads of a unit pressure."""
    at, weights = rule(side.shape, 8)
    share = side.integration_weights(at, weights) @ side.shape.lagrange(side.degree, at)
    total = np.zeros(nodes.size)
    np.add.at(total, np.searchsorted(nodes, side.nodes), share)
    return total


def roundoff(*kinds):
    """Return the rounding of integrals: of inverse bilinear maps they are no polynomials."""
    return 1e-12 if QUADRILATERAL in [shape for shape, _ in kinds] else 3e-15


def rotation(dim):
    c, s = np.cos(0.5), np.sin(0.5)
    turn = np.eye(dim)
    turn[:2, :2] = [[c, -s], [s, c]]
    if dim == 3:
        turn = turn @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    return turn


@pytest.mark.core
@pytest.mark.parametrize("turned", [False, True], ids=["straight", "turned"])
@pytest.mark.parametrize(("on", "against"), PAIRS, ids=PAIR_NAMES)
def test_constant_pressure_and_linear_fields_pass(on, against, turned) -> None:
    """To rounding: a pressure's loads on both sides, and any linear field, on jittered meshes."""
    dim = on[0].dim + 1
    turn = rotation(dim) if turned else None
    check_a_pair(
        flat(on, 5, 1.0, 1.0, 1, turn=turn),
        flat(against, 7, 1.1, -1.0, 2, FIRST, turn),
        roundoff(on, against),
    )


@pytest.mark.parametrize("on", CURVED, ids=CURVED_NAMES)
@pytest.mark.parametrize("against", CURVED, ids=CURVED_NAMES)
def test_they_pass_where_edges_are_curved_in_the_plane(on, against) -> None:
    check_a_pair(bowed(on, 2, 1.0, 1.0, 1), bowed(against, 3, 1.1, -1.0, 2, FIRST), 1e-12)


def check_a_pair(one, other, close) -> None:
    """Check loads of a pressure and the jumps of linear fields, given sides 0.1 apart."""
    (slave, x), (master, y) = one, other
    dim = x.shape[1]
    found = couple(slave, master, 1.0)
    assert found.nodes.size == len(x) and np.abs(found.covered - 1).max() < 1e-12
    np.testing.assert_allclose(found.gap, 0.1, atol=1e-14)
    np.testing.assert_allclose(found.normal, np.broadcast_to(slave.normal[0], x.shape), atol=1e-14)
    assert found.weight.min() > 0
    forces = found.M.T @ found.weight
    np.testing.assert_allclose(forces, loads(master, found.masters), rtol=0, atol=close)
    on_slave = found.D.T @ found.weight
    np.testing.assert_allclose(on_slave, loads(slave, found.slaves), rtol=0, atol=close)
    # A linear field of both has the jump of the gap alone.
    field = np.random.default_rng(3).normal(size=(dim, dim))
    jump = found.D @ (x[found.slaves] @ field) - found.M @ (y[found.masters - FIRST] @ field)
    apart = -0.1 * slave.normal[0] @ field
    np.testing.assert_allclose(jump, np.broadcast_to(apart, jump.shape), atol=1e-13)


def check_tied(slave, master) -> None:
    """Each node is tied to the one at its place."""
    found = couple(slave, master, 1.0)
    np.testing.assert_array_equal(found.masters - FIRST, found.slaves)
    np.testing.assert_allclose((found.D - found.M).toarray(), 0, atol=1e-12)


@pytest.mark.core
@pytest.mark.parametrize("kind", KINDS, ids=NAMES)
def test_matching_meshes_are_tied_node_by_node(kind) -> None:
    slave, _ = flat(kind, 5, 0.0, 1.0, 4)
    master, _ = flat(kind, 5, 0.0, -1.0, 4, FIRST)
    check_tied(slave, master)


@pytest.mark.parametrize("kind", CURVED, ids=CURVED_NAMES)
def test_matching_curved_edges_are_those_of_both_sides(kind) -> None:
    """A sliver on the edge of two facets goes to both in halves: else neighbours were tied too."""
    slave, _ = bowed(kind, 2, 0.0, 1.0, 4)
    master, _ = bowed(kind, 2, 0.0, -1.0, 4, FIRST)
    check_tied(slave, master)


@pytest.mark.core
@pytest.mark.parametrize("kind", KINDS, ids=NAMES)
def test_what_is_partly_covered_still_reproduces_linear_fields(kind) -> None:
    """The master is smaller: nodes far from it drop out, the others extrapolate exactly."""
    slave, x = flat(kind, 7, 0.0, 1.0, 1)
    master, y = flat(kind, 5, 0.05, -1.0, 2, FIRST, size=0.61)
    found = couple(slave, master, 1.0)
    # But for the share of the nodes that drop out: of Q2 corners that face it with the negative
    # part of their function alone.
    share = 0.02 if kind == (QUADRILATERAL, 2) else 1e-3
    assert found.weight.sum() == pytest.approx(0.61 ** kind[0].dim, rel=share)
    assert 0 < found.nodes.size < len(x)
    most = 1.25**2 if share > 1e-3 else 1 + 1e-12
    assert found.covered.min() < 0.9 < found.covered.max() < most
    jump = found.D @ x[found.slaves] - found.M @ y[found.masters - FIRST]
    np.testing.assert_allclose(jump[:, :-1], 0, atol=1e-9)
    np.testing.assert_allclose(jump[:, -1], -0.05, atol=1e-9)
    np.testing.assert_allclose(found.gap, 0.05, atol=1e-9)


def overhanging(cell, degree, share):
    """Return a block of the length 1 on a longer one, beside `share` of the last facets of that."""
    d = 2 if cell in PLANE else 3
    mesh = boxes(MPI.COMM_WORLD, cell, 1, [[3] * d, [4] * d])
    facets, middle, *_ = midpoints(mesh)
    second, height = middle[:, 0] > 1.5, middle[:, d - 1]
    parts = {"base": ~second & (height < 0.01), "top": ~second & (height > 0.99)}
    parts |= {"foot": second & (height < 0.01), "head": second & (height > 0.99)}
    x = mesh.geometry.x
    above = x[:, 0] > 1.5
    x[above, 0] -= 2
    x[above, d - 1] += 1
    x[~above, 0] *= 1 + share / (3 - share)
    domain = from_mesh(mesh, {name: facets[there] for name, there in parts.items()}, 2.0)
    body = Body(Linear(1.0, 0.3), [Fixed("base", [0.0] * d), Fixed("head", [0.0] * d)])
    return Problem(domain, body, Contact("top", against="foot"), degree=degree)


@pytest.mark.parallel
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", [*PLANE, *SPACE])
def test_areas_of_a_partly_covered_side_are_those_of_the_other(cell, degree) -> None:
    """Quadratic functions have negative areas on parts of facets: others have to carry these."""
    for share in (0.02, 0.3, 0.5, 0.7, 0.98):
        nodes = overhanging(cell, degree, share).nodes
        # On triangles of degree 2 they are dropped, and small.
        close = 1e-4 if (cell, degree) == ("tetrahedron", 2) else 1e-12
        assert nodes.sum(np.ones_like(nodes.weight)) == pytest.approx(1.0, rel=close)
        assert nodes.maximum(-nodes.weight, -1.0) < 0


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", [*PLANE, *SPACE])
def test_slivers_of_facets_carry_nothing_or_reproduce_constants(cell, degree) -> None:
    """The mass of quadratic functions on them is singular to rounding."""
    for sliver in (1e-8, 1e-6, 1e-5, 1e-4, 5e-4, 2e-3, 1e-2):
        (geometry,) = overhanging(cell, degree, 1 - sliver).geometries
        jumps = geometry.jumps
        for rows in (jumps.D, jumps.M):
            np.testing.assert_allclose(rows.sum(axis=1), 1.0, rtol=0, atol=1e-8)


@pytest.mark.core
@pytest.mark.parametrize("kind", KINDS, ids=NAMES)
def test_nodes_without_a_multiplier_hand_their_functions_over(kind) -> None:
    """At the rim none has one: constant pressures and constant fields still pass."""
    slave, x = flat(kind, 7, 1.0, 1.0, 1)
    master, y = flat(kind, 11, 1.1, -1.0, 2, FIRST)
    rim = np.flatnonzero(np.any((x[:, :-1] < 1e-9) | (x[:, :-1] > 1 - 1e-9), axis=1))
    found = couple(slave, master, 1.0, no_multiplier=rim)
    assert not np.isin(found.nodes, rim).any()
    assert found.nodes.size == len(x) - rim.size
    assert found.weight.sum() == pytest.approx(1)
    np.testing.assert_allclose(found.D.sum(axis=1), 1, atol=1e-12)
    np.testing.assert_allclose(found.M.sum(axis=1), 1, atol=1e-12)
    jump = found.D @ x[found.slaves] - found.M @ y[found.masters - FIRST]
    np.testing.assert_allclose(jump[:, :-1], 0, atol=1e-12)
    forces = found.M.T @ found.weight
    close = roundoff(kind)
    np.testing.assert_allclose(forces, loads(master, found.masters), rtol=0, atol=close)


@pytest.mark.core
@pytest.mark.parametrize(("corners", "others"), [(3, 3), (4, 3), (4, 4)])
def test_clipped_polygons_have_the_area_in_common(corners, others) -> None:
    """Against the share of random points that lie in both."""
    rng = np.random.default_rng(0)

    def some(count):
        turn = rng.uniform(0, 2 * np.pi, (100, 1)) + np.arange(count) * 2 * np.pi / count
        turn = turn + rng.uniform(-0.2, 0.2, (100, count))
        way = rng.choice([-1, 1], (100, 1))
        return np.stack([np.cos(turn), way * np.sin(turn)], 2) + rng.uniform(-0.5, 0.5, (100, 1, 2))

    def heights(polygon, x):
        edge = np.roll(polygon, -1, axis=0) - polygon
        offset = x[:, None] - polygon
        return edge[:, 0] * offset[..., 1] - edge[:, 1] * offset[..., 0]

    one, other = some(corners), some(others)
    polygon, count = clipped(one, other)
    assert count.max() <= corners + others and not np.isin(count, [1, 2]).any()
    sample = rng.uniform(-2, 2, (20_000, 2))
    for k in range(100):
        x = polygon[k, : count[k]]
        after = np.roll(x, -1, axis=0)
        area = abs(np.sum(x[:, 0] * after[:, 1] - x[:, 1] * after[:, 0])) / 2
        inside = np.ones(len(sample), dtype=bool)
        for given in (one[k], other[k]):
            height = heights(given, sample)
            inside &= np.all(height > 0, axis=1) | np.all(height < 0, axis=1)
        assert area == pytest.approx(16 * inside.mean(), abs=0.2)


def test_a_corner_that_both_triangles_have_loses_no_other() -> None:
    """By signs of rounding it was there three times, and the first corner had no place."""
    common = [-0.07350519801354499, 1.0319861449927856]
    one = np.array(
        [[0.00229683581789203, 0.505898123991906], [0.4841500548336721, 0.5125995288725862], common]
    )
    other = np.array(
        [
            [0.11491038333489148, 0.5160783894000093],
            [0.5128028168049572, 0.48591303931334495],
            common,
        ]
    )
    for first, second in ((one, other), (other, one)):
        polygon, count = clipped(first[None], second[None])
        x = polygon[0, : count[0]]
        assert count[0] <= 6
        after = np.roll(x, -1, axis=0)
        area = np.sum(x[:, 0] * after[:, 1] - x[:, 1] * after[:, 0]) / 2
        assert abs(area) == pytest.approx(0.0960959, rel=1e-6)


@pytest.mark.core
@pytest.mark.parametrize("degree", [1, 2])
def test_concentric_arcs(degree) -> None:
    """Chords of two circles: normals are radial, gaps right to their order; of degree 2 beyond."""

    def arc(n, radius, sign, first):
        a = np.linspace(0.5, 1.5, n + 1)
        x = radius * np.column_stack([np.cos(a), np.sin(a)])
        c = np.stack([x[:-1], x[1:]], axis=1)
        out = c.mean(axis=1)
        out = sign * out / np.linalg.norm(out, axis=1)[:, None]
        nodes = np.column_stack([np.arange(n), np.arange(1, n + 1)])
        nodes = nodes if degree == 1 else np.column_stack([nodes, n + 1 + np.arange(n)])
        deviation = np.array(deviations(nodes[:, :2], c, out)) * (degree - 1)
        return Surface(nodes + first, c, out, *deviation, degree), a

    errors = []
    for n in (20, 40):
        (slave, a), (master, _) = arc(n, 1.0, 1.0, 0), arc(3 * n // 2, 1.05, -1.0, FIRST)
        found = couple(slave, master, 1.0)
        inner = (found.nodes > 0) & (found.nodes < n)
        angle = a[found.nodes[inner]]
        radial = np.column_stack([np.cos(angle), np.sin(angle)])
        errors.append(np.abs(found.gap[inner] - 0.05).max())
        np.testing.assert_allclose(found.normal[inner], radial, atol=1e-12)
    assert errors[0] < (1 / 20) ** 2 / (4 if degree == 1 else 2000)
    assert errors[1] < errors[0] / 3
    if degree == 2:
        # Arcs of one circle lie on each other, wherever the ends of their chords are.
        slave, master = arc(10, 1.0, 1.0, 0)[0], arc(17, 1.0, -1.0, FIRST)[0]
        np.testing.assert_allclose(couple(slave, master, 1.0).gap, 0, atol=1e-14)


@pytest.mark.core
def test_directions_are_halfway_between_an_arc_and_a_line() -> None:
    def chords(x, first):
        corners = np.stack([x[:-1], x[1:]], axis=1)
        out = np.diff(x, axis=0)[:, ::-1] * [-1.0, 1.0]
        out /= np.linalg.norm(out, axis=1)[:, None]
        nodes = first + np.column_stack([np.arange(len(out)), np.arange(1, len(x))])
        return Surface(nodes, corners, out, *np.zeros((3, len(out), 1)), 1)

    angle = np.linspace(0.4, -0.4, 9)
    arc = chords(np.column_stack([-np.sin(angle), np.cos(angle)]), 0)
    line = chords(np.column_stack([np.linspace(1.0, -1.0, 6), np.full(6, 1.01)]), FIRST)
    found = couple(arc, line, 1.0)
    inner = (found.nodes > 0) & (found.nodes < 8)
    half = angle[found.nodes[inner]] / 2
    np.testing.assert_allclose(
        found.normal[inner], np.column_stack([-np.sin(half), np.cos(half)]), atol=1e-12
    )


def test_a_bowl_that_touches_within_facets_does_not_cut_them() -> None:
    """Those of |x - c|^2 over two triangles of degree 2, c in the middle of the edge between."""
    depth = 1e-4
    slave, points = flat((TRIANGLE, 2), 1, 0.0, 1.0, 1)
    bowl, _ = flat((TRIANGLE, 2), 1, 0.5 * depth, -1.0, 1, FIRST)
    edges = [bowl.corners[:, j] - bowl.corners[:, i] for i, j in TRIANGLE.edges]
    found = couple(slave, replace(bowl, deviation=depth * np.sum(np.square(edges), axis=2).T), 1.0)
    values = np.sum((points[:, :2] - 0.5) ** 2, axis=1)
    vertices = {0.5: 0.5, 0.25: (0.25 - 0.2) / 0.6, 0.0: -0.2 / 0.6}  # S of the positive functions
    expected = [vertices[value] for value in values[found.nodes].round(9)]
    np.testing.assert_allclose(found.gap / depth, expected, atol=1e-7)
    np.testing.assert_allclose(found.gap_positive_part, found.gap, atol=1e-12)
    lower = replace(slave, points=slave.points + np.array([0.0, 0.0, 0.1 * depth]))
    cut = couple(lower, replace(bowl, deviation=depth * np.sum(np.square(edges), axis=2).T), 1.0)
    np.testing.assert_allclose(cut.gap / depth, np.array(expected) - 0.1, atol=1e-7)
    deepest = int(np.argmin(cut.gap))
    assert cut.gap_positive_part[deepest] > cut.gap[deepest] + 0.1 * depth


@pytest.mark.core
def test_deviations() -> None:
    """They are those of a sphere, at the rim too; edges of a body are none of a smooth surface."""
    turns = [np.linspace(0, 2 * np.pi, 6 * k, endpoint=False) for k in range(1, 5)]
    rings = [k / 4 * np.column_stack([np.cos(t), np.sin(t)]) for k, t in enumerate(turns, 1)]
    flat = np.concatenate([[[0.0, 0.0]], *rings])
    triangles = Delaunay(flat).simplices.astype(np.int64)
    ball = np.column_stack([0.25 * flat, np.sqrt(1 - np.sum((0.25 * flat) ** 2, axis=1))])
    corners, normal, edges = oriented(ball, triangles, np.array([0.0, 0.0, 1.0]))
    found, unknown, change = deviations(triangles, corners, normal)
    assert max(unknown.max(), change.max()) < 1e-9 * found.max()
    halves = np.sum(edges**2, axis=2) / 4
    np.testing.assert_allclose(found / 4, 1 - np.sqrt(1 - halves), rtol=1e-9)
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(0, 2, 9), np.linspace(0, 1, 5)))
    triangles = Delaunay(np.column_stack([x, y])).simplices.astype(np.int64)
    folded = np.column_stack([np.minimum(x, 1), y, -np.maximum(x - 1, 0)])
    corners, normal, _ = oriented(folded, triangles, np.array([1.0, 0.0, 1.0]))
    np.testing.assert_array_equal(deviations(triangles, corners, normal), 0)


def test_deviations_of_a_quarter_of_a_cylinder() -> None:
    """They are those of its circles at the ends of it too, and none along its axis."""
    turn, z = (v.ravel() for v in np.meshgrid(np.linspace(0, np.pi / 2, 9), np.linspace(0, 1, 4)))
    triangles = Delaunay(np.column_stack([turn, z])).simplices.astype(np.int64)
    corners, normal, edges = oriented(
        np.column_stack([np.cos(turn), np.sin(turn), z]), triangles, np.array([1.0, 1.0, 0.0])
    )
    found = deviations(triangles, corners, normal)[0] / 4
    around, along = np.abs(edges[..., 2]) < 1e-9, np.linalg.norm(edges[..., :2], axis=2) < 1e-9
    depth = 1 - np.cos(np.pi / 32)
    np.testing.assert_allclose(found[around], depth, rtol=2e-4)
    np.testing.assert_allclose(found[along], 0, atol=1e-4 * depth)


def test_surfaces_that_do_not_face_each_other_have_nothing_in_common() -> None:
    slave, _ = flat((TRIANGLE, 1), 3, 0.0, 1.0, 1)
    for master in (
        flat((TRIANGLE, 1), 3, 0.1, 1.0, 2, FIRST)[0],  # looks the same way
        flat((TRIANGLE, 1), 3, 5.0, -1.0, 2, FIRST)[0],  # too far
    ):
        assert couple(slave, master, 1.0).nodes.size == 0


@pytest.mark.core
@pytest.mark.parametrize("kind", KINDS, ids=NAMES)
def test_surfaces_of_meshes(kind) -> None:
    """The nodes of facets are where the basis says, and normals point out of the body."""
    (shape, degree), dim = kind, kind[0].dim + 1
    cells = {TRIANGLE: "tetrahedron", QUADRILATERAL: "hexahedron", INTERVAL: "quadrilateral"}
    make = rectangle if dim == 2 else box
    domain = make(MPI.COMM_SELF, (0.0,) * dim, (1.0,) * dim, (3, 2, 2)[:dim], cell=cells[shape])
    zero = constant(0.0, dim)
    space = BodyEquilibrium(
        domain, Body(Linear(1.0, 0.3), [Fixed("left", [zero] * dim)]), degree
    ).space
    points = space.tabulate_dof_coordinates()[:, :dim]
    for part in ("top", "right"):
        side = surface_of(domain, space, part)
        assert side.shape == shape and side.order == 1 and not side.bend.any()
        expected = shape.lagrange(1, shape.nodes(degree)) @ side.points
        np.testing.assert_allclose(points[side.nodes], expected, atol=1e-14)
        axis = 0 if part == "right" else dim - 1
        normals = np.tile(np.eye(dim)[axis], (side.count, 1))
        np.testing.assert_allclose(side.normal, normals, atol=1e-15)


@pytest.mark.core
@pytest.mark.parametrize("kind", KINDS, ids=NAMES)
def test_the_changed_basis_has_positive_integrals(kind) -> None:
    (shape, degree), change = kind, dual_basis_transformation(*kind)
    places, weights = rule(shape, 4)
    changed = shape.lagrange(degree, places) @ change.T
    np.testing.assert_allclose(changed.sum(axis=1), 1, atol=1e-14)
    expected = {
        (INTERVAL, 1): [1 / 2] * 2,
        (INTERVAL, 2): [1 / 6, 1 / 6, 2 / 3],
        (TRIANGLE, 1): [1 / 3] * 3,
        (TRIANGLE, 2): [2 / 15] * 3 + [1 / 5] * 3,
        (QUADRILATERAL, 1): [1 / 4] * 4,
        (QUADRILATERAL, 2): [1 / 36] * 4 + [1 / 9] * 4 + [4 / 9],
    }
    means = weights @ changed / weights.sum()
    np.testing.assert_allclose(means, expected[kind], atol=1e-15)


def test_ten_thousand_facets_in_seconds() -> None:
    slave, _ = flat((TRIANGLE, 1), 71, 1.0, 1.0, 1)
    master, _ = flat((TRIANGLE, 1), 71, 1.0, -1.0, 2, FIRST)
    begin = time.process_time()
    couple(slave, master, 1.0)
    assert time.process_time() - begin < 5.0


def arc(count, sign, first):
    """Return straight facets along an arc of 0.25 rad to both sides, bulging up or down."""
    angle = np.linspace(-0.25, 0.25, count + 1)
    x = np.column_stack([np.sin(angle), sign * (1 - np.cos(angle))])
    ends = np.column_stack([np.arange(count), np.arange(1, count + 1)])
    middle = (angle[1:] + angle[:-1]) / 2
    normal = np.column_stack([np.sin(middle), -sign * np.cos(middle)])
    none = np.zeros((count, 0))
    return Surface(ends + first, x[ends], normal, none, none, none, 1), x


@pytest.mark.parametrize("more", [0, 3])
@pytest.mark.parametrize("count", [20, 80, 320])
def test_round_sides_face_each_other_on_any_mesh(count, more):
    """Beyond R (h/R)^(1/3) the facets opposite were no candidates: nothing was covered there."""
    (slave, x), (master, _) = arc(count, 1, 0), arc(count + more, -1, 1000)
    found = couple(slave, master, 1.0)
    within = np.abs(x[:, 0]) < 0.22
    covered = np.zeros(len(x))
    covered[found.nodes] = found.covered
    assert covered[within] == pytest.approx(1.0)
    angle = np.arcsin(x[found.nodes, 0])
    inner = np.abs(angle) < 0.21
    # Along the bisector of both normals gaps are the vertical distance.
    gap = 2 * (1 - np.cos(angle[inner]))
    assert found.gap[inner] == pytest.approx(gap, abs=0.1 / count**2 + 0.05 * 0.21**4)
