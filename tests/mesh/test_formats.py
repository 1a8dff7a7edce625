"""Mesh files of other programs: their sets become parts and regions; damaged ones are refused."""

from __future__ import annotations

import re
from functools import partial

import numpy as np
import pytest
from mpi4py import MPI

import meshes
from contact._compat import geometry_dofmap
from contact.case.file import parse_case
from contact.cli.main import BAD_INPUT, CONVERGED, main
from contact.errors import InputError
from contact.mesh.contents import SERENDIPITY, Contents
from contact.mesh.formats import session
from contact.mesh.reader import FORMATS, _by_meshio, from_file, mesh_files
from contact.ranks import on_root
from tests.mesh.test_conventions import HEXAHEDRA, cells
from tests.problems import files
from tests.problems.sizes import integral, sizes_of_parts

COMM = MPI.COMM_WORLD

PLATE = """\
*Heading
 a plate, as CalculiX's manual writes them
*NODE, NSET=Nall
1, 0., 0., 0.
2, 1., 0.
3, 2., 0.
4, 0., 1.
5, 1., 1.
6, 2., 1.
10, .5, 0.
11, 1.5, 0
** elements by numbers with gaps, a line that goes on
*Element, type=CPE4, elset=Eall
 7, 1, 2, 5, 4
 8, 2, 3, 6,
 5
*NSET, NSET=ground, GENERATE
1, 3, 1
*NSET, NSET=alone
2
*ELSET,
 ELSET=Right
8
*ELSET, ELSET=both
right, 7
*SURFACE, NAME=top, TYPE=ELEMENT
Eall, S3
*surface, name=side
right, S2
*SURFACE, NAME=below, TYPE=NODE
ground
*BOUNDARY
ground, 2
*STEP
*STATIC
*END STEP
"""


def two_cubes(program: str, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the points of two cubes along x, and each of them by its nodes in a program's order.

    Those of MED are mirrored.
    """
    points, rows = cells(3, HEXAHEDRA[program])
    nodes = points[rows[0, :count]][:, [1, 0, 2] if "MED" in program else [0, 1, 2]]
    every = np.concatenate([nodes, nodes + np.array([1.0, 0.0, 0.0])])
    points, number = np.unique(every, axis=0, return_inverse=True)
    return points, number.reshape(2, -1)


def bricks(bend: float = 0.0) -> str:
    """Two elements of twenty nodes, of which one edge may be bent; faces as Abaqus numbers them."""
    points, rows = two_cubes("Abaqus 20", 20)
    points[(points == [0.5, 0.0, 0.0]).all(axis=1), 2] = bend
    surfaces = [("low", "Eall, S1"), ("high", "Eall, S2"), ("front", "1, S3"), ("end", "2, S4")]
    surfaces += [("back", "2, S5"), ("start", "1, S6"), ("skin", "Eall,")]
    text = files.abaqus(Contents(points, [("hexahedron", rows)], {"EALL": {0: np.arange(2)}}))
    return text + "".join(f"*SURFACE, NAME={name}\n{face}\n" for name, face in surfaces)


def write_other(path, name: str) -> None:
    """Write the plate, with meshio as far as a format goes."""
    if name == "plate.inp":
        path.write_text(PLATE)
        return
    meshio = pytest.importorskip("meshio")
    points = np.array([[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1.0]])
    quads = ("quad", np.array([[0, 1, 4, 3], [1, 2, 5, 4]]))
    lines = ("line", np.array([[0, 1], [1, 2], [3, 4], [4, 5]]))
    none, both = np.array([], dtype=int), np.array([0, 1])
    if name.endswith(".vtu"):
        sets = {"steel": [both, none], "ground": [none, both], "top": [none, both + 2]}
        made = meshio.Mesh(points, [quads, lines], cell_sets=sets)
    elif name.endswith(".e"):
        pytest.importorskip("netCDF4")
        flat = np.column_stack([points, np.zeros(6)])
        sets = {"ground": np.array([0, 1, 2]), "top": np.array([3, 4, 5])}
        made = meshio.Mesh(flat, [quads], point_sets=sets)
    elif name.endswith(".med"):
        pytest.importorskip("h5py")
        tags = [np.array([-6, -7]), np.array([-8, -8, -9, -9])]
        made = meshio.Mesh(points, [quads, lines], cell_data={"cell_tags": tags})
        made.cell_tags = {-6: ["steel"], -7: ["steel", "soft"], -8: ["ground"], -9: ["top"]}
        made.point_data, made.point_tags = (
            {"point_tags": np.array([2, 0, 0, 2, 0, 0])},
            {2: ["left"]},
        )
    else:
        tags = [np.array([6, 6]), np.array([8, 8, 9, 9])]
        key = "nastran:ref" if name.endswith(".bdf") else "cell_tags"
        made = meshio.Mesh(points, [quads, lines], cell_data={key: tags})
    more = {"data_format": "XML"} if name == "text.xdmf" else {}
    if name.endswith(".xdmf"):
        pytest.importorskip("h5py")
    meshio.write(path, made, **more)


#: Nodes of the lower and the upper side of MED's HEXA27: corners, edges between them, the middle.
LOWER, UPPER = [0, 1, 2, 3, 8, 9, 10, 11, 20], [4, 7, 6, 5, 15, 14, 13, 12, 25]


def salome(count: int = 27, bend: float = 0.0) -> Contents:
    """Return two mirrored cubes along x as Salome has them: a side in two groups, one in none."""
    points, rows = two_cubes("MED 27", count)
    points[:, 2] += bend * points[:, 0] * (2 - points[:, 0])
    of_side = {27: 9, 20: 8, 8: 4}[count]
    sides = np.concatenate([rows[:, side[:of_side]] for side in (LOWER, UPPER)])
    both = {1: np.arange(2)}
    groups = {"low": both, "Group_of_faces": both, "high": {1: np.array([2])}}
    left = {"left": np.flatnonzero(points[:, 0] == 0)}
    return Contents(points, [("hexahedron", rows), ("quad", sides)], groups, left)


FILES = {
    "plate.vtu": ({"ground": 2.0, "top": 2.0}, {"steel": 2.0}),
    "plate.e": ({"ground": 2.0, "top": 2.0}, {"0": 2.0}),
    "plate.med": ({"ground": 2.0, "top": 2.0, "left": 1.0}, {"steel": 2.0, "soft": 1.0}),
    "plate.bdf": ({"8": 2.0, "9": 2.0}, {"6": 2.0}),
    "text.xdmf": ({"8": 2.0, "9": 2.0}, {"6": 2.0}),
    "heavy.xdmf": ({"8": 2.0, "9": 2.0}, {"6": 2.0}),
}


def regions(domain) -> dict[str, float]:
    return {name: integral(domain, region=name) for name in domain.regions}


@pytest.mark.core
@pytest.mark.parallel
def test_sets_of_abaqus_are_parts_and_regions(shared_tmp_path):
    path = shared_tmp_path / "plate.inp"
    on_root(COMM, lambda: path.write_text(PLATE))
    domain = from_file(COMM, path)
    expected = {"top": 2.0, "side": 1.0, "Nall": 6.0, "ground": 2.0, "below": 2.0}
    assert sizes_of_parts(domain) == pytest.approx(expected)
    assert regions(domain) == pytest.approx({"Eall": 2.0, "Right": 1.0, "both": 2.0})
    assert domain.notes == ()


@pytest.mark.parallel
def test_faces_of_twenty_node_bricks(shared_tmp_path):
    path = shared_tmp_path / "main.inp"
    if COMM.rank == 0:
        (shared_tmp_path / "mesh.txt").write_text(bricks())
        path.write_text("*INCLUDE, INPUT=mesh.txt\n")
    COMM.barrier()
    domain = from_file(COMM, path)
    expected = {"low": 2.0, "high": 2.0, "front": 1.0, "end": 1.0, "back": 1.0, "start": 1.0}
    assert sizes_of_parts(domain) == pytest.approx({**expected, "skin": 10.0})
    assert domain.notes == ()
    x = domain.mesh.geometry.x
    for part, axis, value in (("low", 2, 0), ("high", 2, 1), ("front", 1, 0), ("end", 0, 2)):
        from dolfinx.mesh import entities_to_geometry

        facets = domain.facets(part)
        if facets.size:
            assert np.ptp(x[entities_to_geometry(domain.mesh, 2, facets)][..., axis] - value) == 0


def test_bent_edges_are_kept(tmp_path):
    """Twenty nodes of a brick are those of 27, with its own functions on the faces and inside."""
    (tmp_path / "bent.inp").write_text(bricks(0.05))
    domain = from_file(MPI.COMM_SELF, tmp_path / "bent.inp")
    assert domain.order == 2 and geometry_dofmap(domain.mesh).shape == (2, 27)
    assert domain.mesh.geometry.index_map().size_global == 45
    assert domain.notes == (SERENDIPITY,)
    (tmp_path / "folded.inp").write_text(bricks(1.5))
    with pytest.raises(InputError, match=r"\[folded-edges\]"):
        from_file(MPI.COMM_SELF, tmp_path / "folded.inp")


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("name", FILES)
def test_other_formats(name, shared_tmp_path):
    parts, cells = FILES[name]
    on_root(COMM, lambda: write_other(shared_tmp_path / name, name))
    domain = from_file(COMM, shared_tmp_path / name)
    assert sizes_of_parts(domain) == pytest.approx(parts)
    assert regions(domain) == pytest.approx(cells)


SU2 = """NDIME= 2
NPOIN= 6
0 0
1 0
2 0
0 1
1 1
2 1
NELEM= 2
9 0 1 4 3
9 1 2 5 4
NMARK= 2
MARKER_TAG= 8
MARKER_ELEMS= 2
3 0 1
3 1 2
MARKER_TAG= 9
MARKER_ELEMS= 2
3 3 4
3 4 5
"""


def test_a_format_of_meshio_is_one_entry(tmp_path, monkeypatch):
    """Its numbers are the names of parts: markers of SU2 (meshio 5.3.5 cannot write them)."""
    monkeypatch.setitem(FORMATS, ".su2", ("SU2", partial(_by_meshio, "su2")))
    (tmp_path / "plate.su2").write_text(SU2)
    domain = from_file(MPI.COMM_SELF, tmp_path / "plate.su2")
    assert sizes_of_parts(domain) == pytest.approx({"8": 2.0, "9": 2.0})


def test_the_case_file_names_every_ending():
    with pytest.raises(InputError) as error:
        parse_case({"mesh": {"file": 3}, "contact": {"on": "top"}})
    assert FORMATS.keys() <= {*re.findall(r"\.\w+(?=[,)])", str(error.value))}


@pytest.mark.parallel
@pytest.mark.parametrize("count", [8, 20, 27])
def test_groups_of_salome(count, shared_tmp_path):
    """Families of several groups, arrays that are left out, nodes in MED's own order."""
    path = shared_tmp_path / "piece.med"
    on_root(COMM, lambda: files.write(path, salome(count, 0.0 if count == 8 else 0.05)))
    domain = from_file(COMM, path)
    bent = 1.0 if count == 8 else sizes_of_parts(domain)["high"]
    expected = {"low": 2 * bent, "Group_of_faces": 2 * bent, "high": bent, "left": 1.0}
    assert sizes_of_parts(domain) == pytest.approx(expected, rel=1e-6)
    assert integral(domain) == pytest.approx(2.0)
    assert domain.order == (1 if count == 8 else 2)


def test_a_med_file_of_two_meshes_is_refused(tmp_path):
    files.write(tmp_path / "piece.med", salome(8))
    import h5py

    with h5py.File(tmp_path / "piece.med", "a") as data:
        data.copy("ENS_MAA/piece", "ENS_MAA/other")
    with pytest.raises(InputError, match=r"\[mesh-file\]"):
        from_file(MPI.COMM_SELF, tmp_path / "piece.med")


@pytest.mark.parallel
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("cell", ["tetrahedron", "hexahedron"])
def test_input_files_that_gmsh_writes(cell, order, shared_tmp_path):
    """C3D4, C3D10, C3D8 and C3D27 with *ELSET of surfaces; parts are those of Gmsh's own format."""
    sizes = {"size": 4.0, "contact_size": 4.0, "contact_width": 8.0, "radius": 8.0}
    if COMM.rank == 0:
        for ending in ("msh", "inp"):
            meshes.write("sphere", shared_tmp_path / f"ball.{ending}", cell, order, **sizes)
    COMM.barrier()
    own, other = (from_file(COMM, shared_tmp_path / f"ball.{ending}") for ending in ("msh", "inp"))
    assert own.order == other.order == order
    found = sizes_of_parts(other)
    assert {name: found[name] for name in own.parts} == pytest.approx(sizes_of_parts(own))
    assert regions(other)["body"] == pytest.approx(regions(own)["body"])


@pytest.mark.core
def test_side_sets_of_exodus(tmp_path):
    square = [(0, 0), (1, 0), (1, 1), (0, 1)]
    points = np.array([(x, y, z) for z in (0, 1) for x, y in square], float)
    path = tmp_path / "cube.exo"
    files.write(path, Contents(points, [("hexahedron", np.arange(8)[None])]))
    files.add_side_sets(path, {10 + side: [(1, side)] for side in range(1, 7)})
    domain = from_file(MPI.COMM_SELF, path)
    assert sizes_of_parts(domain) == pytest.approx({str(k): 1.0 for k in range(11, 17)})
    # Outward normals: -y, x, y, -x, -z, z.
    middles = {"11": (1, 0.0), "12": (0, 1.0), "13": (1, 1.0), "14": (0, 0.0), "15": (2, 0.0)}
    from dolfinx.mesh import compute_midpoints

    for part, (axis, value) in middles.items():
        assert compute_midpoints(domain.mesh, 2, domain.facets(part))[0, axis] == value


@pytest.mark.parametrize("name", ["plate.inp", "plate.bdf"])
def test_contact_new_takes_names_and_numbers_of_parts(name, tmp_path, capsys):
    path = tmp_path / name
    write_other(path, name)
    capsys.readouterr()
    assert main(["new", str(path)]) == CONVERGED
    assert main(["check", str(path.with_suffix(".toml"))]) == CONVERGED
    assert "2 cells in 2-D" in capsys.readouterr().out


@pytest.mark.parametrize("share", [0.0, 0.1, 0.4, 0.8])
@pytest.mark.parametrize("name", ["plate.inp", *FILES])
def test_damaged_files_end_in_one_line(name, share, tmp_path, capsys):
    path = tmp_path / name
    if name == "plate.inp":
        path.write_text(PLATE.split("*NSET, NSET=ground")[0])
    else:
        write_other(path, name)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    capsys.readouterr()
    assert main(["new", str(path)]) == BAD_INPUT
    printed = capsys.readouterr()
    assert printed.out == ""
    assert len(printed.err.strip().splitlines()) == 1
    assert name in printed.err
    assert [p.name for p in tmp_path.glob("*.toml")] == []


def test_binary_arrays_are_beside_their_xdmf(tmp_path, monkeypatch):
    """Wherever the program runs."""
    meshio = pytest.importorskip("meshio")
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    monkeypatch.chdir(tmp_path)
    marked = {"set": np.array([1, 1, 0])}
    made = meshio.Mesh(points, [("triangle", np.array([[0, 1, 2]]))], point_data=marked)
    meshio.write("part.xdmf", made, data_format="Binary")
    monkeypatch.chdir("/")
    domain = from_file(MPI.COMM_SELF, tmp_path / "part.xdmf")
    assert sizes_of_parts(domain) == pytest.approx({"set 1": 1.0})
    assert {path.name for path in mesh_files(tmp_path / "part.xdmf")} == {
        path.name for path in tmp_path.iterdir()
    }


@pytest.mark.core
def test_labels_of_nodes_of_medit_are_no_parts(tmp_path):
    """Medit has a reference at each node; only those of edges and cells are groups."""
    meshio = pytest.importorskip("meshio")
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    blocks = [("triangle", np.array([[0, 1, 2]])), ("line", np.array([[0, 1]]))]
    labels = {"medit:ref": np.array([4, 4, 5])}
    cells = {"medit:ref": [np.array([1]), np.array([2])]}
    meshio.write(tmp_path / "part.vtu", meshio.Mesh(points, blocks, labels, cells))
    domain = from_file(MPI.COMM_SELF, tmp_path / "part.vtu")
    assert sizes_of_parts(domain) == pytest.approx({"2": 1.0})
    assert [*domain.regions] == ["1"]


def test_an_empty_physical_group_is_named(tmp_path):
    """Where the case asks for it: it is no part whose name is not known."""
    pytest.importorskip("gmsh")
    with session() as gmsh:
        gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
        far = gmsh.model.occ.addPoint(5, 5, 0)
        line = gmsh.model.occ.addLine(gmsh.model.occ.addPoint(4, 4, 0), far)
        gmsh.model.occ.synchronize()
        for dim, tags, name in ((2, [1], "body"), (1, [1], "low"), (1, [line], "none")):
            gmsh.model.addPhysicalGroup(dim, tags, name=name)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.clear([(1, line)])
        gmsh.write(str(tmp_path / "part.msh"))
    domain = from_file(MPI.COMM_SELF, tmp_path / "part.msh")
    assert [*domain.parts] == ["low"]
    with pytest.raises(InputError, match="'none' has no elements"):
        domain.facets("none")
