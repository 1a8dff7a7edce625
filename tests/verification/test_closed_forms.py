"""The sliding block, which P1 and P2 represent exactly: stick, slip, mu(slip), Hencky."""

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import brentq

from forms.hencky import Linear, Log
from forms.laws import ConstantCoefficient, SlipCoefficient
from tests.problems.mechanics import SlidingBlock, contact_data, solve, turn

LOG = Log(1.0, 0.3, yield_strain=0.05)


def sliding(law, mu, squeeze, push):
    """Return the block with the slip at which friction balances the shear stress."""

    def excess(slip):
        block = SlidingBlock(law, mu, squeeze, push, slip)
        return block.stress - float(mu(np.float64(slip))) * block.pressure

    slip = 0.0 if excess(0.0) <= 0 else float(brentq(excess, 0.0, push, xtol=1e-15))
    return SlidingBlock(law, mu, squeeze, push, slip)


BLOCKS = {
    "stick": sliding(LOG, ConstantCoefficient(0.9), 0.01, 0.03),
    "slip": sliding(LOG, ConstantCoefficient(0.5), 0.01, 0.03),
    "slip-dependent": sliding(LOG, SlipCoefficient(0.5, 0.2, 100.0), 0.01, 0.03),
    "linear": sliding(Linear(2.0, 0.2), ConstantCoefficient(0.4), 0.02, 0.05),
    "hencky": sliding(LOG, ConstantCoefficient(0.3), 0.08, 0.2),
    "hencky stick": sliding(LOG, ConstantCoefficient(0.9), 0.08, 0.15),
}


@pytest.mark.core
def test_the_slips_are_those_of_the_specification():
    assert BLOCKS["stick"].slip == 0.0
    assert BLOCKS["slip"].slip == pytest.approx(0.0125, abs=1e-12)
    assert BLOCKS["slip-dependent"].slip == pytest.approx(0.0101806, abs=5e-8)
    assert BLOCKS["hencky"].slip == pytest.approx(0.1085884, abs=5e-8)
    assert BLOCKS["hencky"].pressure == pytest.approx(0.1025744, abs=5e-8)


def solved(block, dim, degree, degrees=0.0, axis=(0.0, 1.0, 0.0)):
    problem = block.problem(MPI.COMM_SELF, dim, degree, degrees, axis)
    return solve(problem, 1e-12 if degrees == 0 else 1e-11)


def nodal_displacement(loop):
    return loop.state.x.reshape(-1, loop.problem.dim)


@pytest.mark.core
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("name", BLOCKS)
def test_sliding_block(name, dim, degree):
    block = BLOCKS[name]
    loop = solved(block, dim, degree)
    x = loop.problem.body.space.tabulate_dof_coordinates()
    height = x[:, dim - 1]
    exact = np.zeros((len(x), dim))
    exact[:, 0], exact[:, -1] = block.slip + block.shear * height, -block.squeeze * height
    assert np.abs(nodal_displacement(loop) - exact).max() < 1e-9
    data = contact_data(loop)
    assert np.abs(data["pressure"] - block.pressure).max() < 1e-9
    force = np.zeros((len(data["pressure"]), dim))
    force[:, 0] = block.stress
    assert np.abs(data["friction"] - force).max() < 1e-9
    assert np.all(data["sticks"] == (block.slip == 0))


@pytest.mark.core
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize(
    ("dim", "axis"), [(2, (0.0, 1.0, 0.0)), (3, (0.0, 1.0, 0.0)), (3, (1.0, 2.0, 0.5))]
)
@pytest.mark.parametrize("name", ["slip-dependent", "hencky", "hencky stick"])
def test_rotation_changes_nothing(name, dim, axis, degree):
    block = BLOCKS[name]
    turned = solved(block, dim, degree, 30.0, axis)
    # With no rotation, the same components are constrained.
    straight = solved(block, dim, degree, 1e-300, axis)
    back = nodal_displacement(turned) @ turn(dim, 30.0, axis)
    assert np.abs(back - nodal_displacement(straight)).max() < 1e-11
    assert turned.state.multipliers.contact == pytest.approx(
        straight.state.multipliers.contact, abs=1e-11
    )
    friction = turned.state.multipliers.friction @ turn(dim, 30.0, axis)
    assert np.abs(friction - straight.state.multipliers.friction).max() < 1e-11
    inner = [[record.inner for record in loop.history] for loop in (turned, straight)]
    assert len(inner[0]) == len(inner[1])
