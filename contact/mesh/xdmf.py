"""XDMF files: a mesh with tags of cells and facets; meshes of which each rank reads its share.

meshio reads files of one grid alone, and of mixed topologies those of first order. dolfinx writes
tags as grids of their own, behind the mesh whose nodes they share.

A file of another format is read and checked on rank 0, which has to hold all of it.
`write_distributed` keeps the checked mesh: XDMF, as dolfinx reads it, and behind it HDF5 with the
names of regions and parts. `read_distributed` takes slices of that, and no rank ever has more.

References
----------
XDMF Model and Format, https://www.xdmf.org/index.php/XDMF_Model_and_Format: numbers of cells in
mixed topologies.
"""

from __future__ import annotations

import json
import re
import tempfile
from contextlib import suppress
from html import escape, unescape
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.errors import InputError
from contact.mesh.cells import Shape
from contact.mesh.contents import Cells, Contents, Groups, Ints
from contact.ranks import on_root

#: First words of the names of topologies, and names of cells.
KINDS = {
    "polyvertex": "vertex",
    "polyline": "interval",
    "edge": "interval",
    "triangle": "triangle",
    "tri": "triangle",
    "quadrilateral": "quadrilateral",
    "quad": "quadrilateral",
    "tetrahedron": "tetrahedron",
    "tet": "tetrahedron",
    "pyramid": "pyramid",
    "wedge": "prism",
    "hexahedron": "hexahedron",
    "hex": "hexahedron",
}

#: Cells of mixed topologies by their number: names, and numbers of nodes.
MIXED = {
    1: ("vertex", 1),
    2: ("interval", 2),
    4: ("triangle", 3),
    5: ("quadrilateral", 4),
    6: ("tetrahedron", 4),
    7: ("pyramid", 5),
    8: ("prism", 6),
    9: ("hexahedron", 8),
    34: ("interval", 3),
    35: ("quadrilateral", 9),
    36: ("triangle", 6),
    37: ("quadrilateral", 8),
    38: ("tetrahedron", 10),
    39: ("pyramid", 13),
    40: ("prism", 15),
    48: ("hexahedron", 20),
    50: ("hexahedron", 27),
}

#: Cells of mixed topologies whose number of nodes stands before these.
COUNTED = (1, 2)

#: Cells of a mixed topology that are read at once.
WINDOW = 10_000

#: NumPy's letters of types of numbers.
TYPES = {"Int": "i", "UInt": "u", "Float": "f", "Char": "i", "UChar": "u"}

#: Formats of arrays that are in files of their own.
FILES = ("HDF", "Binary")

ACCEPTED = "accepted: one mesh, and tags of its cells and facets on the nodes of the mesh"

#: Names of cells here, but for the capital letter of those of basix.
NAMES = {"interval": "Polyline"}

#: The sentence that names the file of names and shares.
MARK = re.compile(r'<Information Name="contact" Value="([^"]+\.h5)')

#: The groups of a mesh in the HDF5 file.
GROUPS = ("regions", "parts")


def read_xdmf(file: Path) -> Contents:
    """Read an XDMF file of one mesh with tags; raise errors of any kind if it is damaged."""
    root = ElementTree.parse(file).getroot()
    grids = [grid for grid in root.iter("Grid") if grid.find("Topology/DataItem") is not None]
    given = [item for grid in grids if (item := grid.find("Geometry/DataItem")) is not None]
    if not given:
        raise ValueError(f"it has no mesh; {ACCEPTED}")
    places, *others = (_array(item, root, file) for item in given)
    if any(not np.array_equal(places, other) for other in others):
        raise ValueError(f"it has several meshes; {ACCEPTED}")
    points, blocks = np.zeros((len(places), 3)), list[tuple[str, Ints]]()
    points[:, : places.shape[1]] = places
    made = Contents(points, blocks, repeats=True)
    for grid in grids:
        own, first = _blocks(grid, root, file), len(blocks)
        ends = np.cumsum([len(rows) for _, rows in own])
        for name, on, values in _attributes(grid, root, file):
            if on == "Node" and len(values) == len(points):
                made.add_nodes(name, values)
            elif on == "Cell" and len(values) == ends[-1]:
                made.add_groups(name, np.split(values, ends[:-1]), first)
        blocks += own
    return made


def array_files(file: Path) -> list[Path]:
    """Return the files of the arrays of an XDMF file, each once; none if it is damaged."""
    with suppress(ElementTree.ParseError):
        items = [item for _, item in ElementTree.iterparse(file) if item.tag == "DataItem"]
        texts = [(item.get("Format"), (item.text or "").strip()) for item in items]
        names = [t.rpartition(":")[0] if f == "HDF" else t for f, t in texts if f in FILES]
        return [file.parent / name for name in dict.fromkeys(names)]
    return []


def _attributes(grid: Element, root: Element, file: Path) -> list[tuple[str, str, Any]]:
    """Return the scalar arrays of a grid: name, "Node" or "Cell", values."""
    found = []
    for given in grid.iter("Attribute"):
        item = given.find("DataItem")
        if item is not None:
            values = _array(item, root, file)
            if values.size == len(values):
                on = given.get("Center", "Node")
                found.append((given.get("Name", ""), on, values.reshape(-1)))
    return found


def _blocks(grid: Element, root: Element, file: Path) -> list[tuple[str, Ints]]:
    """Return the cells of a grid: names, and nodes."""
    topology = next(grid.iter("Topology"))
    given = topology.get("TopologyType") or topology.get("Type") or ""
    rows = _array(next(topology.iter("DataItem")), root, file).astype(np.int64)
    if given == "Mixed":
        return _mixed(rows.ravel())
    name = KINDS.get(given.split("_")[0].lower())
    if name is None or rows.ndim != 2:
        raise ValueError(f"a topology {given!r}, which is not known")
    return [(name, rows)]


def _mixed(data: Ints) -> list[tuple[str, Ints]]:
    """Return the cells of a mixed topology, a list of type, nodes, type, nodes, ..."""
    runs: list[tuple[tuple[str, int], list[Ints]]] = []
    at = 0
    while at < len(data):
        number = int(data[at])
        if number not in MIXED:
            raise ValueError(f"cells of number {number} in a mixed topology, which are not known")
        nodes = MIXED[number][1]
        before = 1 + (number in COUNTED)
        width = before + nodes
        ahead = data[at : at + WINDOW * width]
        ahead = ahead[: len(ahead) // width * width].reshape(-1, width)
        alike = ahead[:, 0] == number
        count = len(alike) if alike.all() else int(alike.argmin())
        if not count or (before == 2 and np.any(ahead[:count, 1] != nodes)):
            raise ValueError("a mixed topology that is cut off, or lines of several points")
        if not runs or runs[-1][0] != MIXED[number]:
            runs.append((MIXED[number], []))
        runs[-1][1].append(ahead[:count, before:])
        at += count * width
    return [(name, np.concatenate(rows)) for (name, _), rows in runs]


def _array(item: Element, root: Element, file: Path) -> Any:
    """Return the array of a data item."""
    import h5py

    text = (item.text or "").strip()
    reference = item.get("Reference")
    if reference is not None:
        path = text if reference == "XML" else reference
        other = root.find("./" + "/".join(path.strip("/").split("/")[1:]))
        if other is None:
            raise ValueError(f"there is no {path!r}")
        return _array(other, root, file)
    kind = item.get("Format", "XML")
    if kind == "HDF":
        name, _, place = text.rpartition(":")
        with h5py.File(file.parent / name, "r") as data:
            return data[place][()]
    size = item.get("Precision", "1" if "Char" in item.get("NumberType", "") else "4")
    letter = TYPES[item.get("NumberType") or item.get("DataType") or "Float"]
    dtype = np.dtype(f"{letter}{size}")
    shape = [int(n) for n in item.get("Dimensions", "").split()]
    if kind == "Binary":
        return np.fromfile(file.parent / text, dtype=dtype).reshape(shape)
    if kind != "XML":
        raise ValueError(f"arrays of the format {kind!r}; accepted: HDF, XML, Binary")
    return np.array(text.split(), dtype=dtype).reshape(shape)


def write_distributed(cells: Cells, path: Path) -> None:
    """Write a checked mesh to ``path``, a new .xdmf file, and an .h5 file. On one rank."""
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
    """Return the XDMF of cells, or of facets of parts, with the labels of their groups."""
    n, corners = rows
    kind = NAMES.get(shape.name, shape.name.capitalize())
    kind += f"_{corners}" if corners > shape.corners else ""
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
    """Return the order of VTK, and thus XDMF, of the nodes of a cell or facet."""
    return list(shape.vtk(shape.degree_of(nodes))[1])


def distributed_arrays(path: Path) -> Path | None:
    """Return the HDF5 file of a mesh by `write_distributed`; else None. On one rank."""
    if path.suffix.lower() != ".xdmf" or not path.is_file():
        return None
    with open(path, errors="replace") as file:
        found = MARK.search(file.read(1000))
    return None if found is None else path.with_name(unescape(found[1]))


def read_distributed(comm: MPI.Intracomm, heavy: Path) -> Cells:
    """Return this rank's share of a mesh, by the file of `distributed_arrays`. Collective."""
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
