"""The contents of a Gmsh model, or of a file of another format, as plain arrays; checked elsewhere.

Gmsh crashes on some damaged files, or takes the memory of the machine for a wrong count: a
checker of the headers would have to know the reader of each format and version, so files are
read by a process of their own, ``python3 -m contact.mesh.extraction FILE OUT SWITCH`` or
``python3 -m contact.mesh.formats FILE OUT``.
"""

import json
import os
import resource
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from contact.mesh.cells import CUT, SHAPES, as_simplices, simplices

Ints = npt.NDArray[np.int64]

#: Endings of the names of files that are not Gmsh's, and their formats.
OTHERS = {
    ".inp": "Abaqus",
    ".vtu": "VTK",
    ".xdmf": "XDMF",
    ".med": "MED",
    ".rmed": "MED",
    ".e": "Exodus",
    ".ex2": "Exodus",
    ".exo": "Exodus",
}

#: The region of a mesh whose cells nothing tells apart.
BODY = "body"

#: Memory that reading a file may take: at least, and bytes for each byte of the file. A node or
#: an element takes some 20 bytes of a file and at most 10 times that in Gmsh and here.
LEAST_MEMORY, MEMORY_A_BYTE = 4 << 30, 100


#: Arrays of a `Model` besides its groups.
ARRAYS = ("tags", "points", "places", "cells")


@dataclass(frozen=True)
class Model:
    """The contents of a Gmsh model, or of another file.

    Attributes
    ----------
    kinds
        Name, dimension and order of each type of elements, as Gmsh has them.
    tags, points
        Nodes: their tags, shape (n,), and coordinates, shape (n, 3).
    places
        The nodes of a cell in the reference cell, corners first, shape (k, d).
    cells
        Cells of the first type of the largest dimension d by their nodes' tags, shape (m, k).
    regions, parts
        Groups of cells, likewise, and of facets by the tags of their corners, by name.
    notes
        Other contents of the file, one sentence each.
    space
        Keys of a case's ``[space]`` for which its elements were made: degree, kinematics.
    """

    kinds: list[tuple[str, int, int]]
    tags: Ints
    points: npt.NDArray[np.float64]
    places: npt.NDArray[np.float64]
    cells: Ints
    regions: dict[str, Ints]
    parts: dict[str, Ints]
    notes: tuple[str, ...] = ()
    space: Mapping[str, int | str] = field(default_factory=dict)

    @property
    def dim(self) -> int:
        """Largest dimension of an element, -1 without any."""
        return max((dim for _, dim, _ in self.kinds), default=-1)

    def save(self, path: Path) -> None:
        """Write the arrays to a file."""
        names = {
            "kinds": self.kinds,
            "regions": [*self.regions],
            "parts": [*self.parts],
            "notes": self.notes,
            "space": self.space,
        }
        groups = [*self.regions.values(), *self.parts.values()]
        arrays: dict[str, Any] = {f"group {i}": group for i, group in enumerate(groups)}
        arrays |= {name: getattr(self, name) for name in ARRAYS}
        np.savez(path, names=np.array(json.dumps(names)), **arrays)

    @classmethod
    def load(cls, path: Path) -> "Model":
        """Read the file of `save`."""
        with np.load(path, allow_pickle=False) as arrays:
            names = json.loads(str(arrays["names"]))
            groups = iter([arrays[f"group {i}"] for i in range(len(arrays) - len(ARRAYS) - 1)])
            nodes = [arrays[name] for name in ARRAYS]
        regions, parts = ({name: next(groups) for name in names[k]} for k in ("regions", "parts"))
        kinds = [tuple(kind) for kind in names["kinds"]]
        tags, points, places, cells = nodes
        said = tuple(names["notes"]), names["space"]
        return cls(kinds, tags, points, places, cells, regions, parts, *said)


@dataclass
class Contents:
    """The contents of a file that has no groups but sets, elements and nodes in VTK's order.

    Attributes
    ----------
    points
        Coordinates of the nodes, shape (n, 3).
    blocks
        Name of a shape, as meshio has it, and elements by their nodes, in VTK's order.
    groups
        Name -> number of a block -> its elements in the group.
    nodes
        Name -> the nodes of a set.
    surfaces
        Name -> facets by their corners, around them.
    notes
        Its other contents, one sentence each.
    space
        As of a `Model`.
    """

    points: Any
    blocks: Sequence[tuple[str, Ints]]
    groups: dict[str, dict[int, Ints]] = field(default_factory=dict)
    nodes: dict[str, Ints] = field(default_factory=dict)
    surfaces: dict[str, Ints] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    space: dict[str, int | str] = field(default_factory=dict)


def letters(given: bytes) -> str:
    """Return a text of a file, in the letters of Western Europe (Latin-1) if it is not UTF-8."""
    try:
        return given.decode("utf-8-sig")
    except UnicodeDecodeError:
        return given.decode("latin-1")


def degree(kinds: Sequence[tuple[str, int, int]]) -> dict[str, int]:
    """Return the degree for which cells of some types were made, as a key of ``[space]``."""
    dim = max((of for _, of, _ in kinds), default=0)
    return {"degree": 2} if any(of == dim and order == 2 for _, of, order in kinds) else {}


def same_name(names: Sequence[str]) -> str:
    """Return the note on sets of nodes that are left out, as a surface has their name."""
    return f"sets left out, as a surface of other facets has their name: {', '.join(names)}"


def extract(model: Any, entities_are_groups: bool) -> Model:
    """Take nodes, simplices and groups out of `gmsh.model`.

    Parameters
    ----------
    entities_are_groups
        Whether the model's entities are the groups themselves.
    """
    kinds = [model.mesh.getElementProperties(t)[:3] for t in model.mesh.getElementTypes()]
    tags, xyz, _ = model.mesh.getNodes()
    nodes = tags.astype(np.int64), xyz.reshape(-1, 3)
    dim = max((kind[1] for kind in kinds), default=-1)
    dim = max(dim, 1)
    properties = model.mesh.getElementProperties
    cells, facets = (
        {t: CUT.get(properties(t)[0].split()[0], 0) for t in model.mesh.getElementTypes(of)}
        for of in (dim, dim - 1)
    )
    first = properties(next(iter(cells))) if cells else None
    shape = next((s for s in SHAPES if first and s.name == first[0].split()[0].lower()), None)
    notes: tuple[str, ...] = ()
    space, cut = degree(kinds), as_simplices(kinds)
    if cut is not None:
        shape, kinds, note = cut
        places, notes = shape.nodes(1), (note,)
    elif first is None or shape is None:
        return Model(kinds, *nodes, np.empty((0, dim)), np.empty((0, 1), dtype=np.int64), {}, {})
    else:
        local = np.array(first[4], dtype=np.float64).reshape(-1, dim)
        # Gmsh's quadrilaterals and hexahedra go from -1 to 1.
        low = local.min(axis=0)
        places = (local - low) / (local.max(axis=0) - low)
        cells = {next(iter(cells)): len(places)}
        facets = {t: count for t, count in facets.items() if count == shape.facet.corners}
    whole, sides = ((of, kept, cut is not None) for of, kept in ((dim, cells), (dim - 1, facets)))
    return Model(
        kinds,
        *nodes,
        places,
        _elements(model, *whole, [-1]),
        _groups(model, *whole, entities_are_groups),
        _groups(model, *sides, entities_are_groups),
        notes,
        space,
    )


def _groups(
    model: Any, dim: int, types: Mapping[int, int], cut: bool, entities_are_groups: bool
) -> dict[str, Ints]:
    """Elements of each physical group of a dimension; one without a name goes by its number."""
    if entities_are_groups:
        found = [(tag, [tag]) for _, tag in model.getEntities(dim) if tag != 0]
    else:
        found = [
            (tag, model.getEntitiesForPhysicalGroup(dim, tag).tolist())
            for _, tag in model.getPhysicalGroups(dim)
        ]
    entities: dict[str, list[int]] = {}
    for tag, members in found:
        entities.setdefault(model.getPhysicalName(dim, tag) or str(tag), []).extend(members)
    return {name: _elements(model, dim, types, cut, tags) for name, tags in entities.items()}


def _elements(
    model: Any, dim: int, types: Mapping[int, int], cut: bool, entities: list[int]
) -> Ints:
    """Tags of the first nodes of elements of some types, as many as each has, in some entities.

    Of the entity -1 they are all. They are cut into simplices, or have the same number of nodes.
    """
    columns = {dim + 1} if cut else {*types.values()}
    found = [np.empty((0, *columns), dtype=np.int64)] if types else []
    for kind, count in types.items():
        every = model.mesh.getElementProperties(kind)[3]
        nodes = [model.mesh.getElementsByType(kind, entity)[1] for entity in entities]
        rows = np.concatenate(nodes).astype(np.int64).reshape(-1, every)[:, :count]
        found.append(simplices(rows, dim).reshape(-1, dim + 1) if cut else rows)
    return np.concatenate(found) if found else np.empty((0, 1), dtype=np.int64)


def _read(file: Path, switch: bool) -> Model:
    """Read a mesh file with Gmsh."""
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    # Gmsh's errors come as exceptions.
    gmsh.option.setNumber("General.Terminal", 0)
    # Format 2 names the group of each element, but Gmsh keeps one set of groups an entity. With
    # the two tags of an element switched, the entities are the groups.
    gmsh.option.setNumber("Mesh.SwitchElementTags", switch)
    gmsh.merge(str(file))
    return extract(gmsh.model, switch)


def run(read: Callable[[Path], Model], file: str, out: str) -> None:
    """Read a mesh file and write its arrays, or print its fault; end the process."""
    try:
        size = LEAST_MEMORY + MEMORY_A_BYTE * Path(file).stat().st_size
        hard = resource.getrlimit(resource.RLIMIT_AS)[1]
        if hard == resource.RLIM_INFINITY or size < hard:
            resource.setrlimit(resource.RLIMIT_AS, (size, hard))
        read(Path(file)).save(Path(out))
    except Exception as error:
        # That of a missing key is the key alone.
        missing = isinstance(error, KeyError) and error.args
        print(f"not found: {error.args[0]}" if missing else str(error) or type(error).__name__)
    sys.stdout.flush()
    # Whatever a damaged file has done to Gmsh's memory, nothing of it is freed.
    os._exit(0)


if __name__ == "__main__":
    run(lambda file: _read(file, sys.argv[3] == "switch"), *sys.argv[1:3])
