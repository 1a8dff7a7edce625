"""When the ramp of the conductivity is followed, and what that is good for.

Solutions followed from a foundation that hardly conducts.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from contact import FixedPointOptions, Friction, NewtonOptions, build_problem, solve
from contact.methods.fallbacks import FIRST_PART, continuation
from contact.methods.newton import Newton
from contact.methods.safeguards import ConductivityDerivative
from contact.thesis.fixed_point import FixedPoint
from forms.laws import SlipCoefficient
from scripts.studies.robustness.problems import problems
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


class Loops:
    """Newton's solves that succeed up to a part, or where parts are close to each other."""

    def __init__(self, most: float, reach: float = 1e30) -> None:
        self.most, self.reach, self.parts, self.reached = most, reach, [], FIRST_PART

    def __call__(self, part: float, _: object) -> tuple[float, SimpleNamespace]:
        self.parts.append(part)
        found = part <= min(self.most, self.reach * self.reached)
        self.reached = part if found else self.reached
        return part, SimpleNamespace(converged=found)


def test_nothing_is_tried_where_conduction_is_not_what_fails():
    loops = Loops(0.0)
    assert continuation(loops, 0.0) is None
    assert loops.parts == [FIRST_PART]


def test_steps_become_shorter_where_they_are_too_long():
    loops = Loops(1.0, reach=40.0)
    end, outcome = continuation(loops, 0.0)
    assert end == 1.0 and outcome.converged
    assert loops.parts[1] == 1e3 * FIRST_PART  # failed
    assert loops.parts[2] == pytest.approx(1e1**1.5 * FIRST_PART)
    assert len(loops.parts) == 8


def test_it_ends_where_no_step_is_short_enough():
    loops = Loops(1e-4)
    assert continuation(loops, 0.0) is None
    assert len(loops.parts) < 15


@pytest.mark.parallel
def test_a_bimorph_in_front_of_a_good_conductor():
    """Its nodes hover where the ramp of psi begins; Newton's loop alone goes to and fro."""
    case = next(problems("hard", "bimorph-8")).case
    comm = MPI.COMM_WORLD
    solution = solve(build_problem(case, comm=comm), NewtonOptions())
    assert solution.converged, solution.outcome.reason
    assert any("continuation" in record.note for record in solution.history)
