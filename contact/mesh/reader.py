"""Meshes from Gmsh: ``.msh`` files and recipes, with physical groups as parts.

Gmsh runs on rank 0 alone. What it finds is checked there, the verdict is broadcast, and
all ranks go on or raise together.
"""

import codecs
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import graph, io
from dolfinx import mesh as dmesh
from mpi4py import MPI

from contact.errors import InputError
from contact.mesh.domain import MAX_PARTS, Domain, exterior_facets, tagged
from contact.mesh.validity import Cells, check_cells, first_of_each

Ints = npt.NDArray[np.int64]

#: Byte order mark, with which some editors begin a file.
BOM = codecs.BOM_UTF8

#: Gmsh's element types of first order, by dimension.
SIMPLEX = {1: 1, 2: 2, 3: 4}
CELL_NAME = {2: "triangle", 3: "tetrahedron"}


def from_msh(comm: MPI.Intracomm, path: str | Path) -> Domain:
    """Read a Gmsh ``.msh`` file (formats 2.2 and 4.1). Collective.

    The parts are the physical groups of curves (plane meshes) or surfaces, by name; a group
    without a name goes by its number. Facets may belong to several groups. Plane meshes may
    be stored in any plane z = const.

    Raises
    ------
    InputError
        If the file is missing or no mesh, has no boundary groups, cells that are not
        straight-sided triangles or tetrahedra, degenerate or overlapping cells, or a group
        that is not part of the boundary. The message names the file.
    """

    def fill(gmsh: Any) -> bool:
        file = Path(path)
        version = _format(file)
        # Format 2 names the group of each element, but Gmsh keeps one set of groups an entity.
        # With the two tags of an element switched, the entities are the groups.
        switch = version < 4
        gmsh.option.setNumber("Mesh.SwitchElementTags", switch)
        try:
            with _plain_name(file) as plain:
                gmsh.merge(str(plain))
        finally:
            gmsh.option.setNumber("Mesh.SwitchElementTags", 0)
        return switch

    return _from_gmsh(comm, fill, f"mesh file {path}")


def _format(file: Path) -> int:
    """Return the major version of a mesh file's format.

    Gmsh takes a file for a mesh by how it begins, and anything else for a script, whose commands
    it executes: nothing may come before ``$MeshFormat``.
    """
    if not file.is_file():
        raise InputError("no such file")
    try:
        with file.open("rb") as stream:
            start = stream.read(200)
    except OSError as error:
        raise InputError(f"it cannot be read ({error.strerror})") from error
    found = re.match(rb"\$MeshFormat[ \t]*\r?\n\s*(2|4)(\.\d+)?[ \t]", start.removeprefix(BOM))
    if found is None:
        raise InputError("this is no Gmsh .msh file of format 2.2 or 4.1 (it begins otherwise)")
    return int(found[1])


@contextmanager
def _plain_name(file: Path) -> Iterator[Path]:
    """Yield a name by which Gmsh reads a file as what it begins with.

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


def from_recipe(comm: MPI.Intracomm, name: str, **parameters: Any) -> Domain:
    """Build a recipe of the package `meshes`, by name. Collective.

    Raises
    ------
    InputError
        For an unknown recipe or wrong parameters.
    """
    import meshes

    def fill(gmsh: Any) -> bool:
        meshes.build(name, **parameters)
        return False

    return _from_gmsh(comm, fill, f"mesh generator {name!r}")


def _from_gmsh(comm: MPI.Intracomm, fill: Callable[[Any], bool], what: str) -> Domain:
    """Fill a Gmsh model on rank 0, check it and distribute it."""
    raw, problem = None, None
    if comm.rank == 0:
        try:
            raw = _run_gmsh(fill)
        except InputError as error:
            problem = str(error)
        except Exception as error:
            # Gmsh's errors are of this very class; anything else is a fault of the program.
            if type(error) is not Exception:
                raise
            problem = f"Gmsh says: {error}"
    problem = comm.bcast(problem)
    if problem is not None:
        raise InputError(f"{what}: {problem}")
    dim, names = comm.bcast((raw.points.shape[1], raw.names) if raw is not None else None)
    if raw is None:
        raw = Cells(
            names,
            np.empty((0, dim)),
            np.empty((0, dim + 1), dtype=np.int64),
            np.empty((0, dim), dtype=np.int64),
            np.empty(0, dtype=np.int32),
        )
    return _distribute(comm, raw, dim)


def _distribute(comm: MPI.Intracomm, raw: Cells, dim: int) -> Domain:
    element = basix.ufl.element("Lagrange", CELL_NAME[dim], 1, shape=(dim,), dtype=np.float64)
    mesh = dmesh.create_mesh(comm, cells=raw.cells, x=raw.points, e=ufl.Mesh(element))
    facets = exterior_facets(mesh)
    vertices, values = io.utils.distribute_entity_data(mesh, dim - 1, raw.facets, raw.masks)
    tags = dmesh.meshtags_from_entities(
        mesh, dim - 1, graph.adjacencylist(vertices), values.astype(np.int32)
    )
    masks = np.zeros(facets.size, dtype=np.int32)
    kept = np.isin(tags.indices, facets)
    masks[np.searchsorted(facets, tags.indices[kept])] = tags.values[kept]
    return tagged(mesh, facets, {name: masks >> b & 1 == 1 for b, name in enumerate(raw.names)})


def _run_gmsh(fill: Callable[[Any], bool]) -> Cells:
    """Return the mesh of a model that ``fill`` makes, leaving a running Gmsh as it was.

    ``fill`` returns whether the model's entities are the groups themselves.
    """
    try:
        import gmsh
    except (ImportError, OSError) as error:  # OSError: one of its shared libraries is missing.
        raise InputError(f"the Python module gmsh is needed ({error})") from error
    started = not gmsh.isInitialized()
    if started:
        gmsh.initialize(readConfigFiles=False, interruptible=False)
    # Gmsh's own messages would mix with ours; its errors come as exceptions.
    terminal = gmsh.option.getNumber("General.Terminal")
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("contact")
    try:
        return _extract(gmsh.model, fill(gmsh))
    finally:
        gmsh.model.remove()
        gmsh.option.setNumber("General.Terminal", terminal)
        if started:
            gmsh.finalize()


def _extract(model: Any, entities_are_groups: bool) -> Cells:
    """Take points, cells and boundary groups out of a Gmsh model and check them."""
    kinds = [model.mesh.getElementProperties(t)[:4] for t in model.mesh.getElementTypes()]
    dim = max((kind[1] for kind in kinds), default=-1)
    if dim < 2:
        raise InputError(
            "it has no triangles or tetrahedra (Gmsh saves the elements of physical groups "
            "alone, if there are any: the body needs a physical group, too)"
        )
    for label, kind_dim, order, _ in kinds:
        if kind_dim == dim and label not in ("Triangle 3", "Tetrahedron 4"):
            why = "curved geometry" if order > 1 else "another shape"
            raise InputError(
                f"its cells include {label!r}, of {why}; accepted are straight-sided "
                "triangles or tetrahedra (Mesh.ElementOrder = 1, no recombination)"
            )
    tags, xyz, _ = model.mesh.getNodes()
    order_of_tags = np.argsort(tags)
    tags, xyz = tags[order_of_tags].astype(np.int64), xyz.reshape(-1, 3)[order_of_tags]

    bodies = _groups(model, dim, entities_are_groups)
    cells = _elements(model, dim, sorted({e for es in bodies.values() for e in es}) or [-1])
    cells = cells[first_of_each(np.sort(cells, axis=1))]
    used = np.unique(cells)
    points = xyz[np.searchsorted(tags, used)]
    cells = np.searchsorted(used, cells)

    by_name = _groups(model, dim - 1, entities_are_groups)
    what = "curves" if dim == 2 else "surfaces"
    if not by_name:
        raise InputError(f"it has no physical groups of {what}, so that no part has a name")
    if len(by_name) > MAX_PARTS:
        raise InputError(f"it has {len(by_name)} physical groups of {what}; at most {MAX_PARTS}")
    rows, bits = [], []
    for bit, (name, members) in enumerate(by_name.items()):
        facets = np.sort(_elements(model, dim - 1, members), axis=1)
        places = np.minimum(np.searchsorted(used, facets), used.size - 1)
        if np.any(used[places] != facets):
            raise InputError(f"the physical group {name!r} has facets that bound no cell")
        rows.append(places)
        bits.append(np.full(len(places), bit))
    return check_cells(
        list(by_name), _flatten(points, dim), cells, np.vstack(rows), np.hstack(bits)
    )


def _groups(model: Any, dim: int, entities_are_groups: bool) -> dict[str, list[int]]:
    """Name of each physical group of a dimension -> its entities."""
    if entities_are_groups:
        found = [(tag, [tag]) for _, tag in model.getEntities(dim) if tag != 0]
    else:
        found = [
            (tag, model.getEntitiesForPhysicalGroup(dim, tag).tolist())
            for _, tag in model.getPhysicalGroups(dim)
        ]
    groups: dict[str, list[int]] = {}
    for tag, entities in found:
        groups.setdefault(model.getPhysicalName(dim, tag) or str(tag), []).extend(entities)
    return groups


def _elements(model: Any, dim: int, entities: list[int]) -> Ints:
    """Node tags of the simplices of some entities (-1: of all), shape (m, dim + 1)."""
    nodes = [model.mesh.getElementsByType(SIMPLEX[dim], entity)[1] for entity in entities]
    return np.concatenate(nodes).astype(np.int64).reshape(-1, dim + 1)


def _flatten(points: npt.NDArray[np.float64], dim: int) -> npt.NDArray[np.float64]:
    extent = np.ptp(points, axis=0)
    if dim == 2 and extent[2] > 1e-9 * extent.max():
        raise InputError(
            "it is a surface in space; accepted are meshes of tetrahedra (the volume needs a "
            "physical group) and plane meshes with z = const"
        )
    return np.ascontiguousarray(points[:, :dim])
