"""Sides of bodies as plain facets, of all shapes and degrees, on jittered meshes."""

from dataclasses import replace

import numpy as np

from contact.interface.mortar.surface import Surface
from contact.mesh.cells import INTERVAL, QUADRILATERAL, TRIANGLE

KINDS = [(shape, degree) for shape in (INTERVAL, TRIANGLE, QUADRILATERAL) for degree in (1, 2)]
NAMES = [f"{shape.name}-{degree}" for shape, degree in KINDS]

#: Number of the first node of the other side.
FIRST = 100_000


def edges(n, rng):
    """Return corner points in [0, 1] and the edges between them."""
    x = np.linspace(0, 1, n + 1)
    x[1:-1] += rng.uniform(-0.3, 0.3, n - 1) / n
    return x[:, None], np.column_stack([np.arange(n), np.arange(1, n + 1)])


def triangles(n, rng):
    """Return corner points in the unit square and triangles of them."""
    p, corners = squares(n, rng)
    return p, np.concatenate([corners[:, [0, 1, 3]], corners[:, [0, 3, 2]]])


def squares(n, rng):
    """Return corner points in the unit square and quadrilaterals of them, no two alike."""
    g = np.linspace(0, 1, n + 1)
    p = np.stack(np.meshgrid(g, g, indexing="ij"), axis=-1).reshape(-1, 2)
    inside = np.all((p > 1e-9) & (p < 1 - 1e-9), axis=1)
    p[inside] += rng.uniform(-0.3, 0.3, (inside.sum(), 2)) / n
    i = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    return p, np.stack([k.ravel() for k in (i[:-1, :-1], i[1:, :-1], i[:-1, 1:], i[1:, 1:])], 1)


def flat(kind, n, height, up, seed, first=0, turn=None, size=1.0):
    """Return a flat side at a height with its nodes' coordinates, by their number."""
    (shape, degree), dim = kind, kind[0].dim + 1
    rng = np.random.default_rng(seed)
    p, corners = {INTERVAL: edges, TRIANGLE: triangles, QUADRILATERAL: squares}[shape](n, rng)
    x = np.column_stack([size * p, np.full(len(p), height)])
    x = x if turn is None else x @ turn.T
    normal = np.zeros(dim)
    normal[-1] = up
    every = shape.lagrange(1, shape.nodes(degree)) @ x[corners]
    _, first_of, number = np.unique(
        every.reshape(-1, dim).round(9), axis=0, return_index=True, return_inverse=True
    )
    nodes = number.reshape(every.shape[:2])
    normal = normal if turn is None else turn @ normal
    out = np.tile(normal, (len(corners), 1))
    none = np.zeros((len(corners), len(shape.edges)))
    side = Surface(nodes + first, x[corners], out, none, none, none, degree)
    return side, every.reshape(-1, dim)[first_of]


def bowed(kind, n, height, up, seed, first=0):
    """Return the like of degree 2 whose edges are curved in the plane of the side, unit square."""
    side, x = flat(kind, n, height, up, seed, first)
    moves = np.random.default_rng(seed).uniform(-0.06, 0.06, x.shape) / n
    moves[np.unique(side.nodes[:, : kind[0].corners] - first)] = 0.0
    moves[:, -1] = 0.0
    x = x + np.where((x > 1e-9) & (x < 1 - 1e-9), moves, 0.0)
    return replace(side, points=x[side.nodes - first]), x


def oriented(points, triangles, outwards):
    """Return corners, unit normals on the side of a direction, and edges of triangles."""
    corners = points[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sign = np.sign(np.einsum("fd,d->f", normal, outwards))
    edges = [corners[:, j] - corners[:, i] for i, j in TRIANGLE.edges]
    unit = normal * (sign / np.linalg.norm(normal, axis=1))[:, None]
    return corners, unit, np.stack(edges, axis=1)
