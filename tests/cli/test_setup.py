"""The set-up of any case in one figure: `contact check --plot`."""

import io

import matplotlib
import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.quiver import Quiver

from contact import build_problem, load_case, parse_case
from contact.cli.main import main
from contact.cli.setup import draw_setup
from scripts.cases import CASES

SMALL = {
    "hertz": ("mesh.contact_size=0.5",),
    "hertz-sphere": (),
    "piezo-column": ("mesh.cells=[2, 2, 2]",),
    "bar": ("mesh.cells=[16, 4]",),
    "compliance-8-4": ("mesh.cells=[24, 4]",),
}


@pytest.mark.parametrize("name", SMALL)
def test_every_case_has_a_picture(name):
    """All that is given stands in the legend, and the dimensions of a plane body beside it."""
    case = load_case(CASES / f"{name}.toml", SMALL[name])
    figure = draw_setup(case, build_problem(case))
    figure.savefig(io.BytesIO(), dpi=30)
    (legend,) = figure.legends
    words = [text.get_text() for text in legend.get_texts()]
    for fixed in case.fixed:
        assert any(word.startswith(f"fixed {fixed.on}: ") for word in words)
    assert "foundation" in words
    if name == "bar":
        assert figure.axes[0].get_title() == r"4 $\times$ 1 mm"
        parts = [c for c in figure.axes[0].collections if isinstance(c, LineCollection)]
        loaded = next(c for c in parts if c.get_label() == "load loaded: traction = [0.0, -0.005]")
        ends = [point[0] for segment in loaded.get_segments() for point in segment]
        assert (min(ends), max(ends)) == (2.0, 4.0)


def test_arrows_are_spread_over_the_pieces_of_a_part():
    case = load_case(CASES / "compliance-8-4.toml", SMALL["compliance-8-4"])
    (arrows,) = (
        each
        for each in draw_setup(case, build_problem(case)).axes[0].collections
        if isinstance(each, Quiver)
    )
    below = arrows.XY[arrows.XY[:, 1] <= 0, 0]
    assert np.count_nonzero(below < 2) == np.count_nonzero(below > 10) >= 2
    assert len(arrows.XY) - len(below) >= 6
    above = arrows.XY[arrows.XY[:, 1] > 0, 0]  # they stopped before the end of the top
    assert above.min() == pytest.approx(12.0 - above.max()) and above.max() > 11


def test_contacts_of_two_bodies_name_both_sides():
    case = load_case(CASES / "two-blocks.toml", ("mesh.lower_size=0.5", "mesh.upper_size=0.5"))
    (legend,) = draw_setup(case, build_problem(case)).legends
    words = [text.get_text() for text in legend.get_texts()]
    assert any("upper_bottom against lower_top: Coulomb friction" in word for word in words)
    assert "opposite: lower_top" in words
    assert "foundation" not in words


def test_check_writes_it(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    before = dict(matplotlib.rcParams)
    assert main(["check", str(CASES / "bar.toml"), "--plot", "--set", "mesh.cells=[8, 2]"]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"bar-setup.png", "bar-setup.pdf"}
    assert "# set-up: bar-setup.png" in capsys.readouterr().out
    assert matplotlib.rcParams["font.size"] == before["font.size"]


def test_parts_inside_of_a_body_are_drawn():
    """An electrode between two layers, and the cut of a bolt, stand in the legend."""
    mesh = {"generator": "rectangle", "size": [4.0, 1.0], "cells": [8, 4]}
    mesh |= {"inside": {"middle": "abs(y - 0.5) < 1e-6", "cut": "abs(x - 2) < 1e-6"}}
    case = parse_case(
        {
            "mesh": mesh,
            "material": {"name": "PZT-4"},
            "fixed": [
                {"on": "left", "displacement": [0.0, 0.0]},
                {"on": "bottom", "potential": 0.0},
            ],
            "electrode": [{"on": "middle", "charge": 1.0}],
            "bolt": [{"on": "cut", "shortening": 2.0}],
            "contact": {"on": "top", "gap": 1.0},
        }
    )
    (legend,) = draw_setup(case, build_problem(case)).legends
    words = {text.get_text() for text in legend.get_texts()}
    assert {"electrode middle: charge = 1.0", "bolt cut: shortening = 2.0"} <= words


def test_conditions_have_colours_of_their_own():
    """Rollers, elastic supports, bolts and electrodes; a pressure has arrows towards the body."""
    mesh = {"generator": "rectangle", "size": [4.0, 2.0], "cells": [8, 4]}
    case = parse_case(
        {
            "mesh": mesh | {"inside": {"cut": "abs(y - 1) < 1e-6"}},
            "material": {"young": 1.0, "poisson": 0.3},
            "fixed": [{"on": "left", "normal": 0.0}],
            "elastic": [{"on": "right", "stiffness": [1.0, 0.0]}],
            "bolt": [{"on": "cut", "shortening": 0.01}],
            "load": [{"on": "top", "pressure": 0.1}],
            "contact": {"on": "bottom"},
        }
    )
    collections = draw_setup(case, build_problem(case)).axes[0].collections
    lines = [c for c in collections if isinstance(c, LineCollection)][1:]  # behind the boundary
    assert len({tuple(line.get_colors()[0]) for line in lines}) == len(lines) == 5
    (arrows,) = (each for each in collections if isinstance(each, Quiver))
    assert np.all(arrows.U == pytest.approx(0.0, abs=1e-12)) and np.all(arrows.V < 0)


def test_electrodes_are_told_apart_and_hide_no_contact():
    """Each has a colour of its own, below and beside the lines of other parts."""
    case = parse_case(
        {
            "mesh": {"generator": "rectangle", "size": [4.0, 1.0], "cells": [8, 2]},
            "material": {"name": "PZT-4"},
            "fixed": [
                {"on": "left", "displacement": [0.0, 0.0]},
                {"on": "bottom", "potential": 0.0},
                {"on": "top", "potential": 1.0},
            ],
            "contact": {"on": "bottom"},
        }
    )
    collections = draw_setup(case, build_problem(case)).axes[0].collections
    lines = {c.get_label(): c for c in collections if isinstance(c, LineCollection)}
    contact = lines["contact bottom: gap = 0.0"]
    below, above = (
        lines[f"fixed {on}: potential = {k}"] for k, on in ((0.0, "bottom"), (1.0, "top"))
    )
    assert below.get_zorder() < contact.get_zorder()
    assert below.get_linewidth()[0] > contact.get_linewidth()[0]
    assert (below.get_colors()[0] != above.get_colors()[0]).any()
