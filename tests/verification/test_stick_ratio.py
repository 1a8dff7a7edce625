"""The part of a growing contact that sticks, against Spence's self-similar solutions."""

import pytest

pytest.importorskip("gmsh")
from scripts.studies.stick_ratio import PRESSED


@pytest.mark.parametrize("name", PRESSED)
def test_steps_find_what_one_step_does_not(name):
    pressed = PRESSED[name]
    static, stepped = pressed.ratios(0.2, [1, 32], cells=100)
    assert stepped == pytest.approx(pressed.coupled[0.2], abs=0.01)
    assert static < 0.5 * stepped


def test_the_limits_without_the_effect_of_shear_on_the_pressure():
    """Roots of Spence's equations, as computed independently."""
    for name, known in (
        ("cylinder", {0.1: 0.045, 0.2: 0.406, 0.3: 0.744, 0.5: 0.968}),
        ("ball", {0.1: 0.224, 0.2: 0.734, 0.3: 0.919, 0.5: 0.992}),
    ):
        for mu, ratio in known.items():
            assert PRESSED[name].uncoupled(mu) == pytest.approx(ratio, abs=1e-3)
