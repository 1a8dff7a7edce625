"""The contents of a Gmsh model as plain arrays; checked elsewhere.

Gmsh crashes on some damaged files, or takes the memory of the machine for a wrong count: a
checker of the headers would have to know the reader of each format and version, so files are
read by a process of their own, ``python3 -m contact.mesh.extraction FILE SWITCH OUT``.
"""

import json
import os
import resource
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

Ints = npt.NDArray[np.int64]

#: Gmsh's element types of first order, by dimension.
SIMPLEX = {0: 15, 1: 1, 2: 2, 3: 4}


#: Memory that reading a file may take: at least, and bytes for each byte of the file. A node or
#: an element takes some 20 bytes of a file and at most 10 times that in Gmsh and here.
LEAST_MEMORY, MEMORY_A_BYTE = 4 << 30, 100


@dataclass(frozen=True)
class Model:
    """The contents of a Gmsh model.

    Attributes
    ----------
    kinds
        Name, dimension and order of each type of elements.
    tags, points
        Nodes: their tags, shape (n,), and coordinates, shape (n, 3).
    cells
        Simplices of the largest dimension d by their nodes' tags, shape (m, d + 1).
    regions, parts
        Physical groups of dimension d and d - 1: name -> their simplices likewise.
    """

    kinds: list[tuple[str, int, int]]
    tags: Ints
    points: npt.NDArray[np.float64]
    cells: Ints
    regions: dict[str, Ints]
    parts: dict[str, Ints]

    @property
    def dim(self) -> int:
        """Largest dimension of an element, -1 without any."""
        return max((dim for _, dim, _ in self.kinds), default=-1)

    def save(self, path: Path) -> None:
        """Write the arrays to a file."""
        names = {"kinds": self.kinds, "regions": [*self.regions], "parts": [*self.parts]}
        groups = [*self.regions.values(), *self.parts.values()]
        arrays: dict[str, Any] = {f"group {i}": group for i, group in enumerate(groups)}
        arrays |= {"tags": self.tags, "points": self.points, "cells": self.cells}
        np.savez(path, names=np.array(json.dumps(names)), **arrays)

    @classmethod
    def load(cls, path: Path) -> "Model":
        """Read the file of `save`."""
        with np.load(path, allow_pickle=False) as arrays:
            names = json.loads(str(arrays["names"]))
            groups = iter([arrays[f"group {i}"] for i in range(len(arrays) - 4)])
            nodes = arrays["tags"], arrays["points"], arrays["cells"]
        regions, parts = ({name: next(groups) for name in names[k]} for k in ("regions", "parts"))
        return cls([tuple(kind) for kind in names["kinds"]], *nodes, regions, parts)


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
    if dim < 1:
        return Model(kinds, *nodes, np.empty((0, 1), dtype=np.int64), {}, {})
    return Model(
        kinds,
        *nodes,
        _simplices(model, dim, [-1]),
        _groups(model, dim, entities_are_groups),
        _groups(model, dim - 1, entities_are_groups),
    )


def _groups(model: Any, dim: int, entities_are_groups: bool) -> dict[str, Ints]:
    """Simplices of each physical group of a dimension; one without a name goes by its number."""
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
    return {name: _simplices(model, dim, members) for name, members in entities.items()}


def _simplices(model: Any, dim: int, entities: list[int]) -> Ints:
    """Node tags of the simplices of some entities (-1: of all), shape (m, dim + 1)."""
    nodes = [model.mesh.getElementsByType(SIMPLEX[dim], entity)[1] for entity in entities]
    return np.concatenate(nodes).astype(np.int64).reshape(-1, dim + 1)


def _read(file: Path, switch: bool) -> Model:
    """Read a mesh file with Gmsh."""
    size = LEAST_MEMORY + MEMORY_A_BYTE * file.stat().st_size
    hard = resource.getrlimit(resource.RLIMIT_AS)[1]
    if hard == resource.RLIM_INFINITY or size < hard:
        resource.setrlimit(resource.RLIMIT_AS, (size, hard))
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    # Gmsh's errors come as exceptions.
    gmsh.option.setNumber("General.Terminal", 0)
    # Format 2 names the group of each element, but Gmsh keeps one set of groups an entity. With
    # the two tags of an element switched, the entities are the groups.
    gmsh.option.setNumber("Mesh.SwitchElementTags", switch)
    gmsh.merge(str(file))
    return extract(gmsh.model, switch)


def main(file: str, switch: str, out: str) -> None:
    """Read a mesh file and write its arrays, or print Gmsh's message."""
    try:
        _read(Path(file), switch == "switch").save(Path(out))
    except Exception as error:
        print(error)
    sys.stdout.flush()
    # Whatever a damaged file has done to Gmsh's memory, nothing of it is freed.
    os._exit(0)


if __name__ == "__main__":
    main(*sys.argv[1:])
