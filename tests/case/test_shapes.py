"""Foundations in the case file that are none."""

from __future__ import annotations

import pytest

from contact.case.file import parse_case
from contact.errors import InputError

CASE = {
    "mesh": {"generator": "box", "size": [1.0, 1.0, 1.0], "cells": [1, 1, 1]},
    "material": {"young": 1.0, "poisson": 0.3},
    "fixed": [{"on": "top", "displacement": [0.0, 0.0, 0.0]}],
}
BAD = {
    "key of another shape": (
        {"shape": "cone", "apex": [0, 0, 0], "axis": [0, 0, 1], "half_angle": 70.0, "inside": True},
        {},
        'inside: given true; accepted: inside with shape = "sphere" or "cylinder"',
    ),
    "edge": (
        {
            "shape": "punch",
            "centre": [0, 0, 0],
            "axis": [0, 0, 1],
            "radius": 1.0,
            "edge_radius": 2.0,
        },
        {},
        "edge_radius: given 2.0; accepted: a length from 0 to the radius",
    ),
    "no axis": (
        {"shape": "punch", "centre": [0, 0, 0], "axis": [0, 0, 0], "radius": 1.0},
        {},
        "not zero",
    ),
    "two and three": (
        {"shape": "cone", "apex": [0, 0, 0], "axis": [0, 1], "half_angle": 70.0},
        {},
        "axis: given [0.0, 1.0]; accepted: 3 components in 3-D",
    ),
    "angle": (
        {"shape": "cone", "apex": [0, 0, 0], "axis": [0, 0, 1], "half_angle": 90.0},
        {},
        "between 0 and 90",
    ),
    "axis missing": (
        {"shape": "plane", "point": [0, 0, 0], "normal": [0, 0, 1]},
        {"direction": "axis"},
        "contact.axis: missing",
    ),
    "axis alone": (
        {"shape": "plane", "point": [0, 0, 0], "normal": [0, 0, 1]},
        {"axis": [0, 0, 1]},
        "contact.axis",
    ),
    "no file": ({"shape": "surface"}, {}, "contact.foundation.file: missing"),
    "shape": ({"shape": "ball"}, {}, '"sphere"'),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_shapes_get_one_line(name):
    foundation, more, words = BAD[name]
    floats = {k: [float(x) for x in v] if isinstance(v, list) else v for k, v in foundation.items()}
    with pytest.raises(InputError) as caught:
        parse_case({**CASE, "contact": {"on": "bottom", "foundation": floats, **more}})
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_surface_is_no_foundation_in_the_plane():
    mesh = {"generator": "rectangle", "size": [1.0, 1.0], "cells": [1, 1]}
    foundation = {"shape": "surface", "file": "a.stl"}
    fixed = [{"on": "top", "displacement": [0.0, 0.0]}]
    with pytest.raises(InputError, match="in 3-D only"):
        parse_case(
            {
                **CASE,
                "mesh": mesh,
                "fixed": fixed,
                "contact": {"on": "bottom", "foundation": foundation},
            }
        )
