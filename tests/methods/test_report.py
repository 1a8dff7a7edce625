"""What the end of a solve says: `converged` and `reason` both come from the residuals."""

import pytest

from contact import build_problem, load_case, solve
from contact.methods.options import OPTIONS, with_method
from contact.methods.report import Outcome
from contact.problem.residuals import Residuals, evaluate

ALLOWED = Residuals(1e-8, 1e-8, 1e-8)
MET = Residuals(1e-9, 0.0, 1e-10)
FLOORS = (5e-8, 0.0, 0.0)


@pytest.mark.core
@pytest.mark.parametrize("ended", ["", "not converged in 200 steps", "the residual stalled"])
def test_what_has_converged_is_said_to_have_met_its_residuals(ended):
    """The reason of a ring in a clearance was "not converged in 200 steps", with exit 0."""
    outcome = Outcome(MET, ALLOWED, ended)
    assert outcome.converged
    assert outcome.reason == "all residuals <= 1e-08"


@pytest.mark.core
@pytest.mark.parametrize(
    ("ended", "reason"),
    [
        ("", "the contact residual is 1.00e-06, above 1e-08"),
        ("not converged in 3 steps", "not converged in 3 steps: the contact residual is 1.00e-06"),
        ("it stalled at 3.1e-02", "it stalled at 3.1e-02: the contact residual is 1.00e-06"),
    ],
)
def test_a_residual_explains_a_failure(ended, reason):
    outcome = Outcome(Residuals(1e-9, 1e-6, 0.0), ALLOWED, ended)
    assert not outcome.converged
    assert outcome.reason.startswith(reason)


@pytest.mark.core
def test_a_residual_below_its_floor_alone_is_met_to_rounding():
    outcome = Outcome(Residuals(3e-8, 0.0, 0.0, FLOORS), ALLOWED, "stalled")
    assert outcome.converged
    words = "all residuals <= 1e-08, to rounding: the equilibrium residual is 3.00e-08, its floor "
    assert outcome.reason == words + "5.00e-08"
    beyond = Outcome(Residuals(6e-8, 0.0, 0.0, FLOORS), ALLOWED, "stalled")
    assert not beyond.converged and "to rounding" not in beyond.reason


@pytest.mark.core
def test_a_criterion_of_its_own_is_named():
    """Where the residuals are met, and where they are not."""
    words = "the thesis's criterion is met"
    assert Outcome(MET, ALLOWED, criterion=words).reason == words
    assert Outcome(Residuals(1.0, 0.0, 0.0), ALLOWED, criterion=words).reason.startswith(
        f"{words}, but "
    )


@pytest.mark.parametrize("most", [1, 5, 200])
@pytest.mark.parametrize("method", ["newton", "uzawa"])
def test_convergence_is_that_of_the_residuals_in_a_problem_built_anew(method, most):
    changes = ["mesh.cells=[32,8]", "friction.mu=0.6", "load.0.traction.1=-0.02"]
    case = load_case("scripts/cases/bar.toml", changes)
    solution = solve(case, with_method(case.solver, OPTIONS[method], max_outer=most))
    residuals, allowed = evaluate(build_problem(case), solution.state), solution.outcome.allowed
    names = "equilibrium", "contact", "friction"
    met = all(getattr(residuals, name) <= 1.01 * getattr(allowed, name) for name in names)
    assert solution.converged == met
    assert solution.converged or most < 200
