"""Problems of the second sweep that took many more solves than they need."""

import pytest

from contact import build_problem, solve
from contact.methods.options import NewtonOptions
from scripts.studies.sweep import problems


@pytest.mark.parametrize(
    ("name", "whole", "dense"),
    [("bimorph-3", 1, 70), ("bimorph-8", 1, 60), ("unsupported-5", 1, 40)],
)
def test_what_takes_no_block_relaxation(name, whole, dense):
    """A bent bimorph, a good conductor, and a block that Newton's loop lets fly away.

    The first took 212 dense steps, the second 700 solves of the body or 970 dense ones, or was not
    solved, by the BLAS: its foundation conducts next to nothing at first. Of the last the convex
    problem was taken 3e12 away from rest: a fifth of its load was rounding there.
    """
    ((_, case),) = problems(False, name, True)
    solution = solve(build_problem(case), NewtonOptions())
    assert solution.converged, solution.outcome.reason
    assert solution.counters.linear_solves <= whole
    assert solution.counters.contact_solves <= dense
    assert not any("block relaxation" in record.note for record in solution.history.records)


@pytest.mark.parametrize("condense", [True, False])
def test_contact_forces_that_are_all_rounding_are_none(condense):
    """lifted-4: a beam on the ground pressed along it with nu 0, which asks for none.

    Newton's loop cycled on the friction of pressures of 1e-17, and so did all other roads but block
    relaxation at the contact nodes, the direct solver's among them.
    """
    ((_, case),) = problems(False, "lifted-4", True)
    solution = solve(build_problem(case), NewtonOptions(condense=condense))
    assert solution.converged, solution.outcome.reason
    assert solution.counters.linear_solves <= 8
    assert {record.note for record in solution.history.records} == {""}
    assert abs(solution.contact_force).max() < 1e-15
    # E A, and none of it in the supports of the contact
    assert abs(solution.displacement.x.array).max() == pytest.approx(1e-4 * 600, rel=1e-8)
