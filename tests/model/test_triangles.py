"""Foundations of triangles: distances, signs at edges, STL files."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from dolfinx import mesh
from mpi4py import MPI

from contact import Body, Contact, Fixed, InputError, Triangles
from contact.mesh.domain import from_mesh
from contact.problem.problem import ContactProblem
from forms.hencky import Linear
from tests.problems.mechanics import constant

POINTS = np.random.default_rng(0).normal(size=(1000, 3))


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
