"""Problems whose solution touches nothing are found with the first solve."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import build_problem, solve
from contact.case.file import parse_case
from contact.methods.load_stepping import LoadStepping
from contact.methods.method import METHODS
from contact.methods.options import NewtonOptions
from tests.problems.blocks import squares

SELF = MPI.COMM_SELF

CASE = {
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


def test_an_approach_of_two_blocks_takes_a_solve_a_step():
    """It took 2884 solves and 990 factorisations: rounding of one block was compared with none."""
    problem = build_problem(parse_case(CASE), SELF)
    method = METHODS["newton"](problem, NewtonOptions(), None)
    steps = list(LoadStepping(problem, method).run([*(np.arange(1, 11) / 10)]))
    assert all(outcome.converged for _, outcome in steps)
    assert method.counters.factorizations == 1
    assert steps[-1][1].reason == "all residuals <= 1e-08"
    top = problem.equilibrium.nodal(steps[-1][0].x)[:, 1].min()
    assert np.isclose(top, -0.001)


@pytest.mark.parametrize("aside", ["0.003*t", "free"])
def test_an_approach_to_a_rigid_shape_takes_a_solve(aside):
    """Five steps took 346 dense solves, and ended with a reason of a failure."""
    ball = {"shape": "sphere", "centre": [1.0, -2.05], "radius": 2.0}
    case = {
        "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [12, 6]},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "top", "displacement": [aside, "-0.01*t"]}],
        "contact": {"on": "bottom", "foundation": ball},
        "friction": {"law": "coulomb", "mu": 0.3},
        "evolution": {"times": [0.0, 1.0], "steps": [5]},
    }
    solution = solve(parse_case(case), comm=SELF)
    assert solution.converged and solution.pressure.max() == 0
    assert solution.outcome.reason == "all residuals <= 1e-08"
    assert solution.counters.factorizations == 1


def test_an_evolution_that_lifts_off_takes_a_solve_a_step():
    """Two blocks are pressed, pushed aside and pulled apart: 300 solves a step."""
    moved = {"on": "upper_top", "displacement": ["0.0003*t", "-0.001*sin(pi*t)"]}
    case = {
        **CASE,
        "fixed": [CASE["fixed"][0], moved],
        "contact": {"on": "upper_bottom", "against": "lower_top"},
    }
    problem = build_problem(parse_case(case), SELF)
    method = METHODS["newton"](problem, NewtonOptions(), None)
    steps = list(LoadStepping(problem, method).run([0.3, 0.6, 0.9, 1.2, 1.5, 1.8]))
    assert all(outcome.converged for _, outcome in steps)
    presses = [bool(state.forces.pressure.max() > 0) for state, _ in steps]
    assert presses == 3 * [True] + 3 * [False]
    assert method.counters.factorizations == 1


@pytest.mark.parametrize("condense", [True, False])
@pytest.mark.parametrize("loads", ["supports", "traction"])
def test_two_blocks_unloaded_to_zero_end_at_zero(loads, condense):
    """The last step took up to 1655 dense solves: forces fell to 1e-164, always by their rounding.

    Pressed, and pushed aside, by parabolas in time that end at zero.
    """
    push = {"on": "upper_top", "displacement": ["0.0003*t*(1 - t)", "-0.001*t*(1 - t)"]}
    if loads == "traction":
        push["displacement"] = [0.0, "free"]
    case = {
        **CASE,
        "fixed": [CASE["fixed"][0], push],
        "load": [{"on": "upper_top", "traction": [0.0, "-0.001*t*(1 - t)"]}]
        * (loads != "supports"),
        "contact": {"on": "upper_bottom", "against": "lower_top"},
    }
    problem = build_problem(parse_case(case), SELF)
    method = METHODS["newton"](problem, NewtonOptions(condense=condense), None)
    steps = list(LoadStepping(problem, method).run([*(np.arange(1, 11) / 10)]))
    assert all(outcome.converged for _, outcome in steps)
    assert all(state.forces.pressure.max() > 0 for state, _ in steps[:-1])
    assert not steps[-1][0].x.any() and not steps[-1][0].forces.pressure.any()


def test_leaves_whose_loads_vanish_go_back_to_zero():
    """Their pressures ended at 1e-12 of those before, as rounding, and cycled: 300 dense solves."""
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
    problem = build_problem(parse_case(case), SELF, domain=leaves)
    method = METHODS["newton"](problem, NewtonOptions(), None)
    (pressed, first), (gone, last) = LoadStepping(problem, method).run([1.0, 2.0])
    assert first.converged and pressed.forces.pressure.max() > 0
    assert last.converged and gone.forces.pressure.max() == 0
    assert np.abs(gone.x).max() == 0
