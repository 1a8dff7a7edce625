"""Problems whose solution touches nothing are found with the first solve."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from contact import build_problem, solve
from contact.case.file import parse_case
from contact.methods.load_stepping import LoadStepping
from contact.methods.method import METHODS
from contact.methods.options import NewtonOptions
from contact.methods.report import Outcome
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from tests.problems.blocks import squares

SELF = MPI.COMM_SELF

APPROACH = {
    "mesh": {"generator": "two_blocks", "lower_size": 0.3, "upper_size": 0.3},
    "material": [
        {"on": "upper", "young": 1.0, "poisson": 0.3},
        {"on": "lower", "young": 3.0, "poisson": 0.3},
    ],
    "fixed": [
        {"on": "lower_bottom", "displacement": [0.0, 0.0]},
        {"on": "upper_top", "displacement": ["0.0003*t", "-0.001*t"]},
    ],
    "contact": {"on": "upper_bottom", "against": "lower_top", "gap": 0.02},
    "friction": {"law": "coulomb", "mu": 0.3},
    "evolution": {"times": [0.0, 1.0], "steps": [10]},
}


def stepped(
    problem: ContactProblem, times: Sequence[float], **options: Any
) -> list[tuple[State, Outcome]]:
    """Return the load steps of a problem by Newton's method; all have converged."""
    method = METHODS["newton"](problem, NewtonOptions(**options), None)
    steps = list(LoadStepping(problem, method).steps(times))
    assert all(outcome.converged for _, outcome in steps)
    return steps


#: Ends of ten equal steps, and of six of an evolution that ends at 1.8.
TENTHS, SIXTHS = [k / 10 for k in range(1, 11)], [0.3, 0.6, 0.9, 1.2, 1.5, 1.8]


def test_an_approach_of_two_blocks():
    """It took 2884 solves and 990 factorisations: rounding of one block was compared with none."""
    problem = build_problem(parse_case(APPROACH), SELF)
    steps = stepped(problem, TENTHS)
    assert steps[-1][1].reason == "all residuals <= 1e-08"
    top = problem.body.nodal(steps[-1][0].x)[:, 1].min()
    assert np.isclose(top, -0.001)


def above_a_ball(aside: float | str) -> dict[str, Any]:
    """Return a block that goes down towards a rigid ball, and does not reach it."""
    ball = {"shape": "sphere", "centre": [1.0, -2.05], "radius": 2.0}
    return {
        "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [12, 6]},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "top", "displacement": [aside, "-0.01*t"]}],
        "contact": {"on": "bottom", "foundation": ball},
        "friction": {"law": "coulomb", "mu": 0.3},
        "evolution": {"times": [0.0, 1.0], "steps": [5]},
    }


@pytest.mark.parametrize("aside", ["0.003*t", "free"])
def test_an_approach_to_a_rigid_shape(aside):
    """Five steps took 346 dense solves, and ended with a reason of a failure."""
    solution = solve(parse_case(above_a_ball(aside)), comm=SELF)
    assert solution.converged and solution.pressure.max() == 0
    assert solution.outcome.reason == "all residuals <= 1e-08"


#: Two blocks are pressed, pushed aside and pulled apart.
LIFTED = {
    **APPROACH,
    "fixed": [
        APPROACH["fixed"][0],
        {"on": "upper_top", "displacement": ["0.0003*t", "-0.001*sin(pi*t)"]},
    ],
    "contact": {"on": "upper_bottom", "against": "lower_top"},
    "evolution": {"times": [0.0, 1.8], "steps": [6]},
}


def test_an_evolution_that_lifts_off():
    """It took 300 solves a step."""
    steps = stepped(build_problem(parse_case(LIFTED), SELF), SIXTHS)
    presses = [bool(state.forces.pressure.max() > 0) for state, _ in steps]
    assert presses == 3 * [True] + 3 * [False]


def unloaded(loads: str) -> dict[str, Any]:
    """Return blocks that are pressed, and pushed aside, by parabolas in time that end at zero."""
    push = {"on": "upper_top", "displacement": ["0.0003*t*(1 - t)", "-0.001*t*(1 - t)"]}
    if loads == "traction":
        push["displacement"] = [0.0, "free"]
    return {
        **APPROACH,
        "fixed": [APPROACH["fixed"][0], push],
        "load": [{"on": "upper_top", "traction": [0.0, "-0.001*t*(1 - t)"]}]
        * (loads != "supports"),
        "contact": {"on": "upper_bottom", "against": "lower_top"},
    }


@pytest.mark.parametrize("condense", [True, False])
@pytest.mark.parametrize("loads", ["supports", "traction"])
def test_two_blocks_unloaded_to_zero_end_at_zero(loads, condense):
    """The last step took up to 1655 dense solves: forces fell to 1e-164, by their rounding."""
    problem = build_problem(parse_case(unloaded(loads)), SELF)
    *pressed, (end, _) = stepped(problem, TENTHS, condense=condense)
    assert all(state.forces.pressure.max() > 0 for state, _ in pressed)
    assert not end.x.any() and not end.forces.pressure.any()


def leaves_let_go() -> list[tuple[State, Outcome]]:
    """Return the steps of leaves on each other that are pressed at their ends, and let go."""
    count = 4
    leaves = squares(SELF, [(0, k) for k in range(count)], (8, 7, 9, 10))
    leaves.mesh.geometry.x[:] *= (3.0, 0.25, 1.0)
    case = {
        "mesh": {"generator": "two_blocks"},  # replaced by the leaves
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": f"left{k}", "displacement": [0.0, 0.0]} for k in range(count)],
        "load": [{"on": f"right{count - 1}", "traction": [0.0, -1e-4], "amplitude": "a"}],
        "contact": [{"on": f"bottom{k + 1}", "against": f"top{k}"} for k in range(count - 1)],
        "friction": {"law": "coulomb", "mu": 0.3},
        "evolution": {
            "times": [0.0, 1.0, 2.0],
            "steps": [1, 1],
            "amplitudes": {"a": {"time": [0.0, 1.0, 2.0], "value": [0.0, 1.0, 0.0]}},
        },
    }
    return stepped(build_problem(parse_case(case), SELF, domain=leaves), [1.0, 2.0])


def test_leaves_whose_loads_vanish_go_back_to_zero():
    """Their pressures ended at 1e-12 of those before, as rounding, and cycled: 300 dense solves."""
    (pressed, _), (gone, _) = leaves_let_go()
    assert pressed.forces.pressure.max() > 0
    assert gone.forces.pressure.max() == 0
    assert np.abs(gone.x).max() == 0
