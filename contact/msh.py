"""Meshes from Gmsh: ``.msh`` files and recipes, with physical groups as parts.

Gmsh runs on rank 0 alone. What it finds is checked there, the verdict is broadcast, and
all ranks go on or raise together.
"""

import re
from collections.abc import Callable
from dataclasses import dataclass
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
from contact.parts import MAX_PARTS, Domain, exterior_facets, tagged

Ints = npt.NDArray[np.int64]

#: Gmsh's element types of first order, by dimension.
SIMPLEX = {1: 1, 2: 2, 3: 4}
CELL_NAME = {2: "triangle", 3: "tetrahedron"}

#: A cell is degenerate if its volume is below this times (longest edge)^d.
FLAT = 1e-10


@dataclass(frozen=True)
class _Raw:
    """A checked mesh: points (n, d), cells (m, d + 1), tagged facets (k, d) and their masks."""

    names: list[str]
    points: npt.NDArray[np.float64]
    cells: Ints
    facets: Ints
    masks: npt.NDArray[np.int32]


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
        if not file.is_file():
            raise InputError("no such file")
        try:
            with file.open("rb") as stream:
                start = stream.read(4096)
        except OSError as error:
            raise InputError(f"it cannot be read ({error.strerror})") from error
        version = re.search(rb"\$MeshFormat\s+(\d+)", start)
        if version is None:
            raise InputError("this is no Gmsh .msh file of format 2.2 or 4.1")
        # Format 2 names the group of each element, but Gmsh keeps one set of groups an entity.
        # With the two tags of an element switched, the entities are the groups.
        switch = version[1] < b"4"
        gmsh.option.setNumber("Mesh.SwitchElementTags", switch)
        try:
            gmsh.merge(str(file))
        finally:
            gmsh.option.setNumber("Mesh.SwitchElementTags", 0)
        return switch

    return _from_gmsh(comm, fill, f"mesh file {path}")


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
        raw = _Raw(
            names,
            np.empty((0, dim)),
            np.empty((0, dim + 1), dtype=np.int64),
            np.empty((0, dim), dtype=np.int64),
            np.empty(0, dtype=np.int32),
        )
    return _distribute(comm, raw, dim)


def _distribute(comm: MPI.Intracomm, raw: _Raw, dim: int) -> Domain:
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


def _run_gmsh(fill: Callable[[Any], bool]) -> _Raw:
    """Return the mesh of a model that ``fill`` makes, leaving a running Gmsh as it was.

    ``fill`` returns whether the model's entities are the groups themselves.
    """
    try:
        import gmsh
    except ImportError as error:
        raise InputError(f"the Python module gmsh is needed to read it ({error})") from error
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


def _extract(model: Any, entities_are_groups: bool) -> _Raw:
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
    cells = cells[_first_of_each(np.sort(cells, axis=1))]
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
    return _check(list(by_name), _flatten(points, dim), cells, np.vstack(rows), np.hstack(bits))


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


def _first_of_each(rows: Ints) -> Ints:
    """Index of the first occurrence of each distinct row, ascending."""
    return np.unique(_number(rows), return_index=True)[1]


def _number(rows: Ints) -> Ints:
    """Number the distinct rows; returns the number of each row, shape (n,)."""
    order = np.lexsort(rows.T)
    new = np.any(rows[order][1:] != rows[order][:-1], axis=1)
    number = np.empty(len(rows), dtype=np.int64)
    number[order] = np.concatenate([[0], np.cumsum(new)])[: len(rows)]
    return number


def _check(
    names: list[str], points: npt.NDArray[np.float64], cells: Ints, rows: Ints, bits: Ints
) -> _Raw:
    """Check cells and boundary groups; ``rows`` are sorted facets, ``bits`` their groups."""
    n = cells.shape[1]
    # Facet i of a cell lies opposite its vertex i.
    others = np.array([[j for j in range(n) if j != i] for i in range(n)])
    cell_facets = np.sort(cells[:, others], axis=2)
    corners = points[cell_facets]
    apex = points[cells]
    edges = np.concatenate([corners[:, :, 1:], apex[:, :, None]], axis=2) - corners[:, :, :1]
    volume = np.linalg.det(edges)
    longest = np.linalg.norm(edges, axis=-1).max(axis=(1, 2))
    flat = ~(np.abs(volume).min(axis=1) > FLAT * longest ** points.shape[1])
    if np.any(flat):
        middle = ", ".join(f"{v:g}" for v in points[cells[flat][0]].mean(axis=0))
        raise InputError(f"it has {flat.sum()} cell(s) of zero volume, the first near ({middle})")

    number = _number(np.vstack([cell_facets.reshape(-1, n - 1), rows]))
    inner, outer = number[: cells.size], number[cells.size :]
    total = int(number.max()) + 1
    count = np.bincount(inner, minlength=total)
    # Two cells that share a facet must lie on either side of it.
    side = np.bincount(inner, weights=np.sign(volume).ravel(), minlength=total)
    wrong = (count > 2) | ((count == 2) & (side != 0.0))
    if np.any(wrong):
        raise InputError(f"its cells overlap (inverted cells) at {wrong.sum()} facet(s)")
    for bit, name in enumerate(names):
        neighbours = count[outer[bits == bit]]
        if np.any(neighbours == 0):
            raise InputError(f"the physical group {name!r} has facets that bound no cell")
        if np.any(neighbours == 2):
            raise InputError(
                f"the physical group {name!r} has {np.count_nonzero(neighbours == 2)} interior "
                "facet(s); a part must lie on the boundary of the body"
            )
    masks = np.zeros(total, dtype=np.int32)
    np.bitwise_or.at(masks, outer, (1 << bits).astype(np.int32))
    first = np.unique(outer, return_index=True)[1]
    return _Raw(names, points, cells, rows[first], masks[outer[first]])
