"""Sets, surfaces and elements of Abaqus' input files as people write them.

Gmsh files: what is read, what is refused, what is ignored.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI

import meshes
from contact.errors import InputError
from contact.mesh.contents import Contents
from contact.mesh.reader import from_file, from_msh
from tests.problems import files
from tests.problems.sizes import integral, sizes_of_parts


def cube(n: int = 2) -> Contents:
    """Return the unit cube of n x n x n elements, those of the lowest layer first."""
    points = np.array([*np.ndindex((n + 1,) * 3)], float)[:, ::-1] / n
    number = np.arange((n + 1) ** 3).reshape((n + 1,) * 3)
    around = [(up, *ji) for up in (0, 1) for ji in [(0, 0), (0, 1), (1, 1), (1, 0)]]
    corners = [number[c : n + c, b : n + b, a : n + a].ravel() for c, b, a in around]
    return Contents(points, [("hexahedron", np.stack(corners, axis=1))])


def block() -> str:
    """Return the cube of eight elements as an input file, all in the set Eall."""
    return files.abaqus(replace(cube(), groups={"Eall": {0: np.arange(8)}}))


#: The faces of the cube's lower side, as shells.
SHELLS = "*ELEMENT, TYPE=S4R, ELSET=shell\n101,1,2,5,4\n102,2,3,6,5\n103,4,5,8,7\n104,5,6,9,8\n"


def read(tmp_path, text: str):
    (tmp_path / "block.inp").write_text(text)
    return from_file(MPI.COMM_SELF, tmp_path / "block.inp")


@pytest.mark.parametrize("order", ["1, 2, 5, 4, 10, 11, 14, 13", "10, 11, 14, 13, 1, 2, 5, 4"])
def test_a_cell_that_stands_twice_counts_once(order, tmp_path):
    """Facets of the boundary stay there, and the volume is that of the body."""
    again = f"*ELEMENT, TYPE=C3D8R, ELSET=again\n11, {order}\n*ELEMENT, TYPE=C3D8, ELSET=more\n"
    again += f"12, {order}\n*NSET, NSET=low, GENERATE\n1, 9\n*ELSET, ELSET=all\nEall, again, more\n"
    again += "*SURFACE, NAME=skin\nall,\n"
    domain = read(tmp_path, block() + again)
    assert sizes_of_parts(domain) == pytest.approx({"low": 1.0, "skin": 6.0})
    assert integral(domain) == pytest.approx(1.0)
    assert {name: len(cells) for name, cells in domain.regions.items()} == {
        **{"Eall": 8, "again": 1, "more": 1, "all": 8}
    }
    assert domain.notes == ()


@pytest.mark.parametrize("label", ["S1", "S2", "SPOS", "SNEG", ""])
def test_either_side_of_a_shell_is_the_facet(label, tmp_path):
    text = f"*SURFACE, NAME=low\nshell, {label}\n*NSET, NSET=high, GENERATE\n19, 27\n"
    domain = read(tmp_path, block() + SHELLS + text)
    assert sizes_of_parts(domain) == pytest.approx({"low": 1.0, "shell": 1.0, "high": 1.0})


def test_edges_of_shells_are_no_facets_of_solids(tmp_path):
    edges = "*SURFACE, NAME=rim\nshell, S3\nshell, E2\n*SURFACE, NAME=both\nshell, S4\n5, S2\n"
    domain = read(tmp_path, block() + SHELLS + edges)
    assert sizes_of_parts(domain) == pytest.approx({"both": 0.25, "shell": 1.0})
    assert "'rim' has no facets" in domain.unusable["rim"]


def test_surfaces_made_of_others_are_refused_by_name(tmp_path):
    text = "*SURFACE, NAME=low\n1, S1\n*SURFACE, NAME=high\n8, S2\n"
    text += "*SURFACE, NAME=both, COMBINE=UNION\nlow, high\n"
    with pytest.raises(InputError, match=r"\[mesh-file\]"):
        read(tmp_path, block() + text)


def test_nodes_of_a_set_of_elements(tmp_path):
    """Before or behind its elements, and with other nodes."""
    sets = "*NSET, NSET=layer, ELSET=lowest\n*ELSET, ELSET=lowest, GENERATE\n1, 4\n"
    sets += "*NSET, NSET=high, GENERATE\n19, 27\n*NSET, NSET=both\nlayer, high\n"
    domain = read(tmp_path, block() + sets)
    assert sizes_of_parts(domain) == pytest.approx({"layer": 1 + 4 / 2, "high": 1.0, "both": 6.0})


def test_sets_and_surfaces_of_one_name(tmp_path):
    """Parts of the same facets are one; else the surface stays, and it is said."""
    sets = "*NSET, NSET=low, GENERATE\n1, 9\n*SURFACE, NAME=LOW\n1, S1\n2, S1\n3, S1\n4, S1\n"
    sets += "*NSET, NSET=End, GENERATE\n19, 27\n*SURFACE, NAME=end\n5, S2\n"
    sets += "*NSET, NSET=nodal, GENERATE\n1, 9\n*SURFACE, NAME=NODAL, TYPE=NODE\nEND\n"
    domain = read(tmp_path, block() + sets)
    assert sizes_of_parts(domain) == pytest.approx({"low": 1.0, "End": 0.25, "nodal": 1.0})


PARTS = """*PART, NAME=Part-1
{block}*NSET, NSET=Set-1, GENERATE
1, 27
*ELSET, ELSET=Set-1, GENERATE
1, 8
*END PART
*ASSEMBLY, NAME=Assembly
*INSTANCE, NAME=Part-1-1, PART=Part-1
*END INSTANCE
{sets}*END ASSEMBLY
"""


def in_parts(sets: str) -> str:
    """Return the unit cube as Abaqus/CAE writes it: a part with sets, and those of an assembly."""
    return PARTS.format(block=files.abaqus(cube()), sets=sets)


def test_a_part_and_its_assembly_have_names_of_their_own(tmp_path):
    """Set-1 is Abaqus/CAE's first name for the section of a part, and for supports."""
    sets = "*NSET, NSET=Set-1, INSTANCE=Part-1-1, GENERATE\n1, 9\n"
    sets += "*ELSET, ELSET=set-1, INSTANCE=Part-1-1\n1, 2\n"
    domain = read(tmp_path, in_parts(sets))
    assert sizes_of_parts(domain) == pytest.approx({"Set-1": 1.0, "Part-1-1.Set-1": 6.0})
    found = {name: len(cells) for name, cells in domain.regions.items()}
    assert found == {"Part-1-1.Set-1": 8, "Set-1": 2}


COMM = MPI.COMM_WORLD
FIXTURES = Path(meshes.__file__).parent / "fixtures"


def midpoints(domain, cells):
    return dmesh.compute_midpoints(domain.mesh, domain.dim, cells).reshape(-1, 3)


BAR = {"left": 1.0, "right": 1.0, "bottom": 4.0, "top": 4.0, "loaded": 2.0}
GOOD = {
    "bar.msh": (2, BAR),
    "bar-2.2.msh": (2, BAR),
    "block.msh": (3, dict.fromkeys(("left", "right", "front", "back", "bottom", "top"), 1.0)),
    "square.msh": (2, {"bottom": 1.0, "top": 1.0}),
    "clockwise.msh": (2, {"bottom": 1.0, "top": 1.0}),
    "triangle.msh": (2, {"bottom": 1.0, "top": 1.0}),  # one cell, stored at z = 2
    "overlap.msh": (2, {"bottom": 1.0, "top": 1.0, "all": 3.0}),
    "regions.msh": (2, {"bottom": 1.0, "top": 1.0}),  # cells in two groups, and twice in one
    "quadrangle.msh": (2, {"bottom": 1.0, "top": 1.0}),
    "second-order.msh": (2, {"bottom": 1.0, "top": 2**0.5}),  # nodes in the middles of edges
    "collapsed.msh": (2, {"bottom": 1.0, "top": 2**0.5}),  # a square with one node at two corners
    "mixed.msh": (2, {"bottom": 1.0, "top": 1.0}),  # two groups in one elementary entity
}
BAD = {
    "line.msh": "no-groups",
    "no-cells.msh": "no-groups",
    "empty.msh": "no-groups",
    "no-groups.msh": "no-groups",
    "no-boundary.msh": "no-groups",
    "degenerate.msh": "mesh-geometry",
    "folded.msh": "mesh-geometry",
    "arrow.msh": "folded-cells",
    "curled.msh": "folded-edges",
    "surface.msh": "surface-mesh",
    "text.msh": "mesh-file",
    "cut.msh": "mesh-file",
    "absent.msh": "file-name",
}


@pytest.mark.core("bar.msh", "bar-2.2.msh", "block.msh")
@pytest.mark.parallel
@pytest.mark.parametrize("name", GOOD)
def test_mesh_files_are_read_with_their_parts(name):
    dim, expected = GOOD[name]
    domain = from_msh(COMM, FIXTURES / name)
    assert domain.dim == dim
    assert sizes_of_parts(domain) == pytest.approx(expected)


@pytest.mark.core
@pytest.mark.parallel
def test_cells_of_second_order_keep_their_nodes():
    domain = from_msh(COMM, FIXTURES / "curved.msh")
    assert domain.order == 2 and domain.mesh.geometry.index_map().size_global == 6
    arc = (np.sqrt(1.16) + np.arcsinh(0.4) / 0.4) / 2  # of a parabola
    assert sizes_of_parts(domain) == pytest.approx({"bottom": arc, "top": 2**0.5}, rel=1e-3)


@pytest.mark.parallel
@pytest.mark.parametrize("name", BAD)
def test_bad_mesh_files_are_refused_on_all_ranks(name):
    with pytest.raises(InputError, match=rf"{name}.*\[{BAD[name]}\]"):
        from_msh(COMM, FIXTURES / "bad" / name)


@pytest.mark.parametrize("unit", ["e-200", "e-9", "e150"])
def test_shapes_are_judged_in_any_unit_of_length(unit, tmp_path):
    for name, message in (("square.msh", None), ("bad/degenerate.msh", r"\[mesh-geometry\]")):
        head, tail = (FIXTURES / name).read_text().split("$EndNodes")
        text = re.sub(r"(?m)^(\d+) (\S+) (\S+) (\S+)$", rf"\1 \g<2>{unit} \g<3>{unit} \4", head)
        (tmp_path / "body.msh").write_text(f"{text}$EndNodes{tail}")
        if message is None:
            domain = from_msh(MPI.COMM_SELF, tmp_path / "body.msh")
            assert domain.size == float(f"1{unit}")
        else:
            with pytest.raises(InputError, match=message):
                from_msh(MPI.COMM_SELF, tmp_path / "body.msh")


def test_one_part_at_least_is_needed(tmp_path):
    text = (FIXTURES / "interior.msh").read_text().replace("1 1 2 2 1 1 2", "1 1 2 3 1 1 3")
    (tmp_path / "body.msh").write_text(text)
    with pytest.raises(InputError, match=r"\[part-facets\]"):
        from_msh(MPI.COMM_SELF, tmp_path / "body.msh")


@pytest.mark.core
@pytest.mark.parallel
def test_groups_of_cells_are_regions():
    domain = from_msh(COMM, FIXTURES / "regions.msh")
    areas = {name: integral(domain, region=name) for name in domain.regions}
    assert areas == pytest.approx({"right": 0.5, "left": 0.5, "all": 1.0})
    x = np.vstack(COMM.allgather(midpoints(domain, domain.cells("right"))))
    assert x == pytest.approx(np.array([[2 / 3, 1 / 3, 0.0]]))


@pytest.mark.parallel
def test_cells_in_no_group_are_no_part_of_the_body():
    domain = from_msh(COMM, FIXTURES / "ungrouped.msh")
    assert integral(domain) == pytest.approx(0.5)
    assert "1 cell(s) in no physical group are no part of the body" in domain.notes


@pytest.mark.parametrize(
    "start",
    [
        "// $MeshFormat 2.2\n",
        "// $MeshFormat\n// 4.1 0 8\n",
        "\n$MeshFormat\n4.1 0 8\n",
        " $MeshFormat\n2.2 0 8\n",
        "\ufeff// $MeshFormat\n",
        "$MeshFormat;\n2.2 0 8\n",
        "/*\n$MeshFormat\n2.2 0 8\n*/\n",
    ],
)
@pytest.mark.parametrize("name", ["body.msh", "body.geo", "body"])
def test_a_mesh_file_is_never_executed(start, name, tmp_path):
    mark = tmp_path / "executed"
    command = f'SystemCall "touch {mark}";\nPrintf("x") > "{mark}";\n'
    (tmp_path / name).write_text(start + command, encoding="utf-8")
    with pytest.raises(InputError, match=r"\[mesh-file\]"):
        from_msh(MPI.COMM_SELF, tmp_path / name)
    assert not mark.exists()
