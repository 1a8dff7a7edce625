"""The linearised laws: blocks are derivatives, and falling friction is followed in part."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from contact.interface.complementarity import ComplementarityParameters, at_bound, linearise
from contact.interface.multipliers import ActiveSet, Multipliers
from contact.model.friction import Friction
from forms.laws import ConstantCoefficient, Coulomb, SlipCoefficient
from tests.problems import mechanics

SELF = MPI.COMM_SELF


@pytest.mark.core
@pytest.mark.parametrize("dimension", [2, 3])
def test_blocks_are_the_derivative_of_the_contact_forces(dimension):
    """Compare with finite differences at a sliding and sticking iterate, away from kinks."""
    problem = mechanics.bar(SELF, 4) if dimension == 2 else mechanics.leaning_block(SELF, 2)
    friction = replace(problem.interface.friction, law=Coulomb(ConstantCoefficient(0.4)))
    interface = replace(problem.interface, friction=friction)
    rng = np.random.default_rng(3)
    nodal = 1e-3 * rng.standard_normal((problem.nodes.gap.size, dimension))
    n, nodes = nodal.shape[0], problem.nodes
    forces = Multipliers(
        rng.uniform(0.5, 1.0, n),
        np.einsum("nij,nj->ni", nodes.tangent, 0.3 * rng.standard_normal((n, dimension))),
    )
    parameters = ComplementarityParameters(20.0, 20.0, 20.0)
    none = np.zeros(n, dtype=bool)
    before = ActiveSet(none, none, none)
    base = linearise(interface, nodal, forces, parameters, before, forces.pressure * 0.4)
    sticks = base.active_set.sticks
    assert np.any(sticks & base.active_set.closed)
    assert np.any(base.active_set.slips & base.active_set.closed)
    # a sticking node pushes with lambda + gamma u_tau, a pressed one with p - gamma (gap - u_nu)
    direction = 1e-6 * rng.standard_normal(nodal.shape)
    moved = linearise(
        interface, nodal + direction, forces, parameters, before, forces.pressure * 0.4
    )
    difference = moved.multipliers.vectors(problem.nodes) - base.multipliers.vectors(problem.nodes)
    predicted = np.einsum("nij,nj->ni", base.blocks, direction)[:, :dimension]
    assert np.allclose(difference[sticks], predicted[sticks], rtol=1e-6, atol=1e-12)
    normal = nodes.normal_component(difference)
    assert np.allclose(normal, nodes.normal_component(predicted), rtol=1e-6, atol=1e-12)


@pytest.mark.core
@pytest.mark.parametrize("softening", [0.25, np.inf])
def test_falling_friction_is_followed_as_far_as_allowed(softening):
    """With no limit, the block is the derivative of mu(|u_tau|) p along the slip."""
    problem = mechanics.bar(SELF, 4, friction=Friction(SlipCoefficient(0.5, 0.2, 1e3)))
    nodes = problem.nodes
    nodal = np.zeros((nodes.nodes.size, 2))
    nodal[:, 0] = 1e-3
    pressure = np.full(nodes.nodes.size, 0.5)
    forces = Multipliers(pressure, 0.3 * pressure[:, None] * [1.0, 0.0])
    parameters = ComplementarityParameters(200.0, 20.0, 1e6)
    every = np.ones(nodes.nodes.size, dtype=bool)
    before = ActiveSet(every, ~every, every)
    base = linearise(problem.interface, nodal, forces, parameters, before, softening=softening)
    assert base.unchanged
    step = np.array([1e-8, 0.0])
    moved = linearise(
        problem.interface, nodal + step, forces, parameters, before, softening=softening
    )
    change = (moved.multipliers.friction - base.multipliers.friction)[:, 0] / step[0]
    assert np.all(change < -0.25 * 20.0)
    expected = np.maximum(change, -softening * parameters.nodal_stiffness)
    assert np.allclose(base.blocks[:, 0, 0], expected, rtol=1e-4)


@pytest.mark.core
def test_sliding_nodes_are_at_their_bound():
    """Those that slid in the step before and do so against their friction; no others."""
    yes = np.ones(4, dtype=bool)
    before = ActiveSet(yes, ~yes, np.array([True, True, True, False]))
    slip = np.array([[1.0, 0.0], [-1.0, 0.0], [0.6, 0.8], [1.0, 0.0]])
    friction = np.array([[0.2, 0.0], [0.2, 0.0], [0.3, 0.4], [0.2, 0.0]])
    found = at_bound(before, friction, slip, np.array([0.5, 0.5, 0.4, 0.5]))
    np.testing.assert_allclose(found, [[0.5, 0.0], [0.2, 0.0], [0.3, 0.4], [0.2, 0.0]])
