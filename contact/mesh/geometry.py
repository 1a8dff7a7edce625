"""Geometry of cells and facets: Jacobians, normals, quadrature weights, volumes and areas."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact import _compat
from contact.mesh.cells import Shape, barycentric, rule, shape_of
from contact.mesh.domain import Domain
from contact.mesh.entities import Indices, cells_at
from contact.tolerances import ROUNDING
from contact.typing import Array

#: Degree of the rule for integrands that are no polynomials.
FINE = 20


def geometry_nodes(domain: Domain, cells: Indices | None = None) -> Array:
    """Return the nodes of the owned cells, or of some, corners first, (cells, nodes, d)."""
    mesh, d = domain.mesh, domain.dim
    of = _compat.geometry_dofmap(mesh)
    chosen = of[: mesh.topology.index_map(d).size_local] if cells is None else of[cells]
    return np.asarray(mesh.geometry.x[chosen, :d])


def jacobians(shape: Shape, of: Array, at: Array) -> Array:
    """Return dx/dxi, (n, q, d, dim), of nodes (n, nodes, d) at points; straight simplices q = 1."""
    degree = shape.degree_of(of.shape[1])
    if shape.simplex and degree == 1:
        return np.swapaxes(of[:, 1:] - of[:, :1], 1, 2)[:, None]
    return np.einsum("qkr,nkd->nqdr", shape.gradients(degree, at), of)


def outward(shape: Shape, points: Array, inside: Array, at: Array) -> Array:
    """Return outward area vectors at points, (f, q, d), of facets (f, nodes, d) before `inside`."""
    normal = area_vectors(jacobians(shape, points, at))
    away = points.mean(axis=1) - inside
    return np.asarray(normal * np.sign(np.einsum("fqd,fd->fq", normal, away))[..., None])


def unit_normals(shape: Shape, points: Array, inside: Array) -> Array:
    """Return unit normals in the middle of facets, shape (f, d); as `outward`."""
    normal = outward(shape, points, inside, shape.middle)[:, 0]
    return np.asarray(normal / np.linalg.norm(normal, axis=1)[:, None])


def volume_factors(shape: Shape, of: Array, at: Array) -> Array:
    """Return |det J| of cells, sqrt(det J^T J) of facets at points, (n, q); as `jacobians`."""
    jacobian = jacobians(shape, of, at)
    if jacobian.shape[2] == jacobian.shape[3]:
        return np.abs(determinant(jacobian))
    return np.asarray(np.linalg.norm(area_vectors(jacobian), axis=-1))


def area_vectors(jacobian: Array) -> Array:
    """Return normals of length sqrt(det J^T J), (..., d), of J of facets, (..., d, d - 1)."""
    columns = np.moveaxis(jacobian, -1, 0)
    if len(columns) == 2:
        return np.asarray(np.cross(*columns))
    return np.asarray(columns[0][..., ::-1] * [-1.0, 1.0])


def facet_normals(
    domain: Domain, part: str, degree: int
) -> tuple[NDArray[np.integer[Any]], NDArray[np.integer[Any]], Array]:
    """Return the cells of the facets of a part, their numbers there, area vectors (f, q, d)."""
    return normals_at(domain, domain.facets(part), degree)


def normals_at(
    domain: Domain, facets: Indices, degree: int
) -> tuple[NDArray[np.integer[Any]], NDArray[np.integer[Any]], Array]:
    """Return the same of facets of this rank; of those inside of the body out of one cell."""
    mesh, d, shape = domain.mesh, domain.dim, shape_of(domain.mesh)
    cells, place = cells_at(mesh, facets)
    x = mesh.geometry.x[_compat.geometry_dofmap(mesh)[cells]][:, :, :d]
    own = shape.facet_nodes(domain.order)[place]
    points = np.take_along_axis(x, own[:, :, None], axis=1)
    return cells, place, outward(shape.facet, points, x.mean(axis=1), shape.facet.nodes(degree))


def determinant(matrix: Array) -> Array:
    """Return the determinants of matrices, shape (..., d, d), in closed form."""
    columns = np.moveaxis(matrix, -1, 0)
    if len(columns) == 1:
        return np.asarray(matrix[..., 0, 0])
    if len(columns) == 2:
        (a, c), (b, d) = (np.moveaxis(column, -1, 0) for column in columns)
        return np.asarray(a * d - b * c)
    return np.asarray(np.sum(columns[0] * np.cross(columns[1], columns[2]), axis=-1))


def inverse(matrix: Array) -> Array:
    """Return the inverses of matrices, shape (..., d, d), in closed form."""
    det = determinant(matrix)[..., None, None]
    columns = np.moveaxis(matrix, -1, 0)
    if len(columns) == 1:
        return np.asarray(1 / matrix)
    if len(columns) == 2:
        (a, c), (b, d) = (np.moveaxis(column, -1, 0) for column in columns)
        return np.asarray(np.moveaxis(np.array([[d, -b], [-c, a]]), (0, 1), (-2, -1)) / det)
    one, two, three = columns
    rows = [np.cross(two, three), np.cross(three, one), np.cross(one, two)]
    return np.asarray(np.stack(rows, axis=-2) / det)


def pulled_back(shape: Shape, of: Array, points: Array) -> Array:
    """Return points, (n, dim), in reference coordinates of cells, (n, nodes, dim), by Newton."""
    degree, at = shape.degree_of(of.shape[1]), np.repeat(shape.middle, len(points), axis=0)
    for _ in range(20):
        slope = np.einsum("pkr,pkd->pdr", shape.gradients(degree, at), of)
        left = points - np.einsum("pk,pkd->pd", shape.lagrange(degree, at), of)
        step = np.einsum("pij,pj->pi", inverse(slope), left)
        # Nothing that is asked for lies farther from a cell.
        at = np.clip(at + step, -1.0, 2.0)
        if np.abs(step).max(initial=0.0) <= ROUNDING:
            break
    return at


def nearest_on_simplices(corners: Array, points: Array) -> Array:
    """Return barycentric coordinates, (n, k), of the points of simplices nearest to others."""
    edges = corners[:, 1:] - corners[:, :1]
    along = np.einsum("nkd,nd->nk", edges, points - corners[:, 0])
    own = barycentric(np.einsum("nkl,nl->nk", inverse(edges @ edges.swapaxes(1, 2)), along))
    if own.shape[1] == 2:
        return np.clip(own, 0.0, 1.0)
    beyond = np.flatnonzero((own < 0).any(axis=1))
    least = np.full(beyond.size, np.inf)
    for side in ([0, 1], [1, 2], [2, 0]):
        ends = corners[beyond][:, side]
        share = nearest_on_simplices(ends, points[beyond])
        far = np.linalg.norm(points[beyond] - np.einsum("nk,nkd->nd", share, ends), axis=1)
        nearer = np.flatnonzero(far < least)
        least[nearer], own[beyond[nearer]] = far[nearer], 0.0
        own[beyond[nearer, None], side] = share[nearer]
    return own


def integration_weights(
    revolved: bool, shape: Shape, of: Array, at: Array, weights: Array
) -> Array:
    """Return w_q |J| at points of a rule, (n, q); of a body of revolution 2 pi r w_q |J|."""
    found = volume_factors(shape, of, at) * weights
    if not revolved:
        return found
    return found * 2 * np.pi * (of[..., 0] @ shape.lagrange(shape.degree_of(of.shape[1]), at).T)


def volume(domain: Domain, region: str | None = None) -> float:
    """Return the volume of the body, or of a region of it. Collective."""
    of_cells = volumes(domain)
    own = of_cells if region is None else of_cells[domain.cells(region)]
    return float(domain.comm.allreduce(float(own.sum()), op=MPI.SUM))


def area(domain: Domain, part: str) -> float:
    """Return the area of a part of the boundary; in the plane its length. Collective."""
    own = areas(domain, domain.facets(part))
    return float(domain.comm.allreduce(float(own.sum()), op=MPI.SUM))


def areas(domain: Domain, facets: NDArray[np.int32]) -> Array:
    """Return the areas of boundary facets of this rank, of revolution of rings, shape (f,)."""
    cells, place = cells_at(domain.mesh, facets)
    shape = shape_of(domain.mesh)
    ends = shape.facet_nodes(domain.order)[place]
    nodes = np.take_along_axis(geometry_nodes(domain, cells), ends[:, :, None], axis=1)
    straight = shape.facet.simplex and domain.order == 1
    points, weights = rule(shape.facet, 1 if straight else FINE)
    return integration_weights(domain.revolved, shape.facet, nodes, points, weights).sum(axis=1)


def volumes(domain: Domain) -> Array:
    """Return the volumes of the owned cells, in a body of revolution of rings, shape (cells,)."""
    shape = shape_of(domain.mesh)
    points, weights = rule(shape, 1 if shape.simplex and domain.order == 1 else 3 * domain.order)
    nodes = geometry_nodes(domain)
    return integration_weights(domain.revolved, shape, nodes, points, weights).sum(axis=1)
