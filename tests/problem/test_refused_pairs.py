"""Pairs of bodies that are refused, and what is said of the others."""

import pytest

from contact import InputError, build_problem, parse_case, solve
from contact.cli.check import expectations
from tests.problems.pairs import case


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (
            {"contact": {"on": "upper_bottom", "against": "upper_left"}},
            r"contact\.against.*\[pair\]",
        ),
        (
            {"contact": {"on": "upper_bottom", "against": "upper_top"}},
            r"\[pair\]",
        ),
        (
            {"contact": {"on": "upper_top", "against": "lower_top"}, "load": []},
            r"contact\.against.*\[pair\]",
        ),
        (
            {
                "contact": [
                    {"on": "upper_bottom", "against": "lower_top"},
                    {"on": "lower_top", "against": "upper_bottom"},
                ]
            },
            r"\[contact-cycle\]",
        ),
        (
            {
                "fixed": [
                    {"on": "lower_bottom", "displacement": [0.0, 0.0]},
                    {"on": "upper_bottom", "displacement": [0.0, "free"]},
                ]
            },
            r"\[held-side\]",
        ),
    ],
)
def test_what_is_refused(more, message):
    with pytest.raises(InputError, match=message):
        build_problem(parse_case(case(**more)))


def test_bodies_that_may_pass_through_each_other_are_named():
    """Only the upper block can touch a foundation: nothing keeps it off the lower one."""
    foundation = {"shape": "plane", "point": [0.0, -0.05], "normal": [0.0, 1.0]}
    contact = {"on": "upper_bottom", "foundation": foundation}
    solution = solve(parse_case(case(contact=contact)))
    assert solution.converged
    assert any("2 of them can pass through the others" in w for w in solution.warnings)
    checked = "\n".join(expectations(solution.problem))
    assert (
        "# warning: the mesh has 2 connected components" in checked
        and "2 of them can pass through" in checked
    )
    apart = solve(parse_case(case()))
    assert not any("pass through" in w for w in (*apart.warnings, *expectations(apart.problem)))
