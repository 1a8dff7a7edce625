"""The figures of a solution."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact.errors import InputError
from contact.plot.body import draw_plane, picture
from contact.plot.contact import draw_line
from contact.plot.run import Run
from contact.plot.series import draw_loop
from contact.plot.style import Look
from contact.results.options import OutputOptions
from contact.results.solution import Solution
from contact.solving import solve
from contact.writing import write_outputs
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
    run = solution.written()
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
    assert draw_line(run, Look()).axes[0].get_xlim() == pytest.approx((0.0, 2.0))
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


def test_axes_end_where_they_are_asked_to() -> None:
    run = run_of(solve(block(2)))
    look = Look(xlim=(0.5, 1.0), ylim=(0.0, 0.4))
    assert draw_line(run, look).axes[0].get_xlim() == (0.5, 1.0)
    ax = draw_plane(picture(run, "von_mises", look=look)).axes[0]
    assert (ax.get_xlim(), ax.get_ylim()) == ((0.5, 1.0), (0.0, 0.4))
    # The foundation below remains where the ends of the other axis alone are given.
    low, high = draw_plane(picture(run, "von_mises", look=Look(xlim=(0.5, 1.0)))).axes[0].get_ylim()
    assert low < 0 and high > 1
    body = r"beside the body, which is drawn from .*; accepted: ends that show some of it"
    for beside, words in (
        (Look(xlim=(5.0, 6.0)), f"--xlim 5,6: {body}"),
        (Look(ylim=(-3.0, -2.0)), f"--ylim -3,-2: {body}"),
    ):
        with pytest.raises(InputError, match=words):
            draw_plane(picture(run, "von_mises", look=beside))
    with pytest.raises(InputError, match=r"--xlim 5,6: beside the contact part, .* from 0 to 2"):
        draw_line(run, Look(xlim=(5.0, 6.0)))


def test_a_crop_has_the_scales_of_what_it_shows() -> None:
    """Limits of the axes and colours, and zones in the legend, from the part that is drawn."""
    mesh = {"generator": "rectangle", "size": [2.0, 1.0], "cells": [40, 8]}
    run = run_of(solve(block(2, mesh=mesh)))
    table, look = run.table, Look(xlim=(0.2, 0.45))
    table = {
        **table,
        "pressure": 1 + table["x"],
        "bound": 0.3 * (1 + table["x"]),
        "status": np.where(table["x"] < 0.5, "open", "stick"),
    }
    figure = draw_line(replace(run, table=table), look)
    assert figure.axes[0].get_ylim() == pytest.approx((0.0, 1.05 * 1.45))
    assert figure.axes[1].get_ylim() == pytest.approx((-0.315 * 1.45, 0.315 * 1.45))
    words = [text.get_text() for text in figure.legends[0].get_texts()]
    assert "open" in words and "sticking" not in words
    # The potential is x: nodal values are those of the cut, and cells those that it meets.
    body = run.body.copy()
    body.point_data["potential"] = body.points[:, 0]
    body.cell_data["number"] = body.cell_centers().points[:, 0]
    still = replace(run, body=body)
    norm = picture(still, "potential", 0.0, look).norm
    assert (norm.vmin, norm.vmax) == pytest.approx((0.2, 0.45))
    norm = picture(still, "number", 0.0, look).norm
    assert 0.15 < norm.vmin < 0.25 < 0.4 < norm.vmax < 0.5
    turned = replace(still, axes="rz")
    norm = picture(turned, "potential", 0.0, Look(mirror=True, xlim=(-0.5, 0.1))).norm
    assert (norm.vmin, norm.vmax) == pytest.approx((0.0, 0.5))


def test_regions_are_classes_with_names() -> None:
    """Not a bar of numbers; a crop has those that it shows."""
    mesh = {
        "generator": "rectangle", "size": [2.0, 1.0], "cells": [8, 4],
        "regions": {"coat": "y < 0.25", "hub": "x > 1.5"},
    }  # fmt: skip
    run = run_of(solve(block(2, mesh=mesh)))
    for look, words in (
        (Look(), ["body", "coat", "hub"]),
        (Look(xlim=(0.1, 0.6), ylim=(0.1, 0.9)), ["body", "coat"]),
    ):
        figure = draw_plane(picture(run, "region", look=look))
        assert [text.get_text() for text in figure.legends[0].get_texts()] == words
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


def curved(nodes: int = 9, turn: float = np.pi / 2, **columns: Any) -> Run:
    """Return the run of a block whose contact part is taken for a quarter of a circle, or more."""
    run = run_of(solve(block(2)))
    angle = np.linspace(0.0, turn, len(run.table["x"]))
    places = {"x": 3 - np.cos(angle), "y": np.sin(angle), "gap": 0 * angle}
    table = {k: v[:nodes] for k, v in (run.table | places | columns).items()}
    surface = run.surface.copy()
    surface["row"][:] = 0  # nothing is held
    return replace(run, table=table, surface=surface)


def test_a_contact_of_one_node_has_the_width_of_its_share() -> None:
    run = curved(nodes=1)
    ax = draw_line(run, Look()).axes[0]
    low, high = ax.get_xlim()
    assert (low + high) / 2 == pytest.approx(run.table["x"][0])
    assert high - low == pytest.approx(run.table["weight"][0])
    assert ax.lines[0].get_marker() == "o"
