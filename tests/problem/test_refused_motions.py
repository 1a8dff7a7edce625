"""Rigid motions, plates and electrodes that are none."""

import pytest
from mpi4py import MPI

from contact.case.file import parse_case
from contact.errors import InputError
from contact.solving import build_problem
from tests.problems.rigid import indented, plate

SELF = MPI.COMM_SELF


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"force": [0.0, -1.0]}, r"contact.rigid.force.1.*\[value\]"),
        ({"rotation": 1.0, "centre": None}, r"contact.rigid.centre.*\[missing\]"),
        ({"displacement": [0.0, "-0.01*t"]}, r"\[value\]"),
        (
            {"displacement": [0.0, "free"], "force": [0.0, 0.01]},
            r"\[pulled-off\]",
        ),
        ({"rotation": "free"}, r"\[unsupported\]"),
    ],
)
def test_bad_motions_are_refused(changes, words):
    data = indented().model_dump(exclude_unset=True)
    data["friction"] = {"law": "none"}
    rigid = {**data["contact"]["rigid"], **changes}
    data["contact"]["rigid"] = {key: value for key, value in rigid.items() if value is not None}
    with pytest.raises(InputError, match=words):
        build_problem(parse_case(data), SELF)


@pytest.mark.parametrize(
    ("rigid", "words"),
    [
        ([{"on": "bottom"}], r"rigid.0.on.*\[value\]"),
        ([{"on": "top"}, {"on": "right"}], r"\[rigid-part\]"),
        ([{"on": "top", "displacement": ["free", 0.0]}], r"\[rigid-part\]"),
    ],
)
def test_bad_rigid_parts_are_refused(rigid, words):
    with pytest.raises(InputError, match=words):
        build_problem(plate(rigid=rigid), SELF)


@pytest.mark.parametrize(("end", "held"), [(2.0, True), (1.2, False)])
def test_nodes_beyond_the_foundation_hold_nothing(end, held):
    """A block 2 x 1 on a ledge that ends at 1.2: pressed at its right end it tips."""
    ledge = {"shape": "punch", "centre": [0.5 * end, 0.0], "axis": [0.0, -1.0]}
    ledge["radius"] = 0.51 * end
    case = {
        "mesh": {
            "generator": "rectangle",
            "size": [2.0, 1.0],
            "cells": [20, 10],
            "parts": {"end": {"side": "top", "from": 1.6, "to": 2.0}},
        },
        "material": {"young": 1.0, "poisson": 0.3},
        "load": [{"on": "end", "pressure": 1e-4}],
        "contact": {"on": "bottom", "foundation": ledge},
        "friction": {"law": "coulomb", "mu": 0.3},
    }
    if held:
        build_problem(parse_case(case), SELF)
        return
    with pytest.raises(InputError, match=r"\[pulled-off\]"):
        build_problem(parse_case(case), SELF)
