"""Each shape against its formula: distances, normals, and gaps along rays."""

from __future__ import annotations

import time

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from contact.case.file import parse_case
from contact.errors import InputError
from contact.interface.obstacle import (
    Cone,
    Cylinder,
    Level,
    Paraboloid,
    Plane,
    Punch,
    Sphere,
    Triangles,
)
from contact.interface.obstacle.stl import read_stl

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
    ball = Sphere((0.0, 4.1), 4.0, False, "axis", (0.0, 1.0)).measure(points, up)[1]
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


def ball(n):
    """Return the triangles of a sphere of radius 1, n along a quarter of its equator."""
    theta, phi = np.linspace(0, np.pi, 2 * n + 1), np.linspace(0, 2 * np.pi, 4 * n + 1)
    t, p = np.meshgrid(theta, phi, indexing="ij")
    x = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)
    a, b, c, d = x[:-1, :-1], x[1:, :-1], x[1:, 1:], x[:-1, 1:]
    made = np.concatenate([np.stack(k, axis=2).reshape(-1, 3, 3) for k in ((a, b, c), (a, c, d))])
    area = np.linalg.norm(np.cross(made[:, 1] - made[:, 0], made[:, 2] - made[:, 0]), axis=1)
    return made[area > 1e-12]


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


def test_surfaces_and_formulas_reach_into_facets_as_deep_as_the_ball():
    points = np.random.default_rng(3).normal(size=(50, 3))
    points /= np.linalg.norm(points, axis=1)[:, None] * 1.001
    known = Sphere((0.0, 0.0, 0.0), 1.0).chord_depth(0.3, points)
    formula = Level(lambda x: x[:, 0] ** 2 + x[:, 1] ** 2 + x[:, 2] ** 2 - 1)
    assert Triangles(ball(40)).chord_depth(0.3, points) == pytest.approx(known, rel=0.1)
    exact = Level(lambda x: np.linalg.norm(x, axis=1) - 1)
    assert exact.chord_depth(0.3, points) == pytest.approx(known, rel=0.02)
    # A distance that is not quite one says it nearly.
    assert formula.chord_depth(0.3, points) == pytest.approx(known, rel=0.1)
    room = Level(lambda x: 1 - np.linalg.norm(x, axis=1))
    assert room.chord_depth(0.3, points) == 0.0
    assert room.chord_depth(0.3, points[:0]) == 0.0


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


def test_a_hundred_thousand_triangles_in_a_second():
    shape = Triangles(ball(112))
    assert len(shape.corners) > 1e5
    direction = np.random.default_rng(3).normal(size=(10_000, 3))
    points = direction / np.linalg.norm(direction, axis=1)[:, None] * 1.02
    begin = time.process_time()
    distance, _ = shape.distance(points)
    seconds = time.process_time() - begin
    assert np.abs(distance - 0.02).max() < (np.pi / 224) ** 2
    assert seconds < 1


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
    assert np.abs(read_stl(one) - made).max() < 1e-7
    assert np.abs(read_stl(two) - made).max() < 1e-7
    for name, content in (
        ("empty.stl", b""),
        ("other.stl", b"vertex a b c"),
        ("cut.stl", b"vertex 1 2 3"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=name):
            read_stl(tmp_path / name)


CASE = {
    "mesh": {"generator": "box", "size": [1.0, 1.0, 1.0], "cells": [1, 1, 1]},
    "material": {"young": 1.0, "poisson": 0.3},
    "fixed": [{"on": "top", "displacement": [0.0, 0.0, 0.0]}],
}
BAD = {
    "key of another shape": (
        {"shape": "cone", "apex": [0, 0, 0], "axis": [0, 0, 1], "half_angle": 70.0, "inside": True},
        {},
        'inside: unknown key with shape = "cone": it belongs to shape = "',
    ),
    "edge": (
        {
            "shape": "punch",
            "centre": [0, 0, 0],
            "axis": [0, 0, 1],
            "radius": 1.0,
            "edge_radius": 2.0,
        },
        {},
        "at most the radius",
    ),
    "no axis": (
        {"shape": "punch", "centre": [0, 0, 0], "axis": [0, 0, 0], "radius": 1.0},
        {},
        "not zero",
    ),
    "two and three": (
        {"shape": "cone", "apex": [0, 0, 0], "axis": [0, 1], "half_angle": 70.0},
        {},
        "3 numbers, as apex has",
    ),
    "angle": (
        {"shape": "cone", "apex": [0, 0, 0], "axis": [0, 0, 1], "half_angle": 90.0},
        {},
        "between 0 and 90",
    ),
    "axis missing": (
        {"shape": "plane", "point": [0, 0, 0], "normal": [0, 0, 1]},
        {"direction": "axis"},
        "contact.axis: missing",
    ),
    "axis alone": (
        {"shape": "plane", "point": [0, 0, 0], "normal": [0, 0, 1]},
        {"axis": [0, 0, 1]},
        "contact.axis",
    ),
    "no file": ({"shape": "surface"}, {}, "contact.foundation.file: missing"),
    "shape": ({"shape": "ball"}, {}, '"sphere"'),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_shapes_get_one_line(name):
    foundation, more, words = BAD[name]
    floats = {k: [float(x) for x in v] if isinstance(v, list) else v for k, v in foundation.items()}
    with pytest.raises(InputError) as caught:
        parse_case({**CASE, "contact": {"on": "bottom", "foundation": floats, **more}})
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_surface_is_no_foundation_in_the_plane():
    mesh = {"generator": "rectangle", "size": [1.0, 1.0], "cells": [1, 1]}
    foundation = {"shape": "surface", "file": "a.stl"}
    fixed = [{"on": "top", "displacement": [0.0, 0.0]}]
    with pytest.raises(InputError, match="in 3-D only"):
        parse_case(
            {
                **CASE,
                "mesh": mesh,
                "fixed": fixed,
                "contact": {"on": "bottom", "foundation": foundation},
            }
        )
