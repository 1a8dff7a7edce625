"""The compliant layer and the current: laws, derivatives, closed forms of one column."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from contact.response import Conductor, FoundationResponse, Layer
from contact.trace import ContactTrace
from forms.laws import (
    Compliance,
    PotentialFactor,
    RampConductivity,
    ShiftedConductivity,
    Truncation,
)


def random_trace(n: int, dim: int, block_size: int, rng: np.random.Generator) -> ContactTrace:
    """Return contact nodes without a mesh, for the pointwise laws."""
    normal = rng.standard_normal((n, dim))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    tangent = np.eye(dim) - normal[:, :, None] * normal[:, None, :]
    return ContactTrace(
        MPI.COMM_SELF, np.arange(n, dtype=np.int32), np.zeros((n, dim)), np.ones(n), normal,
        tangent, rng.uniform(0.0, 0.4, n), block_size,
    )


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("psi", [ShiftedConductivity(0.7, 2.0), RampConductivity(0.7, 2.0)])
def test_jacobian_is_the_derivative_of_the_force(dim, psi):
    rng = np.random.default_rng(3)
    trace = random_trace(200, dim, dim + 1, rng)
    layer = Layer(0.2, Compliance(0.3), PotentialFactor(5.0, 2.0, 3.0))
    response = FoundationResponse(trace, layer, Conductor(psi, 1.5, Truncation(4.0)), 1.7, 1.0)
    x = rng.standard_normal((200, dim + 1))
    pressure = response.layer_pressure(x) - 100.0  # no node presses on the rigid part
    jacobian = response.jacobian(x, pressure)
    assert np.count_nonzero(jacobian[:, 0, -1]) > 20  # layer reached, h_nu rising
    assert np.count_nonzero(jacobian[:, -1, 0]) > 20
    h = 1e-7
    for k in range(dim + 1):
        step = np.zeros(dim + 1)
        step[k] = h
        slope = (response.force(x + step, pressure) - response.force(x - step, pressure)) / (2 * h)
        assert np.abs(jacobian[:, :, k] - slope).max() < 1e-6


def test_block_is_the_symmetric_part_without_the_frozen_factors():
    rng = np.random.default_rng(4)
    trace = random_trace(50, 2, 3, rng)
    layer = Layer(0.2, Compliance(0.3), PotentialFactor(5.0, 1.0))
    conductor = Conductor(ShiftedConductivity(0.7, 0.0), 1.5)
    response = FoundationResponse(trace, layer, conductor, 1.7, 1.0)
    x = rng.standard_normal((50, 3))
    block = response.block(x, np.zeros(50))
    assert np.allclose(block, block.transpose(0, 2, 1), rtol=1e-14)
    # Without dependence of h_nu on the potential and of psi on the gap nothing is left out.
    assert np.allclose(block, response.jacobian(x, np.zeros(50)), rtol=1e-14)
