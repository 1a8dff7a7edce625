"""The figures of a solution."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from contact.output.figures.style import widened
from contact.output.table import contact_table, held_points
from contact.solving import solve
from tests.problems.written import block, electric


@pytest.mark.parametrize("dim", [2, 3])
def test_figures(dim: int, shared_tmp_path: Path) -> None:
    """All figures are drawn."""
    from contact.output.figures.figures import collect

    if dim == 3:
        pytest.importorskip("pyvista")
    drawing = collect(solve(electric(dim)))
    assert drawing is not None
    files = drawing.draw(shared_tmp_path)
    assert [file.name for file in files] == [
        "figure-contact.png",
        "figure-deformed.png",
        "figure-potential.png",
    ]
    assert all(file.stat().st_size > 10_000 for file in files)


def test_figures_begin_at_the_edge_of_the_body() -> None:
    """The clamped corner is no contact node, but the axis and the foundation reach it."""
    from contact.output.figures.body import draw_plane, picture
    from contact.output.figures.contact import draw_line

    case = block(
        2,
        fixed=[{"on": "left", "displacement": [0.0, 0.0]}],
        load=[{"on": "top", "traction": [0.0, -0.1]}],
    )
    solution = solve(case)
    table, held = contact_table(solution), held_points(solution.problem)
    assert table is not None
    assert table["x"].min() == 0.25
    np.testing.assert_allclose(held, [[0.0, 0.0]], atol=1e-15)
    assert draw_line(table, held=held).axes[0].get_xlim() == pytest.approx((0.0, 2.0))
    drawn = picture(solution, "von_mises", "stress")
    assert drawn is not None
    line = draw_plane(drawn, table).axes[0].lines[0].get_xdata()
    assert (np.min(line), np.max(line)) == pytest.approx((0.0, 2.0))


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("inches", [85 / 25.4, 6.3])
def test_words_are_within_the_figure(dim: int, inches: float) -> None:
    """One column of a paper is narrow, and a title may be long."""
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    from contact.output.figures.figures import collect
    from contact.output.figures.style import style

    solution = solve(electric(dim))
    solution.title = "A body that a load of some size presses on what is conductive"
    drawing = collect(solution)
    assert drawing is not None
    with rc_context(style(inches)):
        for name, figure in drawing.figures(inches).items():
            if dim == 3 and name != "contact":
                continue
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
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    from contact.output.figures.body import draw_plane, picture
    from contact.output.figures.style import style

    solution = solve(
        block(2, mesh={"generator": "rectangle", "size": [2, height], "cells": [8, 4]})
    )
    table, drawn = contact_table(solution), picture(solution, "von_mises", "stress")
    assert table is not None and drawn is not None
    with rc_context(style(6.3)):
        title = "A body" + (lines - 1) * " that a load of some size presses for as long as it takes"
        figure = draw_plane(drawn, table, title)
        FigureCanvasAgg(figure).draw()
    assert figure.axes[0].get_title().count("\n") == lines - 1
    assert figure.axes[0].title.get_window_extent().y1 < figure.bbox.height


def test_any_title_can_be_drawn(shared_tmp_path: Path) -> None:
    from contact.output.figures.figures import collect

    solution = solve(block(2))
    for title in ("long " * 1000, "x" * 5000, "a $ b $ \\frac", "two\nlines"):
        drawing = collect(replace(solution, title=title))
        assert drawing is not None
        assert all(file.stat().st_size > 10_000 for file in drawing.draw(shared_tmp_path))


def test_rounding_has_no_colours() -> None:
    """What is the same everywhere has one colour, and a scale with short numbers."""
    low, high = widened(77.83342606819, 77.83342606821)
    assert high - low > 5
    assert widened(0.0, 1.0) == (0.0, 1.0)
    assert widened(-3.0, 2.0) == (-3.0, 2.0)


def test_a_small_contact_zone_is_drawn_with_its_vicinity() -> None:
    """Not the whole body, of which it is a dot; the displacements have the scale of the part."""
    from contact.output.figures.body import draw_plane, near_contact, picture

    mesh = {"generator": "rectangle", "size": [2.0, 1.0], "cells": [64, 4]}
    solution = solve(block(2, mesh=mesh))
    table, whole = contact_table(solution), picture(solution, "von_mises", "stress")
    assert table is not None and whole is not None
    assert near_contact(whole, table) is whole
    status = np.where(abs(table["x"] - 1.0) < 0.04, "stick", "open")
    near = near_contact(whole, {**table, "status": status})
    assert near.scale <= whole.scale
    width = np.ptp(table["x"][status == "stick"])
    assert np.ptp(near.box, axis=0)[0] == pytest.approx(7 * width)
    ax = draw_plane(near, table).axes[0]
    assert ax.get_xlim() == pytest.approx((1 - 3.5 * width, 1 + 3.5 * width))
