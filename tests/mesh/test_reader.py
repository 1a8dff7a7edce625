"""Gmsh files: what is read, what is refused, what is ignored."""

import re
from pathlib import Path

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI

import meshes
from contact.errors import InputError
from contact.mesh.reader import from_msh
from tests.problems.sizes import integral, measures

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
    assert measures(domain) == pytest.approx(expected)


@pytest.mark.core
@pytest.mark.parallel
def test_cells_of_second_order_keep_their_nodes():
    domain = from_msh(COMM, FIXTURES / "curved.msh")
    assert domain.order == 2 and domain.mesh.geometry.index_map().size_global == 6
    arc = (np.sqrt(1.16) + np.arcsinh(0.4) / 0.4) / 2  # of a parabola
    assert measures(domain) == pytest.approx({"bottom": arc, "top": 2**0.5}, rel=1e-3)


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
