"""Meshes with named parts: from a generator, a Gmsh file, a recipe or a dolfinx mesh."""

import math
import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh
from mpi4py import MPI

from contact import _compat
from contact.errors import InputError
from contact.mesh.domain import Domain, exterior_facets, rotate, tagged
from contact.mesh.grid import Piece, box, rectangle
from contact.mesh.reader import from_msh, from_recipe

if TYPE_CHECKING:
    from contact.case.mesh import Mesh as MeshSection

__all__ = [
    "Domain",
    "Piece",
    "box",
    "from_mesh",
    "from_msh",
    "from_recipe",
    "make_domain",
    "rectangle",
    "refined",
]

#: Bytes that making the mesh takes for a cell, without any unknowns (seen: 235 to 345).
CELL_MEMORY = 200

Marker = Callable[[npt.NDArray[np.float64]], npt.NDArray[np.bool_]]


def make_domain(section: "MeshSection", comm: MPI.Intracomm) -> Domain:
    """Make the domain that the section ``[mesh]`` of a case file describes. Collective.

    Raises
    ------
    InputError
        As `rectangle`, `box`, `from_msh` and `from_recipe`, and if the mesh does not fit into
        the memory.
    """
    if section.file is not None:
        domain = from_msh(comm, section.file)
    elif section.generator in ("rectangle", "box"):
        # Triangles of a square, tetrahedra of a cube.
        cells = math.prod(section.cells or ()) * (2 if section.generator == "rectangle" else 6)
        _check_memory(comm, cells)
        # The section itself demands these three for a grid.
        assert section.origin is not None
        assert section.size is not None
        assert section.cells is not None
        grid = (section.origin, section.size, section.cells, _pieces(section))
        if section.generator == "rectangle":
            domain = rectangle(comm, *grid, diagonal=section.diagonal or "right")
        else:
            domain = box(comm, *grid)
    else:
        assert section.generator is not None
        domain = from_recipe(comm, section.generator, **section.parameters)
    axis = section.axis or (0.0, 1.0, 0.0)
    rotate(domain.mesh, section.rotation, axis if domain.dim == 3 else (0.0, 0.0, 1.0))
    for _ in range(section.refine):
        cells = domain.mesh.topology.index_map(domain.dim).size_global
        _check_memory(comm, cells * 2**domain.dim)
        domain = refined(domain)
    return domain


def _check_memory(comm: MPI.Intracomm, cells: int) -> None:
    """Refuse a mesh that certainly does not fit, before the system ends the program for it."""
    machine = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    memory = comm.allreduce(machine, op=MPI.MIN)
    needed = cells * CELL_MEMORY / comm.size
    if needed > memory:
        raise InputError(
            f"mesh: {cells:.3g} cells take more memory, {needed / 1e9:.3g} GB a rank, than there "
            f"is, {memory / 1e9:.3g} GB; accepted: fewer cells (mesh.cells, mesh.refine), or more "
            "ranks on more machines"
        )


def _pieces(section: "MeshSection") -> dict[str, list[Piece]]:
    given = {
        name: pieces if isinstance(pieces, tuple) else (pieces,)
        for name, pieces in section.parts.items()
    }
    return {name: [Piece(p.side, p.start, p.stop) for p in ps] for name, ps in given.items()}


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
