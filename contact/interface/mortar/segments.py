"""Segments of the mortar integration: pairs of facets, their intersections, and quadrature there.

Both facets are projected onto the average plane of the slave facet, along a direction that each
slave facet has; their segments or convex polygons have a segment or a convex polygon in common.
Its points are carried back onto both by the inverse of their maps: on straight simplices and
parallelograms integrands are polynomials there, and the rules are exact. Curved facets are cut
along straight lines between the nodes of their geometry, and the slivers between these and curved
edges are added: to the facet that has them, and from its neighbour, whose functions go on beyond
its edge. With both of each pair of facets the slivers of either side cancel on the other, so that
constants, and linear fields, are integrated over the curved facets of both sides.

References
----------
Puso and Laursen, Comput. Methods Appl. Mech. Engrg. 193 (2004) 601 (average plane); Puso, Laursen
and Solberg, ibid. 197 (2008) 555 (pieces of facets of degree 2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from contact.interface.mortar.surface import Surface
from contact.mesh.cells import INTERVAL, LARGEST, QUADRILATERAL, TRIANGLE, rule
from contact.mesh.geometry import area_vectors, determinant, inverse, jacobians, pulled_back
from contact.tolerances import ROUNDING
from contact.typing import Array


def clipped(polygons: Array, by: Array) -> tuple[Array, NDArray[np.intp]]:
    """Clip convex polygons by others (Sutherland and Hodgman, Comm. ACM 17, 1974).

    Both are corners in their order, either way round, shapes (n, k, 2) and (n, m, 2). The result
    has corners in their order, shape (n, k + m, 2), and their number, 0 where nothing is common,
    (n,); corners beyond this number are 0.
    """
    n, k, _ = polygons.shape
    polygon = np.concatenate([polygons, np.zeros_like(by)], axis=1)
    count: NDArray[np.intp] = np.full(n, k, dtype=np.intp)
    edges = np.roll(by, -1, axis=1) - by
    turn = np.sign(_cross(by[:, 1] - by[:, 0], by[:, 2] - by[:, 0]))
    for side in range(by.shape[1]):
        height = turn[:, None] * _cross(edges[:, side, None], polygon - by[:, side, None])
        polygon, count = _cut(polygon, count, height)
    return polygon, count


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def _cut(polygon: Array, count: NDArray[np.intp], height: Array) -> tuple[Array, NDArray[np.intp]]:
    """Keep the part of each polygon where a linear function, given at the corners, is >= 0."""
    # Signs of rounding would make several crossings of a corner on the line, and lose another.
    n, most, _ = polygon.shape
    present = np.arange(most)[None, :] < count[:, None]
    largest = np.abs(np.where(present, height, 0.0)).max(axis=1)[:, None]
    height = np.where(np.abs(height) <= ROUNDING * largest, 0.0, height)
    following = np.where(
        np.arange(1, most + 1)[None, :] < count[:, None], np.arange(1, most + 1), 0
    )
    next_corner = np.take_along_axis(polygon, following[:, :, None], axis=1)
    next_height = np.take_along_axis(height, following, axis=1)
    inside = (height >= 0) & present
    crosses = ((height >= 0) != (next_height >= 0)) & present
    slope = np.where(crosses, height - next_height, 1.0)
    crossing = polygon + (height / slope)[:, :, None] * (next_corner - polygon)
    # Each edge gives its first corner if that is inside, then its crossing.
    emitted = np.stack([inside, crosses], axis=2).reshape(n, 2 * most)
    corners = np.stack([polygon, crossing], axis=2).reshape(n, 2 * most, 2)
    order = np.argsort(~emitted, axis=1, kind="stable")[:, :most]
    kept = np.take_along_axis(corners, order[:, :, None], axis=1)
    corner_count = emitted.sum(axis=1)
    kept[np.arange(most)[None, :] >= corner_count[:, None]] = 0.0
    return kept, corner_count


@dataclass(frozen=True)
class Points:
    """Quadrature points on common pieces."""

    slave: NDArray[np.intp]  #: the slave facet that each point belongs to, shape (p,)
    master: NDArray[np.intp]  #: the master facet, likewise
    on_slave: Array  #: points of the reference slave facets, shape (p, dim)
    on_master: Array  #: points of the reference master facets, shape (p, dim)
    weight: Array  #: quadrature weights, lengths or areas on the slave facet, or its rings, (p,)
    gap: Array  #: distance from slave to master facet along the slave's direction, shape (p,)
    #: Gap of the curved surfaces, also where displacements do not follow these, shape (p,).
    curved_gap: Array
    #: Depth of the deepest overlap on each slave facet, of facets and of the surfaces that they
    #: approximate; below 0 the least distance, shape (f,) (length).
    depth: Array


def common_points(
    slave: Surface,
    master: Surface,
    pairs: tuple[NDArray[np.intp], NDArray[np.intp]],
    direction: Array,
) -> Points:
    """Return quadrature points on the intersections of pairs of facets.

    `pairs` has the slave and the master facet of each pair, shapes (n,). A slave facet looks along
    its `direction`, a unit vector, shape (f, d).
    """
    i, j = pairs
    slave_nodes, master_nodes = _on_planes(
        slave, i, direction[i], (slave.points[i], master.points[j])
    )
    pair, y, weight = _quadrature(slave, master, pairs, slave_nodes, master_nodes)
    i, j, slave_nodes, master_nodes = i[pair], j[pair], slave_nodes[pair], master_nodes[pair]
    on_slave, on_master = (
        pulled_back(side.shape, nodes[..., : slave.shape.dim], y)
        for side, nodes in ((slave, slave_nodes), (master, master_nodes))
    )
    sides = (
        _SidePoints(master, j, on_master, direction[i], 1.0),
        _SidePoints(slave, i, on_slave, direction[i], -1.0),
    )
    clear, change, curved = np.zeros((3, pair.size))
    for side, nodes in zip(sides, (master_nodes, slave_nodes), strict=True):
        clear += side.of_facets(nodes[..., -1])
        if side.surface.order == 1 and not side.surface.refined:
            height = side.height()
            curved += height
            change += height if side.surface.follows else 0.0
    gap = clear + change
    depth, across = np.full(slave.count, -np.inf), np.einsum("fd,fd->f", slave.normal, direction)
    np.maximum.at(depth, i, -_least_distance(clear, gap, sides) * across[i])
    bears = weight != 0
    weight = weight[bears] * _measure(slave, i[bears], on_slave[bears], slave_nodes[bears])
    gaps = gap[bears], (clear + curved)[bears]
    return Points(i[bears], j[bears], on_slave[bears], on_master[bears], weight, *gaps, depth)


@dataclass(frozen=True)
class _SidePoints:
    """Points on the facets of one side, and the directions of the rays through them."""

    surface: Surface
    facets: NDArray[np.intp]  #: the facet of each point, shape (p,)
    at: Array  #: points of the reference facets, shape (p, dim)
    direction: Array  #: shape (p, d)
    sign: float  #: 1 for the master, -1 for the slave: gaps are the sums of both

    def of_facets(self, heights: Array) -> Array:
        """Return signed heights of the facets, given those at their nodes, (p, k)."""
        functions = self.surface.shape.lagrange(self.surface.order, self.at)
        return self.sign * np.einsum("pk,pk->p", functions, heights)

    def height(self) -> Array:
        """Return signed distances of the curved surface from the facets, shape (p,)."""
        return self.sign * self.surface.distance(self.facets, self.at, self.direction)

    def most(self, some: NDArray[np.intp]) -> Array:
        """Return upper bounds of `height` at some of the points."""
        facets, at, direction = self.facets[some], self.at[some], self.direction[some]
        bounds = self.surface.distance_bounds(facets, at, direction)
        return np.maximum(*(self.sign * bound for bound in bounds))


def _least_distance(clear: Array, gap: Array, sides: Sequence[_SidePoints]) -> Array:
    """Return the distances of facets, below 0 by as much as no curvature explains, shape (p,)."""
    apart, cut = np.maximum(clear, gap), np.flatnonzero(clear < 0)
    most = sum(side.most(cut) for side in sides)
    apart[cut] = np.minimum(clear[cut] + np.maximum(most, 0.0), 0.0)
    return apart


def _measure(slave: Surface, facets: NDArray[np.intp], at: Array, nodes: Array) -> Array:
    """Return lengths or areas on slave facets, or of their rings, per those on the planes, (p,)."""
    gradients, d = slave.shape.gradients(slave.order, at), slave.shape.dim
    turned = np.einsum("pkr,pkd->pdr", gradients, nodes[..., :d])
    size = np.linalg.norm(area_vectors(slave.slopes(facets, at)), axis=1)
    size /= np.abs(determinant(turned))
    if slave.revolved:
        functions = slave.shape.lagrange(slave.order, at)
        size *= 2 * np.pi * np.einsum("pk,pk->p", functions, slave.points[facets, :, 0])
    return np.asarray(size)


def _quadrature(
    slave: Surface,
    master: Surface,
    pairs: tuple[NDArray[np.intp], NDArray[np.intp]],
    slave_nodes: Array,
    master_nodes: Array,
) -> tuple[NDArray[np.intp], Array, Array]:
    """Return pair, point on the plane and weight of all quadrature points, ascending by pair."""
    exact = _degrees(slave, master, *pairs)
    none = np.zeros(0, dtype=np.intp), np.zeros((0, slave.shape.dim)), np.zeros(0)
    points: list[tuple[NDArray[np.intp], Array, Array]] = [none]
    for degree in np.unique(exact):
        chosen = np.flatnonzero(exact == degree)
        slave_pieces = _pieces(slave, slave_nodes[chosen])
        master_pieces = _pieces(master, master_nodes[chosen])
        parts = [_common(slave_pieces, master_pieces, int(degree))]
        for side, nodes, pieces in (
            (slave, slave_nodes, master_pieces),
            (master, master_nodes, slave_pieces),
        ):
            if side.order > 1 and side.shape.dim > 1:
                parts.append(_slivers(side, nodes[chosen], pieces, int(degree)))
        points += [(chosen[pair], y, weight) for pair, y, weight in parts]
    pair, y, weight = (np.concatenate(arrays) for arrays in zip(*points, strict=True))
    order = np.argsort(pair, kind="stable")
    return pair[order], y[order], weight[order]


def _on_planes(
    slave: Surface, facets: NDArray[np.intp], direction: Array, sides: Sequence[Array]
) -> list[Array]:
    """Return points on average planes of slave facets with their heights, (n, m, d) a side."""
    # Coordinates are those of the reference facet, by the slope of its map in the middle.
    shape, points = slave.shape, slave.points[facets]
    origin = shape.lagrange(slave.order, shape.middle) @ points
    slope = jacobians(shape, points, shape.middle)[:, 0]
    to_plane = inverse(np.concatenate([slope, direction[:, :, None]], axis=2))
    middle = np.append(shape.middle[0], 0.0)
    return [np.einsum("nij,nmj->nmi", to_plane, x - origin) + middle for x in sides]


def _degrees(
    slave: Surface, master: Surface, i: NDArray[np.intp], j: NDArray[np.intp]
) -> NDArray[np.intp]:
    """Return the degree of the polynomials to be integrated over each pair, shape (n,)."""
    # The inverse of a bilinear map of the bend b = |w|/4 is analytic up to 1/(2 b) beside a rule on
    # [-1, 1], where its determinant 1 + w (eta, xi) is 0; that of a quadratic map up to 1/(4 b).
    # Errors fall with each degree by the sum of the half axes of the ellipse through the pole.
    total = sum(side.degree * (1 if side.shape.simplex else 2) for side in (slave, master))
    bend = np.maximum(slave.bend[i], master.bend[j])
    pole = 1 / np.clip(2 * bend, ROUNDING, 0.9)
    if slave.order > 1:
        # From the middle of a piece, which is half as large as the facet.
        pole = 1 + pole / 2
    fall = np.log(pole + np.sqrt(pole**2 - 1))
    more = np.where(bend > 0, np.ceil(np.log(1 / ROUNDING) / fall), 0)
    return np.minimum(total + slave.revolved + more, LARGEST).astype(np.intp)


def _pieces(side: Surface, nodes: Array) -> Array:
    """Return the straight pieces of projected facets, corners around each, (n, pieces, c, dim)."""
    shape = side.shape
    return nodes[:, shape.pieces(side.order)[:, shape.around], : shape.dim]


def _common(
    slave_pieces: Array, master_pieces: Array, degree: int
) -> tuple[NDArray[np.intp], Array, Array]:
    """Return pair, point and weight of the points of a rule, and of corners, on common parts."""
    first, second = slave_pieces[:, :, None], master_pieces[:, None]
    low = np.maximum(first.min(axis=3), second.min(axis=3))
    high = np.minimum(first.max(axis=3), second.max(axis=3))
    pair, a, b = np.nonzero(np.all(high > low, axis=3))
    if slave_pieces.shape[3] == 1:
        shape, part = INTERVAL, np.stack([low, high], axis=3)[pair, a, b]
    else:
        shape = TRIANGLE
        polygon, count = clipped(slave_pieces[pair, a], master_pieces[pair, b])
        # A fan about the first corner.
        fan = np.arange(1, polygon.shape[1] - 1)
        row, k = np.nonzero(fan + 1 < count[:, None])
        pair, part = pair[row], polygon[row[:, None], np.stack([0 * k, k + 1, k + 2], axis=1)]
    size = np.abs(determinant(jacobians(shape, part, shape.middle)[:, 0]))
    large = size > ROUNDING
    # Corners have no weight: the gap of straight facets is least there.
    at, weights = rule(shape, degree)
    at = np.concatenate([at, shape.nodes(1)])
    weights = np.append(weights, np.zeros(shape.corners))
    y = shape.lagrange(1, at) @ part[large]
    weight = size[large][:, None] * weights
    return np.repeat(pair[large], weights.size), y.reshape(-1, shape.dim), weight.ravel()


def _slivers(
    side: Surface, nodes: Array, by: Array, degree: int
) -> tuple[NDArray[np.intp], Array, Array]:
    """Return the points, as `_common`, between curved edges and their chords, within `by`."""
    # Half of an edge from p along e, its middle by b aside: p + t e + s t (1 - t) b, with the
    # measure t (1 - t) |e x b|, negative where the edge bends inwards.
    shape, flat = side.shape, nodes[..., :2]
    first, second = np.array(shape.edges).T
    half = flat[:, shape.corners : shape.corners + len(first)]
    bow = half - (flat[:, first] + flat[:, second]) / 2
    # Halves of all edges, and pieces of the other side: (n, edges, 2, pieces).
    begin = np.stack([flat[:, first], half], axis=2)[:, :, :, None]
    along = np.stack([half, flat[:, second]], axis=2)[:, :, :, None] - begin
    inside = flat[:, : shape.corners].mean(axis=1)[:, None, None, None] - begin
    size = -np.sign(_cross(along, inside)) * _cross(along, bow[:, :, None, None])
    bowed, polygons = np.broadcast_to(np.abs(size) > ROUNDING, (*size.shape[:3], by.shape[1])), by
    pair, edge, part, piece = np.nonzero(bowed)
    begin, along, size = (x[pair, edge, part, 0] for x in (begin, along, size))
    low, high, share = _within(begin, along, polygons[pair, piece])
    met = np.flatnonzero(high - low > ROUNDING)
    at, weights = rule(QUADRILATERAL, degree + 2)
    t = low[met, None] + (high - low)[met, None] * at[:, 0]
    rise = t * (1 - t)
    y = begin[met, None] + t[..., None] * along[met, None]
    y += (at[:, 1] * rise)[..., None] * bow[pair[met], edge[met]][:, None]
    weight = (share * (high - low) * size)[met, None] * rise * weights
    return np.repeat(pair[met], weights.size), y.reshape(-1, 2), weight.ravel()


def _within(begin: Array, along: Array, polygons: Array) -> tuple[Array, Array, Array]:
    """Return where segments in convex polygons begin and end, 0 to 1, and the share of these."""
    # Cyrus and Beck, Comput. Graph. 3 (1978); a segment on an edge is half in the polygon.
    edges = np.roll(polygons, -1, axis=1) - polygons
    turn = np.sign(_cross(edges[:, 0], edges[:, 1]))[:, None] / np.linalg.norm(edges, axis=2)
    height = turn * _cross(edges, begin[:, None] - polygons)
    slope = turn * _cross(edges, along[:, None])
    level = np.abs(slope) <= ROUNDING
    at = -height / np.where(level, 1.0, slope)
    low = np.where(~level & (slope > 0), at, 0.0).max(axis=1)
    high = np.where(~level & (slope < 0), at, 1.0).min(axis=1)
    beyond = (level & (height < -ROUNDING)).any(axis=1)
    on_edge = (level & (np.abs(height) <= ROUNDING)).any(axis=1)
    zero, share = np.zeros(len(begin)), np.where(on_edge, 0.5, 1.0)
    return np.maximum(low, zero), np.where(beyond, zero, np.minimum(high, 1.0)), share
