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
        ({"force": [0.0, -1.0]}, r"contact.rigid.force.1: given -1.0; accepted: .* \"free\""),
        ({"rotation": 1.0, "centre": None}, "contact.rigid.centre: missing"),
        ({"rotation": [0.0, 0.0, 1.0]}, "contact.rigid.rotation: given"),
        ({"displacement": [0.0, 0.0, 0.0]}, "2 components in 2-D"),
        ({"displacement": [0.0, "fre"]}, "displacement.1: .* unknown name fre"),
        ({"displacement": [0.0, "-0.01*t"]}, r"a formula in t with \[evolution\] only"),
        ({"displacement": [0.0, "x"]}, "displacement.1: .* depends on the place"),
        ({"amplitude": "press"}, r"an amplitude with \[evolution\] only"),
        (
            {"displacement": [0.0, "free"], "force": [0.0, 0.01]},
            "pull the body off the foundation, or force and moment the rigid part off the body",
        ),
        ({"rotation": "free"}, r"can move as a rigid body \(rotation of the rigid part\)"),
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
        ([{"on": "bottom"}], "rigid.0.on.*beside the contact part"),
        ([{"on": "top"}, {"on": "top"}], "rigid.1.on"),
        ([{"on": "top"}, {"on": "right"}], "shares nodes with another"),
        ([{"on": "top", "displacement": ["free", 0.0]}], "a support fixes a component"),
        ([{"on": "roof"}], "rigid.0.on.*a part of the mesh"),
    ],
)
def test_bad_rigid_parts_are_refused(rigid, words):
    with pytest.raises(InputError, match=words):
        build_problem(plate(rigid=rigid), SELF)
