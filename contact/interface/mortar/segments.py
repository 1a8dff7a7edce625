"""Segments of the mortar integration: pairs of facets, their intersections, and quadrature there.

A master facet is projected onto the line or plane of a slave facet, along a direction that each
slave facet has. Both have in common a segment or a convex polygon, on which all integrands are
polynomials: the rules are exact there.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from contact.body.pointwise import CHUNK
from contact.interface.mortar.surface import Surface, rule, size_of
from contact.tolerances import ROUNDING
from contact.typing import Array

#: Least cosine between a normal and the opposite of the other.
FACING = 0.1

#: How much farther than the nearest facet the one along the normal may be.
DETOUR = 2.0


def facing_pairs(
    slave: Surface, master: Surface, reach: float
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Yield pairs of a slave and a master facet whose shadows along the slave's normal may meet.

    Parameters
    ----------
    slave, master
        The two sides.
    reach
        Slave facets that are farther than this from all of the other side face none (length).
    """
    if slave.count == 0 or master.count == 0:
        return
    tree, radii = cKDTree(master.centres), master.radii
    widest = radii.max()
    centres, own = slave.centres, slave.radii
    distance = tree.query(centres)[0]
    near = np.flatnonzero(distance <= reach + widest + own)
    radius = (own + widest + DETOUR * distance)[near]
    counts = tree.query_ball_point(centres[near], radius, return_length=True)
    ends = np.cumsum(counts) // CHUNK
    for chosen in np.split(np.arange(near.size), np.flatnonzero(np.diff(ends)) + 1):
        found = tree.query_ball_point(centres[near[chosen]], radius[chosen], return_sorted=True)
        i = np.repeat(near[chosen], [len(f) for f in found])
        j = np.array([m for f in found for m in f], dtype=np.intp)
        offset = master.centres[j] - centres[i]
        height = np.einsum("pd,pd->p", offset, slave.normal[i])
        aside = np.sqrt(np.maximum(np.einsum("pd,pd->p", offset, offset) - height**2, 0.0))
        opposite = -np.einsum("pd,pd->p", slave.normal[i], master.normal[j])
        keep = (aside <= own[i] + radii[j]) & (opposite > FACING) & (np.abs(height) <= reach)
        yield i[keep], j[keep]


#: Corners of the intersection of two triangles, at most.
CORNERS = 6


def clipped(triangles: Array) -> tuple[Array, NDArray[np.intp]]:
    """Clip triangles by the reference triangle, on which all barycentric coordinates are >= 0.

    Parameters
    ----------
    triangles
        Barycentric coordinates of the corners of each, shape (n, 3, 3).

    Returns
    -------
    polygons
        Corners in their order, shape (n, 6, 3); those beyond the number of corners are 0.
    count
        Number of corners, 0 where nothing is common, shape (n,).
    """
    n = triangles.shape[0]
    polygon: Array = np.zeros((n, CORNERS, 3))
    polygon[:, :3] = triangles
    count: NDArray[np.intp] = np.full(n, 3, dtype=np.intp)
    for side in range(3):
        polygon, count = _cut(polygon, count, side)
    return polygon, count


def _cut(polygon: Array, count: NDArray[np.intp], side: int) -> tuple[Array, NDArray[np.intp]]:
    """Keep the part of each polygon where a coordinate is >= 0."""
    n, most, _ = polygon.shape
    present = np.arange(most)[None, :] < count[:, None]
    following = np.where(
        np.arange(1, most + 1)[None, :] < count[:, None], np.arange(1, most + 1), 0
    )
    after = np.take_along_axis(polygon, following[:, :, None], axis=1)
    here, there = polygon[:, :, side], after[:, :, side]
    inside = (here >= 0) & present
    crosses = ((here >= 0) != (there >= 0)) & present
    slope = np.where(crosses, here - there, 1.0)
    crossing = polygon + (here / slope)[:, :, None] * (after - polygon)
    # On the side itself, whatever rounding says.
    crossing[:, :, side] = 0.0
    # Of each edge its beginning where that is inside, then the crossing.
    emitted = np.stack([inside, crosses], axis=2).reshape(n, 2 * most)
    corners = np.stack([polygon, crossing], axis=2).reshape(n, 2 * most, 3)
    order = np.argsort(~emitted, axis=1, kind="stable")[:, :most]
    kept = np.take_along_axis(corners, order[:, :, None], axis=1)
    left = emitted.sum(axis=1)
    kept[np.arange(most)[None, :] >= left[:, None]] = 0.0
    return kept, left


@dataclass(frozen=True)
class Points:
    """Quadrature points on common pieces.

    Attributes
    ----------
    slave, master
        The facets that each point belongs to, shape (p,).
    on_slave, on_master
        Barycentric coordinates there, shape (p, d).
    weight
        Quadrature weights, lengths or areas on the slave facet, or of its rings, shape (p,).
    gap
        Distance from the slave to the master facet along the slave's direction, shape (p,).
    """

    slave: NDArray[np.intp]
    master: NDArray[np.intp]
    on_slave: Array
    on_master: Array
    weight: Array
    gap: Array


def common_points(
    slave: Surface,
    master: Surface,
    pairs: tuple[NDArray[np.intp], NDArray[np.intp]],
    direction: Array,
    degree: int,
) -> Points:
    """Return quadrature points on the intersections of pairs of facets.

    Parameters
    ----------
    slave, master
        The two sides.
    pairs
        The facets of each pair, shapes (n,).
    direction
        Along which a slave facet looks, unit vectors, shape (f, d).
    degree
        Of the polynomials that are integrated exactly, 2 or 4.
    """
    i, j = pairs
    corners = slave.corners[i]
    # Barycentric coordinates of the master's corners, projected, on the slave: (n, d, d).
    projected, height = _on_plane(corners, slave.normal[i], direction[i], master.corners[j])
    d = corners.shape[1]
    parts, share = (_segments if d == 2 else _triangles)(projected)
    # Parts of the slave facet by barycentric coordinates of their corners: (n, parts, d, d).
    pair, part = np.nonzero(share > ROUNDING)
    places, weights = rule(d, degree)
    on_slave = np.einsum("qc,pcb->pqb", places, parts[pair, part])
    # The projection is affine: x = sum_c lambda_c x_c on both.
    inverse = np.linalg.inv(projected[pair])
    on_master = np.einsum("pqb,pbc->pqc", on_slave, inverse)
    gap = np.einsum("pqc,pc->pq", on_master, height[pair])
    for side, facets, places_on in ((slave, i[pair], on_slave), (master, j[pair], on_master)):
        cosine = np.abs(np.einsum("pd,pd->p", side.normal[facets], direction[i[pair]]))
        gap -= side.height(facets, places_on) / cosine[:, None]
    size = (size_of(corners)[pair] * share[pair, part])[:, None] * weights
    points = np.repeat(pair, weights.size)
    places = on_slave.reshape(-1, d)
    return Points(
        i[points],
        j[points],
        places,
        on_master.reshape(-1, d),
        size.ravel() * slave.turn(i[points], places),
        gap.ravel(),
    )


def _on_plane(corners: Array, normal: Array, direction: Array, x: Array) -> tuple[Array, Array]:
    """Return barycentric coordinates of projected points on facets, and their distances.

    Parameters
    ----------
    corners, normal
        Of the facets, shapes (n, d, d) and (n, d).
    direction
        Of the projection, and of the distances, shape (n, d).
    x
        Points, shape (n, m, d).

    Returns
    -------
    Shapes (n, m, d) and (n, m).
    """
    offset = x - corners[:, :1]
    cosine = np.einsum("nd,nd->n", normal, direction)
    height = np.einsum("nmd,nd->nm", offset, normal) / cosine[:, None]
    edges = corners[:, 1:] - corners[:, :1]
    gram = np.einsum("nid,njd->nij", edges, edges)
    products = np.einsum("nid,nmd->nim", edges, offset)
    aside = np.einsum("nid,nd->ni", edges, direction)
    products -= aside[:, :, None] * height[:, None, :]
    others = np.linalg.solve(gram, products).transpose(0, 2, 1)
    first = 1 - others.sum(axis=2, keepdims=True)
    return np.concatenate([first, others], axis=2), height


def _segments(projected: Array) -> tuple[Array, Array]:
    """Return the common segment of each pair, shape (n, 1, 2, 2), and its share, (n, 1)."""
    s = projected[:, :, 1]
    low, high = np.maximum(s.min(axis=1), 0.0), np.minimum(s.max(axis=1), 1.0)
    ends = np.stack([low, high], axis=1)
    return np.stack([1 - ends, ends], axis=2)[:, None], (high - low)[:, None]


def _triangles(projected: Array) -> tuple[Array, Array]:
    """Return the triangles of each pair's common polygon, (n, 4, 3, 3), and their shares."""
    polygon, count = clipped(projected)
    # A fan about the first corner; coordinates are barycentric on the slave.
    fan = [polygon[:, [0, k, k + 1]] for k in range(1, polygon.shape[1] - 1)]
    parts = np.stack(fan, axis=1)
    share = np.abs(np.linalg.det(parts))
    share[np.arange(2, polygon.shape[1])[None, :] >= count[:, None]] = 0.0
    return parts, share
