"""Meshes of points and cells that are given as arrays, and the midpoints that name their parts."""

from typing import Any

import basix.ufl
import numpy as np
import ufl
from dolfinx import mesh as dmesh
from mpi4py import MPI

from contact.typing import Array


def assembled(
    comm: MPI.Intracomm,
    points: Array,
    cells: Array,
    cell: str = "triangle",
    order: int = 1,
    **options: Any,
) -> dmesh.Mesh:
    """Return the mesh of the points and cells of rank 0, in the order of dolfinx. Collective."""
    element = basix.ufl.element("Lagrange", cell, order, shape=(points.shape[1],), dtype=np.float64)
    given = None if comm.rank == 0 else 0
    cells, points = cells[:given].astype(np.int64), points[:given]
    return dmesh.create_mesh(comm, cells=cells, x=points, e=ufl.Mesh(element), **options)


def midpoints(mesh: dmesh.Mesh) -> tuple[Array, Array, Array, Array]:
    """Return the boundary facets, their midpoints, those of their cells, and of all own cells."""
    d = mesh.topology.dim
    mesh.topology.create_connectivity(d - 1, d)
    facets = dmesh.exterior_facet_indices(mesh.topology)
    to_cell = mesh.topology.connectivity(d - 1, d)
    every = np.arange(mesh.topology.index_map(d).size_local, dtype=np.int32)
    behind = to_cell.array[to_cell.offsets[facets]]
    middles = (dmesh.compute_midpoints(mesh, d, cells)[:, :d] for cells in (behind, every))
    return facets, dmesh.compute_midpoints(mesh, d - 1, facets)[:, :d], *middles
