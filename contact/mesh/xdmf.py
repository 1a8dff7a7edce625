"""XDMF files: a mesh, and tags of its cells and facets.

meshio reads files of one grid alone, and of mixed topologies those of first order. dolfinx writes
tags as grids of their own, behind the mesh whose nodes they share.

References
----------
XDMF Model and Format, https://www.xdmf.org/index.php/XDMF_Model_and_Format: numbers of cells in
mixed topologies.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from contact.mesh.extraction import Ints

#: First words of the names of topologies, and meshio's names of cells of first order.
KINDS = {
    "polyvertex": "vertex",
    "polyline": "line",
    "edge": "line",
    "triangle": "triangle",
    "tri": "triangle",
    "quadrilateral": "quad",
    "quad": "quad",
    "tetrahedron": "tetra",
    "tet": "tetra",
    "pyramid": "pyramid",
    "wedge": "wedge",
    "hexahedron": "hexahedron",
    "hex": "hexahedron",
}

#: Cells of mixed topologies by their number: meshio's names, and numbers of nodes.
MIXED = {
    1: ("vertex", 1),
    2: ("line", 2),
    4: ("triangle", 3),
    5: ("quad", 4),
    6: ("tetra", 4),
    7: ("pyramid", 5),
    8: ("wedge", 6),
    9: ("hexahedron", 8),
    34: ("line", 3),
    35: ("quad", 9),
    36: ("triangle", 6),
    37: ("quad", 8),
    38: ("tetra", 10),
    39: ("pyramid", 13),
    40: ("wedge", 15),
    48: ("hexahedron", 20),
    50: ("hexahedron", 27),
}

#: Those with the number of their nodes in front of these.
COUNTED = (1, 2)

#: Cells of a mixed topology that are looked at together.
WINDOW = 10_000

#: NumPy's letters of types of numbers.
TYPES = {"Int": "i", "UInt": "u", "Float": "f", "Char": "i", "UChar": "u"}

ACCEPTED = "accepted: one mesh, and tags of its cells and facets on the nodes of the mesh"


def read(file: Path) -> Any:
    """Read an XDMF file as a mesh of meshio, whose cells have the names of those of first order.

    Raises
    ------
    ValueError
        For anything but one mesh with tags.
    Exception
        Of any kind, if it is damaged.
    """
    import meshio

    root = ElementTree.parse(file).getroot()
    grids = [grid for grid in root.iter("Grid") if grid.find("Topology/DataItem") is not None]
    given = [item for grid in grids if (item := grid.find("Geometry/DataItem")) is not None]
    if not given:
        raise ValueError(f"it has no mesh; {ACCEPTED}")
    points, *others = (_array(item, root, file) for item in given)
    if any(not np.array_equal(points, other) for other in others):
        raise ValueError(f"it has several meshes; {ACCEPTED}")
    blocks: list[tuple[str, Ints]] = []
    on_cells: dict[str, dict[int, Any]] = {}
    on_nodes: dict[str, Any] = {}
    for grid in grids:
        own = _blocks(grid, root, file)
        at = [_among(blocks[:1], *block) for block in own]
        numbers = [0 if k is not None else len(blocks) + i for i, k in enumerate(at)]
        for name, on, values in _attributes(grid, root, file):
            if on == "Node" and len(values) == len(points):
                on_nodes[name] = values
            elif on == "Cell" and len(values) == sum(len(rows) for _, rows in own):
                pieces = np.split(values, np.cumsum([len(rows) for _, rows in own])[:-1])
                for number, place, piece in zip(numbers, at, pieces, strict=True):
                    every = piece
                    if place is not None:  # some cells of the mesh: 0 elsewhere
                        every = np.zeros(len(blocks[0][1]), dtype=piece.dtype)
                        every[place] = piece
                    on_cells.setdefault(name, {})[number] = every
        blocks += [block for block, place in zip(own, at, strict=True) if place is None]
    data = {
        name: [found.get(b, np.zeros(len(rows), dtype=int)) for b, (_, rows) in enumerate(blocks)]
        for name, found in on_cells.items()
    }
    return meshio.Mesh(points, blocks, point_data=on_nodes, cell_data=data)


def _among(mesh: list[tuple[str, Ints]], name: str, rows: Ints) -> Ints | None:
    """Return where cells are among those of the mesh, its first block; None if they are not."""
    if not mesh or (mesh[0][0], mesh[0][1].shape[1]) != (name, rows.shape[1]):
        return None
    count = len(mesh[0][1])
    both = np.sort(np.concatenate([mesh[0][1], rows]), axis=1)
    number = np.unique(both, axis=0, return_inverse=True)[1].ravel()
    place = np.full(len(both), -1)
    place[number[:count]] = np.arange(count)
    found = place[number[count:]]
    return found if np.all(found >= 0) else None


def _attributes(grid: Element, root: Element, file: Path) -> list[tuple[str, str, Any]]:
    """Return the scalar arrays of a grid: name, "Node" or "Cell", values."""
    found = []
    for given in grid.iter("Attribute"):
        item = given.find("DataItem")
        if item is not None:
            values = _array(item, root, file)
            if values.size == len(values):
                on = given.get("Center", "Node")
                found.append((given.get("Name", ""), on, values.reshape(-1)))
    return found


def _blocks(grid: Element, root: Element, file: Path) -> list[tuple[str, Ints]]:
    """Return the cells of a grid: meshio's names, and nodes."""
    topology = next(grid.iter("Topology"))
    given = topology.get("TopologyType") or topology.get("Type") or ""
    rows = _array(next(topology.iter("DataItem")), root, file).astype(np.int64)
    if given == "Mixed":
        return _mixed(rows.ravel())
    name = KINDS.get(given.split("_")[0].lower())
    if name is None or rows.ndim != 2:
        raise ValueError(f"a topology {given!r}, which is not known")
    return [(name, rows)]


def _mixed(data: Ints) -> list[tuple[str, Ints]]:
    """Return the cells of a mixed topology: number of a kind, nodes, and so on."""
    runs: list[tuple[tuple[str, int], list[Ints]]] = []
    at = 0
    while at < len(data):
        number = int(data[at])
        if number not in MIXED:
            raise ValueError(f"cells of number {number} in a mixed topology, which are not known")
        nodes = MIXED[number][1]
        before = 1 + (number in COUNTED)
        width = before + nodes
        ahead = data[at : at + WINDOW * width]
        ahead = ahead[: len(ahead) // width * width].reshape(-1, width)
        alike = ahead[:, 0] == number
        count = len(alike) if alike.all() else int(alike.argmin())
        if not count or (before == 2 and np.any(ahead[:count, 1] != nodes)):
            raise ValueError("a mixed topology that is cut off, or lines of several points")
        if not runs or runs[-1][0] != MIXED[number]:
            runs.append((MIXED[number], []))
        runs[-1][1].append(ahead[:count, before:])
        at += count * width
    return [(name, np.concatenate(rows)) for (name, _), rows in runs]


def _array(item: Element, root: Element, file: Path) -> Any:
    """Return the array of a data item."""
    import h5py

    text = (item.text or "").strip()
    reference = item.get("Reference")
    if reference is not None:
        path = text if reference == "XML" else reference
        other = root.find("./" + "/".join(path.strip("/").split("/")[1:]))
        if other is None:
            raise ValueError(f"there is no {path!r}")
        return _array(other, root, file)
    kind = item.get("Format", "XML")
    if kind == "HDF":
        name, _, place = text.rpartition(":")
        with h5py.File(file.parent / name, "r") as data:
            return data[place][()]
    size = item.get("Precision", "1" if "Char" in item.get("NumberType", "") else "4")
    letter = TYPES[item.get("NumberType") or item.get("DataType") or "Float"]
    dtype = np.dtype(f"{letter}{size}")
    shape = [int(n) for n in item.get("Dimensions", "").split()]
    if kind == "Binary":
        return np.fromfile(file.parent / text, dtype=dtype).reshape(shape)
    if kind != "XML":
        raise ValueError(f"arrays of the format {kind!r}; accepted: HDF, XML, Binary")
    return np.array(text.split(), dtype=dtype).reshape(shape)
