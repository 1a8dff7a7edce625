"""Steps that go on where a material that yields gives more than its tangent foresees."""

import math
from dataclasses import replace

import numpy as np
import pytest

from contact import build_problem, solve
from contact.methods.line_search import FLAT, step_length
from contact.methods.options import NewtonOptions
from scripts.studies.sweep import problems


@pytest.mark.parametrize("reach", [1.5, 3.0, 20.0, 60.0])
@pytest.mark.parametrize("law", [math.log1p, math.sqrt, lambda t: t])
def test_a_step_goes_to_where_the_energy_is_least(law, reach):
    """Stresses that grow ever more slowly with the strain, to where they bear the load."""
    asked = []

    def slope(length: float) -> float:
        asked.append(length)
        return law(length) - law(reach)

    length = step_length(slope)
    assert abs(slope(length)) <= FLAT * law(reach)
    assert length > 1
    assert len(asked) <= 20


@pytest.mark.parametrize("slope", [lambda t: t - 1.05, lambda t: t - 0.5, lambda t: 1.0 - t])
def test_a_step_that_is_long_enough_or_leads_uphill_is_left(slope):
    assert step_length(slope) == 1


def test_what_nothing_ends_is_not_followed():
    assert step_length(lambda t: -1.0) == 1


@pytest.mark.parametrize(("name", "solves"), [("yielding-0", 11), ("yielding-1", 12)])
def test_far_beyond_yield(name, solves):
    """Strains of 8, and of 3e4: 12 and 14 solves before. Sparse steps, never lengthened, agree."""
    ((_, case),) = problems(False, name, True)
    problem = build_problem(case)
    solution = solve(problem, NewtonOptions(tolerance=1e-10))
    assert solution.converged, solution.outcome.reason
    notes = [record.note for record in solution.history.records]
    assert any("line search" in note for note in notes)
    rough = solve(problem, NewtonOptions())
    assert rough.counters.linear_solves <= solves
    options = replace(NewtonOptions(tolerance=1e-10), condense=False)
    other = solve(problem, options)
    assert other.converged, other.outcome.reason
    assert not any("line search" in record.note for record in other.history.records)
    u, v = solution.displacement.x.array, other.displacement.x.array
    assert np.abs(u - v).max() <= 1e-6 * np.abs(v).max()
