"""Mesh files of other programs: their sets become parts and regions; damaged ones are refused."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

import meshes
from contact.cli.main import BAD_INPUT, CONVERGED, main
from contact.errors import InputError
from contact.mesh.contents import SERENDIPITY
from contact.mesh.reader import from_file, mesh_files
from tests.problems.sizes import integral, measures

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

#: Corners of a cube of two hexahedra along x, and the middle nodes of C3D20 between them.
EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)]
EDGES += [(0, 4), (1, 5), (2, 6), (3, 7)]


def bricks(bend: float = 0.0) -> str:
    """Two elements of twenty nodes, of which one edge may be bent; faces as Abaqus numbers them."""
    square = [(0, 0), (1, 0), (1, 1), (0, 1)]
    places: dict[tuple[float, ...], int] = {}
    rows = []
    for k in (0, 1):
        corners = [(x + k, y, float(z)) for z in (0, 1) for x, y in square]
        middles = [tuple(np.mean([corners[a], corners[b]], axis=0)) for a, b in EDGES]
        nodes = [
            places.setdefault(tuple(map(float, x)), len(places) + 1) for x in corners + middles
        ]
        rows.append(
            ", ".join(map(str, [k + 1, *nodes[:12]])) + ",\n" + ", ".join(map(str, nodes[12:]))
        )
    moved = {(0.5, 0.0, 0.0): (0.5, 0.0, bend)}
    lines = [f"{n}, " + ", ".join(map(str, moved.get(x, x))) for x, n in places.items()]
    surfaces = [("low", "Eall, S1"), ("high", "Eall, S2"), ("front", "1, S3"), ("end", "2, S4")]
    surfaces += [("back", "2, S5"), ("start", "1, S6"), ("skin", "Eall,")]
    text = ["*NODE", *lines, "*ELEMENT, TYPE=C3D20R, ELSET=EALL", *rows]
    for name, face in surfaces:
        text += [f"*SURFACE, NAME={name}", face]
    return "\n".join(text) + "\n"


def write_other(path, name: str) -> None:
    """Write the plate with meshio, as far as a format goes."""
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


#: Places of nodes of MED's HEXA27 in the unit cube: corners, edges of the lower and the upper face
#: and between them, the lower face, those around, the upper one, the middle.
H27 = np.array(
    [
        *((0, 0, 0), (0, 1, 0), (1, 1, 0), (1, 0, 0), (0, 0, 1), (0, 1, 1), (1, 1, 1), (1, 0, 1)),
        *((0, 0.5, 0), (0.5, 1, 0), (1, 0.5, 0), (0.5, 0, 0)),
        *((0, 0.5, 1), (0.5, 1, 1), (1, 0.5, 1), (0.5, 0, 1)),
        *((0, 0, 0.5), (0, 1, 0.5), (1, 1, 0.5), (1, 0, 0.5)),
        *((0.5, 0.5, 0), (0, 0.5, 0.5), (0.5, 1, 0.5), (1, 0.5, 0.5), (0.5, 0, 0.5)),
        *((0.5, 0.5, 1), (0.5, 0.5, 0.5)),
    ],
    dtype=float,
)


def write_salome(path, count: int = 27, bend: float = 0.0) -> None:
    """Write two cubes along x as Salome does: mirrored cells, families, none for whole kinds.

    Groups have names of 80 letters, several a family; a family of its own is 0, FAMILLE_ZERO, and
    a kind of cells that is all in it has no array FAM.
    """
    h5py = pytest.importorskip("h5py")
    places, rows = {}, []
    for k in (0, 1):
        at = [tuple(x) for x in (H27[:count] + np.array([k, 0.0, 0.0])).tolist()]
        rows.append([places.setdefault(x, len(places) + 1) for x in at])
    points = np.array(list(places))
    points[:, 2] += bend * points[:, 0] * (2 - points[:, 0])
    faces = {"low": [0, 1, 2, 3], "high": [4, 7, 6, 5]}
    kind = {27: ("H27", "QU9"), 20: ("H20", "QU8"), 8: ("HE8", "QU4")}[count]
    quads = [[row[c] for c in around] for around in faces.values() for row in rows]

    def middle(nodes: list[int]) -> int:
        return places[tuple(np.mean(np.array(list(places))[np.array(nodes) - 1], axis=0).tolist())]

    if count > 8:
        edges = [[middle([q[k], q[(k + 1) % 4]]) for k in range(4)] for q in quads]
        inner = [[middle(q)] if count == 27 else [] for q in quads]
        quads = [a + b + c for a, b, c in zip(quads, edges, inner, strict=True)]
    with h5py.File(path, "w") as data:
        mesh = data.create_group("ENS_MAA/piece")
        mesh.attrs["ESP"], mesh.attrs["DIM"] = 3, 3
        step = mesh.create_group("-0000000000000000001-0000000000000000001")
        step["NOE/COO"] = points.T.ravel()
        step["NOE/COO"].attrs["NBR"] = len(points)
        families = np.where(points[:, 0] == 0, 3, 0)
        step["NOE/FAM"] = families
        for name, of in zip(kind, (rows, quads), strict=True):
            step[f"MAI/{name}/NOD"] = np.array(of).T.ravel()
            step[f"MAI/{name}/NOD"].attrs["NBR"] = len(of)
        step[f"MAI/{kind[1]}/FAM"] = [-6, -6, -7, 0]
        sets = {
            "ELEME/FAM_-6_low": (-6, ["low", "Group_of_faces"]),
            "NOEUD/FAM_3_left": (3, ["left"]),
        }
        sets["ELEME/FAM_-7_high"] = (-7, ["high"])
        for name, (number, groups) in sets.items():
            family = data.create_group(f"FAS/piece/{name}")
            family.attrs["NUM"] = number
            letters = [list(group.encode().ljust(80, b"\0")) for group in groups]
            family["GRO/NOM"] = np.array(letters, dtype=np.int8)
            family["GRO"].attrs["NBR"] = len(groups)
        zero = data.create_group("FAS/piece/FAMILLE_ZERO")
        zero.attrs["NUM"] = 0


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
    if COMM.rank == 0:
        path.write_text(PLATE)
    COMM.barrier()
    domain = from_file(COMM, path)
    expected = {"top": 2.0, "side": 1.0, "Nall": 6.0, "ground": 2.0, "below": 2.0}
    assert measures(domain) == pytest.approx(expected)
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
    assert measures(domain) == pytest.approx({**expected, "skin": 10.0})
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
    assert domain.order == 2 and domain.mesh.geometry.dofmap.shape == (2, 27)
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
    if COMM.rank == 0:
        write_other(shared_tmp_path / name, name)
    COMM.barrier()
    domain = from_file(COMM, shared_tmp_path / name)
    assert measures(domain) == pytest.approx(parts)
    assert regions(domain) == pytest.approx(cells)


@pytest.mark.parallel
@pytest.mark.parametrize("count", [8, 20, 27])
def test_groups_of_salome(count, shared_tmp_path):
    """Families of several groups, arrays that are left out, nodes in MED's own order."""
    path = shared_tmp_path / "piece.med"
    if COMM.rank == 0:
        write_salome(path, count, 0.0 if count == 8 else 0.05)
    COMM.barrier()
    domain = from_file(COMM, path)
    bent = 1.0 if count == 8 else measures(domain)["high"]
    expected = {"low": 2 * bent, "Group_of_faces": 2 * bent, "high": bent, "left": 1.0}
    assert measures(domain) == pytest.approx(expected, rel=1e-6)
    assert integral(domain) == pytest.approx(2.0)
    assert domain.order == (1 if count == 8 else 2)


def test_a_med_file_of_two_meshes_is_refused(tmp_path):
    write_salome(tmp_path / "piece.med", 8)
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
    found = measures(other)
    assert {name: found[name] for name in own.parts} == pytest.approx(measures(own))
    assert regions(other)["body"] == pytest.approx(regions(own)["body"])


@pytest.mark.core
def test_side_sets_of_exodus(tmp_path):
    netcdf, meshio = pytest.importorskip("netCDF4"), pytest.importorskip("meshio")
    points = np.array(
        [(x, y, z) for z in (0, 1) for x, y in [(0, 0), (1, 0), (1, 1), (0, 1)]], float
    )
    path = tmp_path / "cube.exo"
    meshio.write(path, meshio.Mesh(points, [("hexahedron", np.arange(8)[None])]))
    with netcdf.Dataset(str(path), "a") as data:
        data.createDimension("num_side_sets", 6)
        for side in range(1, 7):
            data.createDimension(f"num_side_ss{side}", 1)
            for kind, value in (("elem", 1), ("side", side)):
                made = data.createVariable(f"{kind}_ss{side}", "i4", (f"num_side_ss{side}",))
                made[:] = value
        numbers = data.createVariable("ss_prop1", "i4", ("num_side_sets",))
        numbers[:] = np.arange(11, 17)
    domain = from_file(MPI.COMM_SELF, path)
    assert measures(domain) == pytest.approx({str(k): 1.0 for k in range(11, 17)})
    # Outward normals: -y, x, y, -x, -z, z.
    middles = {"11": (1, 0.0), "12": (0, 1.0), "13": (1, 1.0), "14": (0, 0.0), "15": (2, 0.0)}
    from dolfinx.mesh import compute_midpoints

    for part, (axis, value) in middles.items():
        assert compute_midpoints(domain.mesh, 2, domain.facets(part))[0, axis] == value


@pytest.mark.parametrize("name", ["plate.inp", *FILES])
def test_contact_new_takes_each_of_them(name, tmp_path, capsys):
    path = tmp_path / name
    if name == "plate.inp":
        path.write_text(PLATE)
    else:
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
    assert measures(domain) == pytest.approx({"set 1": 1.0})
    assert {path.name for path in mesh_files(tmp_path / "part.xdmf")} == {
        path.name for path in tmp_path.iterdir()
    }
