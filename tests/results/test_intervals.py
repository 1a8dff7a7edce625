"""Intervals of quantities: sequences whose limit is known."""

import numpy as np
import pytest

from contact.results.error_estimate import intervals


def rows(quantity, rate, kkt=1e-10, meshes=4, name="max_displacement", **more):
    """Return rows of meshes of sizes 1, 1/2, ...; the error falls by a rate."""
    sizes = 0.5 ** np.arange(meshes)
    return [
        {"unknowns": int(4 / h**2), "error": 0.1 * h**rate, name: quantity(h), "kkt": kkt} | more
        for h in sizes
    ]


@pytest.mark.core
@pytest.mark.parametrize("rate", [0.3, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("order", np.linspace(0.1, 4.0, 27))
def test_they_hold_the_limit_or_there_are_none(rate, order):
    """Of a quantity that converges a little more slowly than the error they did not."""
    found = intervals(rows(lambda h: 3.0 - h**order, rate))["max_displacement"]
    assert (found is not None) == (2 ** (rate - order) <= 1.25)
    if found is not None:
        assert found[0] <= 3.0 <= found[1]
        assert found[1] - found[0] < 14 * 0.125**order or order > rate


@pytest.mark.core
def test_a_quantity_that_is_exact_has_an_interval_of_its_residual():
    """Rounding decided whether a force that equilibrium gives has one, and whether it holds it."""
    random = np.random.default_rng(0)
    for _ in range(20):
        found = intervals(
            rows(lambda h: -0.04 * (1 + 1e-10 * random.uniform(-1, 1)), 1.0, name="contact_force_y")
        )["contact_force_y"]
        assert found[0] <= -0.04 <= found[1]
        assert found[1] - found[0] < 1e-9
    tilted = rows(lambda h: 1e-13 * random.uniform(-1, 1), 1.0, name="contact_force_x")
    found = intervals([row | {"contact_force_y": 1.0} for row in tilted])
    assert found["contact_force_x"][0] <= 0 <= found["contact_force_x"][1]


@pytest.mark.core
def test_without_three_meshes_of_a_falling_error_there_are_none():
    assert intervals(rows(lambda h: 1 - h, 1.0, meshes=2)) is None
    assert intervals(rows(lambda h: 1 - h, -1.0)) is None
    # An infinite pressure, and one that has just begun to change.
    assert intervals(rows(lambda h: h**-0.5, 0.5))["max_displacement"] is None
    assert intervals(rows(lambda h: float(h < 0.2), 0.5))["max_displacement"] is None
    # A pressure at a corner that falls at first, before it grows without end.
    falls_first = {0.5: 0.0301, 0.25: 0.0213, 0.125: 0.0221}
    assert intervals(rows(lambda h: falls_first.get(h, 0.05), 0.5))["max_displacement"] is None
