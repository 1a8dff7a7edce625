"""Refined meshes of curved bodies: new nodes of the boundary go to the curve that old ones tell.

On straight facets that are cut, a curve would remain the polygon of the first mesh: pressures
would stand at its vertices, and the estimated error would not say so.
"""

from __future__ import annotations

import numpy as np
from dolfinx import la
from dolfinx import mesh as dmesh
from mpi4py import MPI
from numpy.typing import NDArray

from contact import _compat
from contact.mesh.cells import shape_of
from contact.mesh.deviation import deviations
from contact.mesh.domain import Domain
from contact.mesh.entities import Indices, cells_at, exterior_facets
from contact.mesh.geometry import determinant, jacobians, unit_normals
from contact.mesh.owners import Owners
from contact.typing import Array

#: Distance between a node and the middle of its edge, over the length of that.
SAME = 1e-6

#: Least eigenvalue of the normals at a node, over the largest, of facets that are not alike.
APART = 0.1

#: Differences of normals on a flat part.
FLAT = 1e-9

#: Share of its size that a cell must keep: else no node is moved.
KEPT = 0.2


def follow(coarse: Domain, fine: dmesh.Mesh, facets: Indices, parents: Indices) -> None:
    """Move new nodes of curved boundaries from chords to arcs, see `deviation`. Collective.

    Parameters
    ----------
    coarse
        The mesh before, of straight simplices.
    fine
        The mesh after, whose new nodes are in the middles of edges.
    facets, parents
        Its owned facets of the boundary, and that of the mesh before in which each lies.
    """
    d, of_fine = coarse.dim, fine.geometry.index_map()
    every = exterior_facets(coarse.mesh)
    rest = np.setdiff1d(every, np.concatenate([every[:0], *coarse.parts.values()]))
    # By parts: at an edge between two there is no common normal.
    sums = la.vector(of_fine, d * d + d)
    values = sums.array.reshape(-1, d + 1, d)
    for part in (*coarse.parts.values(), rest):
        inside = np.isin(parents, part)
        nodes, normal, height = _heights(coarse, part, fine, facets[inside], parents[inside])
        np.add.at(values[:, 0], nodes, height[:, None] * normal)
        np.add.at(values[:, 1:], nodes, normal[:, :, None] * normal[:, None, :])
    sums.scatter_reverse(la.InsertMode.add)
    sums.scatter_forward()
    # The shortest move that has the height of each facet, of alike facets their mean.
    sizes, vectors = np.linalg.eigh(values[:, 1:])
    kept = sizes > APART * sizes[:, -1:]
    along = np.einsum("nik,ni->nk", vectors, values[:, 0]) / np.where(kept, sizes, 1.0)
    shift = np.einsum("nik,nk->ni", vectors, np.where(kept, along, 0.0))

    shape, comm = shape_of(fine), coarse.comm
    x, dofmap = fine.geometry.x, _compat.geometry_dofmap(fine)
    before = determinant(jacobians(shape, x[dofmap][:, :, :d], shape.middle))
    x[:, :d] += shift
    after = determinant(jacobians(shape, x[dofmap][:, :, :d], shape.middle))
    if comm.allreduce(bool(np.any(after / before < KEPT))):
        x[:, :d] -= shift


def _heights(
    coarse: Domain, part: Indices, fine: dmesh.Mesh, facets: Indices, parents: Indices
) -> tuple[NDArray[np.int32], Array, Array]:
    """Return new nodes of a part, each as often as it has facets, the normals and heights there.

    Collective.
    """
    mesh = coarse.mesh
    part, facet = np.sort(part), shape_of(mesh).facet
    edges = np.array(facet.edges)
    nodes, points, normal = _facets(mesh, part)
    spread = np.stack([normal.max(axis=0, initial=-1.0), -normal.min(axis=0, initial=1.0)])
    coarse.comm.Allreduce(MPI.IN_PLACE, spread, op=MPI.MAX)
    if spread.sum(axis=0).max() < FLAT:
        return nodes[:0, 0], normal[:0], np.zeros(0)
    index_map = mesh.geometry.index_map()
    names = index_map.local_to_global(nodes.ravel()).reshape(nodes.shape)
    height = deviations(names, points, normal, Owners.of(index_map, coarse.comm))[0] / 4
    ends = points[:, edges]
    middle, length = ends.mean(axis=2), np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    row = np.searchsorted(part, parents)
    new, places, _ = _facets(fine, facets)
    away = np.linalg.norm(places[:, :, None] - middle[row][:, None], axis=3)
    of, corner, edge = np.nonzero(away <= SAME * length[row][:, None])
    return new[of, corner], normal[row[of]], height[row[of], edge]


def _facets(mesh: dmesh.Mesh, facets: Indices) -> tuple[NDArray[np.int32], Array, Array]:
    """Return the nodes of straight facets, (f, c), their places, (f, c, d), and their normals."""
    shape, d = shape_of(mesh), mesh.topology.dim
    cells, place = cells_at(mesh, facets)
    own = _compat.geometry_dofmap(mesh)[cells]
    nodes = np.take_along_axis(own, shape.facet_nodes(1)[place], axis=1)
    points = mesh.geometry.x[nodes][:, :, :d]
    inside = mesh.geometry.x[own][:, :, :d].mean(axis=1)
    return nodes, points, unit_normals(shape.facet, points, inside)
