"""VTK's XML files of unstructured grids (.vtu): written by all ranks together, read by one.

One piece whatever the number of ranks, the arrays in base64 where they belong: ParaView, pyvista
and meshio open it (which stumbles over arrays behind the header), and nothing but MPI is needed
to write it.
"""

from __future__ import annotations

import base64
import errno
import mmap
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.typing import Array

Values = NDArray[Any]

#: VTK's number of a kind of cells, by their dimension and their number of nodes.
KINDS = {(1, 2): 3, (1, 3): 21, (2, 3): 5, (2, 6): 22, (3, 4): 10, (3, 10): 24}
#: Where VTK has the nodes of cells of degree 2, in dolfinx's numbering.
ORDER = {
    (1, 3): [0, 1, 2],
    (2, 6): [0, 1, 2, 5, 3, 4],
    (3, 10): [0, 1, 2, 3, 9, 6, 8, 7, 5, 4],
}
_TYPES = {"f8": "Float64", "i8": "Int64", "i4": "Int32", "u1": "UInt8"}
_ARRAY = re.compile(
    rb'<DataArray type="(\w+)" Name="(\w+)"(?: NumberOfComponents="(\d+)")? format="binary">\n'
)
#: Bytes before an array that say how many follow.
_HEAD = 8


@dataclass(frozen=True)
class Grid:
    """Simplices, or this rank's share of them.

    Attributes
    ----------
    points
        Coordinates of the nodes, shape (n, d).
    cells
        Nodes of each cell in dolfinx's order, numbered over all ranks, shape (m, nodes a cell).
    dimension
        Of the cells.
    """

    points: Array
    cells: NDArray[np.int64]
    dimension: int

    @property
    def corners(self) -> NDArray[np.int64]:
        """The corners of the cells, shape (m, dimension + 1)."""
        return self.cells[:, : self.dimension + 1]


@dataclass(frozen=True)
class VTU:
    """What a file holds, or this rank's share of it.

    Attributes
    ----------
    grid
        The grid; the nodes of the ranks are numbered one rank after the other.
    at_points, in_cells
        Fields by name, one row a node or cell.
    """

    grid: Grid
    at_points: Mapping[str, Values]
    in_cells: Mapping[str, Values]


def gathered(comm: MPI.Intracomm, share: VTU) -> VTU | None:
    """Return the shares of all ranks together on rank 0, None elsewhere. Collective."""

    def together(values: Values) -> Values:
        found = comm.gather(values)
        return values if found is None else np.concatenate(found)

    points, cells = together(share.grid.points), together(share.grid.cells)
    at_points, in_cells = (
        {name: together(values) for name, values in fields.items()}
        for fields in (share.at_points, share.in_cells)
    )
    if comm.rank > 0:
        return None
    return VTU(Grid(points, cells, share.grid.dimension), at_points, in_cells)


def write_vtu(comm: MPI.Intracomm, path: Path, share: VTU) -> None:
    """Write a file. Collective.

    Parameters
    ----------
    comm
        The ranks that have shares.
    path
        The file.
    share
        This rank's share; vectors of the plane get a third component 0.

    Raises
    ------
    OSError
        On a rank where the file cannot be written; others may wait for it.
    """
    grid = share.grid
    n, m = (comm.allreduce(len(array), op=MPI.SUM) for array in (grid.points, grid.cells))
    points, cells = _arrays(comm, grid)
    groups = {
        "PointData": {name: _filled(values) for name, values in share.at_points.items()},
        "CellData": {name: _filled(values) for name, values in share.in_cells.items()},
        "Points": points,
        "Cells": cells,
    }
    content: list[str | Values] = [
        '<?xml version="1.0"?>\n'
        '<VTKFile type="UnstructuredGrid" version="1.0" byte_order="LittleEndian"'
        ' header_type="UInt64">\n'
        f'<UnstructuredGrid><Piece NumberOfPoints="{n}" NumberOfCells="{m}">\n'
    ]
    for group, arrays in groups.items():
        content.append(f"<{group}>\n")
        for name, values in arrays.items():
            kind = _TYPES[values.dtype.str[1:]]
            # meshio makes columns of what is said to have one.
            size = f' NumberOfComponents="{values.shape[1]}"' if values.ndim > 1 else ""
            content.append(f'<DataArray type="{kind}" Name="{name}"{size} format="binary">\n')
            content += [values, "\n</DataArray>\n"]
        content.append(f"</{group}>\n")
    content.append("</Piece></UnstructuredGrid></VTKFile>\n")
    try:
        _write(comm, path, content)
    except MPI.Exception as error:
        full = error.Get_error_class() in (MPI.ERR_NO_SPACE, MPI.ERR_QUOTA)
        number = errno.ENOSPC if full else errno.EIO
        raise OSError(number, os.strerror(number), str(path)) from error


def _arrays(comm: MPI.Intracomm, grid: Grid) -> tuple[dict[str, Values], dict[str, Values]]:
    """Return what VTK needs of a share of a grid."""
    points = np.zeros((len(grid.points), 3))
    points[:, : grid.points.shape[1]] = grid.points
    kind = (grid.dimension, grid.cells.shape[1])
    order = ORDER.get(kind, list(range(kind[1])))
    before = comm.exscan(len(grid.cells)) or 0
    ends = kind[1] * (before + 1 + np.arange(len(grid.cells), dtype=np.int64))
    return {"points": points}, {
        "connectivity": np.ascontiguousarray(grid.cells[:, order], dtype=np.int64).reshape(-1),
        "offsets": ends,
        "types": np.full(len(grid.cells), KINDS[kind], dtype=np.uint8),
    }


def _filled(values: Values) -> Values:
    """Return values with three components where they have two, as VTK has vectors."""
    values = values.astype(np.float64 if values.dtype.kind == "f" else np.int32, copy=False)
    if values.ndim == 2 and values.shape[1] == 2:
        values = np.column_stack([values, np.zeros(len(values))])
    return np.ascontiguousarray(values)


def _write(comm: MPI.Intracomm, path: Path, content: list[str | Values]) -> None:
    """Write texts, by rank 0, and arrays, each rank its rows."""
    file = MPI.File.Open(comm, str(path), MPI.MODE_CREATE | MPI.MODE_WRONLY)
    file.Set_size(0)
    place = 0
    for item in content:
        if isinstance(item, str):
            if comm.rank == 0:
                file.Write_at(place, item.encode())
            place += len(item)
        else:
            text, begin, size = _encoded(comm, item)
            file.Write_at_all(place + begin, text)
            place += size
    file.Close()


def _encoded(comm: MPI.Intracomm, values: Values) -> tuple[bytes, int, int]:
    """Return this rank's share of an array in base64, where it begins, and the length of all.

    Three bytes make four letters: a rank begins at the first whole three that is its own, and
    completes its last from the ranks behind it.
    """
    own = values.astype(values.dtype.newbyteorder("<"), copy=False).tobytes()
    size = comm.allreduce(len(own), op=MPI.SUM)
    if comm.rank == 0:
        own = size.to_bytes(_HEAD, "little") + own
    begin = comm.exscan(len(own)) or 0
    skipped, lacking = -begin % 3, -(begin + len(own)) % 3
    behind = b"".join(comm.allgather(own[:2])[comm.rank + 1 :])
    text = base64.b64encode(own[skipped:] + behind[:lacking]) if len(own) > skipped else b""
    return text, (begin + skipped) // 3 * 4, _letters(_HEAD + size)


def _letters(size: int) -> int:
    """Return how many letters of base64 some bytes make."""
    return -(-size // 3) * 4


def read_vtu(path: Path) -> VTU:
    """Read a file that `write_vtu` wrote. On one rank.

    Raises
    ------
    ValueError
        If the file is not one of ours.
    """
    arrays: dict[str, dict[str, Values]] = {}
    kinds = {vtk.encode(): kind for kind, vtk in _TYPES.items()}
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as text:
        for group in ("PointData", "CellData", "Points", "Cells"):
            begin, end = (text.find(f"<{sign}{group}>".encode()) for sign in ("", "/"))
            if not 0 <= begin < end:
                raise ValueError(f"it has no {group}")
            arrays[group] = {}
            while (match := _ARRAY.search(text, begin, end)) is not None:
                kind, components = np.dtype("<" + kinds[match[1]]), int(match[3] or 1)
                head = base64.b64decode(text[match.end() : match.end() + _letters(_HEAD)])
                size = int.from_bytes(head[:_HEAD], "little")
                begin = match.end() + _letters(_HEAD + size)
                values = np.frombuffer(base64.b64decode(text[match.end() : begin])[_HEAD:], kind)
                shaped = values if components == 1 else values.reshape(-1, components)
                arrays[group][match[2].decode()] = shaped
    cells = arrays["Cells"]
    (number,) = np.unique(cells["types"])
    (shape,) = (shape for shape, kind in KINDS.items() if kind == number)
    order = np.argsort(ORDER.get(shape, list(range(shape[1]))))
    nodes = cells["connectivity"].reshape(-1, shape[1])[:, order]
    grid = Grid(arrays["Points"]["points"], nodes, shape[0])
    return VTU(grid, arrays["PointData"], arrays["CellData"])
