"""From the section `[mesh]` of a case to a domain."""

from __future__ import annotations

import logging
import math

from mpi4py import MPI

from contact.case.mesh import Mesh
from contact.errors import InputError
from contact.mesh.domain import Domain
from contact.mesh.grid import box, rectangle
from contact.mesh.reader import from_msh, from_recipe
from contact.mesh.refinement import refined
from contact.mesh.rotation import rotate
from contact.methods.interrupt import deaf
from meshes.grading import memory

#: Bytes that making the mesh takes for a cell, without any unknowns (seen: 235 to 345).
CELL_MEMORY = 200

#: Seconds that it takes for a cell (seen: 5e-6 to 7e-6).
CELL_SECONDS = 6e-6

#: Number of cells from which on there is a word on what they take: about a minute.
MANY = 10_000_000

logger = logging.getLogger("contact.mesh")


def make_domain(section: Mesh, comm: MPI.Intracomm) -> Domain:
    """Make the domain that the section ``[mesh]`` of a case file describes. Collective.

    Raises
    ------
    InputError
        As `rectangle`, `box`, `from_msh` and `from_recipe`, and if the mesh does not fit into
        the memory.
    """
    if section.file is not None:
        domain = from_msh(comm, section.file)
    elif section.sides:
        flat = section.generator == "rectangle"
        # Triangles of a square, tetrahedra of a cube.
        each = (4 if section.diagonal == "crossed" else 2) if flat else 6
        _check_memory(comm, each * math.prod(section.cells or ()), section.refine, 2 if flat else 3)
        # The section itself demands these three for a grid.
        assert section.origin is not None
        assert section.size is not None
        assert section.cells is not None
        grid = (section.origin, section.size, section.cells, section.pieces)
        if section.generator == "rectangle":
            domain = rectangle(comm, *grid, diagonal=section.diagonal or "right")
        else:
            domain = box(comm, *grid)
    else:
        assert section.generator is not None
        with deaf():
            domain = from_recipe(comm, section.generator, **section.parameters)
    axis = section.axis or (0.0, 1.0, 0.0)
    rotate(domain.mesh, section.rotation, axis if domain.dim == 3 else (0.0, 0.0, 1.0))
    if not section.sides:
        cells = domain.mesh.topology.index_map(domain.dim).size_global
        _check_memory(comm, cells, section.refine, domain.dim)
    for _ in range(section.refine):
        domain = refined(domain)
    return domain


def _check_memory(comm: MPI.Intracomm, cells: int, refine: int, dim: int) -> None:
    """Refuse a mesh that certainly does not fit, before anything is made of it.

    Say of a large one what it takes, for that may be long.
    """
    total = cells * 2 ** (dim * refine)
    least = comm.allreduce(memory(), op=MPI.MIN)
    needed = total * CELL_MEMORY / comm.size
    what = f"mesh.refine: {refine} refinements of {cells:.3g} cells, " if refine else "mesh: "
    if needed > least:
        raise InputError(
            f"{what}{total:.3g} cells take more memory, {needed / 1e9:.3g} GB a rank, than there "
            f"is, {least / 1e9:.3g} GB; accepted: fewer cells (mesh.cells, mesh.refine), or more "
            "ranks on more machines"
        )
    if total > MANY and comm.rank == 0:
        seconds = total * CELL_SECONDS / comm.size
        logger.warning(
            f"{what}{total:.3g} cells: their mesh alone takes some {needed / 1e9:.2g} GB a rank "
            f"and {seconds:.2g} s"
        )
