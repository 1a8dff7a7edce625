"""The mollifier R: constants, linear pressures, symmetry, and its limit as the radius goes to 0."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpi4py import MPI

from contact import Body, Contact, Fixed, Friction
from contact.interface.friction import Smoothing
from contact.mesh.grid import rectangle
from contact.problem.problem import ContactProblem
from forms.hencky import Linear
from forms.laws import ConstantCoefficient
from tests.problems.mechanics import (
    bar,
    constant,
    contact_data,
    flat,
    leaning_block,
    pressed_block,
    solve,
)

PROBLEMS = {
    "P1 in the plane": lambda: bar(MPI.COMM_SELF, 8),
    "P2 in the plane": lambda: bar(MPI.COMM_SELF, 8, degree=2),
    "P1 in space": lambda: leaning_block(MPI.COMM_SELF, 4),
    "P2 in space": lambda: pressed_block(MPI.COMM_SELF, 3, 2),
}


@pytest.fixture(scope="module", params=PROBLEMS)
def nodes(request):
    return PROBLEMS[request.param]().nodes


@pytest.mark.core
@given(radius=st.floats(1e-6, 50.0))
@settings(max_examples=25, deadline=None)
def test_a_constant_is_reproduced_to_rounding_at_any_radius(nodes, radius):
    smooth = Smoothing(nodes, radius)(np.full(nodes.size, 3.7))
    assert np.abs(smooth - 3.7).max() < 1e-13


def test_beyond_the_body_it_is_the_mean(nodes):
    pressure = 1 + np.sin(3 * nodes.points[:, 0])
    mean = nodes.sum(pressure) / nodes.sum(np.ones_like(pressure))
    for radius in (1e8, 1e155, 1e300):
        np.testing.assert_allclose(Smoothing(nodes, radius)(pressure), mean, rtol=1e-12)


@pytest.mark.core
@pytest.mark.parametrize(("degree", "accuracy"), [(1, 1e-12), (2, 2e-3)])
def test_a_linear_pressure_is_kept_in_the_interior(degree, accuracy):
    """Exact where nodes and weights are symmetric about the node; Simpson's weights alternate."""
    nodes = bar(MPI.COMM_SELF, 16, degree=degree).nodes
    x = nodes.points[:, 0]
    radius = 0.4
    inside = (x > radius + 0.07) & (x < 4 - radius - 0.07)
    assert inside.any()
    smooth = Smoothing(nodes, radius)(1 + 2 * x)
    assert np.abs(smooth - 1 - 2 * x)[inside].max() < accuracy
    assert np.abs(smooth - 1 - 2 * x)[x > 4 - radius / 2].max() > 0.01


@pytest.mark.core
def test_the_weighted_kernel_is_symmetric_before_its_normalisation(nodes):
    """R moves no more from one node to another than back, up to the division at each."""
    smoothing = Smoothing(nodes, 0.6)
    identity = np.eye(nodes.size)
    matrix = np.column_stack([smoothing(column) for column in identity])
    assert matrix.min() >= 0
    kernel = matrix / nodes.weight
    ratio = kernel / np.where(kernel.T > 0, kernel.T, 1.0)
    # kernel = omega / row sum: the ratio of the entries is the same along each row and column.
    first = 1 / matrix.diagonal() * nodes.weight
    expected = first[None, :] / first[:, None]
    assert np.abs(ratio - expected)[kernel > 1e-8 * kernel.max()].max() < 1e-6


@pytest.mark.parametrize("degree", [1, 2])
def test_a_symmetric_pressure_stays_symmetric(degree):
    domain = rectangle(MPI.COMM_SELF, [0.0, 0.0], [3.0, 1.0], [12, 2])
    supported = Body(Linear(1.0, 0.3), [Fixed("top", [constant(0.0, 2)] * 2)])
    nodes = ContactProblem(domain, supported, Contact("bottom", flat()), degree=degree).nodes
    x = nodes.points[:, 0]
    bump = np.exp(-((x - 1.5) ** 2)) * (x > 0.4) * (x < 2.6)
    smooth = Smoothing(nodes, 0.7)(bump)[np.argsort(x)]
    assert np.abs(smooth - smooth[::-1]).max() < 1e-13
    # At the ends too, where half of the kernel is cut off.
    assert smooth[0] > 0


@pytest.mark.core
def test_it_is_the_identity_at_small_radii(nodes):
    pressure = 1 + np.sin(3 * nodes.points[:, 0])
    errors = [np.abs(Smoothing(nodes, r)(pressure) - pressure).max() for r in (0.8, 0.4, 0.2)]
    # First order in the radius: at the ends, half of the kernel is cut off.
    assert errors[0] > 1.3 * errors[1]
    assert errors[1] > 1.3 * errors[2]
    for radius in (1e-3, 1e-9, 1e-300, 0.0):
        assert np.abs(Smoothing(nodes, radius)(pressure) - pressure).max() < 1e-14


def test_the_solution_with_a_small_radius_is_that_without():
    plain = contact_data(solve(bar(MPI.COMM_SELF, 8, friction=law(0.0))))
    small = contact_data(solve(bar(MPI.COMM_SELF, 8, friction=law(0.05))))
    large = contact_data(solve(bar(MPI.COMM_SELF, 8, friction=law(0.5))))
    assert np.abs(small["pressure"] - plain["pressure"]).max() < 1e-12
    assert np.abs(large["bound"] - plain["bound"]).max() > 1e-4


@pytest.mark.core
def test_the_bound_is_mu_times_the_pressure_under_the_printed_kernel():
    loop = solve(bar(MPI.COMM_SELF, 8, friction=law(0.9)))
    problem, multipliers = loop.problem, loop.state.multipliers
    nodal, x = problem.nodal(loop.state), problem.nodes.points[:, 0]
    square = ((x[:, None] - x) / 0.9) ** 2
    inside = square < 1
    kernel = problem.nodes.weight * inside * np.exp(1 / np.where(inside, square - 1, -1.0))
    bound = 0.4 * kernel @ multipliers.contact / kernel.sum(axis=1)
    assert problem.interface.bound(nodal, multipliers) == pytest.approx(bound, rel=1e-12)
    assert np.abs(bound - 0.4 * multipliers.contact).max() > 1e-4
    slides = problem.interface.slip_length(nodal) > 1e-6
    assert slides.any()
    friction = np.linalg.norm(multipliers.friction, axis=1)
    assert friction[slides] == pytest.approx(bound[slides], rel=1e-6)


def law(radius):
    return Friction(ConstantCoefficient(0.4), radius=radius)
