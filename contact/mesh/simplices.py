"""Simplices of a mesh: quadrature rules, Lagrange polynomials, corners and volumes, in NumPy."""

from __future__ import annotations

from functools import cache

import basix
import numpy as np

from contact import _compat
from contact.mesh.domain import Domain
from contact.typing import Array

CELLS = {
    1: basix.CellType.interval,
    2: basix.CellType.triangle,
    3: basix.CellType.tetrahedron,
}


@cache
def rule(dim: int, degree: int) -> tuple[Array, Array]:
    """Return the barycentric coordinates of a quadrature rule, (q, dim + 1), and its weights."""
    points, weights = basix.make_quadrature(CELLS[dim], degree)
    return barycentric(points), np.asarray(weights)


def barycentric(points: Array) -> Array:
    """Return the barycentric coordinates of points of the reference cell, shape (n, dim + 1)."""
    return np.column_stack([1 - points.sum(axis=1), points])


def lagrange(degree: int, at: Array) -> Array:
    """Return the Lagrange polynomials of a degree at barycentric coordinates, (q, nodes)."""
    if degree == 0:
        return np.ones((len(at), 1))
    variant = basix.LagrangeVariant.gll_warped
    element = basix.create_element(basix.ElementFamily.P, CELLS[at.shape[1] - 1], degree, variant)
    return np.asarray(element.tabulate(0, at[:, 1:])[0, :, :, 0])


def corners(domain: Domain) -> Array:
    """Return the corners of the owned cells, shape (cells, d + 1, d)."""
    mesh, d = domain.mesh, domain.dim
    owned = mesh.topology.index_map(d).size_local
    return np.asarray(mesh.geometry.x[_compat.geometry_dofmap(mesh)[:owned], :d])


def inverse_jacobians(of: Array) -> tuple[Array, Array]:
    """Return dxi/dx and |det dx/dxi| of cells with given corners, in closed form."""
    edges = (of[:, 1:] - of[:, :1]).swapaxes(1, 2)
    if of.shape[2] == 2:
        (a, b), (c, d) = np.moveaxis(edges, 0, -1)
        det = a * d - b * c
        inverse = np.moveaxis(np.array([[d, -b], [-c, a]]), -1, 0) / det[:, None, None]
    else:
        one, two, three = np.moveaxis(edges, 2, 0)
        rows = [np.cross(two, three), np.cross(three, one), np.cross(one, two)]
        det = np.sum(one * rows[0], axis=1)
        inverse = np.stack(rows, axis=1) / det[:, None, None]
    return inverse, np.abs(det)


def measures(domain: Domain, of: Array, at: Array, weights: Array, size: Array) -> Array:
    """Return the weights of points in integrals over the body, (n, q): of a revolved one, of rings.

    Parameters
    ----------
    domain
        The mesh.
    of
        Corners, shape (n, k, d).
    at, weights
        Barycentric coordinates, shape (q, k), and the weights of a rule.
    size
        The size of each over that of the reference one, shape (n,).
    """
    found = size[:, None] * weights
    return found * 2 * np.pi * (of[..., 0] @ at.T) if domain.revolved else found
