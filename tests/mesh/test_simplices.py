"""Cells of several shapes in a file become simplices, with their sets, and meet at their faces."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

import meshes
from contact.mesh.cells import FACES
from contact.mesh.contents import Cells, Contents, Groups, check
from contact.mesh.reader import from_file
from contact.ranks import on_root
from tests.problems import files
from tests.problems.sizes import integral, sizes_of_parts

COMM = MPI.COMM_WORLD
FIXTURES = Path(meshes.__file__).parent / "fixtures"


def stack() -> Contents:
    """Three cubes along x: a hexahedron, two prisms, six pyramids; a tetrahedron below a prism."""
    square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]
    points = [(float(x), y, z) for x in range(4) for y, z in square]
    points += [(2.5, 0.5, 0.5), (4 / 3, 1 / 3, -1.0)]
    at = np.arange(16).reshape(4, 4)

    def cube(k: int) -> np.ndarray:
        """In VTK's order, from x = k to x = k + 1."""
        return np.concatenate([at[k], at[k + 1]])

    a, b, c = cube(0), cube(1), cube(2)
    prisms = [b[[0, 1, 4, 3, 2, 7]], b[[1, 5, 4, 2, 6, 7]]]
    pyramids = [[*c[list(face)], 16] for face in FACES["hexahedron"]]
    low = [b[0], b[1], b[4]]
    blocks = {"hexahedron": [a], "wedge": prisms, "pyramid": pyramids, "tetra": [[*low, 17]]}
    made = Contents(np.array(points), [(name, np.array(rows)) for name, rows in blocks.items()])
    made.groups |= {name: {k: np.arange(len(rows))} for k, (name, rows) in enumerate(made.blocks)}
    made.surfaces |= {"start": at[0][None], "end": at[3][None]}
    made.nodes["side"] = np.flatnonzero(made.points[:, 1] == 1.0)
    return made


#: Volumes of the regions and areas of the parts.
VOLUMES = {"hexahedron": 1.0, "wedge": 1.0, "pyramid": 1.0, "tetra": 1 / 6}
AREAS = {"start": 1.0, "end": 1.0, "side": 3.0}

#: The skin of the cubes but for half a square, and the tetrahedron's three other faces.
SKIN = 13.5 + 2 * np.sqrt(1 + 1 / 9) / 2 + np.sqrt(2 * (1 + 1 / 18)) / 2


def numbered(contents: Contents, order: np.ndarray) -> Contents:
    """Return the same with other numbers of the nodes."""
    new = np.argsort(order)
    return Contents(
        contents.points[order],
        [(name, new[rows]) for name, rows in contents.blocks],
        contents.groups,
        {name: new[rows] for name, rows in contents.nodes.items()},
        {name: new[rows] for name, rows in contents.surfaces.items()},
    )


def sizes(points: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Return the volumes of tetrahedra or the areas of triangles."""
    edges = points[rows[:, 1:]] - points[rows[:, :1]]
    count = edges.shape[1]
    return np.sqrt(np.linalg.det(edges @ edges.transpose(0, 2, 1))) / (count * (count - 1))


def totals(cells: Cells, groups: Groups) -> dict[str, float]:
    """Return the volume or area of each group."""
    each = sizes(cells.points, groups.rows)
    inside = [[i in groups.sets[k] for k in groups.labels] for i in range(len(groups.names))]
    return {name: each[own].sum() for name, own in zip(groups.names, inside, strict=True)}


@pytest.mark.core
@pytest.mark.parametrize("seed", range(8))
def test_neighbours_cut_their_faces_alike_whatever_the_numbers(seed):
    contents = stack()
    order = np.random.default_rng(seed).permutation(len(contents.points))
    cells = check(numbered(contents, order))  # which finds faces of two cells that do not meet
    assert cells.notes[-1] == (
        "its cells, 'Hexahedron 8' beside 'Prism 6' beside 'Pyramid 5' beside 'Tetrahedron 4', "
        "become tetrahedra with straight edges: a mesh has cells of one kind"
    )
    rows = cells.regions.rows
    assert len(rows) == 6 + 2 * 3 + 6 * 2 + 1
    found = totals(cells, cells.regions)
    assert found == pytest.approx(VOLUMES)
    found = totals(cells, cells.parts)
    assert found == pytest.approx(AREAS)
    facets = np.sort(rows[:, [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]].reshape(-1, 3), axis=1)
    once, count = np.unique(facets, axis=0, return_counts=True)
    assert sizes(cells.points, once[count == 1]).sum() == pytest.approx(SKIN)


def write(path, contents: Contents) -> None:
    """Write the stack in a program's format."""
    if path.suffix == ".inp":
        text = files.abaqus(contents) + "*ELSET, ELSET=all\nhexahedron, wedge, pyramid, tetra\n"
        text += "*SURFACE, NAME=start\nhexahedron, S1\n*SURFACE, NAME=end\n5, S1\n"
        text += "*SURFACE, NAME=below\nhexahedron, S3\n3, S1\n*SURFACE, NAME=skin\nall,\n"
        path.write_text(text)
        return
    meshio = pytest.importorskip("meshio")
    quads = ("quad", np.concatenate([contents.surfaces["start"], contents.surfaces["end"]]))
    tags = [np.full(len(rows), k + 1) for k, (_, rows) in enumerate(contents.blocks)]
    tags.append(np.array([11, 12]))
    if path.suffix == ".msh":
        data = {"gmsh:physical": tags, "gmsh:geometrical": tags}
        made = meshio.Mesh(contents.points, [*contents.blocks, quads], cell_data=data)
        made.field_data = {
            name: np.array([k + 1, 3]) for k, (name, _) in enumerate(contents.blocks)
        }
        made.field_data |= {"start": np.array([11, 2]), "end": np.array([12, 2])}
        meshio.write(path, made, file_format="gmsh22", binary=False)
    else:
        sets = {
            name: [np.arange(len(rows) * (k == b)) for b in range(5)]
            for k, (name, rows) in enumerate(contents.blocks)
        }
        none = [np.zeros(0, dtype=int)] * 4
        sets |= {"start": [*none, np.array([0])], "end": [*none, np.array([1])]}
        meshio.write(path, meshio.Mesh(contents.points, [*contents.blocks, quads], cell_sets=sets))


@pytest.mark.parallel
@pytest.mark.parametrize("name", ["stack.inp", "stack.msh", "stack.vtu"])
def test_files_of_unlike_cells_keep_their_sets(name, shared_tmp_path):
    path = shared_tmp_path / name
    on_root(COMM, lambda: write(path, stack()))
    domain = from_file(COMM, path)
    found = {region: integral(domain, region=region) for region in VOLUMES}
    assert found == pytest.approx(VOLUMES)
    areas = sizes_of_parts(domain)
    expected = {"start": 1.0, "end": 1.0}
    if name == "stack.inp":
        # A surface of a square and a triangle, and all that bounds one cell alone.
        expected |= {"side": 3.0, "below": 1.5, "skin": SKIN}
        assert integral(domain, region="all") == pytest.approx(sum(VOLUMES.values()))
    assert {part: areas[part] for part in expected} == pytest.approx(expected)
    assert any("become tetrahedra with straight edges" in note for note in domain.notes)


@pytest.mark.parallel
def test_quadrilaterals_beside_triangles():
    """From Gmsh: a square and a triangle under one name."""
    domain = from_file(COMM, FIXTURES / "two-kinds.msh")
    assert sizes_of_parts(domain) == pytest.approx({"bottom": 1.0, "top": 1.0})
    assert integral(domain, region="body") == pytest.approx(1.5)
    note = "its cells, 'Triangle 3' beside 'Quadrilateral 4', become triangles with straight edges"
    assert domain.notes == (f"{note}: a mesh has cells of one kind",)


def test_cells_of_second_order_become_straight(tmp_path):
    """Six nodes a triangle, four a quadrilateral: middles are left out, and it is said."""
    nodes = ["0, 0", "1, 0", "1, 1", "0, 1", "2, 0", "1.5, -.1", "1.5, .5", "1, .5"]
    lines = ["*NODE", *(f"{k}, {x}" for k, x in enumerate(nodes, 1))]
    lines += ["*ELEMENT, TYPE=CPE4, ELSET=square", "1, 1, 2, 3, 4"]
    lines += ["*ELEMENT, TYPE=CPE6, ELSET=corner", "2, 2, 5, 3, 6, 7, 8"]
    lines += ["*SURFACE, NAME=ground", "square, S1", "corner, S1"]
    (tmp_path / "plate.inp").write_text("\n".join(lines) + "\n")
    domain = from_file(MPI.COMM_SELF, tmp_path / "plate.inp")
    assert domain.order == 1 and sizes_of_parts(domain) == pytest.approx({"ground": 2.0})
    assert integral(domain, region="corner") == pytest.approx(0.5)
    assert domain.notes == (
        "its cells, 'Quadrilateral 4' beside 'Triangle 6', become triangles with straight edges: a "
        "mesh has cells of one kind",
    )


def test_prisms_alone_and_side_sets_of_exodus(tmp_path):
    """Extruded meshes: sides of three and of four corners."""
    points = np.array([(x, y, z) for z in (0, 1) for x, y in [(0, 0), (1, 0), (0, 1)]], float)
    path = tmp_path / "prism.exo"
    files.write(path, Contents(points, [("wedge", np.arange(6)[None])]))
    files.add_side_sets(path, {1: [(1, side) for side in range(1, 6)]})
    domain = from_file(MPI.COMM_SELF, path)
    assert sizes_of_parts(domain) == pytest.approx({"1": 3 + 2**0.5})
    assert domain.notes == (
        "its cells, 'Prism 6', become tetrahedra with straight edges: a mesh has cells of one kind",
    )


def collapsed() -> Contents:
    """Return a cube, a prism, a pyramid and a tetrahedron, all as hexahedra.

    They have one node at several corners; the prism's triangles are up and down.
    """
    cube = [(x, y, z) for z in (0.0, 1.0) for x, y in [(0, 0), (1, 0), (1, 1), (0, 1)]]
    points = [*cube, (2.0, 0.5, 0.0), (2.0, 0.5, 1.0), (0.5, 0.5, 2.0), (-1.0, 0.5, 0.5)]
    prism = [1, 8, 2, 2, 5, 9, 6, 6]
    pyramid = [4, 5, 6, 7, 10, 10, 10, 10]
    tetrahedron = [0, 3, 4, 4, 11, 11, 11, 11]
    blocks = [("hexahedron", np.array([[*range(8)], prism, pyramid, tetrahedron]))]
    shapes = ("cube", "prism", "pyramid", "tetrahedron")
    made = Contents(np.array(points), blocks)
    made.groups |= {name: {0: np.array([k])} for k, name in enumerate(shapes)}
    made.surfaces["low"] = np.array([[0, 1, 2, 3]])
    made.nodes["ground"] = np.flatnonzero(made.points[:, 2] == 0)
    return made


@pytest.mark.parametrize("seed", range(8))
def test_hexahedra_that_have_collapsed_are_cut(seed):
    """Whatever the numbers: volumes of the regions, a part of a square and a triangle."""
    contents = collapsed()
    order = np.random.default_rng(seed).permutation(len(contents.points))
    cells = check(numbered(contents, order))
    assert cells.notes == (
        "its cells, 'Hexahedron 8', become tetrahedra with straight edges: a mesh has cells of one "
        "kind",
    )
    found = totals(cells, cells.regions)
    expected = {"cube": 1.0, "prism": 1 / 2, "pyramid": 1 / 3, "tetrahedron": 1 / 6}
    assert found == pytest.approx(expected)
    found = totals(cells, cells.parts)
    assert found == pytest.approx({"low": 1.0, "ground": 1.5})


def test_quadrilaterals_that_are_triangles_and_free_faces_of_prisms(tmp_path):
    plate = "*NODE\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n5,-1,1\n*ELEMENT,TYPE=CPE4,ELSET=plate\n"
    plate += "1,1,2,3,4\n2,1,4,5,5\n*SURFACE,NAME=rim\nplate,\n*SURFACE,NAME=end\n1,S3\n2,S2\n"
    (tmp_path / "plate.inp").write_text(plate)
    domain = from_file(MPI.COMM_SELF, tmp_path / "plate.inp")
    assert integral(domain) == pytest.approx(1.5)
    assert sizes_of_parts(domain) == pytest.approx({"rim": 4 + 2**0.5, "end": 2.0})
    # Two prisms that share a square, each as a hexahedron, collapsed at corners of other numbers.
    prisms = "*NODE\n1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,0,0,1\n6,1,0,1\n7,1,1,1\n8,0,1,1\n"
    prisms += "*ELEMENT,TYPE=C3D8,ELSET=all\n1,1,2,3,3,5,6,7,7\n2,3,4,1,1,7,8,5,5\n"
    prisms += "*SURFACE,NAME=skin\nall,\n*SURFACE,NAME=low\nall,S1\n*SURFACE,NAME=end\n1,S4\n2,S3\n"
    (tmp_path / "prisms.inp").write_text(prisms)
    domain = from_file(MPI.COMM_SELF, tmp_path / "prisms.inp")
    assert integral(domain) == pytest.approx(1.0)
    assert sizes_of_parts(domain) == pytest.approx({"skin": 6.0, "low": 1.0, "end": 2.0})
