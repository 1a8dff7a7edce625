"""What is said of the sides of two bodies."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from contact import parse_case, solve
from contact.interface.multipliers import Multipliers
from contact.results.bodies import sides
from tests.problems.pairs import case


@pytest.mark.parametrize(("share", "warned"), [(0.1, True), (1e-5, False)])
def test_what_a_method_leaves_at_partly_covered_nodes_is_no_pressure(share, warned):
    """An open node's is zero by Newton's method, rounding by others."""
    sizes = {"lower_width": 1.5, "lower_size": 0.3, "upper_size": 0.3}
    given = case(mesh={"generator": "two_blocks", **sizes}, friction={"law": "none"})
    given["fixed"].append({"on": "upper_left", "displacement": [0.0, "free"]})
    solution = solve(parse_case(given), comm=MPI.COMM_SELF)
    assert solution.converged
    covered = solution.problem.geometries[0].covered
    assert (covered < 0.5).any()
    pressure = np.where(covered < 0.5, share, 1.0) * solution.state.forces.pressure.max()
    forces = Multipliers(pressure, solution.state.forces.friction)
    changed = replace(solution, state=replace(solution.state, forces=forces))
    words = [text for text in sides(changed) if "less than half" in text]
    assert bool(words) == warned


@pytest.mark.parametrize(("way", "warned"), [(0.05, False), (0.9, True)])
def test_what_slides_further_than_a_facet_faces_something_else(way, warned):
    sizes = {"lower_size": 0.3, "upper_size": 0.3}
    given = case(mesh={"generator": "two_blocks", **sizes}, friction={"law": "none"})
    given["fixed"].append({"on": "upper_top", "displacement": [way, -0.01]})
    del given["load"]
    solution = solve(parse_case(given), comm=MPI.COMM_SELF)
    assert solution.converged
    words = [text for text in sides(solution) if "along the surface" in text]
    assert bool(words) == warned


def test_what_slides_there_and_back_faced_something_else_in_between():
    sizes = {"lower_size": 0.3, "upper_size": 0.3}
    given = case(mesh={"generator": "two_blocks", **sizes}, friction={"law": "none"})
    given["fixed"].append({"on": "upper_top", "displacement": ["0.9*(1 - abs(t - 1))", -0.01]})
    del given["load"]
    given["evolution"] = {"times": [0.0, 2.0], "steps": [2]}
    solution = solve(parse_case(given), comm=MPI.COMM_SELF)
    assert solution.converged and np.abs(solution.slip).max() < 0.1
    (words,) = [text for text in sides(solution) if "along the surface" in text]
    assert "slide by up to 0.9" in words
