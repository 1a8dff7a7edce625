"""The orders that Theorems 6.3 to 6.5 promise, on coarse meshes."""

import numpy as np
import pytest

from scripts.studies import limit_theorem

COARSE = (24, 4)


@pytest.mark.parametrize("layer", [False, True])
def test_theorem_6_3_has_order_1_over_four_decades(layer):
    values = (5.1e-2, 5.1e-3, 6.2e-4, 6e-5, 1.4e-5, 3.5e-6, 8.5e-7)
    errors = limit_theorem.theorem_6_3(layer, COARSE, values)
    assert errors.parameter[0] / errors.parameter[-1] > 1e4
    for norms in (*errors.norms.T, errors.total):
        orders = np.diff(np.log(norms)) / np.diff(np.log(errors.parameter))
        assert np.all((orders > 0.9) & (orders < 1.1)), orders
    assert errors.order(8e-7, 1e-2) == pytest.approx(1.0, abs=0.01)


@pytest.mark.core
@pytest.mark.parametrize("label", limit_theorem.FIXED_POINTS)
def test_lagged_fixed_points_converge(label):
    name, changes = limit_theorem.FIXED_POINTS[label]
    errors = limit_theorem.fixed_point_errors(name, COARSE, changes)
    assert errors[-1] < 1e-9
    assert np.all(errors[1:] < 0.5 * errors[:-1])


@pytest.mark.core
def test_normal_compliance_tends_to_signorini_with_order_1():
    errors = limit_theorem.stiffness_limit(COARSE, (1e4, 1e5, 1e6))
    orders = np.diff(np.log(errors.total)) / np.diff(np.log(errors.parameter))
    assert np.allclose(orders, 1.0, atol=0.02)


def test_distant_rigid_part_is_not_met():
    errors, depth = limit_theorem.distance_limit(COARSE, (0.0, 0.3, 0.5, 0.6, 2.0))
    assert 0.5 < depth < 0.6
    assert np.all(np.diff(errors.total[:3]) < 0)
    assert errors.total[2] > 1e-3
    assert np.all(errors.total[3:] < 1e-12)
