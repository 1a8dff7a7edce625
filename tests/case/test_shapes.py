"""Foundations in the case file that are none."""

from __future__ import annotations

import pytest

from contact.case.file import parse_case
from contact.errors import InputError
from tests.problems.messages import message_of

CASE = {
    "mesh": {"generator": "box", "size": [1.0, 1.0, 1.0], "cells": [1, 1, 1]},
    "material": {"young": 1.0, "poisson": 0.3},
    "fixed": [{"on": "top", "displacement": [0.0, 0.0, 0.0]}],
}
BAD = {
    "key of another shape": (
        {"shape": "cone", "apex": [0, 0, 0], "axis": [0, 0, 1], "half_angle": 70.0, "inside": True},
        {},
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
    ),
    "no axis": ({"shape": "punch", "centre": [0, 0, 0], "axis": [0, 0, 0], "radius": 1.0}, {}),
    "two and three": ({"shape": "cone", "apex": [0, 0, 0], "axis": [0, 1], "half_angle": 70.0}, {}),
    "angle": ({"shape": "cone", "apex": [0, 0, 0], "axis": [0, 0, 1], "half_angle": 90.0}, {}),
    "axis missing": (
        {"shape": "plane", "point": [0, 0, 0], "normal": [0, 0, 1]},
        {"direction": "axis"},
    ),
    "axis alone": (
        {"shape": "plane", "point": [0, 0, 0], "normal": [0, 0, 1]},
        {"axis": [0, 0, 1]},
    ),
    "no file": ({"shape": "surface"}, {}),
    "shape": ({"shape": "ball"}, {}),
}


def shaped(foundation, more):
    floats = {k: [float(x) for x in v] if isinstance(v, list) else v for k, v in foundation.items()}
    return parse_case({**CASE, "contact": {"on": "bottom", "foundation": floats, **more}})


@pytest.mark.wording
def test_messages_of_bad_shapes(snapshot):
    said = {name: message_of(shaped, *given) for name, given in BAD.items()}
    snapshot("refused-shapes", said)


def test_a_surface_is_no_foundation_in_the_plane():
    mesh = {"generator": "rectangle", "size": [1.0, 1.0], "cells": [1, 1]}
    foundation = {"shape": "surface", "file": "a.stl"}
    fixed = [{"on": "top", "displacement": [0.0, 0.0]}]
    with pytest.raises(InputError, match=r"\[value\]"):
        parse_case(
            {
                **CASE,
                "mesh": mesh,
                "fixed": fixed,
                "contact": {"on": "bottom", "foundation": foundation},
            }
        )
