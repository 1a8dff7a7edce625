"""Meshes in XDMF and HDF5 of which each rank reads its own share.

A file of another format is read and checked on rank 0, which has to hold all of it. `write` keeps
the checked mesh: XDMF, as dolfinx reads it, and behind it HDF5 with the names of regions and parts.
`read` takes slices of that, and no rank ever has more.
"""

from __future__ import annotations

import json
import re
import tempfile
from html import escape, unescape
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.errors import InputError
from contact.mesh.cells import Shape
from contact.mesh.validity import Cells, Groups
from contact.ranks import on_root

#: XDMF's names of cells and facets; behind those of second order is the number of nodes.
NAMES = {
    "interval": "Polyline",
    "triangle": "Triangle",
    "quadrilateral": "Quadrilateral",
    "tetrahedron": "Tetrahedron",
    "hexahedron": "Hexahedron",
}

#: Where the file of names and shares is told.
MARK = re.compile(r'<Information Name="contact" Value="([^"]+\.h5)')

#: The groups of a mesh in the HDF5 file.
GROUPS = ("regions", "parts")


def write(cells: Cells, path: Path) -> None:
    """Write a checked mesh to ``path``, an .xdmf file, and an .h5 file beside it. On one rank.

    Raises
    ------
    InputError
        If the name ends otherwise, or one of the files is there already.
    """
    import h5py

    heavy = path.with_suffix(".h5")
    if path.suffix.lower() != ".xdmf":
        raise InputError(
            f"{path}: given another ending; accepted: a name that ends with .xdmf", "xdmf-files"
        )
    for file in (path, heavy):
        if file.exists():
            raise InputError(f"{file}: it is there already; accepted: another name", "file-name")
    groups = {name: getattr(cells, name) for name in GROUPS}
    said: dict[str, Any] = {
        name: {"names": group.names, "sets": group.sets} for name, group in groups.items()
    }
    said |= {"shape": cells.shape.name, "unusable": cells.unusable, "notes": cells.notes}
    said |= {"inside": cells.inside, "space": dict(cells.space)}
    shapes = {"regions": cells.shape, "parts": cells.shape.facet}
    with tempfile.TemporaryDirectory(dir=path.parent) as folder:
        made = Path(folder) / heavy.name
        with h5py.File(made, "w") as store:
            store["contact"] = json.dumps(said)  # an attribute has 64 kB at most
            store["points"] = cells.points
            for name, group in groups.items():
                order = _vtk_order(shapes[name], group.rows.shape[1])
                store[name], store[f"{name}-label"] = group.rows[:, order], group.labels
        name_in_xml = escape(heavy.name)
        light = Path(folder) / path.name
        grids = "".join(
            _grid(name, shapes[name], group.rows.shape, cells.points.shape, name_in_xml)
            for name, group in groups.items()
        )
        light.write_text(
            '<?xml version="1.0"?>\n<Xdmf Version="3.0"><Domain>\n'
            f'<Information Name="contact" Value="{name_in_xml}"/>\n{grids}</Domain></Xdmf>\n'
        )
        made.rename(heavy)
        light.rename(path)


def _grid(
    name: str, shape: Shape, rows: tuple[int, ...], points: tuple[int, ...], heavy: str
) -> str:
    """Return the XDMF of the cells, or of the facets of parts, with the labels of their groups."""
    n, corners = rows
    kind = NAMES[shape.name] + (f"_{corners}" if corners > shape.corners else "")
    where = f'Format="HDF">{heavy}:'
    of_polyline = f' NodesPerElement="{corners}"' if kind == "Polyline" else ""
    return (
        f'<Grid Name="{name}" GridType="Uniform">\n'
        f'<Topology TopologyType="{kind}" NumberOfElements="{n}"{of_polyline}>'
        f'<DataItem Dimensions="{n} {corners}" NumberType="Int" Precision="8" {where}/{name}'
        "</DataItem></Topology>\n"
        f'<Geometry GeometryType="{"XY" if points[1] == 2 else "XYZ"}">'
        f'<DataItem Dimensions="{points[0]} {points[1]}" Precision="8" {where}/points'
        "</DataItem></Geometry>\n"
        f'<Attribute Name="{name}" AttributeType="Scalar" Center="Cell">'
        f'<DataItem Dimensions="{n}" NumberType="Int" Precision="4" {where}/{name}-label'
        "</DataItem></Attribute>\n</Grid>\n"
    )


def _vtk_order(shape: Shape, nodes: int) -> list[int]:
    """Return where VTK, and thus XDMF, has the nodes of a cell or facet."""
    return list(shape.vtk(shape.degree_of(nodes))[1])


def heavy_file(path: Path) -> Path | None:
    """Return the HDF5 file of a mesh that `write` has written; else None. On one rank."""
    if path.suffix.lower() != ".xdmf" or not path.is_file():
        return None
    with open(path, errors="replace") as file:
        found = MARK.search(file.read(1000))
    return None if found is None else path.with_name(unescape(found[1]))


def read(comm: MPI.Intracomm, heavy: Path) -> Cells:
    """Return this rank's share of a mesh that `write` has written. Collective.

    Parameters
    ----------
    comm
        Communicator of the ranks of the mesh.
    heavy
        The file of the mesh.

    Raises
    ------
    InputError
        If the file is missing or damaged.
    """
    import h5py

    def opened() -> None:
        try:
            h5py.File(heavy, "r", locking=False).close()
        except OSError as error:
            raise InputError(
                f"{heavy}: it is missing or damaged ({' '.join(str(error).split())}); accepted: "
                "the file that contact mesh has written beside its .xdmf file",
                "xdmf-files",
            ) from error

    on_root(comm, opened)
    with h5py.File(heavy, "r", locking=False) as store:
        said = json.loads(store["contact"].asstr()[()])

        def share(name: str) -> NDArray[Any]:
            """Return this rank's rows of an array."""
            rows = store[name]
            first, last = (len(rows) * (comm.rank + k) // comm.size for k in (0, 1))
            return rows[first:last]

        shape = Shape(said["shape"])
        found = []
        for name, of in zip(GROUPS, (shape, shape.facet), strict=True):
            rows = share(name)
            inverse = np.argsort(_vtk_order(of, rows.shape[1]))
            sets = tuple(tuple(inside) for inside in said[name]["sets"])
            labels = share(f"{name}-label")
            found.append(Groups(tuple(said[name]["names"]), rows[:, inverse], labels, sets))
        regions, parts = found
        notes = tuple(said["notes"])
        # None of these in files of 0.1.0.
        inside, space = tuple(said.get("inside", ())), said.get("space", {})
        return Cells(shape, share("points"), regions, parts, said["unusable"], notes, inside, space)
