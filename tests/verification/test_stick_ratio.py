"""The part of a growing contact that sticks, against Spence's self-similar solutions."""

import numpy as np
import pytest

pytest.importorskip("gmsh")
from scripts.studies import stick_limit
from scripts.studies.stick_ratio import PRESSED


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name == "ball" else pytest.mark.slow) for name in PRESSED],
)
def test_steps_find_what_one_step_does_not(name):
    pressed = PRESSED[name]
    static, stepped = pressed.ratios(0.2, [1, 32], cells=100)
    assert stepped == pytest.approx(pressed.coupled(0.2), abs=0.01)
    assert static < 0.5 * stepped


def test_boundary_elements_converge():
    """Values of another code, +-0.005, and a flat punch, whose pressure is known."""
    for kind, known in (
        (stick_limit.plane, {0.1: 0.035, 0.2: 0.362, 0.3: 0.689, 0.5: 0.941}),
        (stick_limit.axisymmetric, {0.1: 0.202, 0.2: 0.697, 0.3: 0.896, 0.5: 0.984}),
    ):
        for mu, ratio in known.items():
            assert stick_limit.stick_ratio(kind, mu, 0.3, 100) == pytest.approx(ratio, abs=5e-3)
    r, normal, *_ = stick_limit.axisymmetric(100, 0.3)
    p = np.linalg.solve(normal, np.ones(100))  # over 2/pi^2, for w = pi c/2
    assert np.pi**2 / 2 * (p * np.sqrt(1 - r**2))[:80] == pytest.approx(np.ones(80), rel=1e-3)


def test_the_limits_without_the_effect_of_shear_on_the_pressure():
    """Roots of Spence's equations, as computed independently."""
    for name, known in (
        ("cylinder", {0.1: 0.045, 0.2: 0.406, 0.3: 0.744, 0.5: 0.968}),
        ("ball", {0.1: 0.224, 0.2: 0.734, 0.3: 0.919, 0.5: 0.992}),
    ):
        for mu, ratio in known.items():
            assert PRESSED[name].uncoupled(mu) == pytest.approx(ratio, abs=1e-3)
