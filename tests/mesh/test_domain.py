"""Domains: named parts of generated meshes, of dolfinx meshes, and of refined ones.

Regions of cells, and refinement, which hands down regions and parts.
Meshes that fall apart: every connected component has to be constrained.
"""

from pathlib import Path

import numpy as np
import pytest
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from contact import InputError, build_problem, parse_case
from contact.case.mesh import Mesh as MeshSection
from contact.mesh.cells import shape_of
from contact.mesh.contents import Contents
from contact.mesh.domain import from_mesh
from contact.mesh.entities import connected_components
from contact.mesh.grid import Piece, box, rectangle
from contact.mesh.transfer import refined
from contact.ranks import on_root
from tests.problems import files
from tests.problems.messages import message_of
from tests.problems.sizes import integral, sizes_of_parts

COMM = MPI.COMM_WORLD


def mean_normal(domain, name):
    length = integral(domain, part=name)
    return [integral(domain, lambda _, nu, i=i: nu[i], name) / length for i in range(domain.dim)]


def all_midpoints(domain, name):
    x = dmesh.compute_midpoints(domain.mesh, domain.dim - 1, domain.facets(name))
    return np.vstack(COMM.allgather(x.reshape(-1, 3)))


BAR = {"left": 1.0, "right": 1.0, "bottom": 4.0, "top": 4.0}
BRICK = {"left": 2.0, "right": 2.0, "front": 8.0, "back": 8.0, "bottom": 4.0, "top": 4.0}


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("rotation", [0.0, 30.0])
@pytest.mark.parametrize("diagonal", ["right", "left", "crossed", "left_right", "right_left"])
def test_rectangle_has_its_sides_and_pieces(diagonal, rotation):
    parts = {
        "loaded": Piece("top", 2.0, 4.0),
        "ends": [Piece("bottom", None, 0.5), Piece("bottom", 3.5, None)],
        "clamped": Piece("left"),
    }
    domain = rectangle(COMM, (0, 0), (4, 1), (8, 4), parts, diagonal, rotation)
    expected = {**BAR, "loaded": 2.0, "ends": 1.0, "clamped": 1.0}
    assert sizes_of_parts(domain) == pytest.approx(expected, abs=1e-13)
    assert integral(domain) == pytest.approx(4.0)
    assert (domain.dim, domain.size) == (2, 4.0)


@pytest.mark.core
@pytest.mark.parallel
def test_box_has_its_sides_and_pieces():
    parts = {"loaded": Piece("top", (2.0, 0.0), (4.0, 0.5)), "low": Piece("right", None, (1, 0))}
    domain = box(COMM, (0, 0, -1), (4, 1, 2), (4, 2, 4), parts)
    expected = {**BRICK, "loaded": 1.0, "low": 1.0}
    assert sizes_of_parts(domain) == pytest.approx(expected, abs=1e-13)
    planes = {
        "left": (0, 0.0),
        "right": (0, 4.0),
        "front": (1, 0.0),
        "back": (1, 1.0),
        "bottom": (2, -1.0),
        "top": (2, 1.0),
    }
    for name, (axis, level) in planes.items():
        assert np.allclose(all_midpoints(domain, name)[:, axis], level)
    x = all_midpoints(domain, "loaded")
    assert x[:, 0].min() > 2.0
    assert x[:, 1].max() < 0.5


@pytest.mark.parallel
def test_pieces_of_the_vertical_faces_of_a_box_run_along_the_other_axes():
    parts = {"a": Piece("right", (0, 0), (1, 0.5)), "b": Piece("back", (1, 0.5), (4, 1.5))}
    domain = box(COMM, (0, 0, 0), (4, 1, 2), (4, 2, 4), parts)
    assert all_midpoints(domain, "a")[:, 2].max() < 0.5
    x = all_midpoints(domain, "b")
    assert x[:, 0].min() > 1.0
    assert (x[:, 2].min() > 0.5) and (x[:, 2].max() < 1.5)
    assert {n: m for n, m in sizes_of_parts(domain).items() if n in parts} == pytest.approx(
        {"a": 0.5, "b": 3.0}
    )


@pytest.mark.parallel
def test_a_mesh_without_regions_is_one():
    domain = rectangle(COMM, (0, 0), (4, 1), (8, 4))
    assert list(domain.regions) == ["body"]
    assert integral(domain, region="body") == pytest.approx(4.0)


@pytest.mark.core
@pytest.mark.parallel
def test_rotation_turns_the_normals_and_keeps_the_size():
    plane = rectangle(COMM, (1, 2), (4, 1), (4, 1), rotation=30.0)
    assert mean_normal(plane, "top") == pytest.approx([-0.5, np.sqrt(0.75)])
    assert plane.size == 4.0
    space = box(COMM, (0, 0, 0), (4, 1, 2), (2, 1, 1), rotation=30.0)
    assert mean_normal(space, "top") == pytest.approx([0.5, 0.0, np.sqrt(0.75)])
    about_x = box(COMM, (0, 0, 0), (4, 1, 2), (2, 1, 1), rotation=90.0, axis=(2, 0, 0))
    assert mean_normal(about_x, "top") == pytest.approx([0.0, -1.0, 0.0])


CORRECT_RECTANGLE = {"origin": (0, 0), "size": (4, 1), "cells": (8, 4)}
WRONG_RECTANGLES = {
    "no height": {"size": (4, 0)},
    "a size of 3-D": {"size": (4, 1, 1)},
    "a number for an origin": {"origin": 0.0},
    "no cells": {"cells": (4, 0)},
    "half cells": {"cells": (4, 1.5)},
    "diagonal": {"diagonal": "up"},
    "a side for a name": {"parts": {"top": Piece("top")}},
    "a side of 3-D": {"parts": {"a": Piece("front")}},
    "a piece from between nodes": {"parts": {"a": Piece("top", 0.3, 4.0)}},
    "a piece beyond the end": {"parts": {"a": Piece("top", 0.5, 5.0)}},
    "a piece without length": {"parts": {"a": Piece("top", 2.0, 2.0)}},
    "a piece of 3-D": {"parts": {"a": [Piece("top", (2.0, 1.0))]}},
    "no pieces": {"parts": {"a": []}},
}
CORRECT_BOX = {"origin": (0, 0, 0), "size": (4, 1, 2), "cells": (4, 1, 2)}
WRONG_BOXES = {
    "no axis": {"axis": (0, 0, 0)},
    "an axis in the plane": {"axis": (0, 1)},
    "a piece in the plane": {"parts": {"a": Piece("top", 0.5)}},
    "a piece to between nodes": {"parts": {"a": Piece("top", (0, 0), (1.1, 1))}},
}


@pytest.mark.wording
@pytest.mark.parallel
def test_messages_of_wrong_grids(snapshot):
    said = {
        name: message_of(rectangle, COMM, **CORRECT_RECTANGLE | change)
        for name, change in WRONG_RECTANGLES.items()
    }
    said |= {
        f"box: {name}": message_of(box, COMM, **CORRECT_BOX | change)
        for name, change in WRONG_BOXES.items()
    }
    snapshot("wrong-grids", said)


@pytest.mark.parallel
@pytest.mark.parametrize("ghosts", [dmesh.GhostMode.none, dmesh.GhostMode.shared_facet])
def test_parts_of_a_dolfinx_mesh(ghosts):
    mesh = dmesh.create_unit_cube(COMM, 3, 3, 3, ghost_mode=ghosts)
    low = dmesh.locate_entities_boundary(mesh, 2, lambda x: np.isclose(x[2], 0.0))
    domain = from_mesh(mesh, {"low": low, "half": lambda x: x[0] < 0.34})
    assert sizes_of_parts(domain) == pytest.approx({"low": 1.0, "half": 1.0 + 4.0 / 3.0})
    assert domain.size == 1.0


@pytest.mark.core
@pytest.mark.parallel
def test_ranks_without_cells():
    domain = rectangle(COMM, (0, 0), (1, 1), (1, 1))
    assert domain.mesh.topology.index_map(2).size_global == 2
    assert sizes_of_parts(domain) == pytest.approx(dict.fromkeys(BAR, 1.0))
    assert domain.size == 1.0


SECTIONS = {
    "rectangle": (
        {
            "generator": "rectangle",
            "size": [4.0, 1.0],
            "cells": [8, 2],
            "rotation": 30.0,
            "refine": 1,
            "parts": {"loaded": {"side": "top", "from": 2.0, "to": 4.0}},
        },
        {**BAR, "loaded": 2.0},
    ),
    "box": (
        {
            "generator": "box",
            "origin": [0.0, 0.0, 1.0],
            "size": [4.0, 1.0, 2.0],
            "cells": [4, 1, 2],
            "rotation": 10.0,
            "axis": [1.0, 0.0, 0.0],
            "parts": {"a": [{"side": "left"}, {"side": "right"}]},
        },
        {**BRICK, "a": 4.0},
    ),
    "generator": (
        {"generator": "bar", "length": 6.0, "contact_size": 0.2, "size": 0.5},
        {**BAR, "bottom": 6.0, "top": 6.0, "loaded": 4.0},
    ),
    "file": (
        {"file": "meshes/fixtures/square.msh", "rotation": 45.0},
        {"bottom": 1.0, "top": 1.0},
    ),
}


@pytest.mark.parallel
@pytest.mark.parametrize("kind", SECTIONS)
def test_domain_of_a_case_file_section(kind, monkeypatch, request):
    monkeypatch.chdir(request.config.rootpath)
    given, expected = SECTIONS[kind]
    domain = MeshSection.model_validate(given).build(COMM)
    assert sizes_of_parts(domain) == pytest.approx(expected)


def two_regions():
    mesh = dmesh.create_rectangle(
        COMM, [(0, 0), (4, 1)], [8, 2], ghost_mode=dmesh.GhostMode.shared_facet
    )
    regions = {"left": lambda x: x[0] < 1.01, "all": lambda x: x[0] < 5.0}
    return from_mesh(mesh, {"bottom": lambda x: x[1] < 0.01}, regions=regions)


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("refine", [False, True])
def test_regions(refine):
    domain = refined(two_regions()) if refine else two_regions()
    volumes = {name: integral(domain, region=name) for name in domain.regions}
    assert volumes == pytest.approx({"left": 1.0, "all": 4.0})
    one = fem.Constant(domain.mesh, 1.0)
    mixed = fem.form(one * domain.dx + one * domain.dx_in("left") + one * domain.ds("bottom"))
    assert COMM.allreduce(fem.assemble_scalar(mixed)) == pytest.approx(9.0)
    with pytest.raises(InputError, match=r"\[part-name\]"):
        domain.cells("lift")
    with pytest.raises(InputError, match=r"\[part-facets\]"):
        from_mesh(domain.mesh, {}, regions={"none": lambda x: x[0] > 5.0})


def refinable():
    ghosted = dmesh.create_unit_cube(COMM, 2, 2, 2, ghost_mode=dmesh.GhostMode.shared_facet)
    return {
        "rectangle": lambda: rectangle(
            COMM, (0, 0), (4, 1), (8, 2), {"a": Piece("top", 2.0, 4.0)}, rotation=20.0
        ),
        "box": lambda: box(COMM, (0, 0, 0), (4, 1, 2), (4, 1, 2), {"a": Piece("left")}),
        "ghosted": lambda: from_mesh(ghosted, {"a": lambda x: x[2] < 0.6}),
        "two cells": lambda: rectangle(COMM, (0, 0), (1, 1), (1, 1)),
        "quadrilaterals": lambda: rectangle(COMM, (0, 0), (1, 1), (3, 3), cell="quadrilateral"),
        "hexahedra": lambda: box(COMM, (0, 0, 0), (1, 1, 1), (3, 3, 3), cell="hexahedron"),
    }


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize(
    "kind", ["rectangle", "box", "ghosted", "two cells", "quadrilaterals", "hexahedra"]
)
def test_refinement_keeps_the_parts(kind):
    coarse = refinable()[kind]()
    fine = refined(refined(coarse))
    assert sizes_of_parts(fine) == pytest.approx(sizes_of_parts(coarse))
    assert integral(fine) == pytest.approx(integral(coarse))
    assert integral(fine, region="body") == pytest.approx(integral(coarse))
    assert (shape_of(fine.mesh), fine.levels) == (shape_of(coarse.mesh), 2)
    assert fine.size == coarse.size
    assert list(fine.parts) == list(coarse.parts)
    dim = coarse.dim
    count = [d.mesh.topology.index_map(dim).size_global for d in (coarse, fine)]
    assert count[1] == count[0] * 2 ** (2 * dim)
    for name in coarse.parts:
        facets = [COMM.allreduce(d.facets(name).size) for d in (coarse, fine)]
        assert facets[1] == facets[0] * 2 ** (2 * (dim - 1))


def write_two_squares(path: Path, *, share: bool) -> None:
    """Write two squares side by side, with one edge between them or two on top of each other."""
    square = np.array([*np.ndindex(5, 5)]) / 4
    right = np.array([1.0, 0.0])
    points, number = np.concatenate([square, square + right]), np.arange(25).reshape(5, 5)
    corners = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    cells = np.stack(corners, axis=2).reshape(-1, 4)
    cells = np.concatenate([cells, cells + 25])
    if share:
        points, new = np.unique(points, axis=0, return_inverse=True)
        cells = new.reshape(-1)[cells]
    x, y = points.T
    sides = {"left": x == 0, "bottom": y == 0, "top": y == 1}
    nodes = {name: np.flatnonzero(own) for name, own in sides.items()}
    flat = np.column_stack([points, np.zeros(len(points))])
    files.write(path, Contents(flat, [("quad", cells)], nodes=nodes))


def squares(folder: Path, *, share: bool, friction: bool = True) -> dict:
    path = folder / "squares.inp"
    on_root(COMM, lambda: write_two_squares(path, share=share))
    case = {
        "mesh": {"file": str(path)},
        "material": {"law": "linear", "young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "left", "displacement": [0.0, 0.0]}],
        "load": [{"on": "top", "traction": [0.0, -0.01]}],
        "contact": {"on": "bottom"},
    }
    return {**case, "friction": {"law": "coulomb", "mu": 0.3}} if friction else case


@pytest.mark.parallel
@pytest.mark.parametrize("share", [True, False])
def test_nodes_of_one_piece(share: bool, shared_tmp_path: Path) -> None:
    problem = build_problem(parse_case(squares(shared_tmp_path, share=share)), COMM)
    labels, count = connected_components(problem.body.space)
    assert count == (1 if share else 2)
    x = problem.body.space.tabulate_dof_coordinates()[: labels.size, 0]
    inner = np.abs(x - 1) > 1e-9
    found = COMM.allgather(set(zip((x[inner] > 1).tolist(), labels[inner].tolist(), strict=True)))
    assert len(set().union(*found)) == 2, "left and right of the edge: one label each"


@pytest.mark.parallel
def test_a_piece_that_nothing_holds_sideways_is_refused(shared_tmp_path: Path) -> None:
    case = squares(shared_tmp_path, share=False, friction=False)
    said = r"the body about \(1.5, 0.5\) is not constrained.*along x"
    with pytest.raises(InputError, match=said):
        build_problem(parse_case(case), COMM)
    build_problem(parse_case(squares(shared_tmp_path, share=True, friction=False)), COMM)
