"""Numbers of nodes in files of other programs, by the tables of their manuals, on curved cells."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from dolfinx import io
from dolfinx import mesh as dmesh
from mpi4py import MPI

from contact.errors import InputError
from contact.mesh.reader import from_file
from tests.problems.quadrilaterals import unit_block
from tests.problems.sizes import integral, measures

COMM = MPI.COMM_WORLD

CUBE = np.array([(x, y, z) for z in (0, 1) for x, y in [(0, 0), (1, 0), (1, 1), (0, 1)]], float)
SQUARE = CUBE[:4]

#: Edges of a hexahedron by their corners: of the lower face, upright, of the upper face.
LOW, UP, HIGH = (
    [(0, 1), (1, 2), (2, 3), (3, 0)],
    [(0, 4), (1, 5), (2, 6), (3, 7)],
    [(4, 5), (5, 6), (6, 7), (7, 4)],
)

#: Its faces, and all of it.
FRONT, RIGHT, BACK, LEFT = (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)
BOTTOM, TOP, WHOLE = (0, 1, 2, 3), (4, 5, 6, 7), tuple(range(8))

#: Nodes between the corners in each program's order: manuals of Exodus II (HEX20, HEX27), VTK,
#: Abaqus and CalculiX (C3D20, C3D27), MED (H20, H27, whose corners are those of a mirrored cell).
HEXAHEDRA = {
    "Exodus 20": [*LOW, *UP, *HIGH],
    "Exodus 27": [*LOW, *UP, *HIGH, WHOLE, BOTTOM, TOP, LEFT, RIGHT, FRONT, BACK],
    "VTK 20": [*LOW, *HIGH, *UP],
    "VTK 27": [*LOW, *HIGH, *UP, LEFT, RIGHT, FRONT, BACK, BOTTOM, TOP, WHOLE],
    "Abaqus 20": [*LOW, *HIGH, *UP],
    "Abaqus 27": [*LOW, *HIGH, *UP, WHOLE, BOTTOM, TOP, FRONT, RIGHT, BACK, LEFT],
    "MED 20": [*LOW, *HIGH, *UP],
    "MED 27": [*LOW, *HIGH, *UP, BOTTOM, FRONT, RIGHT, BACK, LEFT, TOP, WHOLE],
}

#: The same in all programs.
TETRAHEDRON = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
TRIANGLE, SIDES = [(0, 1), (1, 2), (2, 0)], [*LOW, BOTTOM]

#: Names of elements by their number of nodes and dimension.
NAMES = {
    "Exodus": {(6, 2): "TRI6", (8, 2): "QUAD8", (9, 2): "QUAD9", (10, 3): "TET10"}
    | {(20, 3): "HEX20", (27, 3): "HEX27"},
    "Abaqus": {(6, 2): "CPE6M", (8, 2): "CPE8R", (9, 2): "CPE9", (10, 3): "C3D10"}
    | {(20, 3): "C3D20R", (27, 3): "C3D27"},
    "MED": {(6, 2): "TR6", (8, 2): "QU8", (9, 2): "QU9", (10, 3): "T10"}
    | {(20, 3): "H20", (27, 3): "H27"},
    "VTK": {(6, 2): "triangle6", (8, 2): "quad8", (9, 2): "quad9", (10, 3): "tetra10"}
    | {(20, 3): "hexahedron20", (27, 3): "hexahedron27"},
}
ENDINGS = {"Exodus": ".exo", "Abaqus": ".inp", "MED": ".med", "VTK": ".vtu", "meshio": ".e"}


def bent(x: np.ndarray) -> np.ndarray:
    """Map points by a polynomial of degree 2, whose Jacobian is 1: edges become parabolas."""
    moved = x.copy()
    moved[:, -1] += 0.3 * x[:, 0] * (1 - x[:, 0])
    if x.shape[1] == 3:
        moved[:, 2] += 0.2 * x[:, 1] * (1 - x[:, 1])
    return moved


def cells(dim: int, order: Sequence[tuple[int, ...]]) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes of a square or a cube, and its cells: two triangles, six tetrahedra, or one.

    The nodes of a cell behind its corners are in the middle of some of these.
    """
    corners = CUBE if dim == 3 else SQUARE[:, :2]
    rows = [tuple(range(len(corners)))]
    if order == TRIANGLE:
        rows = [(0, 1, 2), (0, 2, 3)]
    elif order == TETRAHEDRON:
        paths = [(1, 2), (1, 5), (3, 2), (3, 7), (4, 5), (4, 7)]
        rows = [(0, a, b, 6) for a, b in paths]
    keys: dict[tuple[int, ...], int] = {(k,): k for k in range(len(corners))}
    found = []
    for row in rows:
        own = [tuple(sorted(row[c] for c in ends)) for ends in order]
        found.append([*row, *(keys.setdefault(key, len(keys)) for key in own)])
    return np.array([corners[list(key)].mean(axis=0) for key in keys]), np.array(found)


def write(path: Path, program: str, order: Sequence[tuple[int, ...]], dim: int) -> None:
    """Write the square or the cube in a program's format, with a set of the nodes of a side.

    In Exodus it has no name.
    """
    straight, rows = cells(dim, order)
    if program == "MED" and dim == 3:  # whose cells are mirrored
        straight[:, :2] = straight[:, 1::-1]
    points, low = bent(straight), np.flatnonzero(straight[:, -1] == 0)
    flat = np.column_stack([points, np.zeros((len(points), 3 - dim))])
    name = NAMES.get(program, NAMES["VTK"])[rows.shape[1], dim]
    if program == "Abaqus":
        lines = ["*NODE", *(f"{k}, {x}, {y}, {z}" for k, (x, y, z) in enumerate(flat, 1))]
        lines.append(f"*ELEMENT, TYPE={name}")
        for k, row in enumerate(rows, 1):
            text = [str(n + 1) for n in row]
            lines.append(", ".join([str(k), *text[:9]]) + ("," if text[9:] else ""))
            lines += [", ".join(text[9:])] if text[9:] else []
        lines += ["*NSET, NSET=low", ", ".join(str(n + 1) for n in low)]
        path.write_text("\n".join(lines) + "\n")
    elif program == "MED":
        h5py = pytest.importorskip("h5py")
        with h5py.File(path, "w") as data:
            mesh = data.create_group("ENS_MAA/piece")
            mesh.attrs["ESP"] = dim
            mesh["0/NOE/COO"] = points.T.ravel()
            mesh["0/NOE/FAM"] = np.isin(np.arange(len(points)), low) * 3
            mesh[f"0/MAI/{name}/NOD"] = (rows + 1).T.ravel()
            family = data.create_group("FAS/piece/NOEUD/FAM_3_low")
            family.attrs["NUM"] = 3
            family["GRO/NOM"] = np.array([list(b"low".ljust(80, b"\0"))], dtype=np.int8)
    elif program == "Exodus":
        netcdf = pytest.importorskip("netCDF4")
        with netcdf.Dataset(str(path), "w", format="NETCDF3_64BIT_OFFSET") as data:
            sizes = {"num_dim": dim, "num_nodes": len(points), "num_el_blk": 1}
            sizes |= {"cells": len(rows), "each": rows.shape[1]}
            sizes |= {"num_node_sets": 1, "low": len(low)}
            for key, size in sizes.items():
                data.createDimension(key, size)
            for axis, letter in enumerate("xyz"[:dim]):
                data.createVariable(f"coord{letter}", "f8", ("num_nodes",))[:] = points[:, axis]
            made = data.createVariable("connect1", "i4", ("cells", "each"))
            made.elem_type, made[:] = name, rows + 1
            data.createVariable("ns_prop1", "i4", ("num_node_sets",))[:] = 21
            data.createVariable("node_ns1", "i4", ("low",))[:] = low + 1
    else:
        meshio = pytest.importorskip("meshio")
        mark = np.isin(np.arange(len(points)), low).astype(np.int32)
        sets = {"point_sets": {"low": low}}
        more = {"point_data": {"low": mark}} if path.suffix == ".vtu" else sets
        meshio.write(path, meshio.Mesh(flat, [(name, rows)], **more))


CASES = [(name.split()[0], order, 3) for name, order in HEXAHEDRA.items()]
CASES += [("meshio", HEXAHEDRA[f"VTK {n}"], 3) for n in (20, 27)]
CASES += [("meshio", SIDES, 2), ("meshio", TETRAHEDRON, 3)]
CASES += [
    (program, order, dim)
    for program in ("Exodus", "Abaqus", "MED", "VTK")
    for order, dim in ((TRIANGLE, 2), (LOW, 2), (SIDES, 2), (TETRAHEDRON, 3))
]


#: Programs whose order of hexahedra is tested in short runs: other cells are alike in all, groups
#: of MED are tested with nodes between corners, and meshio has the order of VTK.
SHORT = ("Exodus", "Abaqus", "VTK")


@pytest.mark.parametrize(
    ("program", "order", "dim"),
    [
        pytest.param(
            *case,
            id=f"{case[0]}-{case[2]}d-{len(case[1])}",
            marks=() if case[0] in SHORT and len(case[1]) > 6 else pytest.mark.slow,
        )
        for case in CASES
    ],
)
def test_nodes_between_corners_are_where_the_manual_says(program, order, dim, tmp_path):
    """A square or cube under a parabola: volume 1, and its moments in closed form."""
    path = tmp_path / f"piece{ENDINGS[program]}"
    write(path, program, order, dim)
    domain = from_file(MPI.COMM_SELF, path)
    assert domain.order == 2
    assert integral(domain) == pytest.approx(1.0, rel=1e-12)
    height = 0.5 + (0.3 + 0.2 * (dim == 3)) / 6
    assert integral(domain, lambda x: x[dim - 1]) == pytest.approx(height, rel=1e-12)
    # int (z + b)^2 for b = 0.3 x (1 - x) + 0.2 y (1 - y)
    square = 1 / 3 + (height - 0.5) + (0.3**2 + 0.2**2 * (dim == 3)) / 30
    square += 2 * 0.3 * 0.2 / 36 * (dim == 3)
    assert integral(domain, lambda x: x[dim - 1] ** 2) == pytest.approx(square, rel=1e-12)
    assert len(domain.parts) == 1


#: Edges of a prism in the order of VTK, Abaqus and MED, and of a pyramid in that of all.
PRISM = [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)]
PYRAMID = [*LOW, (0, 4), (1, 4), (2, 4), (3, 4)]

#: Names of elements of 15 and 13 nodes.
OTHERS = {
    "Exodus": ("WEDGE15", "PYRAMID13"),
    "Abaqus": ("C3D15", None),
    "MED": ("P15", "P13"),
}


@pytest.mark.parametrize(("program", "names"), OTHERS.items(), ids=[*OTHERS])
def test_prisms_and_pyramids_of_second_order_are_cut(program, names, tmp_path, monkeypatch):
    """In whatever order the nodes between their corners are: these are left out, and it is said."""
    shapes = (
        ("Prism 15", CUBE[[0, 1, 2, 4, 5, 6]], PRISM, 0.5),
        ("Pyramid 13", CUBE[:5], PYRAMID, 1 / 3),
    )
    for name, (kind, corners, edges, volume) in zip(names, shapes, strict=True):
        if name is None:
            continue
        order = [*PRISM[:3], *PRISM[6:], *PRISM[3:6]] if name == "WEDGE15" else edges
        points = np.concatenate([corners, [corners[list(ends)].mean(axis=0) for ends in order]])
        row = np.arange(len(points))[None]
        monkeypatch.setitem(NAMES[program], (len(points), 3), name)
        monkeypatch.setattr("tests.mesh.test_conventions.cells", lambda *_, p=points, r=row: (p, r))
        monkeypatch.setattr("tests.mesh.test_conventions.bent", lambda x: x)
        path = tmp_path / f"{kind}{ENDINGS[program]}"
        write(path, program, order, 3)
        domain = from_file(MPI.COMM_SELF, path)
        assert integral(domain) == pytest.approx(volume, rel=1e-12)
        assert len(domain.parts) == 1 and domain.order == 1 and domain.space["degree"] == 2
        assert f"its cells, '{kind}', become tetrahedra with straight edges" in domain.notes[0]


@pytest.mark.parallel
@pytest.mark.parametrize("cell", ["triangle", "hexahedron"])
def test_tags_of_dolfinx_are_parts_and_regions(cell, shared_tmp_path):
    """Grids behind that of the mesh, which share its nodes."""
    pytest.importorskip("h5py")
    made = unit_block(COMM, cell).mesh
    dim = made.topology.dim
    sides = [
        dmesh.locate_entities_boundary(made, dim - 1, lambda x, v=v: np.isclose(x[0], v))
        for v in (0.0, 1.0)
    ]
    facets = np.concatenate(sides)
    order = np.argsort(facets)
    values = np.repeat(np.array([3, 5], dtype=np.int32), [len(s) for s in sides])
    some = dmesh.locate_entities(made, dim, lambda x: x[0] < 0.5).astype(np.int32)
    tags = dmesh.meshtags(made, dim - 1, facets[order], values[order])
    tags.name, half = "sides", dmesh.meshtags(made, dim, some, np.full(len(some), 7, np.int32))
    half.name = "half"
    expected = len(some), COMM.allreduce(len(some[some < made.topology.index_map(dim).size_local]))
    path = shared_tmp_path / "tagged.xdmf"
    with io.XDMFFile(COMM, path, "w") as file:
        file.write_mesh(made)
        file.write_meshtags(tags, made.geometry)
        file.write_meshtags(half, made.geometry)
    domain = from_file(COMM, path)
    assert measures(domain) == pytest.approx({"sides 3": 1.0, "sides 5": 1.0})
    assert COMM.allreduce(len(domain.regions["half 7"])) == expected[1]
    assert integral(domain) == pytest.approx(1.0)
    assert domain.notes == ()


def test_a_mesh_without_tags_names_them(shared_tmp_path):
    path = shared_tmp_path / "bare.xdmf"
    with io.XDMFFile(MPI.COMM_SELF, path, "w") as file:
        file.write_mesh(unit_block(MPI.COMM_SELF, "triangle").mesh)
    with pytest.raises(InputError, match=r"\[no-groups\]"):
        from_file(MPI.COMM_SELF, path)


def test_mixed_topologies_of_second_order(tmp_path):
    """As meshio writes cells beside their facets."""
    meshio = pytest.importorskip("meshio")
    pytest.importorskip("h5py")
    points, rows = cells(3, HEXAHEDRA["VTK 27"])
    low = [0, 1, 2, 3, *(int(rows[0, 8 + k]) for k in range(4)), int(rows[0, 24])]
    data = {"tags": [np.array([4]), np.array([6])]}
    blocks = [("hexahedron27", rows), ("quad9", np.array([low]))]
    meshio.write(tmp_path / "piece.xdmf", meshio.Mesh(bent(points), blocks, cell_data=data))
    domain = from_file(MPI.COMM_SELF, tmp_path / "piece.xdmf")
    assert [*domain.parts] == ["tags 6"] and [*domain.regions] == ["tags 4"]
    assert domain.order == 2 and integral(domain) == pytest.approx(1.0)
    for name in ("Hexahedron", "Mixed"):
        text = "<Geometry><DataItem Dimensions='1 3'>0 0 {}</DataItem></Geometry><Topology "
        text += f"TopologyType='{name}'><DataItem Dimensions='1 2'>99 0</DataItem></Topology>"
        grids = "".join(f"<Grid>{text.format(z)}</Grid>" for z in range(2 - (name == "Mixed")))
        (tmp_path / "other.xdmf").write_text(f"<Xdmf><Domain>{grids}</Domain></Xdmf>")
        with pytest.raises(InputError, match=r"\[mesh-file\]"):
            from_file(MPI.COMM_SELF, tmp_path / "other.xdmf")
