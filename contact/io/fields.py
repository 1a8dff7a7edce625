"""The files of fields: VTK's XML files (.vtu), which ParaView, pyvista and meshio open; VTX; XDMF.

Shares of grids are gathered on rank 0, which writes one .vtu file. VTX and XDMF are written by all
ranks.
"""

from __future__ import annotations

import errno
import os
import sys
from base64 import b64encode
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

import numpy as np
from dolfinx import fem, has_adios2, io
from mpi4py import MPI
from numpy.typing import NDArray

from contact.errors import InputError
from contact.mesh.cells import shape_of
from contact.mesh.entities import accumulated, with_ghosts
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.ranks import on_root
from contact.results.contact_nodes import Grid, Values, contact_surface
from contact.results.fields import DerivedFields, cell_function, linear, nodal_unknowns, unknowns
from contact.results.solution import Results

#: A time, and the state then.
Frame: TypeAlias = tuple[float, State]

#: VTK's names of kinds of numbers.
KINDS = {"float64": "Float64", "int32": "Int32", "int64": "Int64", "uint8": "UInt8"}

#: Fields that are written for every step, and internal variables.
SERIES = ("displacement", "potential", "von_mises")


def write_fields(solution: Results, folder: Path) -> None:
    """Write the fields in the format that is asked for. Collective.

    ``fields.vtu`` holds all of them, the derived ones both averaged at the nodes and as they
    are in the cells. So do ``fields.bp``, at the nodes, and ``cells.bp``, in the cells: one VTX
    file has one kind of elements only. ``fields.xdmf`` has those at the nodes, of degree 1 at
    most; of several regions the means of the cells. Averages stay in their region. Of an evolution
    each has all steps; ``fields.vtu`` has the last one, and ``fields.pvd`` names files with the
    main fields of all. A library may fail by an OSError on one rank, while others wait for it.
    """
    problem, frames = solution.problem, _frames(solution)
    match solution.output.fields:
        case "vtu":
            share = body_share(problem, solution.state)
            in_cells = {**share.in_cells, "region": regions_of(problem)}
            if solution.error is not None:
                in_cells["error"] = solution.error.cells
            share = replace(share, in_cells=in_cells)
            write_grid(problem.comm, share, folder / "fields.vtu")
            if solution.steps:
                _write_series(solution, frames, folder)
        case "vtx":
            _write_vtx(problem, frames, folder)
        case "xdmf":
            _write_xdmf(problem, frames, folder)


def regions_of(problem: ContactProblem) -> NDArray[np.int32]:
    """Return the region of each owned cell: its place among the names. Collective.

    Of several that share a cell it is the one of fewest cells, which lies in the others.
    """
    domain = problem.domain
    cells = [domain.regions[name] for name in sorted(domain.regions)]
    sizes = problem.comm.allreduce(np.array([len(own) for own in cells]), op=MPI.SUM)
    found = np.full(domain.mesh.topology.index_map(domain.dim).size_local, -1, dtype=np.int32)
    for k in np.argsort(-sizes, kind="stable"):
        found[cells[k]] = k
    return found


def _frames(solution: Results) -> list[Frame]:
    """Return the times and states whose fields are written: the last one always."""
    if not solution.steps:
        return [(0.0, solution.state)]
    every = [(record.state.time, record.state) for record in solution.steps]
    return every[:: -solution.output.every][::-1]


def _write_series(solution: Results, frames: Sequence[Frame], folder: Path) -> None:
    """Write main fields and contact part of each step, a file each, and the lists of these files.

    The lists are ``fields.pvd`` and ``contact.pvd``.
    """
    problem = solution.problem
    derived = DerivedFields(problem.body, frames[0][1])
    names = (*SERIES, *problem.body.laws.names)
    lines: dict[str, list[str]] = {"fields": [], "contact": []}
    for k, (time, state) in enumerate(frames):
        derived.move_to(state)
        shares = {
            "fields": body_share(problem, state, names, derived),
            "contact": contact_surface(solution.at_step(state).contact, state),
        }
        for kind, share in shares.items():
            name = f"{kind}-{k:04d}.vtu"
            write_grid(problem.comm, share, folder / name)
            lines[kind].append(f'<DataSet timestep="{time!r}" file="{name}"/>')

    def write_names() -> None:
        for kind, sets in lines.items():
            text = ['<VTKFile type="Collection">', "<Collection>", *sets, "</Collection>"]
            path = folder / f"{kind}.pvd"
            path.write_text("\n".join([*text, "</VTKFile>"]) + "\n", encoding="utf-8")

    on_root(problem.comm, write_names)


def body_share(
    problem: ContactProblem,
    state: State,
    names: Collection[str] | None = None,
    derived: DerivedFields | None = None,
) -> Grid:
    """Return this rank's share of a body at a state with its fields of some names. Collective.

    Without `names` it has all fields; `derived` are the derived fields at the state, if at hand.
    """
    body, d = problem.body, problem.dim
    space, derived = body.space, derived or DerivedFields(body, state)
    numbers, nodes, groups = _points_of(derived)
    cells = numbers[space.dofmap.list[: len(derived.groups)], derived.groups[:, None]]
    points = space.tabulate_dof_coordinates()[nodes, :d]
    given, in_cells = nodal_unknowns(body, state.x), {}
    at_points = {k: _rows(v[nodes]) for k, v in given.items() if names is None or k in names}
    if names is None or set(names) - set(given):
        means, of_cells = derived.means()[groups, nodes], derived.cell_means()
        for name, columns in derived.columns.items():
            if names is None or name in names:
                at_points[name] = _rows(means[:, columns])
                in_cells[f"{name}_cell"] = _rows(of_cells[:, columns])
    return Grid(points, cells, shape_of(body.domain.mesh), at_points, in_cells)


def _points_of(
    derived: DerivedFields,
) -> tuple[NDArray[np.int64], NDArray[np.intp], NDArray[np.intp]]:
    """Return the points of a grid: a node between groups of cells has one for each. Collective.

    The number over all ranks of the point of each local node and group, -1 for none, and nodes and
    groups of the points of this rank.
    """
    space, groups = derived.body.space, derived.groups
    index_map, count = space.dofmap.index_map, derived.group_count
    numbers = np.zeros((index_map.size_local + index_map.num_ghosts, count), dtype=np.int64)
    numbers[space.dofmap.list[: groups.size], groups[:, None]] = 1
    nodes, of_group = np.nonzero(accumulated(index_map, numbers)[: index_map.size_local])
    # A node's first point stands where the node does, further ones behind all nodes.
    order = np.argsort(np.diff(nodes, prepend=-1) == 0, kind="stable")
    nodes, of_group = nodes[order], of_group[order]
    comm = derived.body.comm
    begin = comm.exscan(nodes.size) or 0
    numbers[:] = -1
    numbers[nodes, of_group] = begin + np.arange(nodes.size)
    return with_ghosts(index_map, numbers), nodes, of_group


def _rows(values: Values) -> Values:
    return values[:, 0] if values.shape[1] == 1 else values


def _write_vtx(problem: ContactProblem, frames: Sequence[Frame], folder: Path) -> None:
    if not has_adios2:
        raise InputError(
            'output.fields: "vtx" needs a dolfinx with ADIOS2, and this one has none; accepted: '
            '"vtu", "xdmf" or "none"',
            "vtx",
        )
    derived = DerivedFields(problem.body, frames[0][1])
    at_nodes, in_cells = _at_nodes(problem, frames[0][1], derived), list(derived.cells().values())
    comm, nodal, cellwise = problem.comm, folder / "fields.bp", folder / "cells.bp"
    with (
        _os_errors(folder),
        io.VTXWriter(comm, nodal, at_nodes, engine="BP4") as at_nodes_file,
        io.VTXWriter(comm, cellwise, in_cells, engine="BP4") as in_cells_file,
    ):
        for time, state in frames:
            derived.move_to(state)
            _copy(_at_nodes(problem, state, derived), at_nodes)
            _copy(derived.cells().values(), in_cells)
            at_nodes_file.write(time)
            in_cells_file.write(time)


def _copy(given: Iterable[fem.Function], into: Iterable[fem.Function]) -> None:
    for source, target in zip(given, into, strict=True):
        target.x.array[:] = source.x.array


def _write_xdmf(problem: ContactProblem, frames: Sequence[Frame], folder: Path) -> None:
    derived = DerivedFields(problem.body, frames[0][1])
    path = folder / "fields.xdmf"
    with _os_errors(path), io.XDMFFile(problem.comm, path, "w") as file:
        file.write_mesh(problem.domain.mesh)
        for time, state in frames:
            derived.move_to(state)
            for function in _at_corners(problem, state, derived):
                file.write_function(function, time)


def _at_nodes(problem: ContactProblem, state: State, derived: DerivedFields) -> list[fem.Function]:
    """Return all fields at the nodes, all discontinuous where the derived ones are."""
    found = unknowns(problem.body, state.x, "DG" if derived.group_count > 1 else "Lagrange")
    return list((found | derived.nodes()).values())


def _at_corners(
    problem: ContactProblem, state: State, derived: DerivedFields
) -> list[fem.Function]:
    """Return the fields for XDMF: of several regions the derived ones are the cells' means."""
    if derived.group_count == 1:
        return [linear(f) for f in _at_nodes(problem, state, derived)]
    found = [linear(f) for f in unknowns(problem.body, state.x).values()]
    means, mesh = derived.cell_means(), problem.domain.mesh
    for name, columns in derived.columns.items():
        values = means[:, None, columns]
        found.append(cell_function(name, mesh, 0, derived.shapes[name], values))
    return found


@contextmanager
def _os_errors(path: Path) -> Iterator[None]:
    """Turn the errors of a library that writes a file into OSErrors."""
    try:
        yield
    except RuntimeError as error:
        number = errno.ENOSPC if "No space left" in str(error) else errno.EIO
        raise OSError(number, os.strerror(number), str(path)) from error


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

    VTK's own writer may crash where the disk is full.
    """
    count = grid.cells.shape[1]
    kind, order = grid.shape.vtk(grid.shape.degree_of(count))
    cells = {
        "connectivity": grid.cells[:, order].ravel(),
        "offsets": np.arange(1, len(grid.cells) + 1) * count,
        "types": np.full(len(grid.cells), kind, dtype=np.uint8),
    }
    points = np.zeros((len(grid.points), 3))
    points[:, : grid.points.shape[1]] = grid.points
    sections: dict[str, Mapping[str, Values]] = {
        "PointData": {name: _filled(values) for name, values in grid.at_points.items()},
        "CellData": {name: _filled(values) for name, values in grid.in_cells.items()},
        "Points": {"points": points},
        "Cells": cells,
    }
    with path.open("w", encoding="ascii") as file:
        file.write(
            '<VTKFile type="UnstructuredGrid" version="1.0" header_type="UInt64" '
            f'byte_order="{sys.byteorder.capitalize()}Endian">\n<UnstructuredGrid>\n'
            f'<Piece NumberOfPoints="{len(points)}" NumberOfCells="{len(grid.cells)}">\n'
        )
        for section, arrays in sections.items():
            file.write(f"<{section}>\n")
            for name, values in arrays.items():
                head = f'type="{KINDS[values.dtype.name]}" format="binary"'
                if values.ndim > 1:
                    head += f' NumberOfComponents="{values.shape[1]}"'
                data = np.uint64(values.nbytes).tobytes() + values.tobytes()
                text = b64encode(data).decode()
                file.write(f'<DataArray Name="{name}" {head}>{text}</DataArray>\n')
            file.write(f"</{section}>\n")
        file.write("</Piece>\n</UnstructuredGrid>\n</VTKFile>\n")


def write_grid(comm: MPI.Intracomm, share: Grid, path: Path) -> None:
    """Write the shares of all ranks into one file. Collective."""
    whole = gathered(comm, share)
    on_root(comm, lambda: None if whole is None else write_vtu(path, whole))


def _filled(values: Values) -> Values:
    """Return values with three components where they have two, as VTK has vectors."""
    values = values.astype(np.float64 if values.dtype.kind == "f" else np.int32, copy=False)
    if values.ndim == 2 and values.shape[1] == 2:
        values = np.column_stack([values, np.zeros(len(values))])
    return np.ascontiguousarray(values)
