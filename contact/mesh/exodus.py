"""Exodus files: their blocks, node sets and side sets.

meshio's reader drops side sets and names, and refuses elements of MOOSE, such as TET10, and node
sets without names.

References
----------
Schoof and Yarberry, EXODUS II: a finite element data model, Sandia report SAND92-2137 (1994),
tables of the nodes and the sides of elements.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from contact.mesh.cells import joined_facets
from contact.mesh.contents import Contents, Ints, decoded

#: Beginnings of the names of elements, and meshio's names without a number; "" for points.
KINDS = {
    "SPHERE": "",
    "BEAM": "line",
    "BAR": "line",
    "TRUSS": "line",
    "EDGE": "line",
    "TRI": "triangle",
    "QUAD": "quad",
    "SHELL": "quad",
    "TET": "tetra",
    "PYR": "pyramid",
    "WEDGE": "wedge",
    "HEX": "hexahedron",
}

#: Corners of the sides of elements, by meshio's names without a number.
SIDES = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quad": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetra": ((0, 1, 3), (1, 2, 3), (0, 3, 2), (0, 2, 1)),
    "pyramid": ((0, 1, 4), (1, 2, 4), (2, 3, 4), (0, 4, 3), (0, 3, 2, 1)),
    "wedge": ((0, 1, 4, 3), (1, 2, 5, 4), (0, 3, 5, 2), (0, 2, 1), (3, 4, 5)),
    "hexahedron": (
        (0, 1, 5, 4),
        (1, 2, 6, 5),
        (2, 3, 7, 6),
        (0, 4, 7, 3),
        (0, 3, 2, 1),
        (4, 5, 6, 7),
    ),
}

#: The first two sides of shells in 3-D, the whole cell; the others are edges, no facets of solids.
SHELLS = {"triangle": ((0, 1, 2), (0, 2, 1)), "quad": ((0, 1, 2, 3), (0, 3, 2, 1))}


def read_exodus(file: Path) -> Contents:
    """Read an Exodus file; raise errors of any kind if it is damaged."""
    import netCDF4

    with netCDF4.Dataset(str(file)) as data:
        data.set_auto_mask(False)
        points = np.zeros((len(data.dimensions["num_nodes"]), 3))
        if "coord" in data.variables:
            given = np.asarray(data.variables["coord"][:], dtype=float)
            points[:, : len(given)] = given.T
        else:
            for axis, name in enumerate(("coordx", "coordy", "coordz")):
                if name in data.variables:
                    points[:, axis] = data.variables[name][:]
        made = Contents(points, [])
        _add_blocks(data, made)
        _add_sets(data, made)
    return made


def _add_blocks(data: Any, made: Contents) -> None:
    """Add the elements, and each block as a group."""
    blocks: list[tuple[str, Ints]] = []
    for number, name in enumerate(_names(data, "eb", _count(data, "num_el_blk"))):
        if f"connect{number + 1}" not in data.variables:  # a block of no elements
            blocks.append(("vertex", np.zeros((0, 1), dtype=np.int64)))
            continue
        given = data.variables[f"connect{number + 1}"]
        rows = np.asarray(given[:], dtype=np.int64) - 1
        kind = str(given.elem_type).upper()
        known = [own for begins, own in KINDS.items() if kind.startswith(begins)]
        if not known:
            raise ValueError(f"elements {kind} that are not known")
        blocks.append((known[0] or "vertex", rows))
        made.groups.setdefault(name, {})[number] = np.arange(len(rows), dtype=np.int64)
    made.blocks = blocks


def _add_sets(data: Any, made: Contents) -> None:
    """Add node sets and side sets."""
    for number, name in enumerate(_names(data, "ns", _count(data, "num_node_sets")), 1):
        if f"node_ns{number}" in data.variables:
            chosen = np.asarray(data.variables[f"node_ns{number}"][:], dtype=np.int64) - 1
            made.nodes[name] = np.union1d(made.nodes.get(name, chosen), chosen)
    for number, name in enumerate(_names(data, "ss", _count(data, "num_side_sets")), 1):
        if f"elem_ss{number}" in data.variables:
            elements, sides = (
                np.asarray(data.variables[f"{of}_ss{number}"][:], dtype=np.int64) - 1
                for of in ("elem", "side")
            )
            made.surfaces[name] = _facets(made, elements, sides)


def _count(data: Any, dimension: str) -> int:
    """Return a dimension of the file, 0 without it."""
    return len(data.dimensions[dimension]) if dimension in data.dimensions else 0


def _names(data: Any, kind: str, count: int) -> list[str]:
    """Return the names of blocks or sets; one without a name goes by its number."""
    numbers = data.variables.get(f"{kind}_prop1")
    names = data.variables.get(f"{kind}_names")
    found = []
    for k in range(count):
        said = b"" if names is None else b"".join(names[k])
        number = k + 1 if numbers is None else int(numbers[k])
        found.append(decoded(said.split(b"\0")[0]).strip() or str(number))
    return found


def _facets(contents: Contents, elements: Ints, sides: Ints) -> Ints:
    """Return the sides of elements by their corners."""
    found: list[Ints] = []
    tables, first = SIDES, 0
    if {name for name, _ in contents.blocks} & {"tetra", "pyramid", "wedge", "hexahedron"}:
        tables = SIDES | SHELLS
    for name, nodes in contents.blocks:
        here = (elements >= first) & (elements < first + len(nodes))
        table = tables.get(name, ())
        for side in np.unique(sides[here]):
            if side < len(table):
                rows = nodes[elements[here & (sides == side)] - first]
                found.append(rows[:, list(table[side])])
        first += len(nodes)
    return joined_facets(found)
