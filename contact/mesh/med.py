"""MED files of Salome and code_aster: their groups of cells, facets and nodes.

Each cell and node is in a family, and a family in groups; family 0 is in none. Where all are in it
the array of families may be missing, which meshio's reader refuses.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from contact.mesh.contents import Contents, Ints, decoded

#: Names of elements in MED without their number of nodes, and in meshio.
KINDS = {"SE": "line", "TR": "triangle", "QU": "quad", "TE": "tetra", "T": "tetra"}
KINDS |= {"HE": "hexahedron", "H": "hexahedron", "PE": "wedge", "P": "wedge", "PY": "pyramid"}


def read_med(file: Path) -> Contents:
    """Read a MED file of one mesh; raise errors of any kind if it is damaged."""
    import h5py

    with h5py.File(file, "r") as data:
        meshes = list(data["ENS_MAA"])
        if len(meshes) != 1:
            raise ValueError(f"{len(meshes)} meshes; accepted: one")
        whole = data["ENS_MAA"][meshes[0]]
        steps = [whole] if "NOE" in whole else [whole[step] for step in whole]
        if len(steps) != 1:
            raise ValueError(f"a mesh at {len(steps)} times; accepted: one")
        families = data.get(f"FAS/{meshes[0]}", whole.get("FAS", {}))
        return _contents(steps[0], int(whole.attrs["ESP"]), families)


def _contents(mesh: Any, dim: int, families: Any) -> Contents:
    """Return the contents of a mesh at a time."""
    coordinates = np.asarray(mesh["NOE/COO"][()], dtype=float).reshape(dim, -1).T
    points = np.zeros((len(coordinates), 3))
    points[:, :dim] = coordinates
    blocks: list[tuple[str, Ints]] = []
    made = Contents(points, blocks)
    named = _names(families.get("ELEME", {}))
    for kind, given in mesh["MAI"].items():
        if kind == "PO1":
            continue
        stem = kind.rstrip("0123456789")
        if stem not in KINDS:
            raise ValueError(f"elements {kind} that are not known")
        name, count = "pyramid" if kind == "P13" else KINDS[stem], int(kind[len(stem) :])
        rows = np.asarray(given["NOD"][()], dtype=np.int64).reshape(count, -1).T - 1
        for group, members in _groups(given, named).items():
            made.groups.setdefault(group, {})[len(blocks)] = members
        blocks.append((name, rows))
    made.nodes |= _groups(mesh["NOE"], _names(families.get("NOEUD", {})))
    return made


def _names(families: Any) -> dict[int, list[str]]:
    """Return the names of the groups of each family."""
    found = {}
    for family in families.values():
        none = np.zeros((0, 80), dtype=np.uint8)
        given = np.asarray(family["GRO/NOM"][()]).view(np.uint8) if "GRO" in family else none
        texts = [decoded(bytes(row).split(b"\0")[0]) for row in given]
        found[int(family.attrs["NUM"])] = [text.strip() for text in texts]
    return found


def _groups(given: Any, names: dict[int, list[str]]) -> dict[str, Ints]:
    """Return the members of each group among elements of a kind, or nodes."""
    found: dict[str, Ints] = {}
    numbers = np.asarray(given["FAM"][()]) if "FAM" in given else np.zeros(0, dtype=np.int64)
    for family in np.unique(numbers):
        members = np.flatnonzero(numbers == family)
        for name in names.get(int(family), []):
            found[name] = np.union1d(found.get(name, members), members)
    return found
