"""`contact check` says of loads, gaps and the mesh what is so.

The set-up of any case in one figure: `contact check --plot`.
"""

import io

import matplotlib
import numpy as np
import pytest
from matplotlib.quiver import Quiver

from contact.case.build import build_problem
from contact.case.file import load_case, parse_case
from contact.cli.check import describe, expectations
from contact.cli.main import main
from contact.plot.setup import draw_setup
from scripts.cases import CASES
from tests.problems.bar import changed
from tests.problems.clamped import clamped

NOTHING = "nothing is loaded or moved"
MESH = {"generator": "rectangle", "size": [2.0, 1.0], "cells": [4, 2]}
PIEZO = {
    "mesh": MESH,
    "material": {"name": "PZT-4", "units": "GPa"},
    "fixed": [
        {"on": "left", "displacement": [0.0, 0.0], "potential": 0.0},
        {"on": "right", "potential": 0.0},
    ],
    "contact": {"on": "bottom"},
}


def said(data):
    return "\n".join(expectations(build_problem(parse_case(data))))


def with_voltage(volts):
    fixed = [PIEZO["fixed"][0], {"on": "right", "potential": volts}]
    return {**PIEZO, "fixed": fixed}


def bar(**changes):
    return changed(load=None, **changes)


ACTING = {
    "an electrode at a potential": with_voltage(1e-3),
    "a conductive foundation": {**PIEZO, "electric": {"law": "perfect", "k_e": 1.0, "phi_f": 1e-3}},
    "a charge": {**PIEZO, "load": [{"on": "top", "charge": 1e-6}]},
    "a support that moves": bar(fixed__0__displacement=[0.0, -1e-3]),
    "a press fit": bar(
        contact={
            "on": "bottom",
            "overlap": "press",
            "foundation": {"shape": "plane", "point": [0.0, 1e-3], "normal": [0.0, 1.0]},
        }
    ),
    "a layer that is thicker than the gap": bar(
        contact={"on": "bottom", "law": "compliance", "gap": 0.01, "layer": 0.02}
    ),
    "a load": changed(),
}


def test_what_is_pressed_apart_is_said():
    """Gaps below 0 may be given, or means over facets of bodies that touch."""
    assert "pressed apart" in said(ACTING["a press fit"])
    assert "by the given gap" in said(bar(contact={"on": "bottom", "gap": -1e-3}))


@pytest.mark.parametrize("name", ACTING)
def test_what_acts_is_seen(name):
    assert NOTHING not in said(ACTING[name])


def line(data, name):
    case = parse_case(data)
    text = describe(case, build_problem(case))
    return next(row for row in text.splitlines() if row.split()[:2] == ["#", name])


@pytest.mark.parallel
def test_a_side_of_a_box():
    data = {
        **changed(),
        "mesh": {"generator": "box", "size": [2.0, 3.0, 4.0], "cells": [2, 3, 4]},
        "fixed": [{"on": "left", "displacement": [0.0, 0.0, 0.0]}],
        "load": [{"on": "top", "pressure": 0.001}],
    }
    words = line(data, "right")
    assert "24 facets" in words and "area 12 " in words
    assert "centroid (2, 1.5, 2)" in words and words.endswith("normal (1, 0, 0)")
    assert "144 cells" in line(data, "body") and "volume 24" in line(data, "body")


@pytest.mark.parallel
def test_parts_of_a_body_of_revolution_are_those_of_the_full_turn():
    data = changed(
        space__kinematics="axisymmetric",
        fixed__0__displacement=["free", 0.0],
        fixed__0__on="top",
        load__0__on="right",
        load__0__traction=[-0.001, 0.0],
        mesh__size=[4.0, 1.0],
    )
    top, right, left = (line(data, name) for name in ("top", "right", "left"))
    assert f"area {np.pi * 16:.6g} " in top and "centroid (0, 1)" in top
    assert f"area {2 * np.pi * 4:.6g} " in right and "normal (1, 0)" in right
    assert left.endswith("on the axis")
    assert f"volume {np.pi * 16:.6g}" in line(data, "body")


def test_a_curved_part_has_a_mean_normal():
    case = load_case(CASES / "two-spheres.toml")
    text = describe(case, build_problem(case))
    assert "not plane, mean normal (0.57" in text


SMALL = {
    "hertz": ("mesh.contact_size=0.5",),
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


def arrows_on_top(**load):
    """Return the arrows of a load on the upper side of a rectangle."""
    case = parse_case(clamped([4.0, 2.0], [8, 4], load=[{"on": "top", **load}]))
    collections = draw_setup(case, build_problem(case)).axes[0].collections
    (arrows,) = (each for each in collections if isinstance(each, Quiver))
    return arrows


@pytest.mark.parametrize(("pressure", "side"), [(0.1, 1.0), (-0.1, -1.0)])
def test_the_arrows_of_a_pressure_are_outside_the_body(pressure, side):
    arrows = arrows_on_top(pressure=pressure)
    assert arrows.U == pytest.approx(0.0, abs=1e-12) and np.all(side * arrows.V < 0)
    assert np.all(arrows.Y >= 2 - 1e-9) and np.all(arrows.Y + arrows.V >= 2 - 1e-9)


@pytest.mark.parametrize("traction", [[1.0, -0.1], [-1.0, 0.1]])
def test_oblique_arrows_are_outside_of_the_body(traction):
    arrows = arrows_on_top(traction=traction)
    assert np.minimum(arrows.Y, arrows.Y + arrows.V) == pytest.approx(2.0)


def test_tractions_forces_and_pressures_have_one_scale():
    """A force is spread over its part; loads in the whole body have arrows in it."""
    loads = [
        {"on": "top", "traction": [0.0, "-t"], "force": [0.0, -4.0], "amplitude": "press"},
        {"on": "right", "force": [1.0, 0.0], "pressure": "-t/2"},
        {"everywhere": True, "body_force": ["x", 0.0]},
    ]
    evolution = {
        "times": [0.0, 1.0, 2.0],
        "steps": [1, 1],
        "amplitudes": {"press": {"time": [0.0, 2.0], "value": [0.0, 1.0]}},
    }
    case = parse_case(clamped([4.0, 2.0], [8, 4], load=loads, evolution=evolution))
    figure = draw_setup(case, build_problem(case))
    top, right, body = (c for c in figure.axes[0].collections if isinstance(c, Quiver))
    assert top.V == pytest.approx(-0.15 * 4.0) and right.U == pytest.approx(0.15 * 4.0 / 2)
    assert np.all(right.X >= 4.0) and figure.axes[0].get_xlim()[1] > 4.0 + 0.3
    assert body.U.max() < 0.3 + 1e-9 and np.all((body.Y > 0) & (body.Y < 2.0))
    # The force is that of the middle of a cell near by, of the width .5.
    middle, slope = body.X + body.U / 2, 0.3 / (4.0 - 0.5 / 3)
    np.testing.assert_allclose(body.U, slope * middle, rtol=0, atol=0.5 * slope)
    words = {text.get_text() for text in figure.legends[0].get_texts()}
    assert {"load right, t = 1", "load in the whole body"} <= words
    assert "load top, amplitude press, t = 1" in words


def test_arrows_at_narrow_bodies_are_no_hairs():
    widths = []
    for size in [4.0, 2.0], [0.2, 2.0]:
        case = parse_case(clamped(size, [2, 2], load=[{"on": "top", "pressure": 1.0}]))
        figure = draw_setup(case, build_problem(case))
        figure.draw_without_rendering()
        (arrows,) = (c for c in figure.axes[0].collections if isinstance(c, Quiver))
        widths.append(arrows.width * arrows.get_transform().get_matrix()[0, 0])  # pixels
    assert widths == pytest.approx(widths[:1] * 2)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_picture_in_3d_has_all_of_the_arrows(monkeypatch, side):
    seen, arrows = [], []

    class Plotter:
        def add_arrows(self, start, step, **_):
            arrows.extend([*start, *(start + step)])

        def __getattr__(self, name):
            return lambda *_, **__: None

    def render(_, camera, add):
        seen.append(camera)
        add(Plotter())

    monkeypatch.setattr("contact.plot.setup.render", render)
    data = {
        "mesh": {"generator": "box", "size": [1.0, 1.0, 1.0], "cells": [2, 2, 2]},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "left", "displacement": [0.0, 0.0, 0.0]}],
        "load": [
            {"on": "top", "traction": [0.0, 0.0, side]},
            {"on": "right", "traction": [side, 0.0, 0.0]},
            {"everywhere": True, "body_force": [0.0, 0.0, -1.0]},
        ],
        "contact": {"on": "bottom"},
    }
    case = parse_case(data)
    draw_setup(case, build_problem(case))
    flat = seen[0].flat(np.array(arrows))
    assert np.ptp(arrows, axis=0)[[0, 2]] == pytest.approx(1.15, abs=0.2)
    assert np.all((flat > seen[0].low) & (flat < seen[0].high))


def test_check_writes_it(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    before = dict(matplotlib.rcParams)
    assert main(["check", str(CASES / "bar.toml"), "--plot", "--set", "mesh.cells=[8, 2]"]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {"bar-setup.png", "bar-setup.pdf"}
    assert "# set-up: bar-setup.png" in capsys.readouterr().out
    assert matplotlib.rcParams["font.size"] == before["font.size"]
