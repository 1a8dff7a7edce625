"""Coulomb's friction as a sequence of given bounds, each solved for sure."""

from dataclasses import replace

import numpy as np
import pytest

from contact.methods.convex.haslinger import coulomb
from tests.problems.convex import block, check, enumerated, random_setting


@pytest.mark.parametrize("seed", range(4))
def test_coulomb_friction_of_three_nodes_agrees_with_all_statuses_tried(seed):
    setting = random_setting(3, 2, 20.0, 0.0, seed)
    (expected,) = enumerated(setting, 0.3)
    found = coulomb(setting.solver, setting.load, lambda pressure, slip: 0.3 * pressure)
    assert found.converged and found.change <= 1e-8
    u = found.result.displacement
    assert np.allclose(u, expected, rtol=0, atol=1e-6 * np.abs(expected).max())


def test_coulomb_friction_that_depends_on_the_slip():
    setting = block(30, 2, np.array([0.1, -1.0]), 0.0)
    scale = 1.0

    def bound(pressure, slip):
        return (0.2 + 0.2 / (1 + slip / scale)) * pressure

    found = coulomb(setting.solver, setting.load, bound)
    assert found.converged  # though without friction nothing would hold it
    result = found.result
    slip = np.abs(result.displacement[:, 0])
    assert np.allclose(found.bound, bound(result.pressure, slip), rtol=0, atol=1e-7)
    check(replace(setting, bound=found.bound), result)


def test_a_bound_that_never_settles_is_said_not_to():
    setting = random_setting(10, 2, 1e2, 0.0, 1)
    rng = np.random.default_rng(0)
    found = coulomb(
        setting.solver, setting.load, lambda p, slip: rng.uniform(0.1, 2.0, 10) * p.max(), limit=12
    )
    assert not found.converged and found.change > 1e-8 and found.problems <= 12
    assert "not settle" in found.message
