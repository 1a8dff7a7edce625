"""The case file's `[evolution]`: steps, amplitudes, formulas in t, and what is refused."""

import pytest

from contact.case.file import parse_case
from tests.problems.bar import changed
from tests.problems.messages import message_of

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


BAD = [
    {"evolution": evolution(), "load__0__amplitude": "pres"},
    {"load__0__amplitude": "press"},
    {"load__0__traction": [0.0, "-t"]},
    {"evolution": evolution(), "contact__gap": "0.1*t"},
    {"evolution": evolution(times=[0.0, 1.0, 1.0])},
    {"evolution": evolution(steps=[2, 0])},
    {"evolution": evolution(steps=[2])},
    {"evolution": evolution(amplitudes={"press": {**PRESS, "value": [1.0]}})},
    {"evolution": evolution(amplitudes={"press": {**PRESS, "time": [0.0, 2.0]}})},
    {"evolution": evolution(amplitudes={"press": {**PRESS, "time": [3.0, 0.0]}})},
    {"evolution": {"times": [0.0, 1.0]}},
    {"evolution": STEPS, "solver__nested": True},
]


@pytest.mark.wording
def test_messages_of_bad_evolutions(snapshot):
    said = {str(k): message_of(parse_case, changed(**changes)) for k, changes in enumerate(BAD)}
    snapshot("refused-evolutions", said)
