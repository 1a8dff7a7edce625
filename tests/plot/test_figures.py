"""The figures of a solution."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import colormaps, rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation
from scipy.spatial import KDTree

from contact.cli.arguments import parse
from contact.errors import InputError
from contact.plot.body import draw_plane, picture
from contact.plot.contact import draw_line
from contact.plot.figures import draw
from contact.plot.run import Run
from contact.plot.series import Swept, draw_loop
from contact.plot.style import Look, smooth
from contact.results.options import OutputOptions, Units
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


def test_a_swept_motion_has_its_unit() -> None:
    """That of its own column, not of the table of the summary of the same name."""
    swept = Swept("", Units(length="mm", stress="MPa"), "plane_strain", [], [{"rigid_y": "1"}])
    assert swept.label("rigid_y") == "rigid, $y$ (mm)"
    assert swept.label("rigid_force_y") == "rigid force, $y$ (N/mm)"
    assert swept.label("volume_ratio_least") == "volume ratio, least"


def test_a_crop_has_nodes_beside_a_single_one() -> None:
    """Three elements on each side at least, and numbers of the axis without an offset."""
    mesh = {"generator": "rectangle", "size": [2.0, 1.0], "cells": [40, 2]}
    run = run_of(solve(block(2, mesh=mesh)))
    table = run.table
    zone = np.isclose(table["x"], 1.0)
    table = {
        **table,
        "status": np.where(zone, "slip", "open"),
        "pressure": np.where(zone, 1.0, 0.0),
    }
    with rc_context(Look().style):
        ax = draw_line(replace(run, table=table), Look()).axes[0]
        assert ax.get_xlim() == pytest.approx((0.85, 1.15))
        assert not ax.xaxis.get_major_formatter().get_useOffset()
    table = {**table, "status": np.full(zone.shape, "open"), "pressure": 0.0 * table["pressure"]}
    ax = draw_line(replace(run, table=table), Look()).axes[0]
    assert [text.get_text() for text in ax.texts] == ["no contact"]


def test_between_nodes_values_are_coloured_and_not_colours_mixed() -> None:
    """Across one triangle all colours are those of the bar."""
    figure = Figure(figsize=(2, 2), dpi=100)
    ax = figure.add_axes((0, 0, 1, 1))
    ax.set(xlim=(0, 1), ylim=(0, 1))
    ax.axis("off")
    triangle = Triangulation([-1, 3, -1], [-1, -1, 3])
    colours = colormaps["viridis"]
    smooth(ax, triangle, np.array([0.0, 1.0, 0.5]), Normalize(0.0, 1.0), colours)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    seen = np.asarray(canvas.buffer_rgba())[..., :3].reshape(-1, 3)
    bar = np.round(255 * colours(np.linspace(0, 1, 256))[:, :3])
    assert KDTree(bar).query(seen)[0].max() <= 2.0
    assert len(np.unique(seen, axis=0)) > 50


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


@pytest.mark.parametrize(
    ("xlim", "shown"),
    [((-1.2, 1.0), (0.0, 1.2)), ((-1.0, -0.5), (0.5, 1.0)), ((-9.0, 9.0), (0.0, 2.0))],
)
def test_the_window_of_both_halves_is_one_of_radii_along_the_contact(
    xlim: tuple[float, float], shown: tuple[float, float]
) -> None:
    run = replace(run_of(solve(block(2))), axes="rz")
    found = draw_line(run, Look(mirror=True, xlim=xlim)).axes[0].get_xlim()
    assert found == pytest.approx(shown)


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


def test_a_foundation_that_is_far_is_not_drawn() -> None:
    """The body would be a dot beside it, as its gap is scaled like the displacements."""
    case = block(2, contact={"on": "bottom", "gap": 1.0})
    run = run_of(solve(case))
    assert not draw_plane(picture(run, "von_mises", scale=10.0)).axes[0].lines
    assert draw_plane(picture(run, "von_mises", scale=0.5)).axes[0].lines


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


def test_the_loops_of_several_rigid_parts() -> None:
    """Each where it moves; forces of one that is free along an axis are not left out."""
    columns = {
        "rigid_x_left+right": [0.0, 0.1, -0.1, 0.0],
        "rigid_y_left+right": [0.0, 0.0, 0.0, 0.0],
        "rigid_x_lid": [0.0, 0.0, 0.0, 0.0],
        "rigid_y_lid": [-0.5, -1.0, -1.5, -2.0],
    }
    columns |= {name.replace("_", "_force_", 1): [1.0] * 4 for name in columns}
    run = replace(run_of(solve(block(2))), steps={k: np.array(v) for k, v in columns.items()})
    figure = draw_loop(run, "rigid")
    named = [[line.get_label() for line in ax.lines] for ax in figure.axes]
    assert named == [["left+right"], ["lid"]]


def curved(nodes: int = 9, turn: float = np.pi / 2, **columns: Any) -> Run:
    """Return the run of a block whose contact part is taken for a quarter of a circle, or more."""
    run = run_of(solve(block(2)))
    angle = np.linspace(0.0, turn, len(run.table["x"]))
    places = {"x": 3 - np.cos(angle), "y": np.sin(angle), "gap": 0 * angle}
    table = {k: v[:nodes] for k, v in (run.table | places | columns).items()}
    surface = run.surface.copy()
    surface["row"][:] = 0  # nothing is held
    return replace(run, table=table, surface=surface)


def test_ends_of_axes_are_coordinates_on_curved_parts_too() -> None:
    turn = 1.25 * np.pi
    run = curved(turn=turn)
    whole = draw_line(run, Look()).axes[-1]
    assert whole.get_xlabel() == r"$\ell$ along $\Gamma_3$, from (2, 0)"
    assert whole.get_xlim() == pytest.approx((0.0, 16 * np.sin(turn / 16)), rel=1e-12)
    # x < 3 is an angle below 90 degrees, y > 0.5 one above 30 degrees.
    room = run.table["weight"].max() / 2 + turn / 8
    low, high = draw_line(run, Look(xlim=(0.0, 3.0), ylim=(0.5, 5.0))).axes[0].get_xlim()
    assert abs(low - np.pi / 6) < room and abs(high - np.pi / 2) < room
    beside = "--xlim 0,1.9: beside the contact part, which has x from 2 to 3.981; accepted: coord"
    with pytest.raises(InputError, match=beside):
        draw_line(run, Look(xlim=(0.0, 1.9)))


def test_curves_are_drawn_along_the_axis_over_which_they_are_graphs() -> None:
    """A half width is read off where it is; the limits of the other axis show the nodes within."""
    run = curved()
    whole = draw_line(run, Look()).axes[-1]
    assert whole.get_xlabel() == r"$x$ along $\Gamma_3$"
    assert whole.get_xlim() == pytest.approx((2.0, 3.0), rel=1e-12)
    low, high = draw_line(run, Look(ylim=(0.5, 5.0))).axes[0].get_xlim()
    assert 2.0 < low < 3 - np.cos(np.pi / 4) and high == pytest.approx(3.0, rel=1e-12)
    slim = replace(run, table=run.table | {"x": run.table["x"] / 2})
    assert draw_line(slim, Look()).axes[-1].get_xlabel() == r"$y$ along $\Gamma_3$"


def test_a_contact_beside_the_ends_is_left_out() -> None:
    """Not the figure: another one is within them."""
    run = run_of(solve(block(2)))
    table = {k: np.concatenate([v, v]) for k, v in run.table.items()}
    count = len(run.table["x"])
    table["entry"] = np.repeat([0, 1], count)
    table["on"] = np.repeat(["one", "two"], count)
    table["x"] = np.where(table["entry"] == 1, table["x"] + 10.0, table["x"])
    both = replace(run, table=table)
    assert len(draw_line(both, Look()).axes) == 2 * len(draw_line(run, Look()).axes)
    axes = draw_line(both, Look(xlim=(10.5, 11.0))).axes
    assert len(axes) == len(draw_line(run, Look()).axes)
    assert axes[0].get_xlim() == (10.5, 11.0)


def test_a_contact_of_one_node_has_the_width_of_its_share() -> None:
    run = curved(nodes=1)
    ax = draw_line(run, Look()).axes[0]
    low, high = ax.get_xlim()
    assert (low + high) / 2 == pytest.approx(run.table["x"][0])
    assert high - low == pytest.approx(run.table["weight"][0])
    assert ax.lines[0].get_marker() == "o"


def test_rows_may_run_against_the_axis() -> None:
    """The axis ends at a node that is held beside the first row, which lies right."""
    run = run_of(solve(block(2)))
    table = {k: v[::-1][:-1] for k, v in run.table.items()}
    held = run.surface.copy()
    held["row"][np.argmin(np.abs(held.points[:, 0]) + np.abs(held.points[:, 1]))] = -1
    ax = draw_line(replace(run, table=table, surface=held), Look()).axes[0]
    assert ax.get_xlim() == pytest.approx((0.0, 2.0))


@pytest.mark.parametrize("width", [85 / 25.4, 6.3])
@pytest.mark.parametrize("axes", ["x", "xy", "xyz"])
def test_labels_of_a_loop_are_apart(width: float, axes: str) -> None:
    look = Look(width)
    forward, back = [0.0005, 0.001, 0.0015, 0.0017], [-0.0005, -0.001, -0.0015, -0.002]
    columns = {f"rigid_{axis}": forward if axis == "x" else back for axis in axes}
    columns |= {f"rigid_force_{axis}": [0.2, 0.4, 0.6, 0.9] for axis in axes}
    run = replace(moved(**columns), axes="xyz" if axes == "xyz" else "xy")
    with rc_context(look.style):
        figure = draw_loop(run, "rigid")
        figure.suptitle("A title")
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        renderer = canvas.get_renderer()
        top = figure._suptitle.get_window_extent(renderer).y0  # type: ignore[attr-defined]
        drawn = [ax for ax in figure.axes if ax.axison]
        assert len(drawn) == len(axes)
        for ax in drawn:
            left, right = ax.bbox.x0 - 1, ax.bbox.x1 + 1
            boxes = [label.get_window_extent(renderer) for label in ax.get_xticklabels()]
            inside = [box for box in boxes if left <= (box.x0 + box.x1) / 2 <= right]
            assert len(inside) >= 2
            assert all(one.x1 + 3 < two.x0 for one, two in pairwise(inside))
            name = ax.yaxis.label.get_window_extent(renderer)
            assert 0 <= name.y0 and name.y1 <= top


def test_ends_below_zero_are_values_of_an_option() -> None:
    """Argparse takes them for options where the second begins with a minus sign."""
    options, rest = parse(["plot", "out", "--xlim", "-0.5,1", "--ylim", "-.5,-0.1"])
    assert (options.xlim, options.ylim, rest) == ("-0.5,1", "-.5,-0.1", [])
    options, rest = parse(["solve", "a.toml", "--quiet", "-contact_ksp_rtol", "-1"])
    assert rest == ["-contact_ksp_rtol", "-1"]


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("inches", [85 / 25.4, 6.3])
def test_words_are_within_the_figure(dim: int, inches: float) -> None:
    """One column of a paper is narrow, and a title may be long."""
    solution = solve(electric(dim))
    solution.title = "A body that a load of some size presses on what is conductive"
    figures = solution.plot(width=inches)
    assert figures is not None
    with rc_context(Look(inches).style):
        for name, figure in figures.items():
            canvas = FigureCanvasAgg(figure)
            canvas.draw()
            box, tolerance = figure.get_tightbbox(canvas.get_renderer()), 0.02  # inches
            width, height = figure.get_size_inches()
            assert box.x0 > -tolerance, name
            assert box.y0 > -tolerance, name
            assert box.x1 < width + tolerance, name
            assert box.y1 < height + tolerance, name


@pytest.mark.parametrize("height", [0.25, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("lines", [1, 3])
def test_the_lines_of_a_title_are_above_the_body(height: float, lines: int) -> None:
    solution = solve(
        block(2, mesh={"generator": "rectangle", "size": [2, height], "cells": [8, 4]})
    )
    title = "A body" + (lines - 1) * " that a load of some size presses for as long as it takes"
    run = replace(run_of(solution), title=title)
    with rc_context(Look(6.3).style):
        figure = draw_plane(picture(run, "von_mises"))
        FigureCanvasAgg(figure).draw()
    assert figure.axes[0].get_title().count("\n") == lines - 1
    assert figure.axes[0].title.get_window_extent().y1 < figure.bbox.height


def test_any_title_can_be_drawn(tmp_path: Path) -> None:
    solution = solve(block(2))
    for title in ("long " * 1000, "x" * 5000, "a $ b $ \\frac", "two\nlines"):
        run = run_of(replace(solution, title=title))
        assert all(file.stat().st_size > 10_000 for file in draw(run, tmp_path))


def test_a_small_contact_zone_is_drawn_with_its_vicinity() -> None:
    """Not the whole body, of which it is a dot; the displacements have the scale of the part."""
    mesh = {"generator": "rectangle", "size": [2.0, 1.0], "cells": [64, 4]}
    run = run_of(solve(block(2, mesh=mesh)))
    whole = picture(run, "von_mises")
    assert np.ptp(whole.box, axis=0)[0] > 2.0
    status = np.where(abs(run.table["x"] - 1.0) < 0.04, "stick", "open")
    near = picture(replace(run, table={**run.table, "status": status}), "von_mises")
    assert near.scale <= whole.scale
    width = np.ptp(run.table["x"][status == "stick"])
    assert np.ptp(near.box, axis=0)[0] == pytest.approx(7 * width)
    ax = draw_plane(near).axes[0]
    assert ax.get_xlim() == pytest.approx((1 - 3.5 * width, 1 + 3.5 * width))


def test_a_foundation_far_away_does_not_shrink_the_body() -> None:
    """The gap is scaled as the displacements are: the body would be a dot beside it."""
    run = run_of(solve(block(2, contact={"on": "bottom", "gap": 5.0})))
    low, high = draw_plane(picture(run, "von_mises", 10.0)).axes[0].get_ylim()
    assert high - low < 2 * run.diameter
