"""Reconstruction of a curved surface from straight facets: its height h above them.

A least-squares fit of a quadratic surface to the vertices around each vertex gives the curvature
tensor K there. In barycentric coordinates lambda the height above a facet is the sum over its edges

    h = sum_ij lambda_i lambda_j c_ij,    c_ij = -e.K e/2    (e the edge between i and j),

and c/4 in the middle of an edge (the sagitta). K of an edge is the mean of the fits at the corners
of its facet, weighted against those beyond which the curvature jumps. Circles are reproduced,
spheres and cylinders to third order; flat sides have h = 0.

References
----------
Max, J. Graphics Tools 4 (1999) 1 (normals at vertices, exact on spheres); Cazals and Pouget,
Comput. Aided Geom. Design 22 (2005) 121 (fits of vertices); Jiang and Shu, J. Comput. Phys. 126
(1996) 202 (weights at jumps).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from contact.mesh.cells import facet_with
from contact.mesh.geometry import area_vectors
from contact.mesh.owners import ALONE, Owners
from contact.ranks import exchanged
from contact.typing import Array

#: Least cosine between the normals of facets that meet, and their mean, on a smooth surface.
SMOOTH = 0.9

#: Least cosine between the normals at both ends of an edge, and of the facets around a vertex and
#: their mean: of twice the angle.
ALIKE_NORMALS = 2 * SMOOTH**2 - 1

#: Weight in a fit of vertices two edges away, for vertices with too few neighbours.
FAR = 1e-3

#: Relative difference of curvature up to which both ends of an edge have the same weight.
ALIKE = 0.4

#: Numbers of vertices.
Numbers = NDArray[np.intp]


def deviations(
    names: NDArray[np.int64],
    corners: Array,
    normal: Array,
    owners: Owners = ALONE,
    levels: int = 0,
    values: Array | None = None,
) -> tuple[Array, Array, Array]:
    """Return c > 0 outwards, its uncertainty and largest change, (f, edges). Collective.

    The uncertainty is the spread of c among the fits at the corners, plus a quarter of the change
    of c from one edge to the next. The largest change is that to the corners and to the vertices
    beyond them; both are zero on circles. The facets of this rank are given by global numbers of
    corners, (f, c), coordinates, (f, c, d), and normals, (f, d). After `levels` uniform refinements
    c is that of the edges before, taken at their ends, where all of the turn is. With values at the
    corners, (f, c), infinite where there are none, c is that of these above linear ones.
    """
    count = len(names)
    arrays = (names, corners, normal, *([] if values is None else [values]))
    found, uncertain, change = _deviations(levels, *_with_rings(owners, *arrays))
    return found[:count], uncertain[:count], change[:count]


def _with_rings(owners: Owners, *arrays: NDArray[Any]) -> tuple[NDArray[Any], ...]:
    """Append the facets of other ranks up to four edges away, corner numbers first. Collective."""
    # The owner of a vertex is told which ranks have facets there.
    comm, own = owners.comm, arrays[0]
    vertices = np.unique(own)
    holder, held_vertex = exchanged(comm, owners.ranks(vertices), vertices)
    order = np.argsort(held_vertex, kind="stable")
    holder, held_vertex = holder[order], held_vertex[order]
    by_vertex = np.argsort(own.ravel(), kind="stable")
    at = own.ravel()[by_vertex]
    every, asked = [arrays], np.zeros(0, dtype=np.int64)
    sent = np.zeros((0, 2), dtype=np.intp)
    # An edge needs the fits at its ends' neighbours, and a fit the normals two edges away.
    for _ in range(4):
        fresh = np.setdiff1d(np.concatenate([facets[0].ravel() for facets in every]), asked)
        asked = np.union1d(asked, fresh)
        asking, vertex = exchanged(comm, owners.ranks(fresh), fresh)
        row, found = _runs(held_vertex, vertex)
        other = holder[found] != asking[row]
        to, row = holder[found][other], row[other]
        _, asking, vertex = exchanged(comm, to, asking[row], vertex[row])
        row, found = _runs(at, vertex)
        pairs = np.column_stack([asking[row], by_vertex[found] // own.shape[1]])
        before = len(sent)
        whole, first = np.unique(np.concatenate([sent, pairs]), axis=0, return_index=True)
        sent, new = np.concatenate([sent, whole[first >= before]]), whole[first >= before]
        every.append(tuple(exchanged(comm, new[:, 0], *(array[new[:, 1]] for array in arrays))[1:]))
    return tuple(np.concatenate(parts) for parts in zip(*every, strict=True))


def _runs(
    known: NDArray[np.integer[Any]], asked: NDArray[np.integer[Any]]
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return all pairs (row of `asked`, place in the ascending `known`) of equal values."""
    begin, end = (np.searchsorted(known, asked, side=side) for side in ("left", "right"))  # type: ignore[call-overload]
    counts = end - begin
    row = np.repeat(np.arange(asked.size), counts)
    return row, np.arange(row.size) + np.repeat(begin - np.cumsum(counts) + counts, counts)


def _deviations(
    levels: int,
    names: NDArray[np.int64],
    corners: Array,
    normal: Array,
    values: Array | None = None,
) -> tuple[Array, Array, Array]:
    """Return c, its uncertainty and its change, given all facets on which they depend."""
    vertices, place = np.unique(names, return_inverse=True)
    place = place.reshape(names.shape)
    points = np.zeros((vertices.size, normal.shape[1]))
    points[place] = corners
    own = np.zeros_like(points)
    np.add.at(own, place, _weights(corners)[:, :, None] * normal[:, None, :])
    own /= np.linalg.norm(own, axis=1)[:, None]
    # No normal at edges and corners of the body.
    known = np.ones(vertices.size, dtype=bool)
    alike = np.einsum("fcd,fd->fc", own[place], normal) > ALIKE_NORMALS
    np.logical_and.at(known, place, alike)
    known[_at_edges(place, normal)] = False
    heights = None
    if values is not None:
        heights = np.zeros(vertices.size)
        heights[place] = np.where(np.isfinite(values), values, 0.0)
        np.logical_and.at(known, place, np.isfinite(values))
    pairs, near = _around(place, vertices.size)
    alike = np.einsum("pd,pd->p", own[pairs[0]], own[pairs[1]]) > ALIKE_NORMALS
    alike &= known[pairs[0]] & (known[pairs[1]] | (values is None))
    pairs, near = pairs[:, alike], near[alike]
    curvature = _curvatures(points, own, pairs, np.where(near, 1.0, FAR), heights)
    pairs = pairs[:, near & known[pairs[1]]]
    edges = facet_with(points.shape[1] - 1, names.shape[1]).edges
    found, uncertain, change = np.zeros((3, len(names), len(edges)))
    for k, (i, j) in enumerate(edges):
        others = [c for c in range(names.shape[1]) if c not in (i, j)]
        around = place[:, [i, j, *others]]
        edge = points[around[:, 1]] - points[around[:, 0]]
        value = np.where(known[around], _sagitta(edge[:, None], curvature[around]), 0.0)
        if levels == 0:
            flat, uncertain[:, k], change[:, k] = _between(
                points, curvature, pairs, around, known, edge, value
            )
            if values is not None:
                found[:, k] = flat
                continue
            # From the parabola's sagitta to that of the arc of the same curvature.
            turn = np.minimum(np.abs(flat) / np.linalg.norm(edge, axis=1), 1.0)
            found[:, k] = 2 * flat / (1 + np.sqrt(1 - turn**2))
        else:
            # The polygon turns at the ends of the first edges alone.
            larger = np.argmax(np.abs(value), axis=1)[:, None]
            found[:, k] = 2.0**levels * np.take_along_axis(value, larger, axis=1)[:, 0]
    return found, uncertain, change


def _at_edges(place: Numbers, normal: Array) -> Numbers:
    """Return the vertices of edges of the body, at which neighbouring facets turn."""
    d = normal.shape[1]
    ends = np.array(facet_with(d - 1, place.shape[1]).topology[d - 2])
    edges, of = np.unique(np.sort(place[:, ends].reshape(-1, d - 1)), axis=0, return_inverse=True)
    mean, of = np.zeros((len(edges), d)), of.reshape(-1, len(ends))
    np.add.at(mean, of, normal[:, None])
    size = np.linalg.norm(mean, axis=1)[of]
    turned = np.einsum("fed,fd->fe", mean[of], normal) <= SMOOTH * size
    return np.unique(edges[of[turned]])


def _weights(corners: Array) -> Array:
    """Return Max's weights of facets in the normals at their corners, shape (f, c)."""
    edges = facet_with(corners.shape[2] - 1, corners.shape[1]).edges
    around = [[a + b - c for a, b in edges if c in (a, b)] for c in range(corners.shape[1])]
    # (f, c, d, d - 1): the edges from each corner.
    sides = [np.swapaxes(corners[:, ends] - corners[:, [c]], 1, 2) for c, ends in enumerate(around)]
    every = np.stack(sides, axis=1)
    lengths = np.linalg.norm(every, axis=2).prod(axis=2)
    return np.asarray(np.linalg.norm(area_vectors(every), axis=2) / lengths**2)


def _around(place: Numbers, count: int) -> tuple[Numbers, NDArray[np.bool_]]:
    """Return pairs of vertices at most two edges apart, shape (2, p), and which are neighbours."""
    # All corners of a facet are neighbours, opposite ones too.
    pairs = combinations(range(place.shape[1]), 2)
    ends = np.concatenate([place[:, pair] for pair in pairs])
    rows, columns = np.concatenate([ends, ends[:, ::-1]]).T
    beside = sparse.csr_array((np.ones(rows.size), (rows, columns)), shape=(count, count))
    both = sparse.coo_array(beside @ beside + 1e6 * beside)
    apart = both.row != both.col
    return np.stack([both.row[apart], both.col[apart]]).astype(np.intp), both.data[apart] >= 1e6


def _curvatures(
    points: Array, normal: Array, pairs: Numbers, weight: Array, values: Array | None = None
) -> Array:
    """Return curvature tensors, < 0 where convex, or second derivatives of values, (v, d, d)."""
    count, d = points.shape
    # The last vectors of an orthonormal basis that begins with the normal.
    tangent = np.linalg.svd(normal[:, None, :])[2][:, 1:]
    at, offset = pairs[0], points[pairs[1]] - points[pairs[0]]
    size = np.linalg.norm(offset, axis=1)
    longest = np.zeros(count)
    np.maximum.at(longest, at, size)
    scale = longest[at]
    along = np.einsum("pid,pd->pi", tangent[at], offset) / scale[:, None]
    z = np.einsum("pd,pd->p", normal[at], offset) / scale
    mixed = list(combinations(range(d - 1), 2))
    products = [along[:, i] * along[:, j] for i, j in mixed]
    columns = np.column_stack([along, 0.5 * along**2, *products])
    if values is not None:
        change = (values[pairs[1]] - values[pairs[0]]) / scale
        form = _form(_fits(at, count, weight, columns, change), mixed)
        form /= np.where(longest > 0, longest, 1.0)[:, None, None]
        return np.asarray(np.einsum("via,vij,vjb->vab", tangent, form, tangent))
    # z^2 beside the squares makes the fit exact on spheres; a second fit with the curvature
    # along the normal of the first makes it exact on cylinders.
    shared = columns.copy()
    shared[:, d - 1 : 2 * (d - 1)] += 0.5 * (z**2 / (d - 1))[:, None]
    form = _form(_fits(at, count, weight, shared, z), mixed)
    fit = _fits(at, count, weight, columns, z - 0.5 * _along_normal(form)[at] * z**2)
    slope = np.sqrt(1 + np.sum(fit[:, : d - 1] ** 2, axis=1))
    form = _form(fit / np.where(longest > 0, longest * slope, 1.0)[:, None], mixed)
    tensor = np.einsum("via,vij,vjb->vab", tangent, form, tangent)
    beside = normal[:, :, None] * normal[:, None, :]
    return np.asarray(tensor + _along_normal(form)[:, None, None] * beside)


def _form(fit: Array, mixed: Sequence[tuple[int, int]]) -> Array:
    """Return the matrices of second derivatives from the coefficients, (v, d - 1, d - 1)."""
    count, k = fit.shape[0], (fit.shape[1] - len(mixed)) // 2
    form = np.zeros((count, k, k))
    diagonal = np.arange(k)
    form[:, diagonal, diagonal] = fit[:, k : 2 * k]
    for number, (i, j) in enumerate(mixed, 2 * k):
        form[:, i, j] = form[:, j, i] = fit[:, number]
    return form


def _along_normal(form: Array) -> Array:
    """Return the curvature K:K/tr K along the normal of second derivatives K, shape (v,)."""
    # With it e.K e of spheres and cylinders does not depend on the error of the normal.
    trace, size = np.trace(form, axis1=1, axis2=2), np.linalg.norm(form, axis=(1, 2))
    return np.asarray(np.clip(size**2 / np.where(trace == 0, np.inf, trace), -size, size))


def _fits(at: Numbers, count: int, weight: Array, columns: Array, right: Array) -> Array:
    """Return the weighted least-squares coefficients at each vertex, (count, k)."""
    k = columns.shape[1]
    weighted = weight[:, None] * columns
    matrix, vector = np.zeros((count, k, k)), np.zeros((count, k))
    np.add.at(matrix, at, weighted[:, :, None] * columns[:, None, :])
    np.add.at(vector, at, weighted * right[:, None])
    inverse = np.linalg.pinv(matrix, rcond=1e-10, hermitian=True)
    return np.asarray(np.einsum("vij,vj->vi", inverse, vector))


def _between(
    points: Array,
    curvature: Array,
    pairs: Numbers,
    corners: Numbers,
    known: NDArray[np.bool_],
    edge: Array,
    value: Array,
) -> tuple[Array, Array, Array]:
    """Return c of one edge of each facet from `value` by each corner, as `deviations`, (f,)."""
    # Where the curvature jumps, as from a side to a fillet, corners on the near side of the jump
    # have nearly all of the weight: those beyond which the curvature does not change.
    largest = np.abs(value).max(axis=1)
    largest[largest == 0] = 1.0
    middle = points[corners[:, :2]].mean(axis=1)
    weights, jumps, totals, changes = (np.zeros_like(value) for _ in range(4))
    for k in range(corners.shape[1]):
        corner = corners[:, k]
        # The neighbours of the corner, facet by facet; those away from the edge have a share.
        of, place = _runs(pairs[0], corner)
        beyond = pairs[1][place]
        outward = points[corner] - middle
        way = np.einsum("pd,pd->p", points[beyond] - points[corner[of]], outward[of])
        share = np.maximum(way, 0.0)
        change = share * (_sagitta(edge[of], curvature[beyond]) - value[of, k])
        total, changed, further = (
            np.bincount(of, given, minlength=len(corners))
            for given in (share, np.abs(change), change)
        )
        other = value.max(axis=1) - value.min(axis=1)
        jump = np.where(total > 0, changed / np.where(total > 0, total, 1.0), other) / largest
        with np.errstate(over="ignore"):  # beside flat facets, of rounding
            weights[:, k] = known[corner] / (jump**2 + ALIKE**2) ** 4
        jumps[:, k] = jump * largest
        totals[:, k] = total
        changes[:, k] = further / np.where(total > 0, total, 1.0)
    weight = np.maximum(weights.sum(axis=1), np.finfo(float).tiny)
    found, further = (np.sum(weights * given, axis=1) / weight for given in (value, jumps))
    # The difference of a corner on one side of a jump from the mean, beyond its own change.
    spread = np.maximum(np.abs(value - found[:, None]) - jumps, 0.0)
    uncertain = 2 * np.sum(weights * spread, axis=1) / weight + further / 4
    for k, end in ((0, 1), (1, 0)):
        # With no vertex beyond it, the fit at the end of a side is that of half an edge away.
        last = (totals[:, end] == 0) & (totals[:, k] > 0) & (jumps[:, k] < ALIKE * largest)
        found -= np.where(last, 0.5 * changes[:, k], 0.0)
    away = np.maximum(np.abs(value - found[:, None]), np.where(totals > 0, jumps, 0.0))
    return found, uncertain, np.where(known[corners], away, 0.0).max(axis=1)


def _sagitta(edge: Array, curvature: Array) -> Array:
    """Return c = -e.K e/2 of edges e, (..., d), and curvature tensors K, (..., d, d)."""
    return np.asarray(-0.5 * np.einsum("...i,...ij,...j->...", edge, curvature, edge))
