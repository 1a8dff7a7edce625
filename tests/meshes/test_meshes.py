"""Gmsh files and recipes: what is read, what is refused, what the recipes make."""

import codecs
import logging
import re
from pathlib import Path

import gmsh
import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

import meshes
from contact.build import build_problem
from contact.case.file import parse_case
from contact.errors import InputError
from contact.mesh.reader import from_msh, from_recipe
from meshes.__main__ import main

COMM = MPI.COMM_WORLD
FIXTURES = Path(meshes.__file__).parent / "fixtures"


def integral(domain, measure, integrand=1.0):
    form = fem.form(ufl.as_ufl(integrand) * fem.Constant(domain.mesh, 1.0) * measure)
    return COMM.allreduce(fem.assemble_scalar(form))


def measures(domain):
    return {name: integral(domain, domain.ds(name)) for name in domain.parts}


def vertices_of(domain, name):
    mesh, dim = domain.mesh, domain.dim
    nodes = dmesh.entities_to_geometry(mesh, dim - 1, domain.facets(name))
    return mesh.geometry.x[np.unique(nodes)]


def midpoints(domain, cells):
    return dmesh.compute_midpoints(domain.mesh, domain.dim, cells).reshape(-1, 3)


def nodes(domain):
    return domain.mesh.geometry.index_map().size_global


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
    "mixed.msh": (2, {"bottom": 1.0, "top": 1.0}),  # two groups in one elementary entity
}
BAD = {
    "line.msh": "no triangles or tetrahedra",
    "no-cells.msh": "no triangles or tetrahedra",
    "empty.msh": "no triangles or tetrahedra",
    "no-groups.msh": "no physical groups of curves",
    "no-boundary.msh": "no physical groups of curves",
    "degenerate.msh": r"1 cell\(s\) of zero volume, the first near \(0.5, 0\)",
    "folded.msh": "cells overlap",
    "quadrangle.msh": "'Quadrilateral 4', of another shape",
    "second-order.msh": "'Triangle 6', of curved geometry",
    "surface.msh": "surface in space",
    "text.msh": "no Gmsh .msh file",
    "cut.msh": "it is cut off",
    "absent.msh": "no such file",
}


@pytest.mark.parallel
@pytest.mark.parametrize("name", GOOD)
def test_mesh_files_are_read_with_their_parts(name):
    dim, expected = GOOD[name]
    domain = from_msh(COMM, FIXTURES / name)
    assert domain.dim == dim
    assert measures(domain) == pytest.approx(expected)


@pytest.mark.parallel
@pytest.mark.parametrize("name", BAD)
def test_bad_mesh_files_are_refused_on_all_ranks(name):
    with pytest.raises(InputError, match=f"mesh file .*{name}: .*{BAD[name]}"):
        from_msh(COMM, FIXTURES / "bad" / name)


@pytest.mark.parallel
@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("interior.msh", "'top' has 1 interior facet(s); a part must lie on the boundary"),
        ("stray.msh", "'top' has facets that bound no cell"),
    ],
)
def test_a_group_that_is_no_part_is_ignored_until_it_is_used(name, reason, caplog):
    with caplog.at_level(logging.INFO, logger="contact"):
        domain = from_msh(COMM, FIXTURES / name)
    assert measures(domain) == pytest.approx({"bottom": 1.0})
    assert len(domain.notes) == 1
    assert reason in domain.notes[0]
    assert [reason in message for message in caplog.messages] == [True] * (COMM.rank == 0)
    with pytest.raises(InputError, match=f"mesh file .*{name}: .*{re.escape(reason)}"):
        domain.ds("top")
    case = {
        "mesh": {"file": str(FIXTURES / name)},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "bottom", "displacement": [0.0, 0.0]}],
        "contact": {"on": "top"},
    }
    with pytest.raises(InputError, match=f"{name}: .*{re.escape(reason)}"):
        build_problem(parse_case(case), COMM)


@pytest.mark.parametrize("unit", ["e-200", "e-9", "e150"])
def test_shapes_are_judged_in_any_unit_of_length(unit, tmp_path):
    for name, message in (("square.msh", None), ("bad/degenerate.msh", "zero volume")):
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
    with pytest.raises(InputError, match=r"'top' has \d interior facet"):
        from_msh(MPI.COMM_SELF, tmp_path / "body.msh")


@pytest.mark.parallel
def test_groups_of_cells_are_regions():
    domain = from_msh(COMM, FIXTURES / "regions.msh")
    areas = {name: integral(domain, domain.dx_in(name)) for name in domain.regions}
    assert areas == pytest.approx({"right": 0.5, "left": 0.5, "all": 1.0})
    x = np.vstack(COMM.allgather(midpoints(domain, domain.cells("right"))))
    assert x == pytest.approx(np.array([[2 / 3, 1 / 3, 0.0]]))


@pytest.mark.parallel
def test_cells_in_no_group_are_no_part_of_the_body():
    domain = from_msh(COMM, FIXTURES / "ungrouped.msh")
    assert integral(domain, domain.dx) == pytest.approx(0.5)
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
    with pytest.raises(InputError, match=r"no Gmsh .msh file"):
        from_msh(MPI.COMM_SELF, tmp_path / name)
    assert not mark.exists()


@pytest.mark.parametrize("fixture", ["bar.msh", "bar-2.2.msh"])
@pytest.mark.parametrize("mark", [b"", codecs.BOM_UTF8])
@pytest.mark.parametrize("name", ["body.msh", "body.msh.gz", "a b; touch x.geo", "mesh"])
def test_a_mesh_file_is_read_whatever_its_name(fixture, mark, name, tmp_path):
    (tmp_path / name).write_bytes(mark + (FIXTURES / fixture).read_bytes())
    assert measures(from_msh(MPI.COMM_SELF, tmp_path / name)) == pytest.approx(BAR)


def test_every_bad_fixture_is_in_the_table_and_all_are_small():
    assert {p.name for p in (FIXTURES / "bad").iterdir()} == set(BAD) - {"absent.msh"}
    assert all(p.stat().st_size < 20_000 for p in FIXTURES.rglob("*.msh"))


@pytest.mark.parallel
def test_a_running_gmsh_is_left_as_it_was():
    if COMM.rank == 0:
        gmsh.initialize(interruptible=False)
        gmsh.model.add("mine")
    from_recipe(COMM, "bar")
    if COMM.rank == 0:
        assert gmsh.isInitialized()
        assert gmsh.model.getCurrent() == "mine"
        gmsh.finalize()


ARC = np.pi * 8.0
RECIPES = {
    "quarter_disc": (np.pi * 16, {"symmetry": 8.0, "top": 8.0, "contact": ARC / 2}),
    "half_disc": (np.pi * 32, {"top": 16.0, "contact": ARC}),
    "disc": (np.pi * 64, {"contact": ARC, "top": ARC / 3}),
    "sphere": (
        np.pi * 500 / 3,
        {
            "symmetry_x": np.pi * 25,
            "symmetry_y": np.pi * 25,
            "top": np.pi * 25,
            "contact": np.pi * 50,
        },
    ),
    "bar": (4.0, BAR),
    "piezo_bar": (32.0, {"left": 4.0, "right": 4.0, "bottom": 8.0, "top": 8.0}),
    "bar_on_ends": (
        24.0,
        {"left": 2.0, "right": 2.0, "top": 12.0, "bottom_ends": 4.0, "contact": 8.0},
    ),
    "block": (1.0, GOOD["block.msh"][1]),
    "column": (
        4.0,
        {"left": 4.0, "right": 4.0, "front": 4.0, "back": 4.0, "bottom": 1.0, "top": 1.0},
    ),
}


@pytest.mark.parallel
@pytest.mark.parametrize("name", meshes.RECIPES)
def test_recipes_make_their_parts(name):
    volume, expected = RECIPES[name]
    domain = from_recipe(COMM, name)
    # Straight sides miss a little of a round body.
    assert measures(domain) == pytest.approx(expected, rel=1e-2)
    assert integral(domain, domain.dx) == pytest.approx(volume, rel=2e-2)


PLANES = {
    "left": (-1, 0, 0),
    "right": (1, 0, 0),
    "front": (0, -1, 0),
    "back": (0, 1, 0),
    "bottom": (0, 0, -1),
    "top": (0, 0, 1),
}


def test_faces_of_a_block_have_the_right_names():
    domain = from_recipe(COMM, "block", width=2.0, depth=3.0, size=0.6)
    nu = ufl.FacetNormal(domain.mesh)
    for name, normal in PLANES.items():
        area = integral(domain, domain.ds(name))
        found = [integral(domain, domain.ds(name), nu[i]) / area for i in range(3)]
        assert found == pytest.approx(normal, abs=1e-12)


@pytest.mark.parametrize("name", ["quarter_disc", "half_disc", "disc", "sphere"])
def test_nodes_of_round_parts_lie_on_the_circle(name):
    radius = 5.0
    domain = from_recipe(COMM, name, radius=radius)
    centre = np.array([0, 0, radius] if domain.dim == 3 else [0, radius, 0])
    x = vertices_of(domain, "contact")
    assert np.allclose(np.linalg.norm(x - centre, axis=1), radius, rtol=1e-9)
    assert np.min(np.linalg.norm(x, axis=1)) < 1e-12


def test_sphere_is_graded_towards_the_contact():
    domain = from_recipe(COMM, "sphere", contact_size=0.1)
    assert nodes(domain) < 30_000
    x = vertices_of(domain, "contact")
    inside = np.count_nonzero(np.linalg.norm(x, axis=1) < 0.88)
    # A quarter disc of radius 0.88 in triangles of edge 0.1.
    assert inside > 0.6 * (np.pi / 4 * 0.88**2) / (0.1**2 * np.sqrt(0.75))


@pytest.mark.parametrize(("half_width", "contact_size"), [(2.72, 0.2), (0.86, 0.07)])
def test_quarter_disc_resolves_the_hertz_contact(half_width, contact_size):
    domain = from_recipe(
        COMM, "quarter_disc", contact_size=contact_size, contact_width=1.5 * half_width
    )
    x = np.sort(vertices_of(domain, "contact")[:, 0])
    gaps = np.diff(x[x < 1.2 * half_width])
    assert gaps.max() < half_width / 12
    assert nodes(domain) < 3000


@pytest.mark.parametrize("name", meshes.RECIPES)
def test_smaller_sizes_give_more_nodes(name):
    sizes = {
        k: 0.7 * v for k, v in meshes.parameters(name).items() if k in ("size", "contact_size")
    }
    assert nodes(from_recipe(COMM, name, **sizes)) > nodes(from_recipe(COMM, name))


@pytest.mark.parallel
@pytest.mark.parametrize(
    ("name", "given", "message"),
    [
        ("quarter_disk", {}, "unknown mesh recipe: 'quarter_disk'; did you mean 'quarter_disc'"),
        ("bar", {"lenght": 3.0}, "'lenght'; did you mean 'length'"),
        ("bar", {"size": -1.0}, "size of the mesh recipe must be a positive number; given: -1"),
        ("bar", {"size": "fine"}, "must be a positive number; given: fine"),
        ("bar", {"size": float("inf")}, "must be a positive number; given: inf"),
        ("bar", {"contact_size": 1e-8}, "at least 1e8 cells; accepted: sizes that give at most"),
        ("block", {"size": 1e-4}, "at least 1e11 cells"),
        ("quarter_disc", {"contact_size": 1e-7}, "at least 1e14 cells"),
        ("sphere", {"contact_size": 1e-200}, r"at least 1e\d{3} cells"),
        ("bar", {"loaded_from": 4.0}, "loaded_from must be less than the length"),
        ("bar_on_ends", {"end": 6.0}, "end must be less than half the length"),
        ("disc", {"top_angle": 91.0}, "top_angle must be at most 90"),
    ],
)
def test_wrong_recipes_are_refused(name, given, message):
    with pytest.raises(InputError, match=message):
        from_recipe(COMM, name, **given)


@pytest.mark.parametrize("version", ["2.2", "4.1"])
def test_command_line_writes_a_mesh(tmp_path, version):
    path = tmp_path / "bar.msh"
    arguments = ["bar", "--size", "0.3", "--length", "5", "--format", version, "--out", str(path)]
    assert main(arguments) == 0
    assert path.read_text().split()[1] == version
    domain = from_msh(COMM, path)
    assert measures(domain) == pytest.approx({**BAR, "bottom": 5.0, "top": 5.0, "loaded": 3.0})


def test_command_line_refuses_wrong_sizes(tmp_path, capsys):
    assert main(["bar", "--size", "-1", "--out", str(tmp_path / "bar.msh")]) == 2
    assert "positive number" in capsys.readouterr().err
