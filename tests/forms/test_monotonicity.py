"""Assumption (h1), as it is reported, against the constants that each law is known to have."""

import numpy as np
import pytest

from forms.hencky import Linear, Log
from forms.monotonicity import check_monotonicity
from tests.problems.materials import XI


@pytest.mark.core
def test_monotonicity_is_reported():
    law, t_max = Log(1.0, 0.3, yield_strain=XI), 0.4
    report = check_monotonicity(law, t_max)
    assert report.holds
    assert report.alpha == pytest.approx(law.shear * XI / t_max, rel=1e-3)
    assert report.beta == pytest.approx(law.shear, rel=1e-12)
    assert report.g_0 == pytest.approx(law.secant_modulus(t_max**2), rel=1e-12)
    assert report.largest == pytest.approx(law.shear, rel=1e-12)
    # With the square as the argument the law softens beyond xi = e xi_0.
    square = Log(1.0, 0.3, yield_strain=XI, argument="square")
    turn = np.sqrt(np.e * XI)
    assert check_monotonicity(square, 0.99 * turn).holds
    assert not check_monotonicity(square, 1.05 * turn).holds
    # A floor keeps (h1) on every range: alpha is the slope where the floor begins.
    floored = Log(1.0, 0.3, yield_strain=XI, g_min=0.1)
    start = np.sqrt(floored._floor_start)
    for t_max in (2 * start, 10 * start):
        alpha = check_monotonicity(floored, t_max, 20000).alpha
        assert alpha == pytest.approx(floored.shear * XI / start, rel=1e-2)
    assert check_monotonicity(Linear(1.0, 0.3), 0.0).holds


@pytest.mark.core
@pytest.mark.parametrize(("poisson", "dim", "holds"), [
    (-0.5, 2, False), (0.12, 2, False), (0.13, 2, True), (-0.01, 3, False), (0.01, 3, True),
])  # fmt: skip
def test_g_is_bounded_by_the_bulk_modulus(poisson, dim, holds):
    """(h1)(a): g <= (d/2) k_0, so nu >= 1/8 in the plane and nu >= 0 in space, g being mu_1."""
    report = check_monotonicity(Linear(1.0, poisson), 0.1, dim=dim)
    assert (report.hardens, report.bounded, report.holds) == (True, holds, holds)
    assert report.ceiling == pytest.approx(dim / 2 / (3 - 6 * poisson))
