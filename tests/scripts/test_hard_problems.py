"""Problems of the second sweep that took many more solves than they need."""

import numpy as np
import pytest

from contact import build_problem, solve
from contact.mesh.cells import SHAPES
from contact.methods.options import NewtonOptions
from forms.laws import SlipCoefficient
from scripts.studies.sweep import on_cells, problems


@pytest.mark.parametrize("name", ["bimorph-3", "bimorph-8", "unsupported-5"])
def test_what_takes_no_block_relaxation(name):
    """A bent bimorph, a good conductor, and a block that Newton's loop lets fly away.

    The first took 212 dense steps, the second 700 solves of the body or 970 dense ones, or was not
    solved, by the BLAS: its foundation conducts next to nothing at first. Of the last the convex
    problem was taken 3e12 away from rest: a fifth of its load was rounding there.
    """
    ((_, case),) = problems(False, name, True)
    solution = solve(build_problem(case), NewtonOptions())
    assert solution.converged, solution.outcome.reason
    assert not any("block relaxation" in record.note for record in solution.history.records)


@pytest.mark.parametrize("condense", [True, False])
def test_contact_forces_that_are_all_rounding_are_none(condense):
    """lifted-4: a beam on the ground pressed along it with nu 0, which asks for none.

    Newton's loop cycles on the friction of pressures of 1e-17, and the interior point leaves 2e-8.
    """
    ((_, case),) = problems(False, "lifted-4", True)
    solution = solve(build_problem(case), NewtonOptions(condense=condense))
    assert solution.converged, solution.outcome.reason
    assert {record.note for record in solution.history.records} == {""}
    assert abs(solution.contact_force).max() < 1e-15
    # E A, and none of it in the supports of the contact
    assert abs(solution.displacement.x.array).max() == pytest.approx(1e-4 * 600, rel=1e-8)


def test_a_node_that_begins_to_slide_goes_on():
    """bar-67 on quadrilaterals: friction falls from 0.1 to 0.083 of the pressure within 1e-7.

    The linearised bound of a node at the end of the slip zone was far below that of its slip. By it
    the node stuck, to be released again: all ways ended with 2e-5 after 308 solves.
    """
    ((_, case),) = problems(False, "bar-67")
    solution = solve(build_problem(on_cells(case, "quadrilateral")), NewtonOptions())
    assert solution.converged, solution.outcome.reason
    nodes = solution.problem.nodes
    slip = solution.problem.interface.slip_length(nodes.apply(solution.state.x))
    slides = (slip > 1e-6) & (solution.pressure > 1e-9)
    ratio = np.linalg.norm(solution.forces.friction, axis=1)[slides] / solution.pressure[slides]
    coefficient = SlipCoefficient(1 / 12, 1 / 30, 6e7)
    assert slides.sum() > 50
    np.testing.assert_allclose(ratio, coefficient(slip[slides]), rtol=1e-6)


def test_problems_on_cells_are_of_all_shapes_and_degrees():
    drawn = [case for _, case in problems(False, cells=True)]
    kinds = {(case.mesh.cell, case.mesh.order, case.space.degree) for case in drawn}
    assert len(drawn) == 200
    assert kinds == {(shape.name, a, b) for shape in SHAPES for a in (1, 2) for b in (1, 2)}
