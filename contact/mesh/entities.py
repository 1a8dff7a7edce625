"""Facets and their cells, overlapping groups of indices, connected components, extents."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from dolfinx import fem, la
from dolfinx import mesh as dmesh
from dolfinx.common import IndexMap
from mpi4py import MPI
from scipy import sparse
from scipy.sparse import csgraph

from contact._compat import lasting
from contact.mesh.cells import shape_of
from contact.ranks import summed

Indices: TypeAlias = npt.NDArray[np.int32]


def combinations(
    count: int, groups: Iterable[npt.NDArray[np.integer[Any]]]
) -> tuple[Indices, tuple[tuple[int, ...], ...]]:
    """Return one label for each index below `count`, and the groups of each label by positions."""
    numbers = np.zeros(count, dtype=np.int32)
    combined: list[tuple[int, ...]] = [()]
    for position, group in enumerate(groups):
        members = np.unique(group)
        # The indices of a number so far divide into those within the group and those without.
        met, within = np.unique(numbers[members], return_inverse=True)
        numbers[members] = len(combined) + within
        combined += [(*combined[old], position) for old in met]
    return numbers, tuple(combined)


def labels_of(names: Iterable[str], combined: Sequence[tuple[int, ...]]) -> dict[str, list[int]]:
    """Return the labels of `combinations` that each of the groups, by name, consists of."""
    return {
        name: [label for label, groups in enumerate(combined) if i in groups]
        for i, name in enumerate(names)
    }


def places_of(
    asked: npt.NDArray[np.integer[Any]], numbers: npt.NDArray[np.integer[Any]]
) -> npt.NDArray[np.intp]:
    """Return the places of numbers of any shape among different others, (n,); -1 for none."""
    order = np.argsort(numbers)
    at = np.append(order, -1)[np.searchsorted(numbers, asked, sorter=order)]
    return np.where(np.append(numbers, 0)[at] == asked, at, -1)


def owned_among(
    index_map: IndexMap, numbers: npt.NDArray[np.int64]
) -> tuple[npt.NDArray[np.intp], Indices]:
    """Return the places of owned ones among global numbers, and their local numbers."""
    begin, end = index_map.local_range
    here = np.flatnonzero((numbers >= begin) & (numbers < end))
    return here, (numbers[here] - begin).astype(np.int32)


def with_ghosts(index_map: IndexMap, rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return rows at local entities, (n, ...), those at ghosts from their owners. Collective."""
    vector = la.vector(index_map, int(np.prod(rows.shape[1:])), rows.dtype)
    vector.array[:] = rows.ravel()
    vector.scatter_forward()
    return vector.array.reshape(rows.shape)


def accumulated(index_map: IndexMap, rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return the sums over all ranks of rows at local entities, (n, ...). Collective."""
    vector = la.vector(index_map, int(np.prod(rows.shape[1:])), rows.dtype)
    vector.array[:] = rows.ravel()
    vector.scatter_reverse(la.InsertMode.add)
    vector.scatter_forward()
    return vector.array.reshape(rows.shape)


def sums_at(
    index_map: IndexMap, at: npt.NDArray[np.integer[Any]], values: npt.ArrayLike
) -> npt.NDArray[np.float64]:
    """Return the sums over all ranks of values at entities of any shape, (n, ...). Collective."""
    tail = np.shape(values)[np.ndim(at) :]
    rows = np.zeros((index_map.size_local + index_map.num_ghosts, *tail))
    np.add.at(rows, at, values)
    return accumulated(index_map, rows)


def cell_facets(mesh: dmesh.Mesh) -> Indices:
    """Return the facets of each local cell, shape (cells, facets); their connectivity is there."""
    dim = mesh.topology.dim
    array = mesh.topology.connectivity(dim, dim - 1).array
    return np.asarray(array.reshape(-1, len(shape_of(mesh).facet_corners)))


def cells_at(mesh: dmesh.Mesh, facets: Indices) -> tuple[Indices, npt.NDArray[np.intp]]:
    """Return the cell behind each facet of the boundary, and which of its facets that is."""
    topology, dim = mesh.topology, mesh.topology.dim
    topology.create_connectivity(dim - 1, dim)
    topology.create_connectivity(dim, dim - 1)
    to_cell = topology.connectivity(dim - 1, dim)
    cells = to_cell.array[to_cell.offsets[facets]]
    place = np.argmax(cell_facets(mesh)[cells] == facets[:, None], axis=1)
    return cells, place


def elongation(mesh: dmesh.Mesh, facets: Indices) -> float:
    """Return the largest diameter of cells over twice their facets' shortest edge. Collective."""
    behind, _ = cells_at(mesh, facets)
    dim, found = mesh.topology.dim, 1.0
    if facets.size:
        places = dmesh.entities_to_geometry(mesh, dim - 1, facets)
        corners = mesh.geometry.x[places[:, shape_of(mesh).facet.around]]
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        found = float(np.max(mesh.h(dim, behind) / (2 * edges.min(axis=1)), initial=1.0))
    return lasting(mesh.comm).allreduce(found, op=MPI.MAX)


def extent(mesh: dmesh.Mesh) -> float:
    """Largest extent of the bounding box over all ranks; a rank may hold no node."""
    x = mesh.geometry.x
    low = x.min(axis=0, initial=np.inf)
    high = x.max(axis=0, initial=-np.inf)
    mesh.comm.Allreduce(MPI.IN_PLACE, low, MPI.MIN)
    mesh.comm.Allreduce(MPI.IN_PLACE, high, MPI.MAX)
    return float((high - low).max())


def exterior_facets(mesh: dmesh.Mesh) -> Indices:
    """Exterior facets that this rank owns, ascending. Collective."""
    tdim = mesh.topology.dim
    mesh.topology.create_entities(tdim - 1)
    mesh.topology.create_connectivity(tdim - 1, tdim)
    mesh.topology.create_connectivity(tdim, tdim - 1)
    mesh.topology.create_connectivity(tdim - 1, 0)
    return np.sort(dmesh.exterior_facet_indices(mesh.topology))


def connected_components(space: fem.FunctionSpace) -> tuple[Indices, int]:
    """Return the connected component of each owned node, (n,), and their number. Collective."""
    labels, count = distributed_components(space, space.dofmap.list)
    return labels[: space.dofmap.index_map.size_local], count


def distributed_components(
    space: fem.FunctionSpace, cells: Indices, keys: npt.NDArray[np.int64] | None = None
) -> tuple[Indices, int]:
    """Return the connected component of each local vertex of a graph, and their number. Collective.

    Vertices are the nodes of a space, then those with keys, (further, k), the same on each rank
    that has them; the vertices of a cell, (cells, n), are connected.
    """
    comm, index_map = lasting(space.mesh.comm), space.dofmap.index_map
    owned, nodes = index_map.size_local, index_map.size_local + index_map.num_ghosts
    first = np.repeat(cells[:, 0], cells.shape[1] - 1)
    further = 0 if keys is None else len(keys)
    count, here = graph_components(first, cells[:, 1:].ravel(), nodes + further)
    here = here + comm.scan(count) - count
    total = comm.allreduce(count, op=MPI.SUM)
    # The numbers that a ghost has here and at its owner are of one component.
    there = with_ghosts(index_map, here[:nodes].astype(np.int64))[owned:]
    pairs = [np.unique(np.column_stack([here[owned:nodes], there]), axis=0)]
    if keys is not None:
        rows = np.concatenate(comm.allgather(np.column_stack([keys, here[nodes:]])))
        _, begin, same = np.unique(rows[:, :-1], axis=0, return_index=True, return_inverse=True)
        pairs.append(np.column_stack([rows[:, -1], rows[begin[same.ravel()], -1]]))
    both = np.concatenate(comm.allgather(np.concatenate(pairs)))
    count, labels = graph_components(both[:, 0], both[:, 1], total)
    return labels[here], count


def component_sums(
    comm: MPI.Intracomm, component: npt.NDArray[Any], values: npt.NDArray[np.float64], count: int
) -> npt.NDArray[np.float64]:
    """Return the sums of values over each component, (count,). Collective."""
    return summed(comm, np.bincount(component, values, minlength=count))


def graph_components(
    one: npt.NDArray[Any], other: npt.NDArray[Any], size: int
) -> tuple[int, Indices]:
    """Return the number of components of a graph, given its edges, and that of each vertex."""
    graph = sparse.coo_array((np.ones(one.size, dtype=bool), (one, other)), shape=(size, size))
    count, labels = csgraph.connected_components(graph, directed=False)
    return int(count), labels


def paths(edges: npt.NDArray[np.integer[Any]], count: int) -> list[npt.NDArray[np.intp]]:
    """Return the polylines of edges, (m, 2), each from its end, or vertex, of smallest number."""
    graph = sparse.coo_array((np.ones(len(edges)), edges.T), shape=(count, count)).tocsr()
    graph = graph + graph.T
    number, component = csgraph.connected_components(graph, directed=False)
    first = np.lexsort((np.arange(count), np.diff(graph.indptr) > 1, component))
    starts = first[np.searchsorted(component[first], np.arange(number))]
    return [
        csgraph.depth_first_order(graph, start, directed=False, return_predecessors=False)
        for start in np.sort(starts)
    ]
