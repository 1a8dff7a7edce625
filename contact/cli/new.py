"""``contact new MESH.msh``: a case file to begin with, for a mesh of one's own."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from mpi4py import MPI

from contact.cli.ending import CONVERGED
from contact.cli.options import add_command
from contact.errors import InputError
from contact.output.folder import on_root


def add_parser(commands: Any) -> None:
    """Add the command to the parser's commands."""
    text = "write a commented case file for a mesh file, with its parts"
    command = add_command(commands, "new MESH.msh [--case CASE.toml]", text)
    command.add_argument("mesh", metavar="MESH.msh", help="Gmsh file with named physical groups")
    command.add_argument("--case", metavar="FILE", help="file to write; MESH.toml by default")


def run(options: argparse.Namespace, comm: MPI.Intracomm) -> int:
    """Write the case file."""
    from contact.cli.template import case_text  # these load dolfinx, after PETSc's options
    from contact.mesh.reader import from_msh

    mesh = Path(options.mesh)
    path = Path(options.case) if options.case else mesh.with_suffix(".toml")
    if not on_root(comm, mesh.is_file):
        raise InputError(f"{mesh}: no such file; accepted: a Gmsh file (.msh)")
    text = case_text(from_msh(comm, mesh), mesh, path)

    def write() -> None:
        try:
            with path.open("x", encoding="utf-8") as file:
                file.write(text)
        except FileExistsError:
            raise InputError(
                f"{path}: it is there already; accepted: another name, by --case FILE"
            ) from None

    on_root(comm, write)
    if comm.rank == 0:
        print(f"{path}: edit it, then run contact check {path}")
    return CONVERGED
