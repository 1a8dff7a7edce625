"""Each shape against its formula: distances, normals, and gaps along rays."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from contact.errors import InputError
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
    SHAPES[name][0].check_normals(POINTS)
    SHAPES[name][0].check_normals(1e-3 * POINTS + np.array(TIP))


class Turned(Plane):
    """A plane whose normals point into it."""

    def distance(self, points):
        """Return distances and normals."""
        distance, normal = super().distance(points)
        return distance, -normal


@pytest.mark.parametrize("count", [0, 1, 30])
def test_a_wrong_sign_of_normals_is_refused(count):
    points = 5.0 + POINTS[:count, :2]
    Plane((0.0, 0.0), (1.0, 2.0)).check_normals(points)
    turned = Turned((0.0, 0.0), (1.0, 2.0))
    if count == 0:  # of a rank without contact nodes
        turned.check_normals(points)
        return
    with pytest.raises(InputError, match=r"\[shape-normals\]"):
        turned.check_normals(points)


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
