"""Readers of mesh files: Gmsh's .msh and models by physical groups, MED, Exodus, XDMF.

A MED file of Salome and code_aster has families of cells and nodes, and a family is in groups;
family 0 is in none. Where all are in it the array of families may be missing, which meshio's reader
refuses. Of Exodus files meshio drops side sets and names, and refuses elements of MOOSE, such as
TET10, and node sets without names. meshio reads XDMF of one grid alone, and of mixed topologies
those of first order; dolfinx writes tags as grids of their own, behind the mesh whose nodes they
share.

References
----------
Schoof and Yarberry, EXODUS II: a finite element data model, Sandia report SAND92-2137 (1994),
tables of the nodes and the sides of elements. XDMF Model and Format,
https://www.xdmf.org/index.php/XDMF_Model_and_Format: numbers of cells in mixed topologies.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from contact.errors import InputError
from contact.mesh.cells import FACES, joined_facets
from contact.mesh.contents import Contents, Ints, Kind, decoded, in_space
from contact.mesh.entities import places_of


@contextmanager
def session() -> Iterator[Any]:
    """Provide a new model of Gmsh, leaving a running Gmsh as it was."""
    try:
        import gmsh
    except (ImportError, OSError) as error:  # OSError: one of its shared libraries is missing.
        raise InputError(f"the Python module gmsh is needed ({error})", "gmsh") from error
    started = not gmsh.isInitialized()
    if started:
        gmsh.initialize(readConfigFiles=False, interruptible=False)
    # Gmsh's errors are exceptions, too: no need to print them.
    terminal = gmsh.option.getNumber("General.Terminal")
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("contact")
    try:
        yield gmsh
    except Exception as error:
        # The class of Gmsh's errors; others are faults of the program.
        if type(error) is not Exception:
            raise
        raise InputError(f"Gmsh says: {error}", "mesh-file") from error
    finally:
        gmsh.model.remove()
        gmsh.option.setNumber("General.Terminal", terminal)
        if started:
            gmsh.finalize()


def read_msh(file: Path) -> Contents:
    """Read a .msh file; execute nothing in it or beside it."""
    # Gmsh executes files of another beginning as scripts, unpacks those of some endings by other
    # programs, and reads options from a file beside: it reads a checked file by another name.
    with file.open("rb") as stream:
        start = re.match(rb"\$MeshFormat[ \t]*\r?\n\s*([24])[. \t]", stream.read(100))
        stream.seek(max(0, file.stat().st_size - 100))
        end = stream.read()
    if start is None:
        raise InputError("this is no Gmsh .msh file; accepted: formats 2.2 and 4.1", "mesh-file")
    if re.search(rb"\$End\w+\s*$", end) is None:  # Gmsh takes half a section for a whole one
        raise InputError("it is cut off: it does not end as a section does", "mesh-file")
    with session() as gmsh, tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / "mesh.msh"
        plain.symlink_to(file.resolve())
        # Format 2 names the group of each element, but Gmsh keeps one set of groups an entity. With
        # the two tags of an element switched, the entities are the groups.
        switch = start[1] == b"2"
        gmsh.option.setNumber("Mesh.SwitchElementTags", switch)
        try:
            gmsh.merge(str(plain))
        finally:
            gmsh.option.setNumber("Mesh.SwitchElementTags", 0)
        return model_contents(gmsh.model, entities_are_groups=switch)


def model_contents(model: Any, entities_are_groups: bool = False) -> Contents:
    """Return nodes, elements and groups, physical ones or entities, of ``gmsh.model``."""
    tags, points, _ = model.mesh.getNodes()
    order = np.argsort(tags)
    tags = tags[order].astype(np.int64)
    if np.any(tags[1:] == tags[:-1]):
        raise InputError("it has several nodes of one number", "mesh-file")
    blocks: list[tuple[str, Ints]] = []
    at: dict[tuple[int, int], range] = {}
    for dim, entity in model.getEntities():
        first = len(blocks)
        for kind, _, nodes in zip(*model.mesh.getElements(dim, entity), strict=True):
            name, _, _, count, *_ = model.mesh.getElementProperties(kind)
            rows = places_of(nodes.astype(np.int64).reshape(-1, count), tags)
            blocks.append((name.split()[0].lower(), rows))
        at[dim, entity] = range(first, len(blocks))
    made = Contents(points.reshape(-1, 3)[order], blocks, by_groups=True)
    groups = [pair for pair in at if pair[1]] if entities_are_groups else model.getPhysicalGroups()
    for dim, tag in groups:
        entities = [tag] if entities_are_groups else model.getEntitiesForPhysicalGroup(dim, tag)
        group = made.groups.setdefault(model.getPhysicalName(dim, tag) or str(tag), {})
        for entity in entities:
            group |= {b: np.arange(len(blocks[b][1])) for b in at[dim, entity]}
    return made


#: Names of elements in MED without their number of nodes, and in meshio.
MED_KINDS = {"SE": "line", "TR": "triangle", "QU": "quad", "TE": "tetra", "T": "tetra"}
MED_KINDS |= {"HE": "hexahedron", "H": "hexahedron", "PE": "wedge", "P": "wedge", "PY": "pyramid"}


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
        mesh, dim = steps[0], int(whole.attrs["ESP"])
        coordinates = np.asarray(mesh["NOE/COO"][()], dtype=float).reshape(dim, -1).T
        made = Contents(in_space(coordinates), [])
        named = _med_names(families.get("ELEME", {}))
        for kind, given in mesh["MAI"].items():
            if kind == "PO1":
                continue
            stem = kind.rstrip("0123456789")
            if stem not in MED_KINDS:
                raise ValueError(f"elements {kind} that are not known")
            name, count = "pyramid" if kind == "P13" else MED_KINDS[stem], int(kind[len(stem) :])
            rows = np.asarray(given["NOD"][()], dtype=np.int64).reshape(count, -1).T - 1
            for group, members in _med_groups(given, named).items():
                made.groups.setdefault(group, {})[len(made.blocks)] = members
            made.blocks.append((name, rows))
        made.nodes |= _med_groups(mesh["NOE"], _med_names(families.get("NOEUD", {})))
    return made


def _med_names(families: Any) -> dict[int, list[str]]:
    """Return the names of the groups of each family."""
    found = {}
    for family in families.values():
        none = np.zeros((0, 80), dtype=np.uint8)
        given = np.asarray(family["GRO/NOM"][()]).view(np.uint8) if "GRO" in family else none
        texts = [decoded(bytes(row).split(b"\0")[0]) for row in given]
        found[int(family.attrs["NUM"])] = [text.strip() for text in texts]
    return found


def _med_groups(given: Any, names: dict[int, list[str]]) -> dict[str, Ints]:
    """Return the members of each group among elements of a kind, or nodes."""
    found: dict[str, Ints] = {}
    numbers = np.asarray(given["FAM"][()]) if "FAM" in given else np.zeros(0, dtype=np.int64)
    for family in np.unique(numbers):
        members = np.flatnonzero(numbers == family)
        for name in names.get(int(family), []):
            found[name] = np.union1d(found.get(name, members), members)
    return found


#: Beginnings of the names of elements in Exodus, and of topologies in XDMF.
KINDS = {
    **dict.fromkeys(("SPHERE", "POLYVERTEX"), "vertex"),
    **dict.fromkeys(("BEAM", "BAR", "TRUSS", "EDGE", "POLYLINE"), "interval"),
    **{"TRI": "triangle", "QUAD": "quadrilateral", "SHELL": "quadrilateral"},
    **{"TET": "tetrahedron", "PYR": "pyramid", "WEDGE": "prism", "HEX": "hexahedron"},
}

#: The sides 1, 2, ... of elements in Exodus among the `FACES` of cells in 3-D.
EXODUS_SIDES = {
    "tetrahedron": (1, 2, 3, 0),
    "pyramid": (1, 2, 3, 4, 0),
    "prism": (2, 3, 4, 0, 1),
    "hexahedron": (2, 3, 4, 5, 0, 1),
}


def _kind(given: str) -> str:
    """Return the name of the cells that a program calls by a name."""
    for begins, name in KINDS.items():
        if given.upper().startswith(begins):
            return name
    raise ValueError(f"elements {given!r} that are not known")


def read_exodus(file: Path) -> Contents:
    """Read an Exodus file; raise errors of any kind if it is damaged."""
    import netCDF4

    with netCDF4.Dataset(str(file)) as data:
        data.set_auto_mask(False)
        given, axes = data.variables, ("coordx", "coordy", "coordz")
        alone = [given[axis][:] for axis in axes if axis in given]
        coordinates = given["coord"][:] if "coord" in given else alone
        made = Contents(in_space(np.transpose(coordinates)), [])

        def numbers(variable: str) -> Ints:
            return np.asarray(given[variable][:], dtype=np.int64) - 1

        for number, name in _exodus_names(data, "eb", "num_el_blk"):
            if f"connect{number}" not in given:  # a block of no elements
                made.blocks.append(("vertex", np.zeros((0, 1), dtype=np.int64)))
                continue
            rows, kind = numbers(f"connect{number}"), given[f"connect{number}"].elem_type
            made.groups.setdefault(name, {})[len(made.blocks)] = np.arange(len(rows))
            made.blocks.append((_kind(str(kind)), rows))
        for number, name in _exodus_names(data, "ns", "num_node_sets"):
            if f"node_ns{number}" in given:
                chosen = numbers(f"node_ns{number}")
                made.nodes[name] = np.union1d(made.nodes.get(name, chosen), chosen)
        for number, name in _exodus_names(data, "ss", "num_side_sets"):
            if f"elem_ss{number}" in given:
                elements, sides = (numbers(f"{of}_ss{number}") for of in ("elem", "side"))
                made.surfaces[name] = _side_facets(made, elements, sides)
    return made


def _exodus_names(data: Any, kind: str, dimension: str) -> Iterator[tuple[int, str]]:
    """Yield the numbers, from 1, and names of blocks or sets; one without goes by its property."""
    properties, names = (data.variables.get(f"{kind}_{of}") for of in ("prop1", "names"))
    for k in range(len(data.dimensions[dimension]) if dimension in data.dimensions else 0):
        said = b"" if names is None else b"".join(names[k])
        number = k + 1 if properties is None else int(properties[k])
        yield k + 1, decoded(said.split(b"\0")[0]).strip() or str(number)


def _side_facets(contents: Contents, elements: Ints, sides: Ints) -> Ints:
    """Return the sides of elements by their corners."""
    found: list[Ints] = []
    solid, first = any(name in EXODUS_SIDES for name, _ in contents.blocks), 0
    for name, nodes in contents.blocks:
        here = (elements >= first) & (elements < first + len(nodes))
        faces = FACES.get(name, ())
        table = [faces[k] for k in EXODUS_SIDES.get(name, range(len(faces)))]
        if solid and name in ("triangle", "quadrilateral"):
            # Either side of a shell is the whole cell; its edges are no facets of solids.
            table = [tuple(range(len(faces)))] * 2
        for side in np.unique(sides[here]):
            if side < len(table):
                rows = nodes[elements[here & (sides == side)] - first]
                found.append(rows[:, list(table[side])])
        first += len(nodes)
    return joined_facets(found)


#: Cells of mixed topologies whose number of nodes stands before these.
COUNTED = (1, 2)

#: Cells of a mixed topology that are read at once.
WINDOW = 10_000

#: NumPy's letters of types of numbers.
TYPES = {"Int": "i", "UInt": "u", "Float": "f", "Char": "i", "UChar": "u"}

#: Formats of arrays that are in files of their own.
FILES = ("HDF", "Binary")

XDMF_ACCEPTED = "accepted: one mesh, and tags of its cells and facets on the nodes of the mesh"


def read_xdmf(file: Path) -> Contents:
    """Read an XDMF file of one mesh with tags; raise errors of any kind if it is damaged."""
    root = ElementTree.parse(file).getroot()
    grids = [grid for grid in root.iter("Grid") if grid.find("Topology/DataItem") is not None]
    given = [item for grid in grids if (item := grid.find("Geometry/DataItem")) is not None]
    if not given:
        raise ValueError(f"it has no mesh; {XDMF_ACCEPTED}")
    places, *others = (_xdmf_array(item, root, file) for item in given)
    if any(not np.array_equal(places, other) for other in others):
        raise ValueError(f"it has several meshes; {XDMF_ACCEPTED}")
    made = Contents(in_space(places), [])
    for grid in grids:
        own, first = _xdmf_blocks(grid, root, file), len(made.blocks)
        ends = np.cumsum([len(rows) for _, rows in own])
        for attribute in grid.iter("Attribute"):
            item = attribute.find("DataItem")
            values = None if item is None else _xdmf_array(item, root, file)
            if values is None or values.size != len(values):  # no scalars
                continue
            name, on = attribute.get("Name", ""), attribute.get("Center", "Node")
            if on == "Node" and len(values) == len(made.points):
                made.add_nodes(name, values.reshape(-1))
            elif on == "Cell" and len(values) == ends[-1]:
                made.add_groups(name, np.split(values.reshape(-1), ends[:-1]), first)
        made.blocks += own
    return made


def array_files(file: Path) -> list[Path]:
    """Return the files of the arrays of an XDMF file, each once; none if it is damaged."""
    with suppress(ElementTree.ParseError):
        items = [item for _, item in ElementTree.iterparse(file) if item.tag == "DataItem"]
        texts = [(item.get("Format"), (item.text or "").strip()) for item in items]
        names = [t.rpartition(":")[0] if f == "HDF" else t for f, t in texts if f in FILES]
        return [file.parent / name for name in dict.fromkeys(names)]
    return []


def _xdmf_blocks(grid: Element, root: Element, file: Path) -> list[tuple[str, Ints]]:
    """Return the cells of a grid: names, and nodes."""
    topology = next(grid.iter("Topology"))
    given = topology.get("TopologyType") or topology.get("Type") or ""
    rows = _xdmf_array(next(topology.iter("DataItem")), root, file).astype(np.int64)
    if given == "Mixed":
        return _xdmf_mixed(rows.ravel())
    if rows.ndim != 2:
        raise ValueError(f"a topology {given!r} without rows of nodes")
    return [(_kind(given), rows)]


def _xdmf_mixed(data: Ints) -> list[tuple[str, Ints]]:
    """Return the cells of a mixed topology, a list of type, nodes, type, nodes, ..."""
    from meshio.xdmf.common import xdmf_idx_to_meshio_type

    runs: list[tuple[str, list[Ints]]] = []
    at = 0
    while at < len(data):
        number = int(data[at])
        if number not in xdmf_idx_to_meshio_type:
            raise ValueError(f"cells of number {number} in a mixed topology, which are not known")
        name = xdmf_idx_to_meshio_type[number]
        nodes = Kind.of_meshio(name).nodes
        before = 1 + (number in COUNTED)
        width = before + nodes
        ahead = data[at : at + WINDOW * width]
        ahead = ahead[: len(ahead) // width * width].reshape(-1, width)
        alike = ahead[:, 0] == number
        count = len(alike) if alike.all() else int(alike.argmin())
        if not count or (before == 2 and np.any(ahead[:count, 1] != nodes)):
            raise ValueError("a mixed topology that is cut off, or lines of several points")
        if not runs or runs[-1][0] != name:
            runs.append((name, []))
        runs[-1][1].append(ahead[:count, before:])
        at += count * width
    return [(name, np.concatenate(rows)) for name, rows in runs]


def _xdmf_array(item: Element, root: Element, file: Path) -> Any:
    """Return the array of a data item."""
    import h5py

    text = (item.text or "").strip()
    reference = item.get("Reference")
    if reference is not None:
        path = text if reference == "XML" else reference
        other = root.find("./" + "/".join(path.strip("/").split("/")[1:]))
        if other is None:
            raise ValueError(f"there is no {path!r}")
        return _xdmf_array(other, root, file)
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
