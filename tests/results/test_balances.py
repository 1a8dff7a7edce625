"""Charges and forces balance, and what a sensor reads."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from contact import parse_case
from contact import solve as solve_case
from contact.errors import InputError
from contact.methods.options import FixedPointOptions
from contact.model.body import Load
from contact.model.friction import Friction
from contact.problem.problem import ContactProblem
from contact.results.resultants import charge_balance, mean_potential, sensor
from contact.thesis.fixed_point import FixedPoint
from scripts.force_balance import force_balance
from tests.problems.mechanics import solve
from tests.problems.pairs import case
from tests.problems.piezo import (
    example,
    hencky,
)

COMM = MPI.COMM_WORLD


@pytest.mark.parallel
@pytest.mark.parametrize("law", [None, hencky(1.0)], ids=["linear", "log"])
@pytest.mark.parametrize("cells", [(16, 8), (4, 2, 3)], ids=["plane", "space"])
def test_global_balances(cells, law):
    problem = example(COMM, cells, law=law)
    solver = solve(problem)
    charges, forces = charge_balance(problem, solver.state), force_balance(problem, solver.state)
    assert charges.imbalance < 1e-8
    assert forces.imbalance < 1e-8
    depth = 1.0 if len(cells) == 2 else 2.0
    assert forces.applied[-1] == pytest.approx(-480.0 * depth, rel=1e-12)
    assert charges.electrodes["left"] == pytest.approx(-charges.foundation, rel=1e-7)
    assert charges.foundation < 0  # it comes from a foundation at 32


@pytest.mark.core
def test_given_charges_balance():
    from tests.problems.mechanics import constant

    problem = example(COMM, (8, 4), k_e=0.5)
    charges = [Load("right", charge=constant(0.7, 2)), Load(None, charge=constant(-0.2, 2))]
    problem = ContactProblem(
        problem.domain,
        replace(problem.description, loads=[*problem.description.loads, *charges]),
        problem.contacts,
    )
    solver = solve(problem)
    charges = charge_balance(problem, solver.state)
    assert charges.given["right"] == pytest.approx(0.7 * 4.0, rel=1e-12)
    assert charges.body == pytest.approx(-0.2 * 32.0, rel=1e-12)
    assert charges.imbalance < 1e-8


def test_sensor_reads_in_proportion_to_the_load():
    """Linear material, full contact, no friction and no conduction: everything is linear."""
    readings = []
    for load in (-5.0, -10.0):
        problem = example(COMM, (16, 8), load, friction=Friction(), k_e=0.0)
        solver = solve(problem, tolerance=1e-11)
        shorted = sensor(problem, solver.state, "left")
        strip = sensor(problem, solver.state, "top")
        assert strip.charge is None
        assert shorted.potential == pytest.approx(0.0, abs=1e-12)
        readings.append(
            (shorted.charge, strip.potential, mean_potential(problem, solver.state, "bottom"))
        )
    assert np.allclose(2 * np.array(readings[0]), readings[1], rtol=1e-8, atol=1e-9)


def test_charges_need_a_potential():
    from tests.problems.mechanics import bar

    problem = bar(COMM, 2)
    solver = FixedPoint(problem, FixedPointOptions())
    with pytest.raises(InputError, match=r"\[piezo\]"):
        charge_balance(problem, solver.state)


@pytest.mark.core
def test_the_balance_of_two_bodies_that_are_both_held():
    """No resultant is left but what passes between them: the rest is rounding, not all of it."""
    given = case(mesh={"generator": "two_blocks", "lower_size": 0.5, "upper_size": 0.5})
    given["fixed"].append({"on": "upper_top", "displacement": [0.0, -0.01]})
    del given["load"]
    solution = solve_case(parse_case(given), comm=MPI.COMM_SELF)
    balance = force_balance(solution.problem, solution.state)
    assert abs(balance.passed[0, 1]) > 1e-3
    assert balance.imbalance < 1e-12
    given["contact"]["gap"] = 0.05
    apart = solve_case(parse_case(given), comm=MPI.COMM_SELF)
    balance = force_balance(apart.problem, apart.state)
    assert apart.converged and np.abs(balance.supports).max() < balance.rounding_force
    assert balance.imbalance == 0  # the supports of a body that only moves feel rounding


@pytest.mark.core
def test_the_balance_of_a_ball_whose_contacts_cancel():
    """What passes from plate to ball and from ball to plate is no resultant, but much."""
    given = {
        "mesh": {"generator": "ball_between_plates"},
        "space": {"kinematics": "axisymmetric"},
        "material": {"young": 1000.0, "poisson": 0.3},
        "fixed": [
            {"on": "lower_bottom", "displacement": ["free", 0.0]},
            {"on": "upper_top", "displacement": ["free", -0.03]},
        ],
        "contact": [
            {"on": "ball_bottom", "against": "lower_top"},
            {"on": "ball_top", "against": "upper_bottom"},
        ],
    }
    solution = solve_case(parse_case(given), comm=MPI.COMM_SELF)
    balance = force_balance(solution.problem, solution.state)
    below, above = balance.passed[:, 1]
    assert below == pytest.approx(-above, rel=1e-7) and below > 1e-3
    assert balance.imbalance < 1e-10
