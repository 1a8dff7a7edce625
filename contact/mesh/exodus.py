"""Blocks and side sets of Exodus files, which meshio leaves out.

References
----------
Schoof and Yarberry, EXODUS II: a finite element data model, Sandia report SAND92-2137 (1994),
tables of the sides of elements.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from contact.mesh.cells import together
from contact.mesh.extraction import Contents, Ints

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


def add(file: Path, contents: Contents) -> None:
    """Add the blocks and the side sets of a file to its other contents."""
    import netCDF4

    with netCDF4.Dataset(str(file)) as data:
        data.set_auto_mask(False)
        for block, name in enumerate(_names(data, "eb", len(contents.blocks))):
            members = np.arange(len(contents.blocks[block][1]), dtype=np.int64)
            contents.groups.setdefault(name, {})[block] = members
        count = len(data.dimensions["num_side_sets"]) if "num_side_sets" in data.dimensions else 0
        for number, name in enumerate(_names(data, "ss", count), 1):
            if f"elem_ss{number}" in data.variables:
                elements = np.asarray(data.variables[f"elem_ss{number}"][:], dtype=np.int64) - 1
                sides = np.asarray(data.variables[f"side_ss{number}"][:], dtype=np.int64) - 1
                contents.surfaces[name] = _facets(contents, elements, sides)


def _names(data: Any, kind: str, count: int) -> list[str]:
    """Return the names of blocks or sets; one without a name goes by its number."""
    numbers = data.variables.get(f"{kind}_prop1")
    names = data.variables.get(f"{kind}_names")
    found = []
    for k in range(count):
        said = b"" if names is None else b"".join(names[k])
        number = k + 1 if numbers is None else int(numbers[k])
        found.append(said.split(b"\0")[0].decode(errors="replace").strip() or str(number))
    return found


def _facets(contents: Contents, elements: Ints, sides: Ints) -> Ints:
    """Return the sides of elements by their corners."""
    found: list[Ints] = []
    first = 0
    for name, nodes in contents.blocks:
        here = (elements >= first) & (elements < first + len(nodes))
        table = SIDES.get(name.rstrip("0123456789"))
        if here.any() and table is not None:
            rows = nodes[elements[here] - first]
            for side in np.unique(sides[here]):
                found.append(rows[sides[here] == side][:, list(table[side])])
        first += len(nodes)
    return together(found)
