"""How far the surface that straight facets stand for bulges out of them.

Facets are chords of what is curved. With unit normals n_i of the surface at the corners x_i it is,
to second order, sum_(i < j) lambda_i lambda_j c_ij above a facet, c_ij = (n_j - n_i).(x_j - x_i)/2,
in barycentric coordinates lambda.

References
----------
Max, J. Graphics Tools 4 (1999) 1 (weights of the facets about a corner, exact on spheres).
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.typing import Array

#: Least cosine between the normals of a surface and of its facets; corners of bodies have less.
SMOOTH = 0.9


def pairs_of(corners: int) -> list[tuple[int, int]]:
    """Return the edges of a facet, as pairs of its corners."""
    return list(combinations(range(corners), 2))


def bulges(names: NDArray[np.int64], corners: Array, normal: Array, comm: MPI.Intracomm) -> Array:
    """Return c of the edges of each facet, positive outwards, shape (f, edges). Collective.

    Parameters
    ----------
    names
        Global numbers of the corners, shape (f, d).
    corners, normal
        Their coordinates, shape (f, d, d), and the facets' normals, shape (f, d).
    comm
        Communicator; the facets are those of this rank.
    """
    edges = pairs_of(names.shape[1])
    every = np.concatenate(comm.allgather(names))
    vertices, place = np.unique(every, return_inverse=True)
    place = place.reshape(every.shape)
    normals = np.concatenate(comm.allgather(normal))
    weights = np.concatenate(comm.allgather(_weights(corners)))
    own = np.zeros((vertices.size, normal.shape[1]))
    np.add.at(own, place, weights[:, :, None] * normals[:, None, :])
    own /= np.linalg.norm(own, axis=1)[:, None]
    # Inside the part, and smooth there: normals at its rim, or at an edge of the body, are none.
    flat = np.einsum("fcd,fd->fc", own[place], normals) > SMOOTH
    known = _inside(place, vertices.size)
    np.logical_and.at(known, place, flat)
    here = np.searchsorted(vertices, names)
    total, count = np.zeros((len(names), len(edges))), np.zeros((len(names), len(edges)))
    for k, (i, j) in enumerate(edges):
        edge = corners[:, j] - corners[:, i]
        for end, sign in ((i, -1.0), (j, 1.0)):
            # n_j - n and n - n_i of a facet with the normal n between the two.
            turned = sign * (own[here[:, end]] - normal)
            sure = known[here[:, end]]
            total[:, k] += np.where(sure, np.einsum("fd,fd->f", turned, edge), 0.0)
            count[:, k] += sure
    found = total / np.maximum(count, 1)
    return np.where(count > 0, found, _likewise(found, count > 0, corners, edges))


def _weights(corners: Array) -> Array:
    """Return the weights of facets at their corners, shape (f, d)."""
    d = corners.shape[1]
    around = [[k for k in range(d) if k != c] for c in range(d)]
    sides = [corners[:, others] - corners[:, [c]] for c, others in enumerate(around)]
    lengths = np.stack([np.linalg.norm(side, axis=2).prod(axis=1) for side in sides], axis=1)
    if d == 2:
        return np.asarray(1 / lengths)
    area = np.linalg.norm(np.cross(sides[0][:, 0], sides[0][:, 1]), axis=1)
    return np.asarray(area[:, None] / lengths**2)


def _inside(place: NDArray[np.intp], count: int) -> NDArray[np.bool_]:
    """Return which vertices facets close around: there end as many edges as facets."""
    facets = np.bincount(place.ravel(), minlength=count)
    if place.shape[1] == 2:
        return facets == 2
    edges = np.concatenate([place[:, [i, j]] for i, j in pairs_of(3)])
    ends = np.unique(np.sort(edges, axis=1), axis=0)
    return np.bincount(ends.ravel(), minlength=count) == facets


def _likewise(
    found: Array, known: NDArray[np.bool_], corners: Array, edges: list[tuple[int, int]]
) -> Array:
    """Return c of edges of which nothing is known: the curvature of the facet's others."""
    squares = [np.sum((corners[:, j] - corners[:, i]) ** 2, axis=1) for i, j in edges]
    lengths = np.stack(squares, axis=1)
    curvature = np.where(known, found / lengths, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    return np.asarray(curvature[:, None] * lengths)
