"""Solutions followed from a foundation that hardly conducts."""

from types import SimpleNamespace

import pytest
from mpi4py import MPI

from contact import build_problem, solve
from contact.methods.fallbacks import FIRST_PART, continuation
from contact.methods.options import NewtonOptions
from scripts.studies.robustness.problems import problems


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
