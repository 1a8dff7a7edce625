"""Meshes with named parts: from a generator, a Gmsh file, a recipe or a dolfinx mesh."""

import math
import os
from typing import TYPE_CHECKING

from mpi4py import MPI

from contact.errors import InputError
from contact.mesh.domain import Domain, from_mesh, rotate
from contact.mesh.grid import Piece, box, rectangle
from contact.mesh.reader import from_msh, from_recipe
from contact.mesh.refinement import refined

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
