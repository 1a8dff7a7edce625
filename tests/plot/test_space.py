"""Figures in 3-D: what the cameras see, and what of the tables is drawn."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pyvista
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.quiver import Quiver

from contact.cli.main import main
from contact.errors import InputError
from contact.plot import figures
from contact.plot.body import picture
from contact.plot.figures import figures_of, window
from contact.plot.foundation import foundation
from contact.plot.run import Run, linear
from contact.plot.space import (
    Front,
    Scene,
    Zone,
    chosen_view,
    close_camera,
    contact_figure,
)
from contact.plot.style import Look
from contact.results.quantities import STATUS
from contact.solving import solve
from contact.writing import write_outputs
from tests.problems.written import block

AXES = {"left": -1, "right": 1, "front": -2, "back": 2, "bottom": -3, "top": 3}
OPPOSITE = {"left": "right", "front": "back", "bottom": "top"}
OPPOSITE |= {b: a for a, b in OPPOSITE.items()}


def pressed(on: Any = "bottom", side: str = "bottom", **more: Any) -> Run:
    """Return the run of a block with a side that its opposite presses on a plane."""
    axis = abs(AXES[side]) - 1
    size, normal, push = [2.0, 1.0, 1.0], np.zeros(3), np.zeros(3)
    normal[axis], push[axis] = -np.sign(AXES[side]), 1e-3 * np.sign(AXES[side])
    point = [size[axis] if k == axis and AXES[side] > 0 else 0.0 for k in range(3)]
    plane = {"shape": "plane", "point": point, "normal": normal.tolist()}
    sections: dict[str, Any] = {
        "mesh": {"generator": "box", "size": size, "cells": [4, 2, 2]},
        "fixed": [{"on": OPPOSITE[side], "displacement": push.tolist()}],
        "contact": {"on": on, "foundation": plane},
        "friction": {"law": "coulomb", "mu": 0.3},
    }
    run = solve(block(3, **(sections | more))).written()
    assert run is not None
    return run


@pytest.mark.parametrize("side", AXES)
def test_the_camera_sees_the_contact(side: str) -> None:
    """Whatever way it faces: no part of the body is in between."""
    run = pressed(side, side)
    zone, outward = Zone.of(run), np.sign(AXES[side]) * np.eye(3)[abs(AXES[side]) - 1]
    np.testing.assert_array_equal(zone.normal, outward)
    assert zone.sides == (1,)
    found = chosen_view(run, linear(run.body), zone)
    assert found is not None
    view, cut = found
    assert view @ outward > 0.5 and not cut


def test_facets_behind_are_not_painted_over_those_in_front() -> None:
    """The far side of a part that has both: open, and its contact direction is the same."""
    run = pressed(["bottom"], fixed=[{"on": "left", "displacement": [0.0, 0.0, 0.0]}],
                  load=[{"everywhere": True, "body_force": [0.0, 0.0, -0.01]}])  # fmt: skip
    both = pressed(["bottom", "top"], fixed=[{"on": "left", "displacement": [0.0, 0.0, 0.0]}],
                   load=[{"everywhere": True, "body_force": [0.0, 0.0, -0.01]}])  # fmt: skip
    for each in (run, both):
        figure = contact_figure(each, Look())
        assert figure is not None
        zone = Zone.of(each)
        camera = close_camera(each, zone, Look(), 1)
        front = Front.of(each, each.surface, zone.normal, camera)
        seen = front.skin["status"][front.nodes]
        assert abs(front.skin.points[front.nodes, 2]).max() < 1e-12
        words = [text.get_text() for text in figure.legends[0].get_texts()]
        for name, word in (("stick", "sticking"), ("slip", "sliding")):
            count = np.count_nonzero(each.table["status"] == name)
            assert np.count_nonzero(seen == STATUS[name]) == count
            assert f"{word}: {count} nodes" in words


def test_rigid_shapes_are_drawn_where_they_are() -> None:
    """In front of the contact part, as far as they are near: a ball that is pushed into it."""
    ball = {"shape": "sphere", "centre": [1.0, 0.5, 1.45], "radius": 0.45}
    run = pressed("top", fixed=[{"on": "bottom", "displacement": [0.0, 0.0, 0.01]}],
                  mesh={"generator": "box", "size": [2.0, 1.0, 1.0], "cells": [12, 6, 2]},
                  contact={"on": "top", "foundation": ball})  # fmt: skip
    shape = foundation(run, 1.0)
    distance = np.linalg.norm(shape.points - ball["centre"], axis=1)
    # The rim is cut between nodes, on chords.
    assert distance.max() < 0.45 + 1e-6 and distance.min() > 0.42
    assert np.count_nonzero(abs(distance - 0.45) < 1e-6) > 10
    assert shape.points[:, 2].min() == pytest.approx(1.0, abs=1e-3)
    assert 1.15 < shape.points[:, 2].max() < 1.32  # the body is 2 long: gaps up to 0.3
    assert Scene.of(run).foundation.n_cells == shape.n_cells
    two = replace(run, table={**run.table, "rigid": np.zeros(len(run.points), dtype=bool)})
    assert foundation(two, 1.0).n_cells == 0


def test_the_peak_is_that_of_all_nodes() -> None:
    """Of the body inside it, and of contact nodes that are cut off."""
    run = pressed()
    peak = run.table["pressure"].max()
    figure = contact_figure(run, Look(xlim=(0.9, 1.1)))
    assert figure is not None
    assert figure.axes[-1].get_xlabel().endswith(f"peak {peak:.4g}")
    body = run.body.copy()
    distance = np.linalg.norm(body.points - [1.0, 0.5, 0.5], axis=1)
    body.point_data["potential"] = np.where(distance < 1e-9, 100.0, 1.0 + distance)
    made = picture(replace(run, body=body), "potential")
    assert max(made.norm.vmax, float(made.label.split()[-1]) if "peak" in made.label else 0) == 100


def test_a_contact_inside_is_seen_where_the_body_is_cut() -> None:
    """Between two bodies: no view sees it."""
    run = pressed()
    upper = run.body.copy()
    lower = run.body.translate([0.0, 0.0, -1.0 - 1e-9])
    both = replace(run, body=lower.merge(upper, merge_points=False))
    zone = Zone.of(run)
    found = chosen_view(both, linear(both.body), zone)
    assert found is not None and found[1]
    assert abs(found[0] @ zone.normal) < 1e-12
    plotter, centre = pyvista.Plotter(off_screen=True), zone.points.mean(axis=0)
    Scene(both.body, {}, zone).add(plotter, *found)
    drawn = np.concatenate([mesh.points for mesh in plotter.meshes])
    assert ((drawn - centre) @ found[0]).max() < 1e-6
    plotter.close()


@pytest.mark.parametrize(
    ("look", "shown"),
    [
        (Look(xlim=(-0.5, 3.0)), [(0.0, 2.0), (0.0, 1.0)]),
        (Look(xlim=(1.2, 1.3)), [(1.2, 1.3), (0.35, 0.65)]),
        (Look(ylim=(0.6, 0.9)), [(0.55, 1.45), (0.6, 0.9)]),
        (Look(xlim=(0.3, 0.4), ylim=(0.1, 0.2)), [(0.3, 0.4), (0.1, 0.2)]),
    ],
)
def test_a_crop_shows_what_is_asked_for(look: Look, shown: list[tuple[float, float]]) -> None:
    """Pressure and status, with no empty patch beside the part."""
    figure = contact_figure(pressed(), look)
    assert figure is not None
    for ax in figure.axes[1:3]:
        assert ax.get_xlim() == pytest.approx(shown[0])
        assert ax.get_ylim() == pytest.approx(shown[1])
        image = np.asarray(ax.images[0].get_array())[..., :3]
        assert (image.min(axis=2) < 250).mean() > 0.98


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_panels_name_what_they_show(mu: float) -> None:
    """Without friction nothing slides; arrows have a scale; titles are apart."""
    run = pressed(friction={"law": "coulomb", "mu": mu} if mu else {"law": "none"})
    with rc_context(Look(6.3).style):
        figure = figures_of(run)["contact"]
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        titles = [ax.title.get_window_extent(canvas.get_renderer()) for ax in figure.axes[:3]]
    assert not titles[0].overlaps(titles[1]) and not titles[1].overlaps(titles[2])
    words = [text.get_text().split(":")[0] for text in figure.legends[0].get_texts()]
    zones = ["sticking", "sliding", "open"] if mu else ["in contact", "open"]
    assert words == [*zones, "foundation"]
    arrows = [each for each in figure.axes[2].collections if isinstance(each, Quiver)]
    assert len(arrows) == (mu > 0)
    assert ("longest arrow" in figure.axes[2].get_title()) == (mu > 0)
    surface = run.surface.copy()
    surface["status"] = np.full(surface.n_points, STATUS["open"])
    status = np.full(len(run.points), "open")
    opened = replace(run, surface=surface, table={**run.table, "status": status})
    assert len(figures_of(opened)["contact"].axes) == len(figure.axes) - 1  # no bar of colours


def test_a_view_is_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run = pressed()
    above, below = (
        np.asarray(contact_figure(run, Look(view=(0.3, -0.4, z))).axes[0].images[0].get_array())  # type: ignore[union-attr]
        for z in (1.0, -1.0)
    )
    # The contact has colours, the rest of the body is grey.
    coloured = [
        (np.ptp(image[..., :3].astype(int), axis=2) > 40).mean() for image in (above, below)
    ]
    assert coloured[0] < 0.01 and coloured[1] > 0.1
    for text in ("1,2", "0,0,0", "a,b,c", "inf,0,0"):
        assert main(["plot", str(tmp_path), "--view", text]) == 2
        assert f"--view {text}; accepted: three numbers" in capsys.readouterr().err


def test_ends_beside_the_part_are_refused() -> None:
    with pytest.raises(InputError, match="--xlim 5,6: beside the contact part"):
        contact_figure(pressed(), Look(xlim=(5.0, 6.0)))


def test_a_window_shows_the_contact_or_a_field(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """With its bar of colours; without a display, or in the plane, one message."""
    run = pressed()
    cases = (None, "pressure", run.table["pressure"].max()), ("von_mises", "values", 0.0)
    for field, name, peak in cases:
        plotter = window(run, field)
        drawn = [mesh for mesh in plotter.meshes if mesh.active_scalars_name == name]
        assert drawn and len(plotter.scalar_bars) == 1
        assert plotter.mapper.scalar_range[1] >= peak
        plotter.close()
    monkeypatch.setattr(pyvista, "OFF_SCREEN", True)
    write_outputs(solve(block(3)), tmp_path)
    write_outputs(solve(block(2)), tmp_path / "plane")
    for arguments, words in (
        (["view", str(tmp_path)], "no display for a window; accepted"),
        (["view", str(tmp_path), "--field", "heat"], "--field heat: no such field"),
        (["view", str(tmp_path / "plane")], "a plane body is not turned"),
    ):
        assert main(arguments) == 2
        assert words in capsys.readouterr().err


def test_a_page_needs_its_packages(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(figures, "find_spec", lambda name: None)
    assert main(["plot", str(tmp_path), "--html"]) == 2
    assert "--html: no package trame, trame_vtk, trame_vuetify; accepted" in capsys.readouterr().err
    # With them pyvista is asked for the file.
    write_outputs(solve(block(3)), tmp_path)
    monkeypatch.setattr(figures, "find_spec", lambda name: name)
    write = lambda self, path: Path(path).write_text("page")  # noqa: E731
    monkeypatch.setattr(pyvista.Plotter, "export_html", write)
    assert main(["plot", str(tmp_path), "--html"]) == 0
    assert (tmp_path / "figure-view.html").read_text() == "page"
