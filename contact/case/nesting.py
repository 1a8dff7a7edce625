"""The case on coarser meshes."""

from __future__ import annotations

import numpy as np

from contact.case.file import Case
from contact.case.mesh import Mesh
from contact.errors import InputError

#: Meshes with fewer cells along the shortest edge do not tell much of the solution.
COARSEST = 4

#: Meshes with fewer nodes than this take longer to be set up than they save.
SMALL = 1000


def coarser_cases(case: Case, levels: int | None = None) -> list[Case]:
    """Return the case on coarser and coarser meshes, the coarsest first, without itself.

    A generated mesh has its cells halved as often as all numbers of cells are even, a mesh
    that is refined has one refinement less.

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
    mesh = case.mesh
    while levels is None or len(found) < levels - 1:
        cells = mesh.cells
        if mesh.refine > 0:
            update: dict[str, object] = {"refine": mesh.refine - 1}
        elif cells is not None and all(n % 2 == 0 for n in cells) and min(cells) >= 2 * COARSEST:
            update = {"cells": tuple(n // 2 for n in cells)}
        else:
            break
        mesh = mesh.model_copy(update=update)
        if levels is None and found and _nodes(mesh) < SMALL:
            break
        found.insert(0, case.model_copy(update={"mesh": mesh}))
    if not found or (levels is not None and len(found) < levels - 1):
        raise InputError(
            f"{case.source}: solver.nested: there are {len(found) + 1} nested meshes only; "
            "accepted: numbers of cells that can be halved, or mesh.refine > 0"
        )
    return found


def _nodes(mesh: Mesh) -> float:
    """Return the number of vertices of a generated mesh; infinity if it is not known."""
    return np.inf if mesh.cells is None else float(np.prod([n + 1 for n in mesh.cells]))
