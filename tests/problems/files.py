"""Mesh files as Abaqus, Salome and Exodus II have them, written from their contents."""

from collections.abc import Mapping, Sequence
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from contact.mesh.contents import Contents
from contact.typing import Array

#: Names of elements in .inp, .exo and .med by their number of nodes and dimension.
ELEMENTS = {
    (3, 2): ("CPE3", "TRI3", "TR3"),
    (6, 2): ("CPE6M", "TRI6", "TR6"),
    (4, 2): ("CPE4", "QUAD4", "QU4"),
    (8, 2): ("CPE8R", "QUAD8", "QU8"),
    (9, 2): ("CPE9", "QUAD9", "QU9"),
    (4, 3): ("C3D4", "TET4", "TE4"),
    (10, 3): ("C3D10", "TET10", "T10"),
    (5, 3): ("C3D5", "PYRAMID5", "PY5"),
    (13, 3): ("", "PYRAMID13", "P13"),
    (6, 3): ("C3D6", "WEDGE6", "PE6"),
    (15, 3): ("C3D15", "WEDGE15", "P15"),
    (8, 3): ("C3D8", "HEX8", "HE8"),
    (20, 3): ("C3D20R", "HEX20", "H20"),
    (27, 3): ("C3D27", "HEX27", "H27"),
}
ENDINGS = (".inp", ".exo", ".med")


def write(path: Path, contents: Contents) -> None:
    """Write contents in the format of the path's ending, without the surfaces of Abaqus."""
    {".inp": _write_abaqus, ".exo": _write_exodus, ".med": _write_med}[path.suffix](path, contents)


def names(contents: Contents, ending: str) -> list[str]:
    """Return the names of the elements of each block."""
    kinds = contents.kinds
    return [ELEMENTS[kind.nodes, kind.dim][ENDINGS.index(ending)] for kind in kinds]


def abaqus(contents: Contents, first_node: int = 1, first_element: int = 1) -> str:
    """Return nodes, elements and sets for Abaqus, numbered from those given."""
    lines, element, starts = ["*NODE"], first_element, []
    for k, x in enumerate(np.asarray(contents.points, dtype=float).tolist(), first_node):
        lines.append(", ".join(map(repr, [k, *x])))
    for name, (_, rows) in zip(names(contents, ".inp"), contents.blocks, strict=True):
        lines.append(f"*ELEMENT, TYPE={name}")
        for k, row in enumerate(rows, element):
            lines += _data([k, *(row + first_node)])
        starts.append(element)
        element += len(rows)
    for name, group in contents.groups.items():
        members = [rows + starts[block] for block, rows in group.items()]
        lines += [f"*ELSET, ELSET={name}", *_data(np.concatenate(members))]
    for name, nodes in contents.nodes.items():
        lines += [f"*NSET, NSET={name}", *_data(nodes + first_node)]
    return "\n".join(lines) + "\n"


def _data(numbers: Sequence[int] | Array) -> list[str]:
    """Return data lines of at most ten numbers; one that goes on ends with a comma."""
    pieces = [numbers[k : k + 10] for k in range(0, len(numbers), 10)]
    return ",\n".join(", ".join(map(str, piece)) for piece in pieces).split("\n")


def _write_abaqus(path: Path, contents: Contents) -> None:
    path.write_text(abaqus(contents))


def _write_exodus(path: Path, contents: Contents) -> None:
    """Write one block; the sets of nodes have the numbers 21, 22, ... and no names."""
    netcdf = pytest.importorskip("netCDF4")
    points, (kind,), ((_, rows),) = contents.points, contents.kinds, contents.blocks
    with netcdf.Dataset(str(path), "w", format="NETCDF3_64BIT_OFFSET") as data:
        sizes = {"num_dim": kind.dim, "num_nodes": len(points), "num_el_blk": 1}
        sizes |= {"cells": len(rows), "each": rows.shape[1]}
        for key, size in sizes.items():
            data.createDimension(key, size)
        for axis, letter in enumerate("xyz"[: kind.dim]):
            data.createVariable(f"coord{letter}", "f8", ("num_nodes",))[:] = points[:, axis]
        made = data.createVariable("connect1", "i4", ("cells", "each"))
        (made.elem_type,), made[:] = names(contents, ".exo"), rows + 1
        if contents.nodes:
            data.createDimension("num_node_sets", len(contents.nodes))
            numbers = data.createVariable("ns_prop1", "i4", ("num_node_sets",))
            numbers[:] = np.arange(len(contents.nodes)) + 21
        for k, (name, nodes) in enumerate(contents.nodes.items(), 1):
            data.createDimension(name, len(nodes))
            data.createVariable(f"node_ns{k}", "i4", (name,))[:] = nodes + 1


def add_side_sets(path: Path, sets: Mapping[int, Sequence[tuple[int, int]]]) -> None:
    """Add sets of sides of elements, by their numbers from 1, to a file of Exodus II."""
    netcdf = pytest.importorskip("netCDF4")
    with netcdf.Dataset(str(path), "a") as data:
        data.createDimension("num_side_sets", len(sets))
        data.createVariable("ss_prop1", "i4", ("num_side_sets",))[:] = list(sets)
        for k, sides in enumerate(sets.values(), 1):
            data.createDimension(f"num_side_ss{k}", len(sides))
            for kind, values in zip(("elem", "side"), np.transpose(sides), strict=True):
                data.createVariable(f"{kind}_ss{k}", "i4", (f"num_side_ss{k}",))[:] = values


def _write_med(path: Path, contents: Contents) -> None:
    """Write a family for each set of groups that entities have; a kind without any has no FAM.

    Names of groups have 80 letters, and FAMILLE_ZERO none.
    """
    h5py = pytest.importorskip("h5py")
    dim = max(kind.dim for kind in contents.kinds)
    with h5py.File(path, "w") as data:
        mesh = data.create_group("ENS_MAA/piece")
        mesh.attrs["ESP"] = mesh.attrs["DIM"] = dim
        step = mesh.create_group("-0000000000000000001-0000000000000000001")
        data.create_group("FAS/piece/FAMILLE_ZERO").attrs["NUM"] = 0
        families, unused = data["FAS/piece"], count(1)

        def add(place: str, rows: Array, kind: str, sets: Mapping[str, Array]) -> None:
            array = "COO" if kind == "NOEUD" else "NOD"
            step[f"{place}/{array}"] = rows.T.ravel()
            step[f"{place}/{array}"].attrs["NBR"] = len(rows)
            if not sets:
                return
            member = np.array([np.isin(np.arange(len(rows)), own) for own in sets.values()])
            several, number = np.unique(member, axis=1, return_inverse=True)
            values = np.zeros(several.shape[1], dtype=int)
            for k, column in enumerate(several.T):
                groups = [name for name, own in zip(sets, column, strict=True) if own]
                if groups:
                    values[k] = next(unused) * (1 if kind == "NOEUD" else -1)
                    family = families.create_group(f"{kind}/FAM_{values[k]}_{groups[0]}")
                    family.attrs["NUM"] = values[k]
                    letters = [list(group.encode().ljust(80, b"\0")) for group in groups]
                    family["GRO/NOM"] = np.array(letters, dtype=np.int8)
                    family["GRO"].attrs["NBR"] = len(groups)
            step[f"{place}/FAM"] = values[number.reshape(-1)]

        add("NOE", contents.points[:, :dim], "NOEUD", contents.nodes)
        for k, (name, (_, rows)) in enumerate(
            zip(names(contents, ".med"), contents.blocks, strict=True)
        ):
            groups = {name: group[k] for name, group in contents.groups.items() if k in group}
            add(f"MAI/{name}", rows + 1, "ELEME", groups)
