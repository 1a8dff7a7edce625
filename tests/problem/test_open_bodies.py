"""Residuals of bodies that touch nothing, or next to nothing."""

import numpy as np
import pytest
from mpi4py import MPI

from contact.case.file import parse_case
from contact.problem.residuals import evaluate
from contact.problem.state import State
from contact.solving import solve as solve_case
from tests.problems.mechanics import (
    bar,
    pressed_block,
    turn,
)


def test_residuals_of_an_open_body():
    problem = bar(MPI.COMM_SELF, 4, 0.005)  # lifted: nothing touches but near the clamp
    rest = problem.start()
    assert evaluate(problem, rest).contact == 0
    assert evaluate(problem, rest).equilibrium == pytest.approx(1.0)
    sunk = np.zeros((problem.nodes.size, 2))
    sunk[:, 1] = -0.01
    x = rest.x.copy()
    problem.nodes.add_jump_transposed(sunk, x)
    assert evaluate(problem, State(x, rest.forces)).contact > 0.5


@pytest.mark.parametrize("method", ["newton", "uzawa"])
def test_a_gap_out_of_reach_does_not_excuse_small_loads(method):
    """The problem is homogeneous: of small loads half the friction was missing, and converged."""
    forces = []
    for load in (1e-3, 1e-16):
        section = {
            "mesh": {"generator": "rectangle", "size": [4.0, 1.0], "cells": [16, 4]},
            "material": {"young": 1.0, "poisson": 0.3},
            "fixed": [{"on": "left", "displacement": [0.0, 0.0]}],
            "load": [{"on": "top", "traction": [0.0, -load]}],
            "contact": {"on": "bottom", "gap": "where(x < 3, 0, 1)"},
            "friction": {"law": "coulomb", "mu": 0.3},
            "solver": {"method": method},
        }
        solution = solve_case(parse_case(section), comm=MPI.COMM_SELF)
        assert solution.converged
        forces.append(solution.contact_force / load)
    assert forces[1] == pytest.approx(forces[0], rel=1e-6)


@pytest.mark.parallel
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("method", ["newton", "uzawa", "penalty"])
def test_a_body_moved_without_touching_is_in_equilibrium(method, degree, dim):
    """All its forces are rounding, the reactions as well: that is no residual."""
    for rotation, move in ((0.0, 0.02), (30.0, -0.005)):
        normal = turn(dim, rotation) @ np.eye(dim)[-1]
        section = {
            "mesh": {
                "generator": "rectangle" if dim == 2 else "box",
                "size": [1.0] * dim,
                "cells": [12 // dim] * dim,
                "rotation": rotation,
            },
            "space": {"degree": degree},
            "material": {"young": 210e9, "poisson": 0.3},
            "fixed": [{"on": "top", "displacement": (move * normal).tolist()}],
            "contact": {"on": "bottom", "gap": 0.01},
            "friction": {"law": "coulomb", "mu": 0.3},
            "solver": {"method": method},
        }
        solution = solve_case(parse_case(section))
        assert solution.outcome.converged, solution.outcome
        assert solution.outcome.residuals.equilibrium < 1e-8


def test_a_body_that_has_flown_away_is_not_in_equilibrium():
    """All forces of such a state are rounding: they must not be measured against themselves."""
    problem = pressed_block(MPI.COMM_SELF, 2)
    for distance in (1e6, 1e12, 1e15):
        x = problem.start().x.reshape(-1, 2).copy()
        x[:, 1] += distance
        away = State(x.ravel(), problem.start().forces)
        assert evaluate(problem, away).equilibrium > 1e-3
