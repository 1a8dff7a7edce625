"""Load steps that fail: they are halved, and an evolution ends with what it has."""

from dataclasses import replace

import pytest

from contact import evolve
from contact.methods.load_stepping import LoadStepping
from contact.methods.method import METHODS
from contact.methods.options import NewtonOptions
from contact.methods.report import Outcome
from contact.problem.residuals import Residuals
from contact.solving import NotConvergedError
from tests.problems.shaken import TIGHT, shaken


def failing(problem, largest: float, options=TIGHT["newton"]):
    """Return Newton's method that fails for steps longer than `largest`."""

    class Careful(type(METHODS[options.method](problem, options, None))):
        def solve(self, *given):
            state, outcome = super().solve(*given)
            since = self.problem.since or 0.0
            if self.problem.time - since > largest * (1 + 1e-9):
                kkt = Residuals(1.0, 1.0, 1.0)
                outcome = Outcome(kkt, outcome.allowed, "too long")
                state = replace(state, x=state.x + 1.0)
            return state, outcome

    return Careful(problem, options, None)


@pytest.mark.parametrize("parts", [1, 2, 16])
def test_a_step_that_fails_is_halved(parts):
    problem = shaken()
    steps = list(LoadStepping(problem, failing(problem, 1 / parts)).steps([1.0, 2.0]))
    assert all(outcome.converged for _, outcome in steps)
    assert [state.time for state, _ in steps] == [(k + 1) / parts for k in range(2 * parts)]


def test_an_evolution_ends_with_what_it_has():
    problem = shaken()
    steps = list(LoadStepping(problem, failing(problem, 1 / 17)).steps([0.05, 1.05, 2.0]))
    assert [outcome.converged for _, outcome in steps] == [True, False]
    assert [state.time for state, _ in steps] == [0.05, 0.05 + 1 / 16]


def test_evolve_says_that_a_step_fails():
    options = NewtonOptions(tolerance=1e-12, max_outer=1, max_iterations=1, condense=False)
    states = evolve(shaken(), [1.0, 2.0], options)
    with pytest.raises(NotConvergedError, match=r"no step to 0\.0625: .*"):
        list(states)
