"""A factorisation that is reused while the material moves on.

When the ramp of the conductivity is followed, and what that is good for.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from mpi4py import MPI

from contact import FixedPointOptions, Friction, NewtonOptions, build_problem, solve
from contact.linear.operator import Counters
from contact.methods.fallbacks import FIRST_PART, continuation
from contact.methods.newton import Chord, Newton
from contact.methods.safeguards import ConductivityDerivative
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.thesis.fixed_point import FixedPoint
from forms.hencky import Log
from forms.laws import ConstantCoefficient, SlipCoefficient
from scripts.studies.robustness.problems import problems
from tests.problems import mechanics
from tests.problems.mechanics import close, newton
from tests.problems.piezo import example, potential

SELF = MPI.COMM_SELF


def yielding(load: float = -0.03, yield_strain: float = 0.02) -> ContactProblem:
    law = Log(1.0, 0.3, yield_strain=yield_strain)
    return mechanics.bar(SELF, 16, load, law=law, friction=Friction(ConstantCoefficient(0.4)))


@pytest.mark.parametrize("yield_strain", [0.02, 0.004])
def test_it_changes_nothing(yield_strain):
    problem = yielding(yield_strain=yield_strain)
    always, chord = (newton(problem, reuse=k) for k in ("never", "within"))
    one, other = always.state, chord.state
    assert np.allclose(one.x, other.x, rtol=0, atol=1e-8 * np.abs(one.x).max())
    assert np.allclose(one.multipliers.contact, other.multipliers.contact, rtol=0, atol=1e-8)


def followed() -> tuple[Newton, list[Counters]]:
    """Return the method after loads that follow each other, and the counts of each of them."""
    method, start, counts = (
        Newton(yielding(), NewtonOptions(tolerance=1e-10, reuse="across")),
        None,
        [],
    )
    for load in np.linspace(-0.03, -0.04, 6):
        before = replace(method.counters)
        method.set_load_step(yielding(load))
        start, outcome = method.solve(start)
        assert outcome.converged
        counts.append(method.counters - before)
    return method, counts


def test_loads_that_follow_each_other_end_where_the_last_one_does():
    x, fresh = followed()[0].state.x, newton(yielding(-0.04)).state.x
    assert np.allclose(x, fresh, rtol=0, atol=1e-8 * np.abs(fresh).max())


def test_a_solve_does_not_depend_on_those_before_unless_that_is_asked_for():
    problem = yielding()
    near, _ = Newton(yielding(-0.031), NewtonOptions()).solve()
    fresh, used = (Newton(problem, NewtonOptions()) for _ in range(2))
    used.solve()
    assert close(used.solve(near)[0], fresh.solve(near)[0])


def test_a_body_that_flies_away_is_not_said_to_be_free():
    """Nothing is left of its stiffness there: the matrix is singular, though it is clamped."""
    law, friction = Log(1.0, 0.3, yield_strain=7.34e-4), Friction(ConstantCoefficient(1.0))
    problem = mechanics.bar(SELF, 8, 0.01417, law=law, friction=friction)
    _, outcome = Newton(problem, NewtonOptions(max_outer=60)).solve()
    assert not outcome.converged


def begun(reached: float) -> tuple[Chord, State]:
    """Return the rule after one step with a new factorisation, which led to a residual."""
    state = yielding().start()
    chord = Chord(1e-8, 10.0)
    iterate, reuse = chord.choose(state, 1.0)
    assert not reuse
    iterate, reuse = chord.choose(state, reached)
    assert reuse
    return chord, iterate


@pytest.mark.parametrize(("rate", "keeps"), [(0.1, True), (0.5, False)])
def test_it_is_kept_as_long_as_that_is_fast(rate, keeps):
    chord, iterate = begun(1e-3)
    assert chord.choose(replace(iterate), 1e-3 * rate)[1] is keeps


def test_a_step_that_makes_things_worse_is_taken_back():
    chord, iterate = begun(1e-3)
    again, reuse = chord.choose(replace(iterate), 2e-3)
    assert again is iterate and not reuse


@pytest.mark.parametrize("name", ["yielding-0", "yielding-1"])
def test_steps_far_in_the_plastic_range_are_taken_whole(name):
    """Strains of 8, and of 3e4; the method on the whole body agrees."""
    case = next(problems("hard", name)).case
    problem = build_problem(case, SELF)
    solution = solve(problem, NewtonOptions(tolerance=1e-10))
    assert solution.converged, solution.outcome.reason
    other = solve(problem, NewtonOptions(tolerance=1e-10, condense=False))
    assert other.converged, other.outcome.reason
    u, v = solution.displacement.x.array, other.displacement.x.array
    assert np.abs(u - v).max() <= 1e-6 * np.abs(v).max()


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
