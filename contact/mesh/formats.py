"""Mesh files of other programs: by meshio, or by readers of their own (`abaqus`, `med`).

Files are read by a process of their own, as by `contact.mesh.extraction`. Groups of elements, tags
of cells and sets of nodes become regions and parts.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from contact.mesh import abaqus, exodus, med
from contact.mesh.cells import CUT, INTERVAL, SHAPES, Kind, Shape, as_simplices, simplices
from contact.mesh.extraction import BODY, OTHERS, Contents, Ints, Model, run
from contact.typing import Array

#: Readers that know more of a program's files than meshio.
OWN = {"Abaqus": abaqus.read, "MED": med.read}

#: Arrays that hold tags of groups, and those of a program's own.
TAGS = {"gmsh:physical", "cell_tags", "point_tags", "medit:ref"}
INNER = {"gmsh:geometrical", "gmsh:bounding_entities", "GlobalElementId", "GlobalNodeId"}

#: Names of shapes of cells in other programs.
NAMES = {"line": "interval", "quad": "quadrilateral", "tetra": "tetrahedron", "wedge": "prism"}


def read(file: Path) -> Model:
    """Read a mesh file.

    Raises
    ------
    Exception
        Of any kind, if it is damaged.
    """
    program = OTHERS[file.suffix.lower()]
    if program in OWN:
        return model_of(OWN[program](file))
    import meshio

    contents = _contents(meshio.read(file))
    if program == "Exodus":
        exodus.add(file, contents)
    return model_of(contents)


def files(file: Path) -> list[Path]:
    """Return the files of which a mesh consists: its mesh file, and those that it refers to.

    Raises
    ------
    OSError
        If one cannot be read.
    ValueError
        If an input file of Abaqus includes one that is missing.
    """
    program = OTHERS.get(file.suffix.lower())
    if program == "Abaqus":
        return abaqus.included(file)
    return [file, *(_heavy(file) if program == "XDMF" else ())]


def _heavy(file: Path) -> list[Path]:
    """Return the files with the arrays of an XDMF file, each once."""
    names = []
    with suppress(ElementTree.ParseError):  # the reader says that it is damaged
        for _, item in ElementTree.iterparse(file):
            kind, text = item.get("Format"), (item.text or "").strip()
            if kind == "HDF":
                names.append(text.rpartition(":")[0])  # FILE:/PLACE
            elif kind == "Binary":
                names.append(text)
            item.clear()
    return [file.parent / name for name in dict.fromkeys(names)]


def _contents(mesh: Any) -> Contents:
    """Return the contents of a mesh of meshio."""
    points = np.zeros((len(mesh.points), 3))
    points[:, : mesh.points.shape[1]] = mesh.points
    blocks = [(block.type, np.asarray(block.data, dtype=np.int64)) for block in mesh.cells]
    made = Contents(points, blocks)
    for name, parts in mesh.cell_sets.items():
        given = (np.asarray([] if part is None else part, dtype=np.int64) for part in parts)
        made.groups[str(name)] = dict(enumerate(given))
    for key, arrays in mesh.cell_data.items():
        for name, members in _by_number(key, arrays):
            group = made.groups.setdefault(name, {})
            for block, rows in members.items():
                group[block] = np.union1d(group.get(block, rows), rows)
    made.nodes |= {str(k): np.asarray(v, dtype=np.int64) for k, v in mesh.point_sets.items()}
    for key, values in mesh.point_data.items():
        if np.asarray(values).dtype.kind in "iub" and np.ndim(values) == 1:
            for name, members in _by_number(key, [values]):
                found = made.nodes.get(name, np.zeros(0, dtype=np.int64))
                made.nodes[name] = np.union1d(found, members[0])
    return made


def _by_number(key: str, arrays: Sequence[Any]) -> Iterator[tuple[str, dict[int, Ints]]]:
    """Yield groups that arrays of whole numbers mark, block by block; 0 marks none.

    Parameters
    ----------
    key, arrays
        Name of the arrays, and one a block. The name of a group is its number, behind that of the
        array unless that is one for tags.
    """
    whole = [np.asarray(array) for array in arrays]
    if key in INNER or any(v.dtype.kind not in "iub" or v.ndim != 1 for v in whole):
        return
    several, names = key.split("-"), {}
    if len(several) > 1 and max(v.max(initial=0) for v in whole) == len(several) - 1:
        # Sets that meshio has written as one array: their names, and -1 for none.
        names, whole = dict(enumerate(several, 1)), [v + 1 for v in whole]
    before = "" if key in TAGS else f"{key} "
    for block, values in enumerate(whole):
        for number in np.unique(values[values > 0]).tolist():
            name = names.get(number, f"{before}{number}")
            yield name, {block: np.flatnonzero(values == number)}


def model_of(contents: Contents) -> Model:
    """Return the contents of a file as they are checked."""
    known = [_kind(name, nodes.shape[1]) for name, nodes in contents.blocks]
    kinds = list(dict.fromkeys(kind for kind, _ in known if kind[1] > 0))
    cut = as_simplices(kinds)
    if cut is not None:
        return model_of(_cut(contents, [kind for kind, _ in known], cut[2]))
    tags = np.arange(1, len(contents.points) + 1)
    dim = max((kind[1] for kind in kinds), default=-1)
    whole = [b for b, (kind, _) in enumerate(known) if kind[1] == dim]
    shape = known[whole[0]][1] if whole else None
    if shape is None or dim < 2 or len({known[b][0] for b in whole}) > 1:
        none = np.zeros((0, 1), dtype=np.int64)
        return Model(kinds, tags, contents.points, np.zeros((0, max(dim, 1))), none, {}, {})
    blocks = [nodes for _, nodes in contents.blocks]
    places = _places(shape, blocks[whole[0]].shape[1])
    for b in whole:
        blocks[b] = _middles_in_order(shape, contents.points, blocks[b])
    cells = np.concatenate([blocks[b] for b in whole])
    regions, parts = {}, dict(contents.surfaces)
    for name, members in contents.groups.items():
        inside = [blocks[b][members[b]] for b in whole if b in members]
        if sum(map(len, inside)):
            regions[name] = np.concatenate(inside)
        sides = [
            blocks[b][rows][:, : shape.facet.corners]
            for b, rows in members.items()
            if known[b][1] == shape.facet and len(rows)
        ]
        if sides and name not in parts:
            parts[name] = np.concatenate(sides)
    notes = list(contents.notes)
    if regions and len(np.unique(np.concatenate([*regions.values()]), axis=0)) < len(cells):
        regions[BODY] = cells
    outside, without = _exterior(shape, cells[:, _corners(shape)]), []
    for name, nodes in contents.nodes.items():
        found = outside[np.isin(outside, nodes).all(axis=1)]
        if len(found) and name not in parts:
            parts[name] = found
        elif not len(found):
            without.append(name)
    if without:
        notes.append(f"sets of nodes that hold no facet of the boundary: {', '.join(without)}")
    return Model(
        kinds,
        tags,
        contents.points,
        places,
        cells + 1,
        {name: rows + 1 for name, rows in regions.items()},
        {name: rows + 1 for name, rows in parts.items()},
        tuple(notes),
    )


def _cut(contents: Contents, kinds: Sequence[Kind], note: str) -> Contents:
    """Return the contents of a file with its cells and their facets cut into simplices.

    Parameters
    ----------
    contents, kinds
        The contents, and the kind of each block.
    note
        The sentence on it.
    """
    dim = max(of for _, of, _ in kinds)
    blocks, each = list(contents.blocks), np.ones(len(kinds), dtype=np.int64)
    for b, ((kind, of, _), (_, nodes)) in enumerate(zip(kinds, contents.blocks, strict=True)):
        if of >= dim - 1:
            made = simplices(nodes[:, : CUT[kind.split()[0]]], of)
            each[b] = made.shape[1]
            blocks[b] = {1: "line", 2: "triangle", 3: "tetra"}[of], made.reshape(-1, of + 1)
    groups = {
        name: {
            b: (rows[:, None] * each[b] + np.arange(each[b])).ravel() for b, rows in members.items()
        }
        for name, members in contents.groups.items()
    }
    surfaces = {
        name: simplices(faces, dim - 1).reshape(-1, dim) if len(faces) else faces
        for name, faces in contents.surfaces.items()
    }
    notes = [*contents.notes, note]
    return Contents(contents.points, blocks, groups, contents.nodes, surfaces, notes)


def _kind(name: str, nodes: int) -> tuple[Kind, Shape | None]:
    """Return name, dimension and order as Gmsh has them, and the shape if it is one of ours."""
    stem = name.rstrip("0123456789")
    word = NAMES.get(stem, stem)
    shape = next((s for s in (INTERVAL, *SHAPES) if s.name == word), None)
    label = "Line" if shape == INTERVAL else word.capitalize()
    if label not in CUT:
        return (name, 0 if stem == "vertex" else 3, 1), None
    return (f"{label} {nodes}", shape.dim if shape else 3, 1 if nodes == CUT[label] else 2), shape


def _places(shape: Shape, count: int) -> Any:
    """Return the nodes of a cell with so many of them, in VTK's order."""
    degree = 1 if count == shape.corners else 2
    return shape.nodes(degree)[list(shape.vtk(degree)[1])][:count]


def _middles_in_order(shape: Shape, points: Array, rows: Ints) -> Ints:
    """Return cells whose nodes within faces and the cell are in VTK's order.

    Programs number them in ways of their own: Abaqus has that of the cell first, MED the lower face
    first. They are those next to where the middles of the edges say that they are.
    """
    if shape.dim < 3 or rows.shape[1] != len(shape.nodes(2)) or not shape.serendipity:
        return rows
    columns = np.argsort(shape.vtk(2)[1])  # of the shape's nodes
    weights = np.concatenate([weights for _, _, weights in shape.serendipity])
    inner = columns[np.concatenate([nodes for nodes, _, _ in shape.serendipity])]
    expected, given = weights @ points[rows[:, columns]], points[rows[:, inner]]
    nearest = np.linalg.norm(expected[:, :, None] - given[:, None], axis=3).argmin(axis=2)
    ordered = rows.copy()
    ordered[:, inner] = np.take_along_axis(rows[:, inner], nearest, axis=1)
    each_once = np.all(np.sort(nearest, axis=1) == np.arange(len(inner)), axis=1)
    return np.where(each_once[:, None], ordered, rows)


def _corners(shape: Shape) -> list[int]:
    """Return the corners in the order of the shape, as nodes in VTK's order."""
    return [shape.vtk(1)[1].index(corner) for corner in range(shape.corners)]


def _exterior(shape: Shape, corners: Ints) -> Ints:
    """Return the facets of one cell alone, by their corners, around them."""
    facets = corners[:, shape.facet_corners[:, shape.facet.around]]
    return abaqus.once(facets.reshape(-1, facets.shape[2]))


if __name__ == "__main__":
    run(read, *sys.argv[1:3])
