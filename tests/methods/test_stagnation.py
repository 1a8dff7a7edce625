"""A method that fails leaves the best of what it has met."""

import numpy as np
import pytest
from mpi4py import MPI

from contact.methods.options import FixedPointOptions, PenaltyOptions
from contact.methods.report import Best, Stagnation
from contact.model.friction import Friction
from contact.problem.residuals import evaluate
from contact.thesis.fixed_point import FixedPoint
from contact.thesis.penalty import Penalty
from forms.laws import ConstantCoefficient
from tests.problems import mechanics


def test_the_least_residual_is_the_best_and_no_number_is_none():
    best: Best[str] = Best()
    for name, residual in (("lost", np.nan), ("far", np.inf)):
        best.see(name, residual)
    assert best.found is None
    for name, residual in (("a", 0.5), ("b", 0.1), ("c", 0.2), ("d", np.nan)):
        best.see(name, residual)
    assert best.found == "b"


@pytest.mark.parametrize("factor", [3.0, np.nan], ids=["worse", "no numbers"])
@pytest.mark.parametrize("stopping", ["residual", "thesis"])
@pytest.mark.parametrize(
    ("method", "options"), [(FixedPoint, FixedPointOptions), (Penalty, PenaltyOptions)]
)
def test_the_best_iterate_is_left_where_the_last_one_is_worse(
    monkeypatch, method, options, stopping, factor
):
    """Of the penalty method that ended without numbers, these were the solution."""
    problem = mechanics.bar(
        MPI.COMM_SELF, 4, -0.05, friction=Friction(ConstantCoefficient(0.5)), law=None
    )
    limits = options(tolerance=1e-14, max_outer=4).model_copy(
        update={"stopping": stopping, "eps_fp": 1e-30}
    )
    solver, kind = method(problem, limits), type(problem.start())
    whole = solver._step

    def spoilt(*arguments):
        made = whole(*arguments)
        if len(solver.history) < 3:
            return made
        solver.state = kind(factor * solver.state.x, solver.state.forces)
        return made

    monkeypatch.setattr(solver, "_step", spoilt)
    state, outcome = solver.solve()
    assert not outcome.converged
    # The penalty method solves for equilibrium, and the laws hold as its penalties let them.
    name = "equilibrium" if method is Penalty else "largest"
    sizes = [getattr(record.residuals, name) for record in solver.history]
    assert not sizes[-1] <= min(sizes[:-1])
    if stopping == "residual":
        assert outcome.residuals == evaluate(problem, state)
        assert getattr(outcome.residuals, name) == min(sizes[:-1])
    else:
        assert getattr(outcome.residuals, name) == pytest.approx(sizes[-1], nan_ok=True)


@pytest.mark.parametrize(("rate", "given_up"), [(0.4, False), (0.8, False), (0.95, True)])
def test_steps_together_make_progress_where_they_halve_the_measure_in_time(rate, given_up):
    stagnation = Stagnation(limit=8, progress=0.5, cumulative=True)
    assert any(stagnation(rate**step) for step in range(40)) == given_up


def test_each_step_by_itself_is_compared_with_the_best_one():
    stagnation = Stagnation(limit=8, progress=0.5)
    assert [stagnation(0.8**step) for step in range(10)] == 8 * [False] + 2 * [True]


def test_what_rises_again_is_compared_with_the_last_progress():
    stagnation = Stagnation(limit=3, progress=0.5, cumulative=True)
    assert [stagnation(at) for at in (1.0, 0.6, 0.9, 0.45, 0.6, 0.5, 0.3)] == 6 * [False] + [True]
    assert stagnation.best == 0.3
