"""When the ramp of the conductivity is followed, and what that is good for."""

import numpy as np
import pytest
from mpi4py import MPI

from contact.methods.newton import Newton
from contact.methods.options import FixedPointOptions, NewtonOptions
from contact.methods.safeguards import ConductivityDerivative
from contact.model.friction import Friction
from contact.thesis.fixed_point import FixedPoint
from forms.laws import SlipCoefficient
from tests.problems.piezo import example, potential


@pytest.mark.core
def test_followed_as_long_as_the_residual_falls():
    follow = ConductivityDerivative(1e-2)
    assert [follow(r) for r in (1.0, 1e-1, 9e-3, 1e-4, 1e-9)] == [False, False, True, True, True]


def test_a_step_that_made_it_worse_is_not_repeated_at_once():
    """A frozen step takes back what a followed one has spoilt, and not much more."""
    follow = ConductivityDerivative()
    assert follow(1.83e-3)
    assert not follow(9.55e-3)
    assert not follow(1.82e-3)
    assert not follow(1.81e-3)
    assert follow(1e-4)


@pytest.mark.core
def test_steps_in_between_that_must_not_follow():
    follow = ConductivityDerivative()
    assert follow(1e-3)
    assert not follow(1e-2, allowed=False)
    assert not follow(9e-4)
    assert not follow(2e-5, allowed=False)
    assert follow(1e-5)


def test_a_node_opens_along_the_ramp():
    """A node that draws less current as it opens, and thus opens further: no cycle."""
    friction = Friction(SlipCoefficient(0.5, 0.2, 1.0))
    found = []
    methods = (
        (Newton, NewtonOptions()),
        (Newton, NewtonOptions(condense=False)),
        (FixedPoint, FixedPointOptions()),
    )
    for method, options in methods:
        problem = example(MPI.COMM_WORLD, friction=friction, phi_f=116.0, delta=5.0)
        solver = method(problem, options)
        state, outcome = solver.solve()
        assert outcome.converged
        found.append((potential(problem, state), solver.history))
    notes = {record.note for _, records in found[:2] for record in records}
    assert notes <= {"", "rejected"}, "Newton's method falls back"
    assert np.allclose(found[0][0], found[2][0], rtol=1e-7)
    assert np.allclose(found[1][0], found[2][0], rtol=1e-7)


def test_a_solve_does_not_depend_on_an_earlier_one():
    """Psi is followed near the solution only, however near an earlier solve has ended."""
    friction = Friction(SlipCoefficient(0.5, 0.2, 1.0))
    solver = FixedPoint(
        example(MPI.COMM_WORLD, friction=friction, phi_f=116.0, delta=5.0), FixedPointOptions()
    )
    first, _ = solver.solve()
    steps = [record.inner for record in solver.history]
    again, _ = solver.solve()
    assert [record.inner for record in solver.history] == 2 * steps
    assert np.array_equal(again.x, first.x)


def test_a_step_that_is_taken_back():
    """The iterate before it is as good as it was: psi stays frozen until it is much better."""
    follow = ConductivityDerivative()
    assert follow(2e-2)
    assert follow.worsened(4e-1)
    assert not follow.worsened(4e-1)
    assert not follow(2e-2)
    assert follow(1e-3)
