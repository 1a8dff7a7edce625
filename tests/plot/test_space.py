"""Figures in 3-D: what the cameras see, and what of the tables is drawn."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from dolfinx.mesh import compute_midpoints
from mpi4py import MPI

from contact import Body, Contact, Fixed, Linear, Problem
from contact.cli.main import main
from contact.cli.plot import direction
from contact.mesh.domain import from_mesh
from contact.plot import figures
from contact.plot.body import picture
from contact.plot.foundation import foundation
from contact.plot.run import Run, _foundations
from contact.plot.space import (
    Camera,
    Zone,
    chosen_sight,
    close_camera,
    contact_figure,
    other_side,
)
from contact.plot.style import Look
from contact.solving import solve
from contact.writing import write_outputs, written
from tests.problems.blocks import Blocks
from tests.problems.written import block

AXES = {"left": -1, "right": 1, "front": -2, "back": 2, "bottom": -3, "top": 3}
OPPOSITE = {"left": "right", "front": "back", "bottom": "top"}
OPPOSITE |= {b: a for a, b in OPPOSITE.items()}


def pressed(on: Any = "bottom", side: str = "bottom", by: float = 1e-3, **more: Any) -> Run:
    """Return the run of a block with a side that its opposite presses on a plane."""
    axis = abs(AXES[side]) - 1
    size, normal, push = [2.0, 1.0, 1.0], np.zeros(3), np.zeros(3)
    normal[axis], push[axis] = -np.sign(AXES[side]), by * np.sign(AXES[side])
    point = [size[axis] if k == axis and AXES[side] > 0 else 0.0 for k in range(3)]
    plane = {"shape": "plane", "point": point, "normal": normal.tolist()}
    sections: dict[str, Any] = {
        "mesh": {"generator": "box", "size": size, "cells": [4, 2, 2]},
        "fixed": [{"on": OPPOSITE[side], "displacement": push.tolist()}],
        "contact": {"on": on, "foundation": plane},
        "friction": {"law": "coulomb", "mu": 0.3},
    }
    run = written(solve(block(3, **(sections | more))))
    assert run is not None
    return run


@pytest.mark.parametrize("side", AXES)
def test_the_camera_sees_the_contact(side: str) -> None:
    """Whatever way it faces: no part of the body is in between."""
    run = pressed(side, side)
    outward = np.sign(AXES[side]) * np.eye(3)[abs(AXES[side]) - 1]
    zone = Zone.of(run, run.table["entry"])
    np.testing.assert_array_equal(zone.normal, outward)
    sight = chosen_sight(run, zone)
    assert sight.eye @ outward > 0.5 and not sight.clear.any() and sight.words == ""
    # From outside, not mirrored, and upwards as the body is seen.
    whole = Camera.of(sight.eye, run.body.points)
    close = close_camera(zone, 1, whole)
    np.testing.assert_array_equal(close.view, outward)
    assert close.up @ whole.up > 0.5
    # Where the body is seen edge-on too.
    across = np.roll(outward, 1)
    edge = Camera.of(across, run.body.points, above=outward)
    close = close_camera(zone, 1, edge)
    np.testing.assert_array_equal([close.view, close.up], [outward, -across])


def test_the_other_body_is_translucent_or_both_are_cut_open() -> None:
    """The contact lies between them."""
    case = block(
        3,
        mesh={"generator": "two_boxes", "lower_size": 0.7, "upper_size": 0.5},
        material={"young": 1.0, "poisson": 0.3},
        fixed=[
            {"on": "lower_bottom", "displacement": [0.0, 0.0, 0.0]},
            {"on": "upper_top", "displacement": [0.0, 0.0, -0.01]},
        ],
        contact={"on": "upper_bottom", "against": "lower_top"},
    )
    run = written(solve(case))
    assert run is not None
    zone = Zone.of(run, run.table["entry"])
    sight = chosen_sight(run, zone)
    lower = run.body.cell_centers().points[:, 2] < 0
    np.testing.assert_array_equal(sight.clear, lower)
    assert sight.words == "the other body translucent" and sight.eye[2] < 0
    opened = chosen_sight(run, zone, cut=True)
    assert opened.words == "cut open" and opened.cut is not None and not opened.clear.any()
    normal, origin = opened.cut
    assert abs(normal @ zone.normal) < 1e-9 and normal @ opened.eye > 0
    np.testing.assert_allclose(origin, 0.0, atol=1e-9)


def test_the_other_side_shows_the_pressure_of_the_contacts_in_the_view() -> None:
    """Two contacts have the same part against them: each close-up has that of its own."""
    blocks = Blocks(dim=3, upper=5).domain(MPI.COMM_SELF)
    under = blocks.facets("under")
    x = compute_midpoints(blocks.mesh, 2, under)[:, 0]
    parts = {name: blocks.facets(name) for name in ("top", "over", "bottom")}
    domain = from_mesh(blocks.mesh, {**parts, "one": under[x < 0.4], "two": under[x > 0.6]})
    supports = [Fixed("bottom", [0.0, 0.0, 0.0]), Fixed("top", [0.0, 0.0, -0.01])]
    contacts = [Contact(name, against="over") for name in ("one", "two")]
    run = written(solve(Problem(domain, Body(Linear(1.0, 0.3), supports), contacts)))
    assert run is not None
    seen = {}
    for entries in ((0,), (1,), (0, 1)):
        side = other_side(run, run.opposite, Zone.of(run, np.array(entries)))
        pressure = np.nan_to_num(side["pressure"])
        seen[entries] = [pressure[abs(side.points[:, 0] - end) < 0.2].max() for end in (0, 1)]
    (one, none), (nothing, two) = seen[0,], seen[1,]
    assert one > 0.005 and two > 0.005 and seen[0, 1] == [one, two]
    assert none < 0.2 * one and nothing < 0.2 * two


SHAPES: dict[str, dict[str, Any]] = {
    "ball": {"shape": "sphere", "centre": [1.0, 0.5, -0.25], "radius": 0.25},
    "large ball": {"shape": "sphere", "centre": [1.0, 0.5, -30.0], "radius": 30.0},
    "plane": {"shape": "plane", "point": [0.0, 0.0, 0.0], "normal": [0.0, 0.0, 1.0]},
    "cylinder": {"shape": "cylinder", "point": [0, 0.5, -3], "axis": [1, 0, 0], "radius": 3.0},
    "cone": {"shape": "cone", "apex": [1, 0.5, 0], "axis": [0, 0, -1], "half_angle": 60.0},
}


@pytest.mark.parametrize("scale", [1.0, 5.0])
@pytest.mark.parametrize("name", SHAPES)
def test_rigid_shapes_are_drawn_whole(name: str, scale: float) -> None:
    """As they are, moved with the body that they press, where it touches them; small ones whole."""
    rigid = {"displacement": [0.0, 0.0, 0.01]}
    run = pressed(contact={"on": "bottom", "foundation": SHAPES[name], "rigid": rigid}, by=0.0)
    shape = run.shapes[0]
    drawn = foundation(run, scale)
    touching = run.table["status"] != "open"
    nearest = (run.table["gap"] + run.table["moved"])[touching].min()
    moved = np.array([0.0, 0.0, 0.01 - (scale - 1) * nearest])
    distance = shape.distance(drawn.points - moved)[0]
    # Behind facets that are coarser than the shape.
    assert -0.013 * run.diameter < distance.min() <= distance.max() < 0.001 * run.diameter
    low, high = np.reshape(drawn.bounds, (3, 2)).T
    # In a box around the contact part, which the magnified displacements have widened.
    box = (run.surface.points + scale * run.surface["displacement"]).T
    room = 0.31 * np.ptp(box, axis=1).max()
    assert np.all(low > box.min(axis=1) - room) and np.all(high < box.max(axis=1) + room)
    if name == "ball":
        np.testing.assert_allclose(high - low, 0.5, atol=0.03)
        assert not drawn.extract_feature_edges(feature_edges=False, manifold_edges=False).n_cells
    elif name != "cone":
        np.testing.assert_allclose((high - low)[:2], [3.2, 2.2], rtol=0.02)


@pytest.mark.parametrize("kind", ["ball", "punch"])
def test_shapes_are_drawn_where_they_have_moved(kind: str) -> None:
    """Along the surface too, and by a given rotation, which contact directions do not tell."""
    shapes = SHAPES | {
        "punch": {"shape": "punch", "centre": [1, 0.5, 0], "axis": [0, 0, -1], "radius": 0.25}
    }
    rigid = {
        "displacement": [0.3, 0.0, 0.01],
        "rotation": [0.0, 0.0, 2.0],
        "centre": [1.0, -0.5, 0.0],
    }
    run = pressed(contact={"on": "bottom", "foundation": shapes[kind], "rigid": rigid}, by=0.0)
    low, high = np.reshape(foundation(run, 1.0).bounds, (3, 2)).T
    middle = [1.3 - np.radians(2.0), 0.5]
    np.testing.assert_allclose((low + high)[:2] / 2, middle, atol=0.005)


def test_a_formula_is_drawn_where_it_has_values() -> None:
    """The box of the picture is larger than the arch."""
    arch = {"shape": "distance", "distance": "z - 0.5*(sqrt(1.45**2 - (x-1)**2) - 1.45)"}
    drawn = foundation(pressed(contact={"on": "bottom", "foundation": arch}), 1.0)
    low, high = np.reshape(drawn.bounds, (3, 2)).T
    assert -0.46 < low[0] < -0.3 and 2.3 < high[0] < 2.46


def test_a_case_of_another_version_has_no_shapes() -> None:
    """Pictures are those of the facets then."""
    for case in ("[[contact]]\non = 'bottom'\nlater = 1\n", "contact = 3", "[", ""):
        assert _foundations(case) == ({}, {})


def test_shapes_of_files_are_drawn_by_the_facets(tmp_path: Path) -> None:
    """Where they face the body: pictures need the files of the run alone."""
    np.save(tmp_path / "flat.npy", np.zeros((3, 3)))
    heights = {"shape": "heights", "file": str(tmp_path / "flat.npy"), "spacing": [1.0, 0.5]}
    run = pressed(contact={"on": "bottom", "foundation": heights})
    (tmp_path / "flat.npy").unlink()
    drawn = foundation(run, 1.0)
    assert drawn.bounds == pytest.approx((0.0, 2.0, 0.0, 1.0, 0.0, 0.0), abs=1e-9)


def test_planes_that_meet_end_there() -> None:
    """Those of a groove: nothing is drawn of one inside the other."""
    planes = [
        {"shape": "plane", "point": [x, 0.0, 0.0], "normal": normal}
        for x, normal in ((0.0, [0.3, 0.0, 1.0]), (2.0, [-0.3, 0.0, 1.0]))
    ]
    mesh = {
        "generator": "box",
        "size": [2.0, 1.0, 1.0],
        "cells": [10, 2, 2],
        "parts": {
            "one": {"side": "bottom", "from": [0.0, 0.0], "to": [0.6, 1.0]},
            "two": {"side": "bottom", "from": [1.4, 0.0], "to": [2.0, 1.0]},
        },
    }
    contacts = [
        {"on": on, "foundation": plane} for on, plane in zip(("one", "two"), planes, strict=True)
    ]
    run = pressed(contact=contacts, mesh=mesh)
    drawn = foundation(run, 1.0)
    for shape in run.shapes.values():
        assert shape.distance(drawn.points)[0].min() > -0.01 * run.diameter
    sides = drawn.points[:, 0] < 1.0
    assert np.ptp(drawn.points[sides, 2]) == pytest.approx(
        np.ptp(drawn.points[~sides, 2]), rel=0.05
    )


def test_a_shape_of_two_contacts_is_drawn_once() -> None:
    """Two surfaces at one place speckle."""
    halves = {
        on: {"side": "bottom", "from": [low, 0.0], "to": [high, 1.0]}
        for on, low, high in (("one", 0.0, 1.0), ("two", 1.5, 2.0))
    }
    mesh = {"generator": "box", "size": [2.0, 1.0, 1.0], "cells": [4, 2, 2], "parts": halves}
    ball = {"shape": "sphere", "centre": [1.0, 0.5, -3.0], "radius": 3.0}
    both = pressed(contact=[{"on": on, "foundation": ball} for on in halves], mesh=mesh)
    single = pressed(contact={"on": "bottom", "foundation": ball})
    assert foundation(both, 1.0).n_cells == pytest.approx(foundation(single, 1.0).n_cells, rel=0.05)


def test_the_pressure_of_held_nodes_is_not_known() -> None:
    """They are no contact nodes; they had the colour of no pressure."""
    free = ["free", 0.0, 0.0]
    run = pressed(fixed=[{"on": "top", "displacement": [0.0, 0.0, -1e-3]},
                         {"on": "left", "displacement": free}])  # fmt: skip
    zone = Zone.of(run, run.table["entry"])
    constrained = zone.corners[..., 0] == 0
    assert constrained.any()
    np.testing.assert_array_equal(np.isnan(zone.pressure), constrained)


def test_the_peak_is_that_of_all_nodes() -> None:
    """Of the body inside it, and of contact nodes that are cut off."""
    run = pressed()
    peak = run.table["pressure"].max()
    figure = contact_figure(run, Look())
    assert figure is not None
    assert figure.axes[-1].get_xlabel().endswith(f"peak {peak:.4g}")
    body = run.body.copy()
    distance = np.linalg.norm(body.points - [1.0, 0.5, 0.5], axis=1)
    body.point_data["potential"] = np.where(distance < 1e-9, 100.0, 1.0 + distance)
    made = picture(replace(run, body=body), "potential")
    assert max(made.norm.vmax, float(made.label.split()[-1]) if "peak" in made.label else 0) == 100


@pytest.mark.parametrize("gap", [0.0, 1.0])
def test_the_legend_has_a_foundation_that_is_drawn(gap: float) -> None:
    run = pressed(contact={"on": "bottom", "gap": gap})
    run = run if gap == 0 else replace(run, surface=run.surface.copy())
    if gap:  # facets without a known foundation in front of them
        run.surface.point_data["row"][:] = -1
    labels = [text.get_text() for text in contact_figure(run, Look()).legends[0].get_texts()]
    assert ("foundation" in labels) == (gap == 0)


def test_a_page_to_turn_a_body_in(tmp_path, capsys, monkeypatch):
    """By PyVista's own packages; without them a message names these, and no file is left."""
    out = tmp_path / "out"
    write_outputs(solve(block(3)), out)
    before = sorted(out.iterdir())

    def missing(*_: Any) -> None:
        raise errors.pop()("trame")

    monkeypatch.setattr(figures, "export_page", missing)
    errors = [ImportError, AttributeError]  # without packages, and with those of another version
    while errors:
        assert main(["plot", str(out), "--html"]) == 2
        assert 'accepted: pip install "pyvista[jupyter]"' in capsys.readouterr().err
    assert sorted(out.iterdir()) == before
    monkeypatch.setattr(figures, "export_page", lambda _, path: path.write_text("page"))
    assert main(["plot", str(out), "--html"]) == 0
    assert (out / "figure-view.html").exists()


def test_directions_are_of_the_size_one() -> None:
    """At least nearly: the largest component is 1."""
    assert direction("0,0,1e-300") == (0.0, 0.0, 1.0)
    assert direction("1e300,-1e300,0") == (1.0, -1.0, 0.0)
