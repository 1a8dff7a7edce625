"""Problems of the second sweep that took many more solves than they need."""

import pytest

from contact import build_problem, solve_problem
from contact.methods.options import NewtonOptions
from scripts.studies.sweep import problems


@pytest.mark.parametrize(
    ("name", "whole", "dense"), [("bimorph-3", 1, 40), ("bimorph-8", 60, None)]
)
def test_what_a_bent_bimorph_takes(name, whole, dense):
    """-3: Newton's loop finishes what the convex problems have come close to, in 212 steps before.

    -8: a good conductor, which block relaxation took 700 solves of the body for.
    """
    ((_, case),) = problems(False, name, True)
    solution = solve_problem(build_problem(case), NewtonOptions())
    assert solution.converged, solution.outcome.reason
    assert solution.counters.linear_solves <= whole
    assert dense is None or solution.counters.contact_solves <= dense
    assert not any("block relaxation" in record.note for record in solution.history.records)
