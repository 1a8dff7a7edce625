"""The case file's `[evolution]`: steps, amplitudes, formulas in t, and what is refused."""

import pytest

from contact.case.file import parse_case
from contact.errors import InputError
from tests.problems.bar import changed

STEPS = {"times": [0.0, 1.0, 3.0], "steps": [2, 4]}
PRESS = {"time": [0.0, 3.0], "value": [0.0, 1.0]}


def evolution(**changes):
    return {**STEPS, "amplitudes": {"press": PRESS}, **changes}


@pytest.mark.core
def test_ends_of_the_steps():
    case = parse_case(changed(evolution=STEPS))
    assert case.evolution.ends == [0.5, 1.0, 1.5, 2.0, 2.5, 3.0]


@pytest.mark.core
def test_an_amplitude_is_linear_between_its_values():
    case = parse_case(changed(evolution=evolution(), load__0__amplitude="press"))
    function = case.evolution.amplitudes["press"]
    assert [function(time) for time in (0.0, 1.5, 3.0)] == [0.0, 0.5, 1.0]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"evolution": evolution(), "load__0__amplitude": "pres"},
            r"load\.0\.amplitude: given \"pres\".*amplitudes: constant, press \(did you",
        ),
        ({"load__0__amplitude": "press"}, r"load\.0\.amplitude: .* with \[evolution\] only"),
        ({"load__0__traction": [0.0, "-t"]}, r"load\.0\.traction\.1: .* with \[evolution\] only"),
        (
            {"evolution": evolution(), "contact__gap": "0.1*t"},
            r"contact\.gap: given \"0\.1\*t\".* a formula without t",
        ),
        (
            {"evolution": evolution(times=[0.0, 1.0, 1.0])},
            r"evolution\.times: given .*; accepted: numbers that increase",
        ),
        ({"evolution": evolution(steps=[2, 0])}, r"evolution\.steps\.1: given 0.* whole number"),
        ({"evolution": evolution(steps=[2])}, r"evolution\.steps: given \[2\].* 2 numbers"),
        (
            {"evolution": evolution(amplitudes={"press": {**PRESS, "value": [1.0]}})},
            r"evolution\.amplitudes\.press\.value: given \[1.0\]; accepted: 2 values",
        ),
        (
            {"evolution": evolution(amplitudes={"press": {**PRESS, "time": [0.0, 2.0]}})},
            r"evolution\.amplitudes\.press\.time: given \[0.0, 2.0\].* reach from 0 to 3",
        ),
        (
            {"evolution": evolution(amplitudes={"press": {**PRESS, "time": [3.0, 0.0]}})},
            r"evolution\.amplitudes\.press\.time: given .* numbers that increase",
        ),
        ({"evolution": {"times": [0.0, 1.0]}}, r"evolution\.steps: missing"),
        (
            {"evolution": STEPS, "solver__nested": True},
            r"solver\.nested: given true.* nested = false with \[evolution\]",
        ),
    ],
)
def test_bad_input(changes, message):
    with pytest.raises(InputError, match=message):
        parse_case(changed(**changes))
