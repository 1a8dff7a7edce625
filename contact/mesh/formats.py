"""Mesh files by the endings of their names: groups of elements, tags of cells, sets of nodes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from contact.mesh import abaqus, exodus, gmsh_model, med, xdmf
from contact.mesh.contents import Contents

#: Programs and formats by the endings of the names of their files; any other is Gmsh's.
PROGRAMS = {
    ".inp": "Abaqus",
    ".vtu": "VTK",
    ".xdmf": "XDMF",
    ".med": "MED",
    ".rmed": "MED",
    ".e": "Exodus",
    ".ex2": "Exodus",
    ".exo": "Exodus",
}

ACCEPTED = "mesh files of Gmsh (.msh), Abaqus (.inp), VTK (.vtu), XDMF, MED and Exodus (.e)"


def program(file: Path) -> str:
    """Return the program or format of a mesh file."""
    return PROGRAMS.get(file.suffix.lower(), "Gmsh")


def read(file: Path) -> Contents:
    """Read a mesh file; raise errors of any kind if it is damaged."""
    readers = {"Abaqus": abaqus.read_abaqus, "MED": med.read, "Exodus": exodus.read, "VTK": _vtu}
    readers |= {"Gmsh": gmsh_model.read, "XDMF": xdmf.read}
    return readers[program(file)](file)


def files(file: Path) -> list[Path]:
    """Return the files of a mesh: its own, and those that it names; an error if one is missing."""
    if program(file) == "Abaqus":
        return abaqus.included_files(file)
    return [file, *(xdmf.heavy(file) if program(file) == "XDMF" else ())]


def _vtu(file: Path) -> Contents:
    """Read a VTK file."""
    import meshio

    mesh = meshio.vtu.read(file)
    points = np.zeros((len(mesh.points), 3))
    points[:, : mesh.points.shape[1]] = mesh.points
    made = Contents(points, [(block.type, block.data.astype(np.int64)) for block in mesh.cells])
    for key, arrays in mesh.cell_data.items():
        made.add_groups(key, arrays)
    for key, values in mesh.point_data.items():
        made.add_nodes(key, values)
    return made
