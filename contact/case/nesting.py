"""The case on coarser meshes."""

from __future__ import annotations

import numpy as np

from contact.case.file import Case
from contact.case.mesh import Mesh
from contact.errors import InputError
from contact.mesh import grid

#: Meshes with fewer cells along the shortest edge do not tell much of the solution.
COARSEST = 4

#: Meshes with fewer nodes than this take longer to be set up than they save.
SMALL = 500


def coarser_cases(case: Case, levels: int | None = None) -> list[Case]:
    """Return the case on coarser and coarser meshes, the coarsest first, without itself.

    A generated mesh has its cells halved as often as they are enough, and its parts end at
    positions of the grid; a mesh that is refined has one refinement less.

    Parameters
    ----------
    case
        The case on the finest mesh.
    levels
        Number of meshes, with the finest; None for all that pay.

    Raises
    ------
    InputError
        If there is no coarser mesh, or there are not as many as asked for.
    """
    found: list[Case] = []
    mesh = _coarser(case.mesh)
    while mesh is not None and (levels is None or len(found) < levels - 1):
        if levels is None and found and _nodes(mesh) < SMALL:
            break
        found.insert(0, case.model_copy(update={"mesh": mesh}))
        mesh = _coarser(mesh)
    if not found or (levels is not None and len(found) < levels - 1):
        raise InputError(
            f"{case.source}: solver.nested: there are {len(found) + 1} nested meshes only; "
            f"accepted: at least {2 * COARSEST} cells along each edge and parts that end at "
            "positions of the grid of half as many, or mesh.refine > 0"
        )
    return found


def has_coarser(case: Case) -> bool:
    """Tell whether there is a coarser mesh."""
    return _coarser(case.mesh) is not None


def _coarser(mesh: Mesh) -> Mesh | None:
    """Return the next coarser mesh, if there is one."""
    cells = mesh.cells
    if mesh.refine > 0:
        return mesh.model_copy(update={"refine": mesh.refine - 1})
    if cells is not None and min(cells) >= 2 * COARSEST:
        coarser = mesh.model_copy(update={"cells": tuple((n + 1) // 2 for n in cells)})
        return coarser if _fits(coarser) else None
    return None


def _fits(mesh: Mesh) -> bool:
    """Tell whether the parts of a rectangle or box end at positions of its grid."""
    assert mesh.generator and mesh.origin and mesh.size and mesh.cells
    try:
        grid.plan(mesh.generator, mesh.origin, mesh.size, mesh.cells, mesh.pieces)
    except grid.GridError:
        return False
    return True


def _nodes(mesh: Mesh) -> float:
    """Return the number of vertices of a generated mesh; infinity if it is not known."""
    return np.inf if mesh.cells is None else float(np.prod([n + 1 for n in mesh.cells]))
