"""Mesh files of other programs: by meshio, or by readers of their own where it knows too little.

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
from scipy.optimize import linear_sum_assignment

from contact.mesh import abaqus, exodus, med, xdmf
from contact.mesh.cells import (
    CUT,
    INTERVAL,
    SHAPES,
    Kind,
    Shape,
    as_simplices,
    distinct,
    once,
    proper,
    simplices,
    together,
)
from contact.mesh.extraction import (
    BODY,
    OTHERS,
    Contents,
    Ints,
    Model,
    degree,
    run,
    same_name,
)
from contact.typing import Array

#: Readers that know more of a program's files than meshio.
OWN = {"Abaqus": abaqus.read, "MED": med.read, "Exodus": exodus.read}

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
    if program == "XDMF":
        return model_of(_contents(xdmf.read(file)))
    import meshio

    return model_of(_contents(meshio.vtu.read(file)))


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
    if any(
        r.size and not 0 <= r.min() <= r.max() < len(contents.points) for _, r in contents.blocks
    ):
        raise ValueError("it has elements whose nodes it does not have")
    kinds = list(dict.fromkeys(kind for kind, _ in known if kind[1] > 0))
    cut = as_simplices(kinds, _collapsed(contents, [kind for kind, _ in known]))
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
    # The nodes of a cell, and the corners in the order of the shape among them, in VTK's order.
    count = blocks[whole[0]].shape[1]
    order = shape.vtk(1 if count == shape.corners else 2)[1][:count]
    corners = [order.index(corner) for corner in range(shape.corners)]
    places = shape.nodes(1 if count == shape.corners else 2)[list(order)]
    for b in whole:
        blocks[b] = _middles_in_order(shape, contents.points, blocks[b])
    every = np.concatenate([blocks[b] for b in whole])
    cells, notes = distinct(every), list(contents.notes)
    if twice := len(every) - len(cells):
        notes.append(f"{twice} cell(s) that stand twice in it count once")
    of = shape.facet.corners
    parts = {k: v if len(v) else np.zeros((0, of), int) for k, v in contents.surfaces.items()}
    regions, left = {}, []
    for name, members in contents.groups.items():
        inside = [blocks[b][members[b]] for b in whole if b in members]
        if sum(map(len, inside)):
            regions[name] = np.concatenate(inside)
        sides = [
            blocks[b][rows][:, : shape.facet.corners]
            for b, rows in members.items()
            if known[b][1] == shape.facet and len(rows)
        ]
        if sides and not _added(parts, name, np.concatenate(sides)):
            left.append(name)
    if regions and len(distinct(np.concatenate([*regions.values()]))) < len(cells):
        regions[BODY] = cells
    # Facets of one cell alone, by their corners, around them.
    facets = cells[:, corners][:, shape.facet_corners[:, shape.facet.around]]
    outside, without = once(facets.reshape(-1, facets.shape[2])), list[str]()
    for name, nodes in contents.nodes.items():
        found = outside[np.isin(outside, nodes).all(axis=1)]
        if not len(found):
            without.append(name)
        elif not _added(parts, name, found):
            left.append(name)
    if left:
        notes.append(same_name(left))
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
        degree(kinds) | contents.space,
    )


def _added(parts: dict[str, Ints], name: str, facets: Ints) -> bool:
    """Add a part unless another has its name; tell whether all of its facets are there then."""
    there = parts.setdefault(name, facets)
    return len(distinct(np.concatenate([there, facets]))) == len(distinct(there))


def _collapsed(contents: Contents, kinds: Sequence[Kind]) -> int:
    """Return the number of cells that are no simplices and have a node at several corners."""
    dim = max((of for _, of, _ in kinds), default=0)
    count = 0
    for (kind, of, _), (_, nodes) in zip(kinds, contents.blocks, strict=True):
        corners = CUT.get(kind.split()[0], 0)
        if of == dim and corners > dim + 1:
            count += int(np.count_nonzero(~proper(nodes[:, :corners])))
    return count


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
    blocks: list[tuple[str, Ints]] = list(contents.blocks)
    groups: dict[str, dict[int, Ints]] = {name: {} for name in contents.groups}
    for b, ((kind, of, _), (_, nodes)) in enumerate(zip(kinds, contents.blocks, strict=True)):
        count = np.ones(len(nodes), dtype=np.int64)
        if of >= dim - 1:
            made = simplices(nodes[:, : CUT[kind.split()[0]]], of)
            # Those of no volume are no part of a cell that has collapsed; no simplex may have.
            full = proper(made.reshape(-1, of + 1)).reshape(made.shape[:2]) | (made.shape[1] == 1)
            count = full.sum(axis=1)
            if of == dim and not count.all():
                raise ValueError(f"it has {np.sum(count == 0)} cell(s) of zero volume")
            blocks[b] = {1: "line", 2: "triangle", 3: "tetra"}[of], made[full]
        for name, members in contents.groups.items():
            if b in members:
                chosen = np.zeros(len(nodes), dtype=bool)
                chosen[members[b]] = True
                groups[name][b] = np.flatnonzero(np.repeat(chosen, count))
    surfaces = {
        name: together([simplices(faces, dim - 1).reshape(-1, dim)]) if len(faces) else faces
        for name, faces in contents.surfaces.items()
    }
    notes, space = [*contents.notes, note], degree(kinds) | contents.space
    return Contents(contents.points, blocks, groups, contents.nodes, surfaces, notes, space)


def _kind(name: str, nodes: int) -> tuple[Kind, Shape | None]:
    """Return name, dimension and order as Gmsh has them, and the shape if it is one of ours."""
    stem = name.rstrip("0123456789")
    word = NAMES.get(stem, stem)
    shape = next((s for s in (INTERVAL, *SHAPES) if s.name == word), None)
    label = "Line" if shape == INTERVAL else word.capitalize()
    if label not in CUT:
        return (name, 0 if stem == "vertex" else 3, 1), None
    return (f"{label} {nodes}", shape.dim if shape else 3, 1 if nodes == CUT[label] else 2), shape


def _middles_in_order(shape: Shape, points: Array, rows: Ints) -> Ints:
    """Return cells whose nodes between corners are in VTK's order.

    Programs number them in ways of their own: of hexahedra Exodus has the upright edges in front
    of the upper ones, Abaqus the middle in front of the faces, MED the lower face first. A file
    has one order; it is the one in which the nodes are nearest to the places of straight edges,
    and then to those within faces and the cell that the edges tell: an assignment problem.
    """
    if rows.shape[1] == shape.corners or not len(rows):
        return rows
    ordered = rows.copy()
    columns = np.argsort(shape.vtk(2)[1])  # of the shape's nodes
    edges = shape.corners + np.arange(len(shape.edges))
    straight = np.zeros((len(edges), len(columns)))
    straight[:, : shape.corners] = shape.lagrange(1, shape.nodes(2)[edges])
    expected = [(edges, straight)]
    if shape.serendipity and rows.shape[1] == len(columns):
        inner, _, told = map(list, zip(*shape.serendipity, strict=True))
        expected.append((np.concatenate(inner), np.concatenate(told)))
    for nodes, weights in expected:
        known = columns[np.flatnonzero(np.any(weights != 0, axis=0))]
        at = points[ordered[:, known]]
        size = np.ptp(at, axis=1).max(axis=1)[:, None, None]
        middle = at.mean(axis=1, keepdims=True)
        places = weights[:, np.any(weights != 0, axis=0)] @ (at - middle) / size
        given = (points[ordered[:, columns[nodes]]] - middle) / size
        # The part of the squares of distances that depends on the order.
        costs = -np.einsum("cid,cjd->ij", places, given)
        ordered[:, columns[nodes]] = ordered[:, columns[nodes[linear_sum_assignment(costs)[1]]]]
    return ordered


if __name__ == "__main__":
    run(read, *sys.argv[1:3])
