"""Rigid motions, plates and electrodes that are none."""

import pytest
from mpi4py import MPI

from contact.case.file import parse_case
from contact.errors import InputError
from contact.solving import build_problem
from tests.problems.rigid import column, indented, plate

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


@pytest.mark.parametrize("changes", [{"displacement": ["free", 0.0]}, {"rotation": 1.0}])
def test_nothing_leaves_the_axis_of_revolution(changes):
    data = indented().model_dump(exclude_unset=True)
    data["space"] = {"kinematics": "axisymmetric"}
    data["contact"]["foundation"]["centre"] = [0.0, 2.0]
    data["contact"]["rigid"] |= changes
    with pytest.raises(InputError, match="of a body of revolution"):
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


@pytest.mark.parametrize("axis", [[0.0, -1.0], [1.0, 0.0]])
def test_an_axis_that_leads_away_is_no_contact_direction(axis):
    data = indented().model_dump(exclude_unset=True)
    shape = {"shape": "paraboloid", "apex": [1.0, 1.0], "axis": [0.0, 1.0], "radius": 1.0}
    data["contact"] |= {"direction": "axis", "axis": axis, "foundation": shape}
    with pytest.raises(InputError, match="from no node of the part 'top' does the contact direct"):
        build_problem(parse_case(data), SELF)


def test_bad_electrodes_are_refused():
    with pytest.raises(InputError, match=r"electrode.0.on.*potential is not fixed"):
        column(electrode=[{"on": "bottom"}])
    with pytest.raises(InputError, match=r"electrode.*\[material.piezo\]"):
        plate(electrode=[{"on": "top"}])
    with pytest.raises(InputError, match="shares nodes with an electrode"):
        build_problem(
            column(electrode=[{"on": "right"}], electric={"k_e": 1.0}, fixed=[
                {"on": "left", "displacement": [0.0, "free"], "potential": 0.0}]),
            SELF,
        )  # fmt: skip
    with pytest.raises(InputError, match="a part whose potential is fixed"):
        build_problem(column(electrode=[{"on": "right"}]), SELF)
