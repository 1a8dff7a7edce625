"""Meshes from Gmsh: ``.msh`` files and generators, with physical groups as parts.

Gmsh runs for rank 0 alone. The result is checked there, the verdict is broadcast, and
all ranks go on or raise together.
"""

import codecs
import logging
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import basix.ufl
import numpy as np
import ufl
from dolfinx import graph, io
from dolfinx import mesh as dmesh
from mpi4py import MPI

from contact.errors import InputError
from contact.mesh import shared
from contact.mesh.domain import Domain, Indices, exterior_facets, with_names
from contact.mesh.extraction import OTHERS, Model, extract
from contact.mesh.validity import Cells, Groups, check_model
from contact.ranks import on_all_ranks, on_root

logger = logging.getLogger("contact.mesh")

#: Seconds that reading a file may take, whatever its length, and for each byte of it: ten times
#: the time on a machine that others use, too.
LEAST_TIME, TIME_A_BYTE = 60.0, 5e-6

#: Cells from which a mesh that one rank reads for all is worth a word: it takes some 1.4 GB.
MANY = 5_000_000

#: Byte order mark, with which some editors begin a file.
BOM = codecs.BOM_UTF8


def from_msh(comm: MPI.Intracomm, path: str | Path) -> Domain:
    """Read a Gmsh ``.msh`` file (formats 2.2 and 4.1). Collective.

    The regions are the physical groups of surfaces (plane meshes) or volumes, by name; the
    parts are those of curves or surfaces. A group without a name goes by its number. Groups may
    overlap. Cells in no group are no part of the body, unless there are no groups of cells at
    all; a group of facets that are not all on the boundary of the body is ignored, until it is
    asked for. `Domain.notes` and the log say so. Plane meshes may be stored in any plane
    z = const.

    Parameters
    ----------
    comm
        Communicator of the ranks of the mesh.
    path
        The file.

    Returns
    -------
    The mesh with its parts and regions.

    Raises
    ------
    InputError
        If the file is missing, damaged or no mesh, has no boundary groups, cells of several kinds,
        or degenerate, folded or overlapping cells. The message names the file.
    """
    return _from_rank_0(comm, lambda: _read(Path(path), gmsh=True), f"mesh file {path}")


def from_file(comm: MPI.Intracomm, path: str | Path) -> Domain:
    """Read a mesh file of one of several formats, by the ending of its name. Collective.

    Input files of Abaqus and CalculiX (.inp), and, by meshio, VTK (.vtu), XDMF (.xdmf), MED (.med)
    and Exodus (.e, .exo, .ex2); any other is one for `from_msh`. Sets of cells are regions; sets of
    facets, surfaces, and sets of nodes (the facets of the boundary all of whose nodes they hold)
    are parts. Whole numbers of cells or nodes in VTK's files and XDMF mark sets, 0 none. Of XDMF
    that `convert` has written each rank reads its share; other files are read on rank 0.

    Parameters
    ----------
    comm
        Communicator of the ranks of the mesh.
    path
        The file.

    Returns
    -------
    The mesh with its parts and regions.

    Raises
    ------
    InputError
        As `from_msh`, and if a set has no meaning.
    """
    file, source = Path(path), f"mesh file {path}"
    heavy = on_root(comm, lambda: shared.heavy_file(file))
    if heavy is None:
        return _from_rank_0(comm, lambda: _read(file), source)
    return _distribute(comm, shared.read(comm, *heavy), source)


def convert(file: Path, to: Path) -> Cells:
    """Write a mesh file as XDMF of which each rank reads its share. On one rank.

    Parameters
    ----------
    file
        A file as of `from_file`.
    to
        The new file, ``*.xdmf``; another with the ending .h5 is written beside it.

    Returns
    -------
    The mesh that has been written.

    Raises
    ------
    InputError
        As `from_file`, and if one of the new files is there already.
    """
    cells = _checked(lambda: _read(file), f"mesh file {file}")
    shared.write(cells, to)
    return cells


def _read(file: Path, gmsh: bool = False) -> Model:
    """Read a file by the ending of its name, or one of Gmsh."""
    if not file.is_file():
        raise InputError("no such file", "file-name")
    other = None if gmsh else OTHERS.get(file.suffix.lower())
    if other is not None:
        return _apart("contact.mesh.formats", [], file.resolve(), file, f"the {other} reader")
    how = ["switch"] if _format(file) < 4 else ["as they are"]
    with _plain_name(file) as plain:
        return _apart("contact.mesh.extraction", how, plain, file, "Gmsh")


def _apart(module: str, options: list[str], plain: Path, file: Path, reader: str) -> Model:
    """Read a file in a process of its own, see `contact.mesh.extraction`.

    Parameters
    ----------
    module, options
        The module to run, and its options behind the names of the file and of that for arrays.
    plain
        The name to read the file by.
    file, reader
        Its name, and who reads it, in messages.
    """
    limit = LEAST_TIME + TIME_A_BYTE * file.stat().st_size
    # All modules of this process can be imported by the other.
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(os.path.abspath, sys.path))}
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "model.npz"
        try:
            done = subprocess.run(
                [sys.executable, "-P", "-m", module, str(plain), str(out), *options],
                env=environment,
                cwd=file.parent,  # where XDMF has its binary files
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                timeout=limit,
            )
        except subprocess.TimeoutExpired:
            raise InputError(
                f"{reader} does not come to an end with it in {limit:.0f} s", "mesh-file"
            ) from None
        if done.returncode != 0:
            raise InputError(
                f"{reader} breaks off reading it (status {done.returncode}): it is damaged",
                "mesh-file",
            )
        if not out.exists():
            said = " ".join(done.stdout.decode(errors="replace").split())
            said = said.replace(str(plain), file.name)
            raise InputError(
                f"{reader} says of it: {said or 'nothing, and reads nothing of it'}", "mesh-file"
            )
        return Model.load(out)


def _format(file: Path) -> int:
    """Return the major version of a mesh file's format, having looked at both ends of the file.

    Gmsh takes a file for a mesh by how it begins, and anything else for a script, whose commands
    it executes: nothing may come before ``$MeshFormat``.
    """
    try:
        with file.open("rb") as stream:
            start = stream.read(200)
            stream.seek(max(0, file.stat().st_size - 200))
            end = stream.read()
    except OSError as error:
        raise InputError(f"it cannot be read ({error.strerror})", "mesh-file") from error
    found = re.match(rb"\$MeshFormat[ \t]*\r?\n\s*(2|4)(\.\d+)?[ \t]", start.removeprefix(BOM))
    if found is None:
        raise InputError(
            "this is no Gmsh .msh file of format 2.2 or 4.1 (it begins otherwise)", "mesh-file"
        )
    # Gmsh takes a section that is cut off for a whole one.
    if re.search(rb"\$End\w+\s*$", end) is None:
        raise InputError("it is cut off: it does not end as a section does", "mesh-file")
    return int(found[1])


@contextmanager
def _plain_name(file: Path) -> Iterator[Path]:
    """Yield a name by which Gmsh reads a file by its first line.

    Some suffixes have readers of their own, or programs that unpack the file first; and after a
    byte order mark Gmsh finds no beginning at all.
    """
    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / "mesh.msh"
        with file.open("rb") as stream:
            marked = stream.read(len(BOM)) == BOM
            if not marked:
                plain.symlink_to(file.resolve())
            else:
                with plain.open("wb") as copy:
                    shutil.copyfileobj(stream, copy)
        yield plain


def from_generator(
    comm: MPI.Intracomm, name: str, cell: str | None = None, order: int = 1, **parameters: Any
) -> Domain:
    """Build a generator of the package `meshes`, by name. Collective.

    Parameters
    ----------
    comm
        Communicator.
    name, cell, order, parameters
        As `meshes.build` takes them.

    Raises
    ------
    InputError
        For an unknown generator or wrong parameters.
    """
    import meshes

    def build() -> Model:
        with _gmsh() as gmsh:
            meshes.build(name, cell, order, **parameters)
            return extract(gmsh.model, entities_are_groups=False)

    return _from_rank_0(comm, build, f"mesh generator {name!r}")


def _from_rank_0(comm: MPI.Intracomm, load: Callable[[], Model], source: str) -> Domain:
    """Check on rank 0 the model that ``load`` makes there, and distribute it."""
    with on_all_ranks(comm):
        raw = _checked(load, source) if comm.rank == 0 else None
    if raw is not None and comm.size > 1 and len(raw.regions.rows) >= MANY:
        logger.info(
            "%s: one rank has read all %d cells; of a file that contact mesh writes each reads its "
            "share",
            source,
            len(raw.regions.rows),
        )
    names = comm.bcast(None if raw is None else raw.without_rows())
    return _distribute(comm, names if raw is None else raw, source)


def _checked(load: Callable[[], Model], source: str) -> Cells:
    """Return a model that has been checked, or name its source."""
    try:
        return check_model(load())
    except InputError as error:
        raise error.within(f"{source}: ") from None


def _distribute(comm: MPI.Intracomm, raw: Cells, source: str) -> Domain:
    dim = raw.points.shape[1]
    order = raw.shape.degree_of(raw.regions.rows.shape[1])
    element = basix.ufl.element("Lagrange", raw.shape.name, order, shape=(dim,), dtype=np.float64)
    mesh = dmesh.create_mesh(comm, cells=raw.regions.rows, x=raw.points, e=ufl.Mesh(element))
    exterior_facets(mesh)
    parts, regions = _sets(mesh, dim - 1, raw.parts), _sets(mesh, dim, raw.regions)
    inside = {name: parts.pop(name) for name in raw.inside}
    domain = with_names(mesh, parts, regions)
    if comm.rank == 0:
        for note in raw.notes:
            logger.info("%s: %s", source, note)
    unusable = {name: f"{source}: {reason}" for name, reason in raw.unusable.items()}
    more: dict[str, Any] = {"notes": raw.notes, "inside": inside, "space": raw.space}
    return replace(domain, unusable=unusable, **more)


def _sets(mesh: dmesh.Mesh, dim: int, groups: Groups) -> dict[str, Indices]:
    """Return the owned cells or facets of each group. Collective."""
    vertices, labels = io.utils.distribute_entity_data(mesh, dim, groups.rows, groups.labels)
    mesh.topology.create_connectivity(dim, 0)
    tags = dmesh.meshtags_from_entities(
        mesh, dim, graph.adjacencylist(vertices), labels.astype(np.int32)
    )
    owned = tags.indices < mesh.topology.index_map(dim).size_local
    indices, values = tags.indices[owned], tags.values[owned]
    labels_of = {
        name: [label for label, inside in enumerate(groups.sets) if i in inside]
        for i, name in enumerate(groups.names)
    }
    return {name: indices[np.isin(values, labels)] for name, labels in labels_of.items()}


@contextmanager
def _gmsh() -> Iterator[Any]:
    """Provide a new model of Gmsh, leaving a running Gmsh as it was."""
    try:
        import gmsh
    except (ImportError, OSError) as error:  # OSError: one of its shared libraries is missing.
        raise InputError(f"the Python module gmsh is needed ({error})", "gmsh") from error
    started = not gmsh.isInitialized()
    if started:
        gmsh.initialize(readConfigFiles=False, interruptible=False)
    # Gmsh's own messages would mix with ours; its errors come as exceptions.
    terminal = gmsh.option.getNumber("General.Terminal")
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("contact")
    try:
        yield gmsh
    except Exception as error:
        # Gmsh's errors are of this very class; anything else is a fault of the program.
        if type(error) is not Exception:
            raise
        raise InputError(f"Gmsh says: {error}", "mesh-file") from error
    finally:
        gmsh.model.remove()
        gmsh.option.setNumber("General.Terminal", terminal)
        if started:
            gmsh.finalize()
