"""Rigid foundations beside magnified bodies: true shapes, or shallow profiles that touch."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from contact.plot.body import draw_plane, picture
from contact.plot.foundation import (
    BEYOND,
    SHALLOW,
    UNSEEN,
    profiles,
)
from contact.plot.run import Run
from contact.solving import solve
from contact.writing import written
from tests.problems.written import block

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
