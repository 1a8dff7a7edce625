"""A factorisation that is reused while the material moves on."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from contact import Friction, NewtonOptions, build_problem, solve
from contact.linear.operator import Counters
from contact.methods.newton import Chord, Newton
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from forms.hencky import Log
from forms.laws import ConstantCoefficient
from scripts.studies.robustness.problems import problems
from tests.problems import mechanics
from tests.problems.mechanics import close, newton

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
    assert np.allclose(one.forces.pressure, other.forces.pressure, rtol=0, atol=1e-8)


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
