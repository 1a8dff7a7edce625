"""The linearised laws: blocks are derivatives, and falling friction is followed in part."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from contact.interface.complementarity import ComplementarityParameters, LinearisedBound, linearise
from contact.interface.multipliers import ActiveSet, Multipliers
from contact.methods.safeguards import at_bound, bound_by_slip, guarded_active_set
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
    multipliers = Multipliers(
        rng.uniform(0.5, 1.0, n),
        np.einsum(
            "nij,nj->ni", nodes.tangential_projector, 0.3 * rng.standard_normal((n, dimension))
        ),
    )
    parameters = ComplementarityParameters(20.0, 20.0, 20.0)
    none = np.zeros(n, dtype=bool)
    before = ActiveSet(none, none, none)
    bound = interface.bound(nodal, multipliers)
    active, multipliers = guarded_active_set(
        interface, nodal, multipliers, bound, parameters.c, before
    )
    sticks = active.sticks
    assert np.any(sticks & active.closed)
    assert np.any(active.slips & active.closed)
    # a sticking node pushes with lambda + gamma u_tau, a pressed one with p - gamma (gap - u_nu)
    direction, zero = 1e-6 * rng.standard_normal(nodal.shape), np.zeros(n)

    def linearised(nodal):
        pressure, length = interface.pressure(nodal, multipliers), interface.slip_length(nodal)
        s = interface.friction.bound(length, pressure)
        bound = LinearisedBound(s, interface.friction.by_pressure(length, pressure), zero)
        return linearise(interface, nodal, multipliers, active, parameters, bound)

    (base, blocks), (moved, _) = linearised(nodal), linearised(nodal + direction)
    difference = moved.vectors(nodes) - base.vectors(nodes)
    predicted = np.einsum("nij,nj->ni", blocks, direction)[:, :dimension]
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
    multipliers = Multipliers(pressure, 0.3 * pressure[:, None] * [1.0, 0.0])
    parameters = ComplementarityParameters(200.0, 20.0, 1e6)
    every = np.ones(nodes.nodes.size, dtype=bool)
    before = ActiveSet(every, ~every, every)
    interface, limit = problem.interface, softening * parameters.nodal_stiffness

    def linearised(nodal):
        s, length = interface.bound(nodal, multipliers), interface.slip_length(nodal)
        active, raised = guarded_active_set(interface, nodal, multipliers, s, parameters.c, before)
        assert active.same(before)
        by_slip = bound_by_slip(interface, length, pressure, limit)
        bound = LinearisedBound(s, interface.friction.by_pressure(length, pressure), by_slip)
        return linearise(interface, nodal, raised, active, parameters, bound)

    step = np.array([1e-8, 0.0])
    (base, blocks), (moved, _) = linearised(nodal), linearised(nodal + step)
    change = (moved.friction - base.friction)[:, 0] / step[0]
    assert np.all(change < -0.25 * 20.0)
    expected = np.maximum(change, -softening * parameters.nodal_stiffness)
    assert np.allclose(blocks[:, 0, 0], expected, rtol=1e-4)


@pytest.mark.core
def test_sliding_nodes_are_at_their_bound():
    """Those that slid in the step before and do so against their friction; no others."""
    yes = np.ones(4, dtype=bool)
    before = ActiveSet(yes, ~yes, np.array([True, True, True, False]))
    slip = np.array([[1.0, 0.0], [-1.0, 0.0], [0.6, 0.8], [1.0, 0.0]])
    friction = np.array([[0.2, 0.0], [0.2, 0.0], [0.3, 0.4], [0.2, 0.0]])
    found = at_bound(before, friction, slip, np.array([0.5, 0.5, 0.4, 0.5]))
    np.testing.assert_allclose(found, [[0.5, 0.0], [0.2, 0.0], [0.3, 0.4], [0.2, 0.0]])
