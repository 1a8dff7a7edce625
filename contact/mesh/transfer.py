"""From one mesh of a body to another: refinement, and interpolation of functions.

Local refinement moves new nodes of a curved boundary onto the curve of `deviation`: on a polygon
that is only cut, the pressure would concentrate at its vertices, unseen by the error estimate.
"""

from __future__ import annotations

from dataclasses import replace

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from numpy.typing import NDArray

from contact import _compat
from contact._compat import lasting
from contact.errors import InputError
from contact.mesh.cells import shape_of
from contact.mesh.deviation import deviations
from contact.mesh.domain import Domain
from contact.mesh.entities import Indices, cell_facets, cells_at, extent, exterior_facets, sums_at
from contact.mesh.geometry import determinant, jacobians, unit_normals
from contact.mesh.owners import Owners
from contact.typing import Array


def refined(domain: Domain, marked: Indices | None = None) -> Domain:
    """Return the mesh of `with_parents`. Collective."""
    return with_parents(domain, marked)[0]


def with_parents(domain: Domain, marked: Indices | None = None) -> tuple[Domain, Indices]:
    """Cut every edge, or those of marked cells, in two; names are inherited. Collective.

    `marked` are owned cells, all by default; others are cut as far as the cuts of these ask for
    (Plaza and Carey, Appl. Numer. Math. 32, 2000). The cells of the new mesh lie in the cells of
    the old one, on the same rank; the second result is the old cell in which each new owned cell
    lies. Where all edges are cut a curved boundary keeps its old straight facets; those of marked
    cells follow the curve.
    """
    coarse = domain.mesh
    tdim = coarse.topology.dim
    fine, parent_cells, parent_facets = _cut(coarse, marked)
    facets = exterior_facets(fine)
    coarse_facets, fine_facets = cell_facets(coarse), cell_facets(fine)

    # dolfinx.mesh.transfer_meshtag does the same, but refuses ghosted parents.
    # The parents are listed in the order in which the refined cells were made.
    made = _compat.original_cells(fine) - fine.topology.index_map(tdim).local_range[0]
    parent = parent_cells[made]
    local = parent_facets.reshape(-1, fine_facets.shape[1])[made]
    cells, places = np.nonzero(local >= 0)
    owner = np.full(fine_facets.max(initial=-1) + 1, -1, dtype=np.int32)
    owner[fine_facets[cells, places]] = coarse_facets[parent[cells], local[cells, places]]

    if marked is not None:
        _follow(domain, fine, facets, owner[facets])
    parts = {name: facets[np.isin(owner[facets], old)] for name, old in domain.parts.items()}
    facets = np.arange(min(owner.size, fine.topology.index_map(tdim - 1).size_local))
    of_coarse, owner = coarse.topology.index_map(tdim - 1), owner[: facets.size]
    every = {name: sums_at(of_coarse, old, 1.0) > 0 for name, old in domain.inside.items()}
    inside = {
        name: facets[(owner >= 0) & within[owner]].astype(np.int32)
        for name, within in every.items()
    }
    owned = parent[: fine.topology.index_map(tdim).size_local]
    regions = {
        name: np.flatnonzero(np.isin(owned, old)).astype(np.int32)
        for name, old in domain.regions.items()
    }
    named = replace(domain, mesh=fine, parts=parts, regions=regions, inside=inside)
    return replace(named, levels=domain.levels + (marked is None)), owned


def _cut(coarse: dmesh.Mesh, marked: Indices | None) -> tuple[dmesh.Mesh, Indices, Indices]:
    """Return the refined mesh, cells on the rank of their parents, and its parents. Collective."""
    # Parents of the cells, and of each of their facets its place in the parent cell, -1 for none.
    if not shape_of(coarse).simplex and marked is None:
        _check_straight(coarse)
        return _halved(coarse)
    check_adaptable(coarse)
    coarse.topology.create_entities(1)
    edges = None
    if marked is not None:
        edges = dmesh.compute_incident_entities(coarse.topology, marked, coarse.topology.dim, 1)
    parents = dmesh.RefinementOption.parent_cell_and_facet
    made: tuple[dmesh.Mesh, Indices, Indices] = dmesh.refine(
        coarse, edges, partitioner=None, option=parents
    )
    return made


def check_adaptable(mesh: dmesh.Mesh) -> None:
    """Refuse curved cells, and cells that are no simplices: dolfinx has no hanging nodes."""
    _check_straight(mesh)
    shape = shape_of(mesh)
    if not shape.simplex:
        raise InputError(
            f"mesh.adapt: the cells are {shape.plural}, of which some cannot be refined alone; "
            "accepted: triangles or tetrahedra, or mesh.refine",
            "refine",
        )


def _check_straight(mesh: dmesh.Mesh) -> None:
    if _compat.geometry_degree(mesh) > 1:
        raise InputError(
            "mesh.refine, mesh.adapt: the cells are curved; accepted: cells of order 1, or a finer "
            "mesh of order 2",
            "refine",
        )


def _halved(coarse: dmesh.Mesh) -> tuple[dmesh.Mesh, Indices, Indices]:
    """Cut each quadrilateral in 4, each hexahedron in 8. Collective."""
    shape, d = shape_of(coarse), coarse.topology.dim
    space = fem.functionspace(coarse, ("Lagrange", 2))
    owned = coarse.topology.index_map(d).size_local
    nodes, children = space.dofmap.list[:owned], shape.children
    numbers = space.dofmap.index_map.local_to_global(nodes.ravel()).reshape(nodes.shape)
    cells = numbers[:, children].reshape(-1, shape.corners)
    points = space.tabulate_dof_coordinates()[: space.dofmap.index_map.size_local, :d]
    element = basix.ufl.element("Lagrange", shape.name, 1, shape=(d,), dtype=np.float64)
    rank = lasting(coarse.comm).rank
    stay = _compat.destinations(np.full(len(cells), rank, dtype=np.int32))
    kept = {"partitioner": lambda *_: stay}
    fine = dmesh.create_mesh(coarse.comm, cells=cells, x=points, e=ufl.Mesh(element), **kept)
    # Facets of a child at the corner that it has of its parent lie in the parent's of their place.
    places = np.arange(len(shape.facet_corners), dtype=np.int32)
    at_corner = (shape.facet_corners[None] == np.arange(shape.corners)[:, None, None]).any(axis=2)
    facets = np.tile(np.where(at_corner, places, -1).ravel(), owned)
    parents = np.repeat(np.arange(owned, dtype=np.int32), len(children))
    return fine, parents, facets


#: Largest distance of a node outside of a mesh, over its extent and over its largest cell.
OUTSIDE, NEAR = 1e-3, 0.1

#: Rounds in which cells without common nodes are chosen; further ones find hardly any.
ROUNDS = 3


def carry(coarse: fem.Function, space: fem.FunctionSpace) -> fem.Function:
    """Return the interpolant of a function in a space on another mesh of the body. Collective."""
    # A node slightly outside of the old mesh, as on a curved boundary, gets the value of the
    # closest cell.
    made = fem.Function(space, name=coarse.name)
    cells = _covering(space)
    source = coarse.function_space
    mesh = source.mesh
    comm = lasting(mesh.comm)
    everywhere = np.arange(mesh.topology.index_map(mesh.topology.dim).size_local, dtype=np.int32)
    largest = float(mesh.h(mesh.topology.dim, everywhere).max(initial=0.0))
    largest = comm.allreduce(largest, op=MPI.MAX)
    # A larger padding makes dolfinx search more cells.
    padding = min(OUTSIDE * extent(space.mesh), NEAR * largest)
    data = fem.create_interpolation_data(space, source, cells, padding=padding)
    made.interpolate_nonmatching(coarse, cells, interpolation_data=data)
    made.x.scatter_forward()
    return made


def _covering(space: fem.FunctionSpace) -> NDArray[np.int32]:
    """Return owned cells that contain all nodes, few of them twice: dolfinx searches each node."""
    # Random cells without common nodes first, then any cell of each node that is left.
    topology = space.mesh.topology
    nodes = space.dofmap.list[: topology.index_map(topology.dim).size_local]
    cells = np.random.default_rng(0).permutation(nodes.shape[0]).astype(np.int32)
    uncovered = np.zeros(nodes.max(initial=-1) + 1, dtype=bool)
    uncovered[nodes] = True
    last = np.zeros(uncovered.size, dtype=np.int32)
    found = []
    for _ in range(ROUNDS):
        cells = cells[uncovered[nodes[cells]].all(axis=1)]
        last[nodes[cells]] = cells[:, None]
        apart = cells[(last[nodes[cells]] == cells[:, None]).all(axis=1)]
        uncovered[nodes[apart]] = False
        found.append(apart)
    last[nodes] = np.arange(nodes.shape[0], dtype=np.int32)[:, None]
    return np.unique(np.concatenate([*found, last[uncovered]]))


#: Largest distance between a node and the middle of its edge, over the length of the edge.
SAME = 1e-6

#: Least eigenvalue of sum n n^T at a node, over the largest, for directions with a height.
APART = 0.1

#: Largest difference of normals on a flat part.
FLAT = 1e-9

#: Least ratio of the volume of a cell after and before its nodes move; else none moves.
KEPT = 0.2


def _follow(coarse: Domain, fine: dmesh.Mesh, facets: Indices, parents: Indices) -> None:
    """Move new nodes in the middles of boundary edges onto the curve (`deviation`). Collective."""
    d, of_fine = coarse.dim, fine.geometry.index_map()
    every = exterior_facets(coarse.mesh)
    rest = np.setdiff1d(every, np.concatenate([every[:0], *coarse.parts.values()]))
    # Part by part: at an edge between two there is no common normal.
    found = []
    for part in (*coarse.parts.values(), rest):
        inside = np.isin(parents, part)
        found.append(_heights(coarse, part, fine, facets[inside], parents[inside]))
    nodes, normal, height = map(np.concatenate, zip(*found, strict=True))
    right, matrix = height[:, None] * normal, normal[:, :, None] * normal[:, None, :]
    values = sums_at(of_fine, nodes, np.concatenate([right[:, None], matrix], axis=1))
    # The shortest shift s with n.s = h for the facets' normals n, in the least-squares sense.
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
    """Return the new nodes of a part, once a facet, with normals and heights. Collective."""
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
