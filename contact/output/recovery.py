"""Recovered fields: means of the values in the cells around each vertex, linear in between."""

from __future__ import annotations

import numpy as np
from dolfinx import la
from scipy import sparse

from contact import _compat
from contact.mesh.cells import shape_of
from contact.mesh.domain import Domain, Indices
from contact.typing import Array


def nodal_means(domain: Domain, cells: Indices, values: Array) -> Array:
    """Return the means around the corners of cells, (cells, corners, components). Collective.

    Parameters
    ----------
    domain
        The mesh.
    cells
        Owned cells; those around them that are not among them do not count.
    values
        At the corners of each of the cells, shape (cells, corners, components); or constant there,
        shape (cells, components).
    """
    corners = shape_of(domain.mesh).corners
    vertices = _compat.geometry_dofmap(domain.mesh)[cells, :corners]
    index_map = domain.mesh.geometry.index_map()
    count = index_map.size_local + index_map.num_ghosts
    at_corners = values if values.ndim == 3 else values[:, None]
    at_corners = np.broadcast_to(at_corners, (*vertices.shape, values.shape[-1]))
    with_ones = np.concatenate([at_corners, np.ones((*vertices.shape, 1))], axis=2)
    rows = np.ones(vertices.size), (vertices.ravel(), np.arange(vertices.size))
    around = sparse.csr_array(rows, shape=(count, vertices.size))
    sums = around @ with_ones.reshape(vertices.size, values.shape[-1] + 1)
    if domain.comm.size > 1:
        total = la.vector(index_map, sums.shape[1])
        total.array[:] = sums.ravel()
        total.scatter_reverse(la.InsertMode.add)
        total.scatter_forward()
        sums = total.array.reshape(sums.shape)
    found = sums[vertices]
    return np.asarray(found[..., :-1] / found[..., -1:])
