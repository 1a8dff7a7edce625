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
from contact.mesh.contents import Contents
from contact.mesh.reader import from_file
from tests.problems import files
from tests.problems.quadrilaterals import unit_block
from tests.problems.sizes import integral, sizes_of_parts

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

#: Names of cells in meshio by their number of nodes and dimension.
NAMES = {(6, 2): "triangle6", (8, 2): "quad8", (9, 2): "quad9", (10, 3): "tetra10"}
NAMES |= {(20, 3): "hexahedron20", (27, 3): "hexahedron27", (15, 3): "wedge15"}
NAMES |= {(13, 3): "pyramid13"}
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


def write(path: Path, points: np.ndarray, rows: np.ndarray, low: np.ndarray) -> None:
    """Write cells in the format of the path's ending, with a set of nodes, in Exodus without name.

    Points are in two or three dimensions; cells of MED are mirrored.
    """
    dim = points.shape[1]
    if path.suffix == ".med" and dim == 3:
        points = points[:, [1, 0, 2]]
    flat = np.column_stack([points, np.zeros((len(points), 3 - dim))])
    blocks = [(NAMES[rows.shape[1], dim], rows)]
    if path.suffix in files.ENDINGS:
        files.write(path, Contents(flat, blocks, nodes={"low": low}))
        return
    meshio = pytest.importorskip("meshio")
    mark = np.isin(np.arange(len(points)), low).astype(np.int32)
    named = {"point_data": {"low": mark}} if path.suffix == ".vtu" else {"point_sets": {"low": low}}
    meshio.write(path, meshio.Mesh(flat, blocks, **named))


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
    points, rows = cells(dim, order)
    write(path, bent(points), rows, np.flatnonzero(points[:, -1] == 0))
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


@pytest.mark.parametrize("program", ["Exodus", "Abaqus", "MED"])
def test_prisms_and_pyramids_of_second_order_are_cut(program, tmp_path):
    """In whatever order the nodes between their corners are: these are left out, and it is said."""
    prism = [*PRISM[:3], *PRISM[6:], *PRISM[3:6]] if program == "Exodus" else PRISM
    shapes = [("Prism 15", CUBE[[0, 1, 2, 4, 5, 6]], prism, 0.5)]
    if program != "Abaqus":
        shapes.append(("Pyramid 13", CUBE[:5], PYRAMID, 1 / 3))
    for kind, corners, order, volume in shapes:
        points = np.concatenate([corners, [corners[list(ends)].mean(axis=0) for ends in order]])
        path = tmp_path / f"{kind}{ENDINGS[program]}"
        write(path, points, np.arange(len(points))[None], np.flatnonzero(points[:, 2] == 0))
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
    assert sizes_of_parts(domain) == pytest.approx({"sides 3": 1.0, "sides 5": 1.0})
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
