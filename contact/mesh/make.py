"""Meshes with named parts: from a generator, a Gmsh file, a recipe or a dolfinx mesh."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh

from contact import _compat
from contact.errors import InputError
from contact.mesh.domain import Domain, exterior_facets, tagged
from contact.mesh.grid import Piece, box, rectangle
from contact.mesh.reader import from_msh, from_recipe

__all__ = [
    "Domain",
    "Piece",
    "box",
    "from_mesh",
    "from_msh",
    "from_recipe",
    "rectangle",
    "refined",
]

Marker = Callable[[npt.NDArray[np.float64]], npt.NDArray[np.bool_]]


def from_mesh(
    mesh: dmesh.Mesh,
    parts: Mapping[str, Marker | npt.NDArray[np.integer[Any]]],
    size: float | None = None,
) -> Domain:
    """Name parts of the boundary of a dolfinx mesh. Collective.

    Parameters
    ----------
    mesh
        Triangles or tetrahedra with straight edges.
    parts
        Name -> function of x, shape (3, n), that is true at all vertices of the part's facets;
        or the local indices of the facets. The same names on all ranks.
    size
        Largest extent of the body; by default that of its bounding box.

    Raises
    ------
    InputError
        For other meshes, a part without facets, or an interior facet in a part.
    """
    kinds = (dmesh.CellType.triangle, dmesh.CellType.tetrahedron)
    flat = mesh.topology.dim == mesh.geometry.dim and _compat.geometry_degree(mesh) == 1
    if mesh.topology.cell_type not in kinds or not flat:
        raise InputError(
            "the mesh must consist of triangles in the plane or of tetrahedra, "
            "with straight edges (geometry of degree 1)"
        )
    facets = exterior_facets(mesh)
    fdim = mesh.topology.dim - 1
    owned = mesh.topology.index_map(fdim).size_local
    marks = {}
    for name, given in parts.items():
        if callable(given):
            chosen = dmesh.locate_entities_boundary(mesh, fdim, given)
        else:
            chosen = np.asarray(given, dtype=np.int32)
        chosen = chosen[chosen < owned]
        inside = int(np.count_nonzero(~np.isin(chosen, facets)))
        if mesh.comm.allreduce(inside) > 0:
            raise InputError(f"the part {name!r} contains interior facets of the mesh")
        marks[name] = np.isin(facets, chosen)
    return tagged(mesh, facets, marks, size)


def refined(domain: Domain) -> Domain:
    """Cut every edge in two; the parts are inherited. Collective.

    The cells of the new mesh lie in the cells of the old one, on the same rank. A curved
    boundary keeps its old straight facets.
    """
    coarse = domain.mesh
    tdim = coarse.topology.dim
    coarse.topology.create_entities(1)
    # Without a partitioner the refined cells stay on the rank of their parent.
    fine, parent_cells, parent_facets = dmesh.refine(
        coarse, partitioner=None, option=dmesh.RefinementOption.parent_cell_and_facet
    )
    facets = exterior_facets(fine)
    for mesh in (coarse, fine):
        mesh.topology.create_connectivity(tdim, tdim - 1)
    coarse_facets = coarse.topology.connectivity(tdim, tdim - 1).array.reshape(-1, tdim + 1)
    fine_facets = fine.topology.connectivity(tdim, tdim - 1).array.reshape(-1, tdim + 1)

    # dolfinx.mesh.transfer_meshtag does the same, but refuses ghosted parents.
    # The parents are listed in the order in which the refined cells were made.
    made = _compat.original_cells(fine) - fine.topology.index_map(tdim).local_range[0]
    parent = parent_cells[made]
    local = parent_facets.reshape(-1, tdim + 1)[made]
    cells, places = np.nonzero(local >= 0)
    owner = np.full(fine_facets.max(initial=-1) + 1, -1, dtype=np.int32)
    owner[fine_facets[cells, places]] = coarse_facets[parent[cells], local[cells, places]]

    values = np.zeros(coarse_facets.max(initial=-1) + 1, dtype=np.int32)
    values[domain.facet_tags.indices] = domain.facet_tags.values
    masks = values[owner[facets]]
    marks = {name: np.isin(masks, domain.parts[name]) for name in domain.parts}
    return replace(tagged(fine, facets, marks, domain.size), levels=domain.levels + 1)
