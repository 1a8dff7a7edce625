"""Motions of rigid parts: the same from Python and from a case file."""

import tomllib

import numpy as np
import pytest

from contact import InputError, Motion, Rigid
from contact.case.file import parse_case, to_toml
from contact.model.rigid import numbers_at
from tests.problems.bar import changed

TIMES = {"times": [0.0, 1.0], "steps": [4]}


def section(**keys):
    """Return the motion of `[[rigid]]` with some keys, of a case with load steps."""
    rigid = [{"on": "right", **keys}]
    return parse_case(changed(rigid=rigid, evolution=TIMES, load=None)).rigid[0]


@pytest.mark.parametrize("time", [0.25, 1.0])
def test_degrees_of_a_case_file_are_radians_in_python(time):
    read = section(displacement=["0.1*t", "free"], rotation=90.0, centre=[1.0, 2.0], force=[0, -3])
    for drop in ("0.1*t", lambda t: 0.1 * t):
        made = Motion([drop, None], np.pi / 2, [0.0, -3.0], centre=[1.0, 2.0])
        for motion in (made.filled(2), read.filled(2)):
            assert [value is None for value in motion.values] == [False, True, False]
            values = numbers_at(motion.values, None, time)
            np.testing.assert_allclose(values, [0.1 * time, 0.0, np.pi / 2])
            forces = numbers_at((*motion.force, *motion.moments), None, 1.0)
            np.testing.assert_allclose(forces, [0.0, -3.0, 0.0])
            assert motion.centre == (1.0, 2.0)


@pytest.mark.parametrize(
    ("rotation", "written", "radians"),
    [
        (30.0, "30.0", np.pi / 6),
        (0.1, "0.1", np.pi / 1800),
        ("45*t", '"45*t"', np.pi / 4),
        ("free", '"free"', None),
    ],
)
def test_degrees_are_written_as_they_are_read(rotation, written, radians):
    rigid = [{"on": "right", "rotation": rotation, "centre": [0.0, 0.0]}]
    text = to_toml(parse_case(changed(rigid=rigid, evolution=TIMES, load=None)))
    assert f"rotation = {written}\n" in text
    again = parse_case(tomllib.loads(text))
    assert to_toml(again) == text
    value = again.rigid[0].filled(2).values[2]
    assert value is None if radians is None else numbers_at([value], None, 1.0) == radians


def test_radians_of_python_are_written_as_degrees():
    case = parse_case(changed(rigid=[{"on": "right"}], load=None, evolution=TIMES))
    for rotation in (0.3, "0.3*t"):
        rigid = (Rigid("right", rotation=rotation, centre=[0.0, 0.0]),)
        written = to_toml(case.model_copy(update={"rigid": rigid}))
        read = parse_case(tomllib.loads(written)).rigid[0]
        assert numbers_at(read.filled(2).values, None, 1.0)[2] == pytest.approx(0.3, rel=1e-14)


@pytest.mark.parametrize("dim", [2, 3])
def test_what_is_not_given_is_zero(dim):
    for motion in (Motion(), section(), Motion([0.0] * dim, [0.0] * 3 if dim == 3 else 0.0)):
        filled = motion.filled(dim)
        assert numbers_at(filled.values, None, 1.0).tolist() == [0.0] * (dim + 2 * dim - 3)
        assert filled.centre == (0.0,) * dim


def test_a_free_rotation():
    turning = Motion([0.0, "free"], None, moment="2*t", centre=[0.0, 0.0])
    assert turning.filled(2).values[1:] == (None, None)
    assert numbers_at(turning.moments, None, 0.5).tolist() == [1.0]


def test_a_motion_and_its_components_are_one_or_the_other():
    with pytest.raises(InputError, match=r"Rigid: motion: given .*accepted: .*or its components"):
        Rigid("top", Motion([0.0, "free"]), displacement=[0.1, 0.0])


def test_values_of_an_entry_are_functions_of_time_together():
    """A force beside a motion with t acts at once, as that of a load beside a formula."""
    rigid = Rigid("top", displacement=["0.1*t", None], force=[0.0, -3.0])
    for values, beside, expected in (
        (rigid.values, rigid.forces, [0.05, 0.0, 0.0]),
        (rigid.forces, rigid.values, [0.0, -3.0, 0.0]),
    ):
        found = numbers_at(values, rigid.amplitude, 0.5, beside)
        np.testing.assert_allclose(found[:2], expected[:2])
