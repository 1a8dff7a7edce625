"""The figures of a solution."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact.plot.body import draw_plane, picture
from contact.plot.contact import draw_line
from contact.plot.run import Run
from contact.plot.series import draw_loop
from contact.results.options import OutputOptions
from contact.results.solution import Solution
from contact.solving import solve
from contact.writing import write_outputs, written
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
    np.testing.assert_allclose(run.held, [[0.0, 0.0]], atol=1e-15)
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
