"""Recovered fields: means of the values in the cells around each vertex, linear in between."""

from __future__ import annotations

import numpy as np
from dolfinx import la
from scipy import sparse

from contact import _compat
from contact.body.pointwise import in_chunks
from contact.mesh.cells import shape_of
from contact.mesh.domain import Domain, Indices
from contact.typing import Array


def nodal_means(domain: Domain, cells: Indices, values: Array) -> Array:
    """Return the means around local vertices, shape (vertices, components). Collective.

    They are NaN at vertices of none of the cells.

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
    dofmap, index_map = _compat.geometry_dofmap(domain.mesh), domain.mesh.geometry.index_map()
    sums = np.zeros((index_map.size_local + index_map.num_ghosts, values.shape[-1] + 1))
    for part in in_chunks(np.arange(cells.size)):
        vertices = dofmap[cells[part], :corners]
        at_corners = values[part] if values.ndim == 3 else values[part, None]
        at_corners = np.broadcast_to(at_corners, (*vertices.shape, values.shape[-1]))
        with_ones = np.concatenate([at_corners, np.ones((*vertices.shape, 1))], axis=2)
        rows = np.ones(vertices.size), (vertices.ravel(), np.arange(vertices.size))
        around = sparse.csr_array(rows, shape=(len(sums), vertices.size))
        sums += around @ with_ones.reshape(vertices.size, values.shape[-1] + 1)
    if domain.comm.size > 1:
        total = la.vector(index_map, sums.shape[1])
        total.array[:] = sums.ravel()
        total.scatter_reverse(la.InsertMode.add)
        total.scatter_forward()
        sums = total.array.reshape(sums.shape)
    with np.errstate(invalid="ignore"):
        return np.asarray(sums[:, :-1] / sums[:, -1:])
