"""Generators of meshes: what they make and what they refuse."""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI

import meshes
from contact._compat import geometry_dofmap
from contact.mesh.cells import shape_of
from contact.mesh.reader import from_generator, from_msh
from meshes.__main__ import main
from tests.problems.messages import message_of
from tests.problems.sizes import integral, sizes_of_parts

COMM = MPI.COMM_WORLD


def vertices_of(domain, name):
    mesh, dim = domain.mesh, domain.dim
    nodes = dmesh.entities_to_geometry(mesh, dim - 1, domain.facets(name))
    return mesh.geometry.x[np.unique(nodes)]


def nodes(domain):
    return domain.mesh.geometry.index_map().size_global


BAR = {"left": 1.0, "right": 1.0, "bottom": 4.0, "top": 4.0, "loaded": 2.0}
SIDES = ("left", "right", "front", "back", "bottom", "top")


ARC = np.pi * 8.0
GENERATORS = {
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
    "block": (1.0, dict.fromkeys(SIDES, 1.0)),
    "column": (
        4.0,
        {"left": 4.0, "right": 4.0, "front": 4.0, "back": 4.0, "bottom": 1.0, "top": 1.0},
    ),
    "bracket": (
        # Base, web and fillet, without the holes.
        40 * (60 * 8 + 52 * 8 + 64 - 16 * np.pi) - 8 * np.pi * (2 * 5.5**2 + 8**2),
        {
            "base": 2400 - 2 * np.pi * 5.5**2,
            "bolts": 2 * np.pi * 11 * 8,
            "eye": np.pi * 16 * 8,
            "fillet": np.pi / 2 * 8 * 40,
            "back": 2400 - np.pi * 8**2,
        },
    ),
    "half_space": (
        900.0,
        {"axis": 30.0, "contact": 1.0, "free": 29.0, "side": 30.0, "bottom": 30.0},
    ),
    "half_cylinder": (
        np.pi * 108,
        {
            "contact": np.pi / 2,
            "free": np.pi * 17.5,
            "symmetry": 72.0,
            "side": np.pi * 36,
            "bottom": np.pi * 18,
        },
    ),
    "bimorph_on_stop": (
        6.0 * 1.0 + 0.2 * 0.3,
        {
            "clamped": 1.0,
            "tip": 1.0,
            "upper_top": 6.0,
            "lower_bottom": 6.0,
            "stop_top": 0.2,
            "stop_bottom": 0.2,
        },
    ),
    "two_blocks": (
        6.0,
        {
            f"{block}_{side}": length
            for block, width in (("lower", 4.0), ("upper", 2.0))
            for side, length in (("bottom", width), ("top", width), ("left", 1.0), ("right", 1.0))
        },
    ),
    "cylinder_on_block": (
        np.pi * 625 + 2e4,
        {
            "arc": np.pi * 25,
            "block_top": 100.0,
            "symmetry": 250.0,
            "top": 50.0,
            "block_bottom": 100.0,
            "block_right": 200.0,
        },
    ),
    "two_boxes": (
        5.0,
        {
            **{f"lower_{side}": 4.0 for side in ("bottom", "top")},
            **{f"lower_{side}": 2.0 for side in ("left", "right", "front", "back")},
            **{f"upper_{s}": 1.0 for s in ("bottom", "top", "left", "right", "front", "back")},
        },
    ),
    "two_half_cylinders": (
        np.pi * 100,
        {"upper_arc": np.pi * 10, "lower_arc": np.pi * 10, "upper_cut": 20.0, "lower_cut": 20.0},
    ),
    "two_balls": (
        np.pi * 1250,
        {
            "symmetry": 100.0,
            **dict.fromkeys(("upper_arc", "lower_arc"), np.pi * 25),
            **dict.fromkeys(("upper_cut", "lower_cut"), 50.0),
        },
    ),
    "two_spheres": (
        np.pi * 125e3 / 3,
        {
            **dict.fromkeys(("symmetry_x", "symmetry_y"), np.pi * 1250),
            **dict.fromkeys(("upper_round", "lower_round"), np.pi * 1250),
            **dict.fromkeys(("upper_cut", "lower_cut"), np.pi * 625),
        },
    ),
    "ball_between_plates": (
        np.pi / 2 + 1.5,
        {
            "ball_bottom": np.pi / 2,
            "ball_top": np.pi / 2,
            **{
                f"{plate}_{side}": 1.5 for plate in ("lower", "upper") for side in ("bottom", "top")
            },
            "symmetry": 3.0,
        },
    ),
}


@pytest.mark.parallel(2)
@pytest.mark.parametrize("name", meshes.GENERATORS)
def test_generators_make_their_parts(name):
    volume, expected = GENERATORS[name]
    domain = from_generator(COMM, name)
    # Straight sides miss a little of a round body.
    assert sizes_of_parts(domain) == pytest.approx(expected, rel=1e-2)
    assert integral(domain) == pytest.approx(volume, rel=2e-2)


#: Generators with curved sides.
ROUND = [
    "quarter_disc", "half_disc", "disc", "sphere", "bracket", "half_cylinder", "cylinder_on_block",
    "two_half_cylinders", "two_balls", "two_spheres", "ball_between_plates",
]  # fmt: skip


@pytest.mark.parallel(2)
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", [name for name in meshes.GENERATORS if name not in meshes.SWEPT])
def test_generators_make_other_cells(name, order):
    volume, expected = GENERATORS[name]
    flat = from_generator(COMM, name).dim == 2
    sizes = {k: 2 * v for k, v in meshes.parameters(name).items() if k.endswith("size")}
    cell = "quadrilateral" if flat else "hexahedron"
    large = flat or name == "bracket"  # whose holes are round to no less than this
    domain = from_generator(COMM, name, cell, order, **({} if large else sizes))
    assert shape_of(domain.mesh).name == cell
    # Straight cells of second order are kept as those of first.
    assert domain.order == (order if name in ROUND else 1)
    # Sides of second order miss next to nothing of a round body.
    least = {1: 3e-2, 2: 5e-4}[order]
    assert sizes_of_parts(domain) == pytest.approx(expected, rel=least)
    assert integral(domain) == pytest.approx(volume, rel=least)


@pytest.mark.core
@pytest.mark.parametrize("name", ["half_cylinder", "half_space", "sphere"])
def test_cells_have_positive_volumes(name):
    """As other programs ask for, which read the files that are written."""
    mesh = from_generator(COMM, name).mesh
    dim = mesh.topology.dim
    corners = mesh.geometry.x[geometry_dofmap(mesh)][..., :dim]
    assert np.linalg.det(corners[:, 1:] - corners[:, :1]).min() > 0


@pytest.mark.core
@pytest.mark.parametrize("name", ["quarter_disc", "half_disc", "disc", "sphere"])
def test_nodes_of_round_parts_lie_on_the_circle(name):
    radius = 5.0
    domain = from_generator(COMM, name, radius=radius)
    centre = np.array([0, 0, radius] if domain.dim == 3 else [0, radius, 0])
    x = vertices_of(domain, "contact")
    assert np.allclose(np.linalg.norm(x - centre, axis=1), radius, rtol=1e-9)
    assert np.min(np.linalg.norm(x, axis=1)) < 1e-12


def test_sphere_is_graded_towards_the_contact():
    domain = from_generator(COMM, "sphere", contact_size=0.1)
    assert nodes(domain) < 30_000
    x = vertices_of(domain, "contact")
    inside = np.count_nonzero(np.linalg.norm(x, axis=1) < 0.88)
    # A quarter disc of radius 0.88 in triangles of edge 0.1.
    assert inside > 0.6 * (np.pi / 4 * 0.88**2) / (0.1**2 * np.sqrt(0.75))


@pytest.mark.parametrize(("half_width", "contact_size"), [(2.72, 0.2), (0.86, 0.07)])
def test_quarter_disc_resolves_the_hertz_contact(half_width, contact_size):
    domain = from_generator(
        COMM, "quarter_disc", contact_size=contact_size, contact_width=1.5 * half_width
    )
    x = np.sort(vertices_of(domain, "contact")[:, 0])
    gaps = np.diff(x[x < 1.2 * half_width])
    assert gaps.max() < half_width / 12
    assert nodes(domain) < 3000


WRONG = [
    ("quarter_disk", {}),
    ("bar", {"lenght": 3.0}),
    ("bar", {"size": -1.0}),
    ("bar", {"size": "fine"}),
    ("bar", {"size": float("inf")}),
    ("bar", {"contact_size": 1e-08}),
    ("block", {"size": 0.0001}),
    ("quarter_disc", {"contact_size": 1e-07}),
    ("two_blocks", {"lower_size": 8e-08}),
    ("sphere", {"contact_size": 1e-200}),
    ("bar", {"loaded_from": 4.0}),
    ("bar_on_ends", {"end": 6.0}),
    ("disc", {"top_angle": 91.0}),
    ("bracket", {"eye_diameter": 40.0}),
    ("bracket", {"bolt_diameter": 20.0}),
    ("bar", {"cell": "hexahedron"}),
    ("sphere", {"cell": "triangle", "contact_size": 2.0}),
    ("bar", {"order": 3}),
    ("half_cylinder", {"order": 2}),
    ("half_cylinder", {"cell": "hexahedron"}),
    ("half_cylinder", {"radius": 0.05}),
]


@pytest.mark.wording
@pytest.mark.parallel(2)
def test_messages_of_wrong_generators(snapshot):
    said = {
        f"{name} {given}": message_of(from_generator, COMM, name, **given) for name, given in WRONG
    }
    snapshot("wrong-generators", said)


@pytest.mark.parametrize("version", ["2.2", "4.1"])
def test_command_line_writes_a_mesh(tmp_path, version):
    path = tmp_path / "bar.msh"
    arguments = ["bar", "--size", "0.3", "--length", "5", "--format", version, "--out", str(path)]
    assert main(arguments) == 0
    assert path.read_text().split()[1] == version
    domain = from_msh(COMM, path)
    assert sizes_of_parts(domain) == pytest.approx(
        {**BAR, "bottom": 5.0, "top": 5.0, "loaded": 3.0}
    )
    disc = ["quarter_disc", "--cell", "quadrilateral", "--order", "2", *arguments[5:]]
    assert main(disc) == 0
    domain = from_msh(COMM, path)
    assert (shape_of(domain.mesh).name, domain.order) == ("quadrilateral", 2)
