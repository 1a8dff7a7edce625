"""The set-up of any case in one figure: `contact check --plot`."""

import io

import matplotlib
import numpy as np
import pytest
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
    """All parts with conditions stand in the legend, and loads have arrows."""
    case = load_case(CASES / f"{name}.toml", SMALL[name])
    figure = draw_setup(case, build_problem(case))
    figure.savefig(io.BytesIO(), dpi=30)
    (legend,) = figure.legends
    words = [text.get_text() for text in legend.get_texts()]
    assert {f"fixed {fixed.on}" for fixed in case.fixed} <= {*words}
    assert "foundation" in words
    if name == "bar":
        collections = figure.axes[0].collections
        loaded = next(c for c in collections if c.get_label() == "load loaded")
        ends = [point[0] for segment in loaded.get_segments() for point in segment]
        assert (min(ends), max(ends)) == (2.0, 4.0)
        (arrows,) = (each for each in collections if isinstance(each, Quiver))
        assert np.all(arrows.U == 0) and np.all(arrows.V < 0) and np.all(arrows.Y > 1)


@pytest.mark.parametrize(("pressure", "side"), [(0.1, 1.0), (-0.1, -1.0)])
def test_the_arrows_of_a_pressure_are_outside_the_body(pressure, side):
    data = {
        "mesh": {"generator": "rectangle", "size": [4.0, 2.0], "cells": [8, 4]},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "left", "displacement": [0.0, 0.0]}],
        "load": [{"on": "top", "pressure": pressure}],
        "contact": {"on": "bottom"},
    }
    case = parse_case(data)
    collections = draw_setup(case, build_problem(case)).axes[0].collections
    (arrows,) = (each for each in collections if isinstance(each, Quiver))
    assert arrows.U == pytest.approx(0.0, abs=1e-12) and np.all(side * arrows.V < 0)
    assert np.all(arrows.Y >= 2 - 1e-9) and np.all(arrows.Y + arrows.V >= 2 - 1e-9)


def test_check_writes_it(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    before = dict(matplotlib.rcParams)
    assert main(["check", str(CASES / "bar.toml"), "--plot", "--set", "mesh.cells=[8, 2]"]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"bar-setup.png", "bar-setup.pdf"}
    assert "# set-up: bar-setup.png" in capsys.readouterr().out
    assert matplotlib.rcParams["font.size"] == before["font.size"]
