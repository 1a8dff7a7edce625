"""Meshes from files and from generators: rank 0 reads and checks them.

It has to hold all of a mesh. `convert` writes the checked mesh as XDMF, of which each rank reads
its share by dolfinx.
"""

from __future__ import annotations

import json
import logging
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import basix.ufl
import numpy as np
import ufl
from dolfinx import graph, io
from dolfinx import mesh as dmesh
from mpi4py import MPI

from contact.errors import InputError
from contact.mesh.abaqus import included_files, read_abaqus
from contact.mesh.contents import Contents, Groups, check, in_space
from contact.mesh.domain import Domain, with_names
from contact.mesh.entities import Indices, combinations, exterior_facets, labels_of
from contact.mesh.formats import (
    array_files,
    model_contents,
    read_exodus,
    read_med,
    read_msh,
    read_xdmf,
    session,
)
from contact.ranks import on_all_ranks, on_root

logger = logging.getLogger("contact.mesh")

#: Beginning of the names that `write` puts into an XDMF file.
CONVERTED = '<Information Name="contact" Value="{'


def _by_meshio(module: str, file: Path) -> Contents:
    """Read a file by a module of meshio: cells, sets, and whole numbers of cells and nodes."""
    mesh = import_module(f"meshio.{module}").read(file)
    blocks = [(block.type, block.data.astype(np.int64)) for block in mesh.cells]
    made = Contents(in_space(mesh.points), blocks)
    for key, arrays in mesh.cell_data.items():
        made.add_groups(key, arrays)
    for key, values in mesh.point_data.items():
        made.add_nodes(key, values)
    for name, sets in mesh.cell_sets.items():
        made.groups[name] = {b: np.asarray(own) for b, own in enumerate(sets) if own is not None}
    made.nodes |= {name: np.asarray(own) for name, own in mesh.point_sets.items()}
    return made


#: Ending of a file's name -> its program or format, and how it is read.
FORMATS: dict[str, tuple[str, Callable[[Path], Contents]]] = {
    ".msh": ("Gmsh", read_msh),
    ".inp": ("Abaqus", read_abaqus),
    ".vtu": ("VTK", partial(_by_meshio, "vtu")),
    ".bdf": ("Nastran", partial(_by_meshio, "nastran")),
    ".xdmf": ("XDMF", read_xdmf),
    ".med": ("MED", read_med),
    ".rmed": ("MED", read_med),
    ".e": ("Exodus", read_exodus),
    ".exo": ("Exodus", read_exodus),
    ".ex2": ("Exodus", read_exodus),
}

_ENDINGS = {
    program: ", ".join(ending for ending, (own, _) in FORMATS.items() if own == program)
    for program, _ in FORMATS.values()
}
#: The formats in words.
ACCEPTED = f"a mesh file of {', '.join(f'{name} ({ends})' for name, ends in _ENDINGS.items())}"


def mesh_files(file: Path) -> list[Path]:
    """Return the files of a mesh: its own, and those that it names; an error if one is missing."""
    ending = file.suffix.lower()
    if ending == ".inp":
        return included_files(file)
    return [file, *(array_files(file) if ending == ".xdmf" else ())]


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
        If the file is missing, damaged or no mesh, has no boundary groups, or degenerate, folded or
        overlapping cells. The message names the file.
    """
    return _from_rank_0(comm, lambda: _read(Path(path), ".msh"), f"mesh file {path}")


def from_file(comm: MPI.Intracomm, path: str | Path) -> Domain:
    """Read a mesh file of one of several formats, by the ending of its name. Collective.

    The formats are that of Gmsh, as `from_msh` reads it, and those of the table in docs/how-to.md
    (`FORMATS`). Sets of cells are regions; sets of facets, surfaces, and sets of nodes (the facets
    of the boundary all of whose nodes they have) are parts. Positive whole numbers of cells or
    nodes in files of VTK, XDMF and Nastran are sets. Of XDMF that `convert` has written each rank
    reads its share; other files are read on rank 0.

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
    file = Path(path)
    if on_root(comm, lambda: _is_converted(file)):
        return _read_share(comm, file)
    return _from_rank_0(comm, lambda: _read(file, file.suffix.lower()), f"mesh file {path}")


def convert(file: Path, to: Path) -> Domain:
    """Write a mesh file as new .xdmf and .h5 files, of which ranks read shares. On one rank."""
    domain = from_file(MPI.COMM_SELF, file)
    write(domain, to)
    return domain


def write(domain: Domain, path: Path) -> None:
    """Write a mesh and its names to ``path``, a new .xdmf file, and an .h5 file. On one rank."""
    heavy = path.with_suffix(".h5")
    if path.suffix.lower() != ".xdmf":
        raise InputError(
            f"{path}: given another ending; accepted: a name that ends with .xdmf", "xdmf-files"
        )
    for file in (path, heavy):
        if file.exists():
            raise InputError(f"{file}: it is there already; accepted: another name", "file-name")
    names: dict[str, Any] = {key: getattr(domain, key) for key in ("unusable", "notes", "space")}
    names["inside"] = [*domain.inside]
    tags, facets = [], {**domain.parts, **domain.inside}
    kinds = ("parts", domain.dim - 1, facets), ("regions", domain.dim, domain.regions)
    for kind, dim, groups in kinds:
        count = domain.mesh.topology.index_map(dim).size_local
        labels, sets = combinations(count, groups.values())
        names[kind] = labels_of(groups, sets)
        tagged = np.flatnonzero(labels).astype(np.int32)
        tags.append(dmesh.meshtags(domain.mesh, dim, tagged, labels[tagged]))
        tags[-1].name = kind
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        made = Path(folder) / path.name
        with io.XDMFFile(domain.comm, str(made), "w") as store:
            store.write_information("contact", json.dumps(names))
            store.write_mesh(domain.mesh)
            for some in tags:
                store.write_meshtags(some, domain.mesh.geometry)
        made.with_suffix(".h5").rename(heavy)
        made.rename(path)


def _is_converted(path: Path) -> bool:
    """Tell whether `write` has made a file; refuse it without its arrays. On one rank."""
    if path.suffix.lower() != ".xdmf" or not path.is_file():
        return False
    with path.open(errors="replace") as file:
        if CONVERTED not in file.read(1000):
            return False
    import h5py

    heavy = path.with_suffix(".h5")
    try:
        h5py.File(heavy, "r", locking=False).close()
    except OSError as error:
        raise InputError(
            f"{heavy}: it is missing or damaged ({' '.join(str(error).split())}); accepted: "
            "the file that contact mesh has written beside its .xdmf file",
            "xdmf-files",
        ) from error
    return True


def _read_share(comm: MPI.Intracomm, path: Path) -> Domain:
    """Read this rank's share of a mesh that `write` has written. Collective."""
    with io.XDMFFile(comm, str(path), "r") as file:
        names = json.loads(file.read_information("contact"))
        mesh = file.read_mesh(ghost_mode=dmesh.GhostMode.none)
        exterior_facets(mesh)
        parts = _named(file.read_meshtags(mesh, "parts"), names["parts"], mesh)
        regions = _named(file.read_meshtags(mesh, "regions"), names["regions"], mesh)
    inside = {name: parts.pop(name) for name in names["inside"]}
    domain = with_names(mesh, parts, regions)
    kept = {key: names[key] for key in ("unusable", "space")}
    return replace(domain, notes=tuple(names["notes"]), inside=inside, **kept)


def _read(file: Path, ending: str) -> Contents:
    """Read a file in the format of an ending; any error of a library becomes one message."""
    if not file.is_file():
        raise InputError("no such file", "file-name")
    if ending not in FORMATS:
        raise InputError(f"no mesh file ends in {ending!r}; accepted: {ACCEPTED}", "mesh-file")
    program, read = FORMATS[ending]
    try:
        return read(file)
    except InputError:
        raise
    except Exception as error:
        said = " ".join(str(error).split()) or type(error).__name__
        said = f"not found: {said}" if isinstance(error, KeyError) else said
        said = "a set or a file contains itself" if isinstance(error, RecursionError) else said
        accepted = "" if "accepted:" in said else f"; accepted: {ACCEPTED}"
        words = f"the {program} reader says of it: {said}{accepted}"
        raise InputError(words, "mesh-file") from error


def from_generator(
    comm: MPI.Intracomm, name: str, cell: str | None = None, order: int = 1, **parameters: Any
) -> Domain:
    """Mesh the geometry of a generator of the package `meshes`, as `meshes.build`. Collective."""
    import meshes

    def build() -> Contents:
        with session() as gmsh:
            meshes.build(name, cell, order, **parameters)
            return model_contents(gmsh.model)

    return _from_rank_0(comm, build, f"mesh generator {name!r}")


def _from_rank_0(comm: MPI.Intracomm, load: Callable[[], Contents], source: str) -> Domain:
    """Check on rank 0 the contents that ``load`` returns there, and distribute them. Collective."""
    with on_all_ranks(comm):
        raw = None
        if comm.rank == 0:
            try:
                raw = check(load())
            except InputError as error:
                raise error.within(f"{source}: ") from None
            for note in raw.notes:
                logger.info("%s: %s", source, note)
    names = comm.bcast(None if raw is None else raw.without_rows())
    raw = raw or names
    dim = raw.points.shape[1]
    order = raw.shape.degree_of(raw.regions.rows.shape[1])
    element = basix.ufl.element("Lagrange", raw.shape.name, order, shape=(dim,), dtype=np.float64)
    mesh = dmesh.create_mesh(comm, cells=raw.regions.rows, x=raw.points, e=ufl.Mesh(element))
    exterior_facets(mesh)
    parts, regions = _sets(mesh, dim - 1, raw.parts), _sets(mesh, dim, raw.regions)
    inside = {name: parts.pop(name) for name in raw.inside}
    unusable = {name: f"{source}: {reason}" for name, reason in raw.unusable.items()}
    more: dict[str, Any] = {"notes": raw.notes, "inside": inside, "space": raw.space}
    return replace(with_names(mesh, parts, regions), unusable=unusable, **more)


def _sets(mesh: dmesh.Mesh, dim: int, groups: Groups) -> dict[str, Indices]:
    """Return the owned cells or facets of each group. Collective."""
    vertices, labels = io.utils.distribute_entity_data(mesh, dim, groups.rows, groups.labels)
    mesh.topology.create_connectivity(dim, 0)
    tags = dmesh.meshtags_from_entities(
        mesh, dim, graph.adjacencylist(vertices), labels.astype(np.int32)
    )
    return _named(tags, labels_of(groups.names, groups.sets), mesh)


def _named(
    tags: dmesh.MeshTags, labels_of: Mapping[str, Sequence[int]], mesh: dmesh.Mesh
) -> dict[str, Indices]:
    """Return the owned entities with the labels of each name."""
    owned = tags.indices < mesh.topology.index_map(tags.dim).size_local
    indices, values = tags.indices[owned], tags.values[owned]
    return {name: indices[np.isin(values, labels)] for name, labels in labels_of.items()}
