"""Warnings about bodies whose rigid motion contact resists by next to nothing."""

import pytest
from mpi4py import MPI

from contact import parse_case, solve
from tests.problems.pairs import case

CYLINDERS = {
    "mesh": {"generator": "two_half_cylinders", "contact_size": 0.2, "contact_width": 0.7},
    "material": {"young": 1000.0, "poisson": 0.3},
    "fixed": [{"on": "lower_cut", "displacement": [0.0, 0.0]}],
    "load": [{"on": "upper_cut", "traction": [0.0, -1.0]}],
    "contact": {"on": "upper_arc", "against": "lower_arc"},
}
UPRIGHT = {"on": "upper_cut", "displacement": [0.0, "free"]}


@pytest.mark.parametrize(
    ("friction", "supports", "warned"),
    [
        ({"law": "none"}, [], True),
        ({"law": "none"}, [UPRIGHT], False),
        ({"law": "coulomb", "mu": 0.3}, [], False),
    ],
)
def test_a_cylinder_that_can_roll_in_its_place(friction, supports, warned):
    """Without friction it does so against what the mesh makes of the circle."""
    given = case(**CYLINDERS, friction=friction)
    given["fixed"] = given["fixed"] + supports
    solution = solve(parse_case(given), comm=MPI.COMM_SELF)
    assert solution.converged
    assert any("by next to nothing" in warning for warning in solution.warnings) == warned


def test_a_block_that_lies_on_another_is_held_by_friction():
    solution = solve(parse_case(case()), comm=MPI.COMM_SELF)
    assert solution.converged
    assert not any("by next to nothing" in warning for warning in solution.warnings)


def test_a_box_that_slips_all_around_is_held_across_the_friction():
    """In space it slips in all directions, and nothing moves it as a whole."""
    boxes = {"generator": "two_boxes", "lower_width": 1.5, "lower_size": 0.4, "upper_size": 0.35}
    table = {"shape": "plane", "point": [0, 0, -1], "normal": [0, 0, 1]}
    contacts = [
        {"on": "upper_bottom", "against": "lower_top"},
        {"on": "lower_bottom", "foundation": table},
    ]
    loads = [{"on": "upper_top", "traction": [0.1, 0.05, -1.0]}]
    given = case(mesh=boxes, fixed=[], load=loads, contact=contacts)
    solution = solve(parse_case(given), comm=MPI.COMM_SELF)
    assert solution.converged
    assert not [text for text in solution.warnings if "the mesh is too coarse" not in text]
