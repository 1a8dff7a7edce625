"""Each shape against its formula: distances, normals, and gaps along rays.

Foundations of triangles: distances, signs at edges, STL files.
"""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from dolfinx import mesh
from mpi4py import MPI
from scipy.optimize import minimize_scalar

from contact import Body, Contact, Fixed
from contact.errors import InputError
from contact.mesh.domain import from_mesh
from contact.model.obstacle import (
    Cone,
    Cylinder,
    Heights,
    Level,
    Paraboloid,
    Plane,
    Punch,
    Sphere,
    Triangles,
)
from contact.model.obstacle.shapes import measured
from contact.problem.problem import ContactProblem
from forms.hencky import Linear
from tests.problems.mechanics import constant

TILT = np.array([0.3, -0.5, 0.8])
UP = TILT / np.linalg.norm(TILT)
TIP = (0.2, -0.1, 0.4)

#: Shape -> whether a point is in it, by its height above the tip and its distance from the axis.
SHAPES = {
    "plane": (Plane(TIP, tuple(-UP)), lambda h, r: h > 0),
    "sphere": (Sphere(TIP, 0.7), lambda h, r: h**2 + r**2 < 0.49),
    "room": (Sphere(TIP, 3.0, True), lambda h, r: h**2 + r**2 > 9),
    "cylinder": (Cylinder(TIP, tuple(TILT), 0.6), lambda h, r: r < 0.6),
    "bore": (Cylinder(TIP, tuple(TILT), 3.0, True), lambda h, r: r > 3),
    "cone": (Cone(TIP, tuple(TILT), 70.3), lambda h, r: r < h * np.tan(np.deg2rad(70.3))),
    "steep cone": (Cone(TIP, tuple(TILT), 20.0), lambda h, r: r < h * np.tan(np.deg2rad(20))),
    "paraboloid": (Paraboloid(TIP, tuple(TILT), 0.5), lambda h, r: h > r**2),
    "punch": (Punch(TIP, tuple(TILT), 0.6), lambda h, r: (h > 0) & (r < 0.6)),
    "rounded punch": (Punch(TIP, tuple(TILT), 0.6, 0.2), None),
}
POINTS = np.random.default_rng(0).normal(size=(1000, 3))


def coordinates(points):
    """Return heights above the tip, and distances from the axis."""
    offset = points - np.array(TIP)
    h = offset @ UP
    return h, np.linalg.norm(offset - h[:, None] * UP, axis=1)


@pytest.mark.core
@pytest.mark.parametrize("name", SHAPES)
def test_distances_and_normals(name):
    """The nearest point is on the surface, nothing is nearer, and the normal leads to it."""
    shape, inside = SHAPES[name]
    distance, normal = shape.distance(POINTS)
    assert np.allclose(np.linalg.norm(normal, axis=1), 1, atol=1e-12)
    surface = POINTS - distance[:, None] * normal
    assert np.abs(shape.distance(surface)[0]).max() < 1e-11
    # The slope of a distance is its normal, but for points that are as near to two sides.
    h, unit = 1e-6, np.random.default_rng(1).normal(size=(1000, 3))
    unit /= np.linalg.norm(unit, axis=1)[:, None]
    slope = (shape.distance(POINTS + h * unit)[0] - shape.distance(POINTS - h * unit)[0]) / (2 * h)
    smooth = np.abs(slope - np.einsum("ni,ni->n", normal, unit)) < 1e-6
    assert np.mean(smooth) > 0.99
    # A distance never changes faster than the point moves.
    other = POINTS[::-1]
    change = np.abs(shape.distance(other)[0] - distance)
    assert np.all(change <= np.linalg.norm(other - POINTS, axis=1) + 1e-12)
    if inside is not None:
        assert np.array_equal(distance < 0, inside(*coordinates(POINTS)))


@pytest.mark.core
def test_the_paraboloid_by_minimisation():
    shape, _ = SHAPES["paraboloid"]
    distance, _ = shape.distance(POINTS)
    for (h, r), found in zip(np.column_stack(coordinates(POINTS))[:60], distance, strict=False):

        def to(s, h=h, r=r):
            return np.hypot(r - s, h - s**2)

        best = min(
            minimize_scalar(to, bounds=bounds, method="bounded", options={"xatol": 1e-10}).fun
            for bounds in ((0, 1), (0, 5), (-5, 0))
        )
        assert abs(found) == pytest.approx(best, abs=1e-8)


@pytest.mark.core
@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("direction", ["body", "axis"])
def test_gaps_along_rays(name, direction):
    """The ray ends on the surface at its first or last meeting; it never skips one outside."""
    shape, _ = SHAPES[name]
    along = np.array([0.1, 0.2, 1.0])
    aimed = type(shape)(**{**vars(shape), "direction": direction, "along": tuple(along)})
    body = np.random.default_rng(2).normal(size=(1000, 3))
    body /= np.linalg.norm(body, axis=1)[:, None]
    rays, gap = aimed.measure(POINTS, body)
    expected = body if direction == "body" else along / np.linalg.norm(along)
    assert np.allclose(rays, expected, atol=1e-14)
    met = np.isfinite(gap)
    assert 20 < met.sum()
    ends = POINTS[met] + gap[met, None] * rays[met]
    size = 1 + np.abs(gap[met])
    assert np.abs(shape.distance(ends)[0] / size).max() < 1e-9
    # Outside, the first half of the way to the surface is free, and rays that never meet are out.
    outside = shape.distance(POINTS)[0] > 0
    for share in (0.25, 0.5, 0.9, 0.99):
        way = POINTS[met] + share * gap[met, None] * rays[met]
        assert np.all(shape.distance(way)[0][outside[met]] > -1e-12)
    for t in np.geomspace(1e-2, 1e2, 40):
        away = POINTS[~met & outside] + t * rays[~met & outside]
        assert np.all(shape.distance(away)[0] > -1e-9)


@pytest.mark.core
def test_closed_forms_along_the_axis():
    """The gaps of Hertz's paraboloid, of Sneddon's cone and of a flat punch, in half planes."""
    r = np.linspace(0, 1.5, 301)
    points, up = np.column_stack([r, np.zeros_like(r)]), np.array([[0.0, 1.0]] * 301)
    aim = {"direction": "axis", "along": (0.0, 2.0)}
    tip = ((0.0, 0.1), (0.0, 1.0))
    nu, gap = Paraboloid(*tip, 4.0, **aim).measure(points, up)
    assert np.allclose(gap, 0.1 + r**2 / 8, rtol=1e-13) and np.array_equal(nu, up)
    _, gap = Cone(*tip, 70.3, **aim).measure(points, up)
    assert np.allclose(gap, 0.1 + r / np.tan(np.deg2rad(70.3)), rtol=1e-13)
    _, gap = Punch(*tip, 1.0, **aim).measure(points, up)
    assert np.allclose(gap[r < 0.999], 0.1, rtol=1e-13) and np.all(np.isinf(gap[r > 1.001]))
    _, gap = Punch(*tip, 1.0, 0.3, **aim).measure(points, up)
    edge = (r > 0.7) & (r < 0.999)
    assert np.allclose(gap[r < 0.7], 0.1, rtol=1e-13)
    assert np.allclose(gap[edge], 0.4 - np.sqrt(0.09 - (r[edge] - 0.7) ** 2), rtol=1e-9)
    ball = Sphere((0.0, 4.1), 4.0, **aim).measure(points, up)[1]
    assert np.allclose(ball, 4.1 - np.sqrt(16 - r**2), rtol=1e-13)


def test_a_formula_is_the_shape_that_it_describes():
    shape, _ = SHAPES["sphere"]
    level = Level(lambda x: np.linalg.norm(x - np.array(TIP), axis=1) - 0.7)
    for made in zip(level.distance(POINTS), shape.distance(POINTS), strict=True):
        assert np.abs(made[0] - made[1]).max() < 1e-8
    # An ellipsoid by a function that is no distance: right on the surface, to second order near it.
    axes = np.array([1.0, 2.0, 3.0])
    ellipsoid = Level(lambda x: np.sum((x / axes) ** 2, axis=1) - 1)
    on = axes * POINTS / np.linalg.norm(POINTS, axis=1)[:, None]
    normal = on / axes**2
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    for h in (1e-2, 1e-3):
        distance, found = ellipsoid.distance(on + h * normal)
        assert np.abs(distance - h).max() < 5 * h**2
        assert np.abs(found - normal).max() < 5 * h


def test_a_ray_passes_by_no_side_of_a_body_that_is_not_convex():
    """A ring: Newton's method on the distance alone would miss every ninth ray that meets it."""

    def distance(x):
        return np.hypot(np.hypot(x[:, 0], x[:, 1]) - 1.0, x[:, 2]) - 0.3

    rng = np.random.default_rng(0)
    points = rng.normal(size=(300, 3))
    points *= 3 / np.linalg.norm(points, axis=1)[:, None]
    rays = rng.uniform(-1.2, 1.2, size=points.shape) - points
    rays /= np.linalg.norm(rays, axis=1)[:, None]
    ways = np.linspace(0, 6, 3001)
    on_way = points[:, None] + ways[:, None] * rays[:, None]
    inside = distance(on_way.reshape(-1, 3)).reshape(300, -1) <= 0
    met, first = inside.any(axis=1), ways[inside.argmax(axis=1)]
    assert 100 < met.sum() < 200
    found = Level(distance).ray(points, rays)
    assert np.array_equal(np.isfinite(found), met)
    assert np.all((found[met] <= first[met]) & (found[met] > first[met] - 0.0021))


@pytest.mark.core
@pytest.mark.parametrize("name", SHAPES)
def test_normals_are_the_slope_of_the_distance(name):
    """Also beside edges and tips, where there are several slopes."""
    for points in (POINTS, 1e-3 * POINTS + np.array(TIP)):
        turned, known, _ = SHAPES[name][0].turned_normals(points)
        assert 2 * turned <= known


@pytest.mark.parametrize("size", [0.0, 1e-200, 1e200])
def test_a_direction_whose_length_is_no_number_is_refused(size):
    with pytest.raises(
        InputError, match=r"Plane: normal: given .*; accepted: a vector of finite length"
    ):
        Plane((0.0, 0.0), (0.0, size))


class Turned(Plane):
    """A plane whose normals point into it."""

    def distance(self, points):
        """Return distances and normals."""
        distance, normal = super().distance(points)
        return distance, -normal


@pytest.mark.parallel
def test_a_wrong_sign_of_normals_is_refused():
    """All ranks decide by the points of all: a rank may have none, or a single one."""
    comm, up = MPI.COMM_WORLD, (1.0, 2.0)
    for count in (1, 30):
        points = 5.0 + POINTS[: count if comm.rank == comm.size - 1 else 0, :2]
        normal = np.zeros_like(points)
        measured(Plane((0.0, 0.0), up), points, normal, comm, "contact")
        with pytest.raises(InputError, match=r"contact.foundation: .*\[shape-normals\]"):
            measured(Turned((0.0, 0.0), up), points, normal, comm, "contact")


class Long(Plane):
    """A plane whose normals are twice as long."""

    def distance(self, points):
        """Return distances and normals."""
        distance, normal = super().distance(points)
        return distance, 2 * normal


def test_normals_that_are_no_unit_vectors_are_refused():
    """Forces were wrong by some per cent."""
    points = 5.0 + POINTS[:30, :2]
    with pytest.raises(InputError, match=r"contact.foundation: .*\[shape-normals\]"):
        measured(
            Long((0.0, 0.0), (1.0, 2.0)), points, np.zeros_like(points), MPI.COMM_SELF, "contact"
        )


class AtAnEdge(Plane):
    """A plane whose normal is wrong at the points of one rank."""

    def distance(self, points):
        """Return distances and normals."""
        distance, normal = super().distance(points)
        return distance, np.where(points[:, :1] > 100, -normal, normal)


@pytest.mark.parallel
def test_points_of_a_single_rank_do_not_decide():
    comm = MPI.COMM_WORLD
    points = np.full((1 if comm.rank == 0 else 5, 2), 200.0 if comm.rank == 0 else 5.0)
    if comm.size > 1:
        measured(AtAnEdge((0.0, 0.0), (1.0, 2.0)), points, 0 * points, comm, "contact")


def test_shapes_by_formulas_and_files_are_those_of_functions_and_arrays(tmp_path):
    ellipse = Level(lambda x: (x[:, 0] / 2) ** 2 + x[:, 1] ** 2 - 1)
    x = np.linspace(-1.0, 1.0, 9)
    (tmp_path / "heights.csv").write_text("x,y\n" + "".join(f"{a},{a * a}\n" for a in x))
    corners = np.array([[[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [0.0, 4.0, 0.0]]])
    rows = "".join(f"vertex {' '.join(map(str, c))}\n" for c in corners[0])
    facet = f"facet normal 0 0 1\nouter loop\n{rows}endloop\nendfacet\n"
    (tmp_path / "floor.stl").write_text(f"solid floor\n{facet}endsolid floor\n")
    points = np.random.default_rng(0).uniform(0.1, 1.0, (20, 3))
    for one, other, dim in (
        (Level("(x/2)**2 + y**2 - 1"), ellipse, 2),
        (Heights(file=str(tmp_path / "heights.csv")), Heights((x,), x * x), 2),
        (Triangles(file=str(tmp_path / "floor.stl")), Triangles(corners), 3),
    ):
        for found, known in zip(
            one.distance(points[:, :dim]), other.distance(points[:, :dim]), strict=True
        ):
            assert found == pytest.approx(known, abs=1e-12)


def ball(n):
    """Return the triangles of a sphere of radius 1, n along a quarter of its equator."""
    theta, phi = np.linspace(0, np.pi, 2 * n + 1), np.linspace(0, 2 * np.pi, 4 * n + 1)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    x = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)
    a, b, c, d = x[:-1, :-1], x[1:, :-1], x[1:, 1:], x[:-1, 1:]
    made = np.concatenate([np.stack(k, axis=2).reshape(-1, 3, 3) for k in ((a, b, c), (a, c, d))])
    area = np.linalg.norm(np.cross(made[:, 1] - made[:, 0], made[:, 2] - made[:, 0]), axis=1)
    return made[area > 1e-12]


@pytest.mark.core
def test_a_surface_of_triangles_is_second_order():
    points = POINTS[np.linalg.norm(POINTS, axis=1) > 0.3]
    radius = np.linalg.norm(points, axis=1)
    errors = []
    for n in (8, 16, 32):
        distance, normal = Triangles(ball(n)).distance(points)
        errors.append(np.abs(distance - radius + 1).max())
        assert np.array_equal(distance > 0, radius > 1) or np.abs(radius - 1).min() < errors[-1]
        surface = points - distance[:, None] * normal
        assert np.abs(np.linalg.norm(surface, axis=1) - 1).max() < (2 / n) ** 2
    assert np.log2(errors[0] / errors[2]) / 2 == pytest.approx(2, abs=0.15)


@pytest.mark.core
def test_signs_at_edges_and_corners():
    """In front of the edges and corners of a cube faces alone do not tell the side."""
    corners = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
    from scipy.spatial import ConvexHull

    hull = ConvexHull(corners)
    made = corners[hull.simplices]
    flip = np.einsum(
        "mi,mi->m", np.cross(made[:, 1] - made[:, 0], made[:, 2] - made[:, 0]), made[:, 0]
    )
    made[flip < 0] = made[flip < 0][:, ::-1]
    points = 2.5 * POINTS
    distance, _ = Triangles(made).distance(points)
    out = np.maximum(np.abs(points) - 1, 0)
    exact = np.linalg.norm(out, axis=1) + np.minimum(np.abs(points).max(axis=1) - 1, 0)
    assert np.abs(distance - exact).max() < 1e-12


def above(shape, direction, press=False):
    """Return the contact nodes of the top of a block, its middle beneath a ball."""
    block = from_mesh(
        mesh.create_box(MPI.COMM_SELF, [[-0.5, -0.5, -1.0], [0.5, 0.5, 0.0]], [4, 4, 2]),
        {"top": lambda x: np.isclose(x[2], 0.0), "bottom": lambda x: np.isclose(x[2], -1.0)},
    )
    body = Body(Linear(1.0, 0.3), [Fixed("bottom", (constant(0.0, 3),) * 3)])
    rigid = shape(direction=direction, along=(0.0, 0.0, 1.0))
    return ContactProblem(block, body, Contact("top", rigid, press=press)).nodes


def lifted(inward):
    made = ball(12) + np.array([0.0, 0.0, 1.0])
    return partial(Triangles, made[:, ::-1] if inward else made)


def test_a_surface_that_is_inside_out_is_refused():
    """Its far side is not what a ray from the body meets."""
    nodes = above(lifted(False), "axis")
    r = np.linalg.norm(nodes.points[:, :2], axis=1)
    assert nodes.gap == pytest.approx(1 - np.sqrt(1 - r**2), abs=0.01)
    for direction in ("axis", "body"):
        for press in (False, True):
            with pytest.raises(InputError, match=r"\[inside-out\]"):
                above(lifted(True), direction, press)
    with pytest.raises(InputError, match=r"\[behind\]"):
        above(lifted(True), "foundation")


@pytest.mark.core
def test_stl_files(tmp_path):
    made = ball(4)
    binary = np.zeros(len(made), [("n", "<f4", 3), ("c", "<f4", (3, 3)), ("a", "<u2")])
    binary["c"] = made
    one, two = tmp_path / "binary.stl", tmp_path / "text.stl"
    one.write_bytes(bytes(80) + np.uint32(len(made)).tobytes() + binary.tobytes())
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in triangle)
        + "endloop\nendfacet\n"
        for triangle in made
    )
    two.write_text(f"solid ball\n{facets}endsolid ball\n")
    for file in (one, two):
        read = Triangles(file=str(file)).triangles
        assert np.abs(read - made).max() < 1e-7
    for name, content in (
        ("empty.stl", b""),
        ("other.stl", b"vertex a b c"),
        ("cut.stl", b"vertex 1 2 3"),
        ("degenerate.stl", bytes(80) + np.uint32(1).tobytes() + bytes(50)),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=name):
            Triangles(file=str(tmp_path / name)).check(3)
