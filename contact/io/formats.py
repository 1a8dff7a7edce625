"""Tables as csv files; grids as VTK's XML files (.vtu), which ParaView, pyvista and meshio open.

A file is one whatever the number of ranks: the shares are gathered on rank 0, which writes. Those
of many nodes are in pieces, one of each rank.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from contact.mesh.owners import Owners
from contact.ranks import on_each, on_root
from contact.results.grid import Grid, Table, Values

#: Nodes of all ranks up to which a file lists them together; of more, a file a rank.
TOGETHER = 100_000


def gathered(comm: MPI.Intracomm, share: Grid) -> Grid | None:
    """Return the shares of all ranks together on rank 0, None elsewhere. Collective."""

    def together(values: Values) -> Values:
        found = comm.gather(values)
        return values if found is None else np.concatenate(found)

    whole = Grid(
        together(share.points),
        together(share.cells),
        share.shape,
        {name: together(values) for name, values in share.at_points.items()},
        {name: together(values) for name, values in share.in_cells.items()},
    )
    return whole if comm.rank == 0 else None


def write_vtu(path: Path, grid: Grid) -> None:
    """Write a file; vectors of the plane get a third component 0. On one rank.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    from vtkmodules.util.numpy_support import numpy_to_vtk, numpy_to_vtkIdTypeArray
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkUnstructuredGrid
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridWriter

    count = grid.cells.shape[1]
    kind, order = grid.shape.vtk(grid.shape.degree_of(count))
    points = np.zeros((len(grid.points), 3))
    points[:, : grid.points.shape[1]] = grid.points
    places, cells, made = vtkPoints(), vtkCellArray(), vtkUnstructuredGrid()
    places.SetData(numpy_to_vtk(points))
    nodes = np.ascontiguousarray(grid.cells[:, order], dtype=np.int64)
    ends = np.arange(0, nodes.size + 1, count, dtype=np.int64)
    cells.SetData(numpy_to_vtkIdTypeArray(ends), numpy_to_vtkIdTypeArray(nodes.ravel()))
    made.SetPoints(places)
    made.SetCells(kind, cells)
    for data, fields in (
        (made.GetPointData(), grid.at_points),
        (made.GetCellData(), grid.in_cells),
    ):
        for name, values in fields.items():
            array = numpy_to_vtk(_filled(values), deep=True)
            array.SetName(name)
            data.AddArray(array)
    writer = vtkXMLUnstructuredGridWriter()
    writer.SetInputData(made)
    writer.SetDataModeToBinary()
    writer.SetHeaderTypeToUInt64()
    writer.SetCompressorTypeToNone()
    writer.WriteToOutputStringOn()  # on a full disk VTK itself would crash
    writer.Write()
    path.write_text(writer.GetOutputString(), encoding="ascii")


def in_pieces(comm: MPI.Intracomm, nodes: int) -> bool:
    """Whether each rank writes its own share of as many nodes."""
    return comm.size > 1 and nodes > TOGETHER


def write_share(comm: MPI.Intracomm, share: Grid, path: Path, pieces: bool = False) -> Path:
    """Write a grid into a VTU file, or a piece of each rank; return the name of all. Collective."""
    if pieces:
        return _write_pieces(comm, path, _by_itself(comm, share))
    whole = gathered(comm, share)
    on_root(comm, lambda: None if whole is None else write_vtu(path, whole))
    return path


def _by_itself(comm: MPI.Intracomm, share: Grid) -> Grid:
    """Return a share with the points of other ranks that its cells have. Collective.

    Its cells are numbered by itself, and points have their numbers over all ranks as ``node``.
    """
    begins = np.append(0, np.cumsum(comm.allgather(len(share.points))))
    owners = Owners(comm, begins)
    nodes, cells = np.unique(share.cells, return_inverse=True)

    def at(values: Values) -> Values:
        return owners.values(nodes, lambda given: values[given - owners.begin])

    at_points = {name: at(values) for name, values in share.at_points.items()}
    return Grid(
        at(share.points),
        cells.reshape(share.cells.shape),
        share.shape,
        at_points | {"node": nodes},
        share.in_cells,
    )


def _write_pieces(comm: MPI.Intracomm, path: Path, grid: Grid) -> Path:
    """Write the share of each rank, and a file that names all, which is returned. Collective."""
    on_each(comm, lambda: write_vtu(piece(path, comm.rank), grid))
    fields = {
        kind: "".join(
            f'<PDataArray type="{"Float64" if array.dtype.kind == "f" else "Int32"}" '
            f'Name="{name}" NumberOfComponents="{array[0].size}"/>\n'
            for name, values in own.items()
            for array in [_filled(np.zeros((1, *values.shape[1:]), values.dtype))]
        )
        for kind, own in (("PPointData", grid.at_points), ("PCellData", grid.in_cells))
    }
    parts = "".join(f'<Piece Source="{piece(path, k).name}"/>\n' for k in range(comm.size))
    text = (
        '<VTKFile type="PUnstructuredGrid" byte_order="LittleEndian" header_type="UInt64">\n'
        '<PUnstructuredGrid GhostLevel="0">\n'
        + "".join(f"<{kind}>\n{arrays}</{kind}>\n" for kind, arrays in fields.items())
        + '<PPoints><PDataArray type="Float64" NumberOfComponents="3"/></PPoints>\n'
        + f"{parts}</PUnstructuredGrid>\n</VTKFile>\n"
    )
    names = path.with_suffix(".pvtu")
    on_root(comm, lambda: names.write_text(text, encoding="utf-8"))
    return names


def piece(path: Path, rank: int) -> Path:
    """Return the name of a rank's piece of a file: ``contact.0003.csv``."""
    return path.with_name(f"{path.stem}.{rank:04d}{path.suffix}")


def _filled(values: Values) -> Values:
    """Return values with three components where they have two, as VTK has vectors."""
    values = values.astype(np.float64 if values.dtype.kind == "f" else np.int32, copy=False)
    if values.ndim == 2 and values.shape[1] == 2:
        values = np.column_stack([values, np.zeros(len(values))])
    return np.ascontiguousarray(values)


def write_rows(
    comm: MPI.Intracomm, columns: Table | None, path: Path, pieces: bool, more: bool = False
) -> None:
    """Write the columns of rank 0, or those of each into a file of its own. Collective."""
    own = piece(path, comm.rank) if pieces else path

    def write() -> None:
        if columns is not None and (pieces or comm.rank == 0):
            rows = zip(*(column.tolist() for column in columns.values()), strict=True)
            write_csv(own, columns, rows, more)

    on_each(comm, write)


def write_csv(
    path: Path, header: Iterable[str], rows: Iterable[Iterable[Any]], more: bool = False
) -> None:
    """Write a table, numbers to the last digit, or more rows of one. On one rank."""
    begun = more and path.exists()
    with path.open("a" if begun else "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        if not begun:
            writer.writerow(header)
        writer.writerows(rows)


def write_mappings(
    path: Path, rows: Sequence[Mapping[str, Any]], header: Iterable[str] = ()
) -> None:
    """Write rows of named values, under the names in the header and all others. On one rank."""
    names = list(dict.fromkeys([*header, *(name for row in rows for name in row)]))
    write_csv(path, names, ([row.get(name) for name in names] for row in rows))
