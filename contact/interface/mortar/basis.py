"""Lagrange basis functions on straight facets, and the basis that the multipliers are dual to.

Points are given by barycentric coordinates, shape (p, c): c = 2 corners of an edge, 3 of a
triangle. The nodes are the corners, then for degree 2 the middle of the edge, or of the triangle's
edges, the first of them opposite to the first corner.
"""

from __future__ import annotations

import math

import numpy as np

from contact.typing import Array

#: Share of each mid-edge function that goes to the two vertices of a quadratic triangle.
ALPHA = 1 / 5

#: Symmetric rules on a triangle, by degree: barycentric orbits (a, a, 1 - 2 a) and weights of a
#: point (Dunavant, Int. J. Numer. Methods Engrg. 21 (1985)).
ORBITS = {
    2: [(1 / 6, 1 / 3)],
    4: [
        (0.445948490915964886, 0.223381589678011466),
        (0.091576213509770743, 0.109951743655321868),
    ],
}


def basis(barycentric: Array, degree: int) -> Array:
    """Return the basis functions at points, shape (p, nodes)."""
    if degree == 1:
        return barycentric
    corners = barycentric * (2 * barycentric - 1)
    if barycentric.shape[1] == 2:
        return np.column_stack([corners, 4 * barycentric.prod(axis=1)])
    others = [[1, 2], [2, 0], [0, 1]]
    return np.column_stack([corners, *(4 * barycentric[:, pair].prod(axis=1) for pair in others)])


def positive_change(corners: int, degree: int) -> Array:
    """Return A with the functions N~ = A N, all of whose integrals are positive.

    The vertex functions of a quadratic triangle have none. There each takes the share alpha of
    its two mid-edge neighbours (Popp, Wohlmuth, Gee and Wall, SIAM J. Sci. Comput. 34 (2012)
    B421); else A is the identity.
    """
    if (corners, degree) != (3, 2):
        return np.eye(degree + 1 if corners == 2 else 3)
    change = np.diag([1.0] * 3 + [1 - 2 * ALPHA] * 3)
    change[:3, 3:] = ALPHA * (1 - np.eye(3))
    return change


def rule(corners: int, degree: int) -> tuple[Array, Array]:
    """Return points (q, corners) and weights (q,) of sum 1, exact for polynomials of a degree.

    Parameters
    ----------
    corners
        2 for an edge, 3 for a triangle.
    degree
        2 or 4.
    """
    if corners == 2:
        points, weights = np.polynomial.legendre.leggauss(degree // 2 + 1)
        return np.column_stack([1 - points, 1 + points]) / 2, weights / 2
    # A point and those that a turn of the triangle makes of it.
    places = [a + (1 - 3 * a) * np.eye(3) for a, _ in ORBITS[degree]]
    return np.concatenate(places), np.repeat([weight for _, weight in ORBITS[degree]], 3)


def size_of(corners: Array) -> Array:
    """Return the lengths or areas of facets given by their corners, shape (f, d, d) -> (f,)."""
    edges = corners[:, 1:] - corners[:, :1]
    gram = np.einsum("fid,fjd->fij", edges, edges)
    return np.asarray(np.sqrt(np.linalg.det(gram)) / math.factorial(edges.shape[1]))
