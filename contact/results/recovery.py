"""Recovered fields: means of the values in the cells around each vertex, linear in between.

Across facets inside of the body at which something acts, stresses jump: there the cells around a
vertex fall into groups that these facets separate, as the materials do.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from dolfinx import la
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from contact import _compat
from contact.body.elements import in_chunks
from contact.mesh.cells import shape_of
from contact.mesh.domain import Domain, Indices
from contact.mesh.entities import cell_facets
from contact.mesh.owners import Owners
from contact.ranks import exchanged
from contact.typing import Array


def nodal_means(
    domain: Domain, cells: Indices, values: Array, apart: Sequence[str] = ()
) -> tuple[Array, NDArray[np.integer]]:
    """Return means around vertices, (n, components), and which are those of corners. Collective.

    Parameters
    ----------
    domain
        The mesh.
    cells
        Owned cells; those around them that are not among them do not count.
    values
        At the corners of each of the cells, shape (cells, corners, components); or constant there,
        shape (cells, components).
    apart
        Names of parts inside of the body across which there are no means.

    Returns
    -------
    The means, and their places at the corners of the cells, shape (cells, corners).
    """
    corners = shape_of(domain.mesh).corners
    dofmap, index_map = _compat.geometry_dofmap(domain.mesh), domain.mesh.geometry.index_map()
    sums = np.zeros((index_map.size_local + index_map.num_ghosts, values.shape[-1] + 1))
    for part in in_chunks(np.arange(cells.size)):
        vertices = dofmap[cells[part], :corners]
        here = values[part].reshape(-1, values.shape[-1])
        # The constants of a cell go to all of its corners.
        column = np.repeat(np.arange(len(here)), vertices.size // max(len(here), 1))
        rows = np.ones(vertices.size), (vertices.ravel(), column)
        around = sparse.csr_array(rows, shape=(len(sums), len(here)))
        sums[:, :-1] += around @ here
        sums[:, -1] += around.sum(axis=1)
    if domain.comm.size > 1:
        total = la.vector(index_map, sums.shape[1])
        total.array[:] = sums.ravel()
        total.scatter_reverse(la.InsertMode.add)
        total.scatter_forward()
        sums = total.array.reshape(sums.shape)
    with np.errstate(invalid="ignore"):
        means = np.asarray(sums[:, :-1] / sums[:, -1:])
    places = dofmap[cells, :corners]
    return _separated(domain, cells, values, apart, means, places) if apart else (means, places)


def _separated(
    domain: Domain,
    cells: Indices,
    values: Array,
    apart: Sequence[str],
    means: Array,
    places: NDArray[np.integer],
) -> tuple[Array, NDArray[np.integer]]:
    """Return means and places with those of groups at the vertices of parts. Collective."""
    # Corners of two cells at a vertex are of one group where a facet joins the cells that has the
    # vertex and is in no part. The rank that owns a vertex is sent all corners there, and returns
    # the mean of its group to each.
    mesh, comm, d = domain.mesh, domain.comm, domain.dim
    shape = shape_of(mesh)
    mesh.topology.create_connectivity(d, d - 1)
    of_facets, of_nodes = mesh.topology.index_map(d - 1), mesh.geometry.index_map()
    facet_owners, owners = Owners.of(of_facets, comm), Owners.of(of_nodes, comm)
    own = np.unique(np.concatenate([domain.facets_anywhere(name) for name in apart]))
    local = cell_facets(mesh)[cells]
    facets = of_facets.local_to_global(local.ravel()).reshape(local.shape)
    nodes = of_nodes.local_to_global(places.ravel()).reshape(places.shape)
    within = facet_owners.requested(of_facets.local_to_global(own.astype(np.int32)))
    cut = np.isin(facets, facet_owners.among(within, facets.ravel()))
    named = owners.requested(nodes[:, shape.facet_corners][cut].ravel())
    chosen = np.isin(nodes, owners.among(named, nodes.ravel()))
    joins = np.zeros((len(shape.facet_corners), shape.corners), dtype=bool)
    np.put_along_axis(joins, shape.facet_corners, True, axis=1)
    cell, facet, corner = np.nonzero(chosen[:, None] & joins & ~cut[:, :, None])
    before = comm.exscan(int(chosen.sum())) or 0
    number = before + np.cumsum(chosen).reshape(chosen.shape) - 1
    ranks = owners.ranks(nodes[chosen])
    around = values[chosen] if values.ndim == 3 else values[np.nonzero(chosen)[0]]
    by, numbers, around = exchanged(comm, ranks, number[chosen], around)
    # A cell at a vertex is joined to those of its facets that are in no part.
    at = np.column_stack([number[cell, corner], facets[cell, facet], nodes[cell, corner]])
    joined = exchanged(comm, owners.ranks(at[:, 2]), at)[1]
    _, meets = np.unique(joined[:, 1:], axis=0, return_inverse=True)
    size = len(numbers) + len(joined)
    links = np.ones(len(joined)), (np.searchsorted(numbers, joined[:, 0]), len(numbers) + meets)
    groups = connected_components(sparse.csr_array(links, shape=(size, size)), directed=False)[1]
    _, group = np.unique(groups[: len(numbers)], return_inverse=True)
    entries = np.ones(group.size), (group, np.arange(group.size))
    onto = sparse.csr_array(entries, shape=(group.max(initial=-1) + 1, group.size))
    sums = onto @ np.column_stack([around, np.ones(group.size)])
    found = exchanged(comm, by, (sums[:, :-1] / sums[:, -1:])[group])[1]
    # They come back in the order in which the corners went.
    order = np.empty(ranks.size, dtype=np.intp)
    order[np.argsort(ranks, kind="stable")] = np.arange(ranks.size)
    places = places.copy()
    places[chosen] = len(means) + order
    return np.concatenate([means, found]), places
