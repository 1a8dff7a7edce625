"""Figures in 3-D: what the cameras see, and what of the tables is drawn."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from contact.cli.main import main
from contact.plot import figures
from contact.plot.body import picture
from contact.plot.run import Run, linear
from contact.plot.space import (
    Zone,
    chosen_view,
    contact_figure,
)
from contact.plot.style import Look
from contact.solving import solve
from contact.writing import write_outputs, written
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
    run = written(solve(block(3, **(sections | more))))
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


def test_a_page_to_turn_a_body_in(tmp_path, capsys, monkeypatch):
    """By PyVista's own packages; without them a message names these, and no file is left."""
    out = tmp_path / "out"
    write_outputs(solve(block(3)), out)
    before = sorted(out.iterdir())

    def missing(*_: Any) -> None:
        raise ImportError("trame")

    monkeypatch.setattr(figures, "export_page", missing)
    assert main(["plot", str(out), "--html"]) == 2
    assert 'accepted: pip install "pyvista[jupyter]"' in capsys.readouterr().err
    assert sorted(out.iterdir()) == before
    monkeypatch.setattr(figures, "export_page", lambda _, path: path.write_text("page"))
    assert main(["plot", str(out), "--html"]) == 0
    assert (out / "figure-view.html").exists()
