"""The figures of a solution.

Labels of figures and the ends of their colours.
Figures of one step of an evolution.
Rigid foundations beside magnified bodies: true shapes, or shallow profiles that touch.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact.cli.main import main
from contact.plot.body import draw_plane, picture
from contact.plot.contact import draw_line
from contact.plot.foundation import BEYOND, SHALLOW, UNSEEN, profiles
from contact.plot.run import Run, read_run, read_step
from contact.plot.series import draw_loop
from contact.plot.style import unit_of
from contact.results.options import OutputOptions, Units
from contact.solution import Solution
from contact.solving import solve
from contact.writing import write_outputs, written
from scripts.cases import CASES
from tests.problems.written import block, electric


@pytest.mark.parametrize("dim", [2, 3])
def test_figures(dim: int, tmp_path: Path) -> None:
    """All figures are drawn, whatever format the fields are asked for in."""
    solution = solve(electric(dim))
    solution.output = OutputOptions(fields="none" if dim == 2 else "vtu")
    write_outputs(solution, tmp_path, figures=True)
    files = sorted(tmp_path.glob("figure-*"))
    assert [file.name for file in files] == [
        "figure-contact.png",
        "figure-deformed.png",
        "figure-potential.png",
    ]
    assert all(file.stat().st_size > 10_000 for file in files)
    assert (tmp_path / "fields.vtu").exists() == (dim == 3)


def test_a_body_in_2d_is_not_turned(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_outputs(solve(block(2)), tmp_path / "out")
    before = sorted((tmp_path / "out").iterdir())
    for option in ("--view=0,0,1", "--html"):
        assert main(["plot", str(tmp_path / "out"), option]) == 2
        assert "in 2-D is not turned; accepted: " in capsys.readouterr().err
        assert sorted((tmp_path / "out").iterdir()) == before


def run_of(solution: Solution) -> Run:
    run = written(solution)
    assert run is not None
    return run


def test_figures_begin_at_the_edge_of_the_body() -> None:
    """The clamped corner is no contact node, but the axis and the foundation reach it."""
    case = block(
        2,
        fixed=[{"on": "left", "displacement": [0.0, 0.0]}],
        load=[{"on": "top", "traction": [0.0, -0.1]}],
    )
    run = run_of(solve(case))
    assert run.table["x"].min() == 0.25
    np.testing.assert_allclose(run.constrained, [[0.0, 0.0]], atol=1e-15)
    assert draw_line(run).axes[0].get_xlim() == pytest.approx((0.0, 2.0))
    line = draw_plane(picture(run, "von_mises")).axes[0].lines[0].get_xdata()
    assert (np.min(line), np.max(line)) == pytest.approx((0.0, 2.0))


@pytest.mark.parametrize("degree", [1, 2])
def test_the_colours_are_those_of_the_field(degree: int) -> None:
    """In a body under one stress; the mesh of triangles is that of the deformed body."""
    run = run_of(solve(block(2, degree)))
    x = run.body.points[:, 0]
    run.body.point_data["potential"] = x**2
    drawn = picture(run, "potential", scale=1.0)
    skin = drawn.skin
    assert len(skin.regular_faces) == run.body.n_cells * (1 if degree == 1 else 4)
    back = skin.points - skin["displacement"]
    np.testing.assert_allclose(skin["values"], back[:, 0] ** 2, atol=1e-6)
    np.testing.assert_allclose(run.body.points[:, 0], x)


def test_a_small_contact_zone_is_drawn_with_its_vicinity() -> None:
    """Not the whole body, of which it is a dot: axes and colours are those of the part."""
    mesh = {"generator": "rectangle", "size": [2.0, 1.0], "cells": [64, 4]}
    run = run_of(solve(block(2, mesh=mesh)))
    run.body.point_data["potential"] = run.body.points[:, 0]
    status = np.where(abs(run.table["x"] - 1.0) < 0.04, "stick", "open")
    run = replace(run, table={**run.table, "status": status})
    near, width = picture(run, "potential"), np.ptp(run.table["x"][status == "stick"])
    shown = 1 - 3.5 * width, 1 + 3.5 * width
    assert draw_plane(near).axes[0].get_xlim() == pytest.approx(shown)
    assert (near.norm.vmin, near.norm.vmax) == pytest.approx(shown, abs=2 / 64)
    low, high = draw_line(run).axes[0].get_xlim()
    assert low < 1 - width < 1 + width < high and high - low < 0.3


def test_axes_of_several_contacts_are_those_of_all() -> None:
    """Those of the second, which has no friction and less pressure, hid the first."""
    pieces = {"one": (0.0, 0.75), "two": (1.25, 2.0)}
    parts = {name: {"side": "bottom", "from": a, "to": b} for name, (a, b) in pieces.items()}
    mesh = {"generator": "rectangle", "size": [2.0, 1.0], "cells": [8, 4], "parts": parts}
    rubs = {"law": "coulomb", "mu": 0.3}
    contact = [{"on": "one", "friction": rubs}, {"on": "two", "gap": 0.04}]
    run = run_of(solve(block(2, mesh=mesh, contact=contact, friction={"law": "none"})))
    first, second = run.contacts
    assert first["pressure"].max() > 2 * second["pressure"].max() > 0
    axes = draw_line(run).axes
    assert all(ax.get_ylim()[1] >= 0.7 * first["pressure"].max() for ax in axes[:2])
    assert all(0 < 0.7 * first["bound"].max() <= ax.get_ylim()[1] < 0.9 for ax in axes[2:])


def test_regions_are_classes_with_names() -> None:
    """Not a bar of numbers."""
    mesh = {
        "generator": "rectangle", "size": [2.0, 1.0], "cells": [8, 4],
        "regions": {"coat": "y < 0.25", "hub": "x > 1.5"},
    }  # fmt: skip
    run = run_of(solve(block(2, mesh=mesh)))
    figure = draw_plane(picture(run, "region"))
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["body", "coat", "hub"]
    assert len(figure.axes) == 1


def moved(**columns: list[float]) -> Run:
    """Return the run of a rigid part with these columns in its steps."""
    run = run_of(solve(block(2)))
    course = {f"rigid_{axis}": np.zeros(4) for axis in "xy"}
    course |= {f"rigid_force_{axis}": np.zeros(4) for axis in "xy"}
    return replace(run, steps=course | {k: np.array(v) for k, v in columns.items()})


@pytest.mark.parametrize(
    ("columns", "drawn"),
    [
        ({"rigid_x": [0.0, 0.01, -0.01, 0.01], "rigid_y": [-1.0, -1.0, -1.0, -1.0]}, "xy"),
        ({"rigid_x": [1.0, 0.0, -1.0, 0.0], "rigid_y": [1e-9, -1e-9, 1e-9, 0.0]}, "x"),
        ({"rigid_y": [0.3, 0.6, 0.9, 1.2]}, "y"),
    ],
)
def test_a_loop_is_drawn_for_each_direction_that_moves(
    columns: dict[str, list[float]], drawn: str
) -> None:
    """The load line and the loop of shear, which is far shorter; not rounding."""
    axes = draw_loop(moved(**columns), "rigid").axes
    assert [ax.get_xlabel() for ax in axes] == [f"displacement $u_{axis}$" for axis in drawn]
    for ax, axis in zip(axes, drawn, strict=True):
        assert ax.lines[0].get_xdata()[1:] == pytest.approx(columns[f"rigid_{axis}"])


@pytest.mark.parametrize(
    ("quantity", "plane", "space"),
    [
        ("area", "(mm)", "(mm$^2$)"),
        ("force", "(N/mm)", "(N)"),
        ("work", "(N)", "(N mm)"),
        ("force · length", "(N)", "(N mm)"),
    ],
)
def test_units_of_a_unit_of_thickness(quantity: str, plane: str, space: str) -> None:
    units = Units(length="mm", stress="MPa")
    assert unit_of(quantity, units, True) == f" {plane}"
    assert unit_of(quantity, units, False) == f" {space}"
    ours = Units(length="l", stress="s")
    assert unit_of("work", ours, True) == " (s l$^2$)"
    assert unit_of("force", ours, True) == " (s l)"


def test_a_stress_per_area_names_the_force() -> None:
    assert unit_of("force", Units(length="mm", stress="daN/mm²"), False) == " (daN)"
    assert unit_of("force", Units(length="m", stress="N/mm2"), False) == " (N/mm2 m$^2$)"


SMALL = ["--set", "mesh.cells=[8,4]", "--set", "evolution.steps=[1,2,1,1]", "--quiet"]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fretting")
    assert main(["solve", str(CASES / "fretting.toml"), "--out", str(folder), *SMALL]) == 0
    return folder


def test_a_step_is_drawn(run: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Contact and body of the step, in files that end with its number."""
    assert main(["plot", str(run), "--step", "2"]) == 0
    drawn = {path.name for path in run.glob("figure-*-step-2.png")}
    assert drawn == {"figure-contact-step-2.png", "figure-deformed-step-2.png"}
    step, last = read_step(run, 2), read_run(run)
    tables = last.tables
    assert abs(step.table["moved"]).max() < 1e-12  # the foundation is at rest
    np.testing.assert_array_equal(step.table["pressure"], tables[1]["pressure"])
    assert abs(step.table["tau"] - last.table["tau"]).max() > 0
    own = step.surface["row"] >= 0
    pressure = tables[1]["pressure"][step.surface["row"][own].astype(int)]
    np.testing.assert_allclose(step.surface["pressure"][own], pressure, rtol=1e-6)
    assert step.title.endswith("t = 1.5")
    assert main(["plot", str(run), "--step", "6"]) == 2
    assert "--step 6: no fields of such a step; accepted: 1, 2, 3, 4, 5" in capsys.readouterr().err


SHAPES: dict[str, dict[str, Any]] = {
    "plane": {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]},
    "tilted plane": {"shape": "plane", "point": [0.0, 0.0], "normal": [1e-3, 1.0]},
    "small ball": {"shape": "sphere", "centre": [1.0, -0.3], "radius": 0.3},
    "ball": {"shape": "sphere", "centre": [1.0, -3.0], "radius": 3.0},
    "large ball": {"shape": "sphere", "centre": [1.0, -30.0], "radius": 30.0},
    "wedge": {"shape": "cone", "apex": [1.0, 0.0], "axis": [0, -1], "half_angle": 45.0},
    "blunt wedge": {"shape": "cone", "apex": [1.0, 0.0], "axis": [0, -1], "half_angle": 89.0},
    "punch": {"shape": "punch", "centre": [1.0, 0.0], "axis": [0, -1], "radius": 0.3},
    "heights": {"shape": "heights"},
}


def pressed(contact: dict[str, Any], by: float = 1e-3, **more: Any) -> Run:
    """Return the run of a block that is pressed down on a foundation by a small displacement."""
    sections: dict[str, Any] = {
        "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [40, 10]},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "top", "displacement": [0.0, -by]}],
        "contact": {"on": "bottom", **contact},
        "friction": {"law": "none"},
    }
    run = written(solve(block(2, **(sections | more))))
    assert run is not None
    return run


@pytest.mark.parametrize("name", SHAPES)
def test_foundations_are_no_spikes_and_bodies_touch_them(name: str, tmp_path: Path) -> None:
    """In front of a straight part, whatever the scale: nothing overlaps, what touches is closed."""
    shape = dict(SHAPES[name])
    if name == "heights":
        x = np.linspace(0.0, 2.0, 201)
        heights = np.column_stack([x, 2e-4 * (np.cos(9 * x) - 1)])
        np.savetxt(tmp_path / "rough.csv", heights, delimiter=",", header="x,y", comments="")
        shape["file"] = str(tmp_path / "rough.csv")
    run = pressed({"foundation": shape})
    made = picture(run, "von_mises")
    assert made.scale > 1 and np.ptp(run.points[run.table["status"] != "open", 0]) >= 0
    (profile,) = profiles(run, made.scale, made.skin.points[:, :2], made.near)
    size = run.diameter if made.near is None else np.ptp(made.near, axis=0).max()
    seen = np.ones(len(run.points), dtype=bool)
    if made.near is not None:
        seen = np.all((run.points >= made.near[0]) & (run.points <= made.near[1]), axis=1)
    gap, touching = profile.gap[1:-1], run.table["status"] != "open"
    assert gap[seen].min() >= -1.001 * UNSEEN * size
    assert gap[seen & touching].max() <= 1e-6 * size
    # Its own shape, or one that rises by little.
    true = run.points + run.table["gap"][:, None] * np.column_stack(
        [run.table[f"nu_{axis}"] for axis in "xy"]
    )
    drawn = profile.points[1:-1]
    shallow = np.ptp((drawn - run.points)[seen, 1]) <= 1.001 * SHALLOW * size
    assert shallow or np.ptp((drawn - true)[:, 1]) < 1e-9
    ax = draw_plane(made).axes[0]
    (low, high), extent = ax.get_ylim(), np.ptp(made.box[:, 1])
    assert high - low <= 1.1 * extent + (2 * BEYOND + 0.1) * np.ptp(made.box, axis=0).max()
    assert low < drawn[seen][touching[seen], 1].min()
