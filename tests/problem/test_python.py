"""What is put together in Python is what a case of the same words stands for."""

import numpy as np
import pytest

from contact import (
    Body,
    Contact,
    Fixed,
    Friction,
    Load,
    Problem,
    evolve,
    make_material,
    parse_case,
    solve,
    solve_steps,
)
from tests.problems.mechanics import close
from tests.problems.put_together import block, problem


def test_the_words_of_the_case_file() -> None:
    given = {"traction": [0.0, 0.001]}
    assert Load("right", **given) == Load("right", [0.0, 0.001])
    assert Load(body_force=[0.0, 0.001]) == Load(None, [0.0, 0.001])
    assert Load(None, body_charge=2.0) == Load(None, charge=2.0)
    x = problem(contact=Contact("bottom", gap=0.002)).nodes.gap
    assert x == pytest.approx(0.002)


def test_an_interference_by_a_gap() -> None:
    pressed = solve(
        problem(Fixed("top", [0.0, 0.0]), contact=Contact("bottom", -0.001, press=True))
    )
    moved = solve(problem(Fixed("top", [0.0, -0.001])))
    assert pressed.contact_force == pytest.approx(moved.contact_force, rel=1e-6)


def test_steps_of_a_problem() -> None:
    """They are those that `evolve` gives, and their rows say what they have come to."""
    made = problem(Fixed("top", [lambda x: 1e-3 * x[0], -0.005]))
    friction = Problem(made.domain, made.description, Contact("bottom"), Friction(mu=0.2))
    times = [0.5, 1.0]
    states = list(evolve(friction, times))
    solution = solve_steps(friction, np.array(times))
    assert [step.row["t"] for step in solution.steps] == times
    assert close(solution.state, states[-1], atol=1e-9)
    force = solution.steps[-1].row["contact_force_y"]
    assert force == pytest.approx(solution.contact_force[1])
    assert solution.movements == {}
    assert solution.charges is None


def test_materials_of_keys() -> None:
    """They are those of a case with the same keys; a list of them makes a body."""
    keys = {"name": "PZT-4", "units": "GPa", "poling": 30.0}
    given = make_material(2, **keys)
    potential = {"on": "bottom", "potential": 0.0}
    mesh = {"generator": "rectangle", "size": [2.0, 1.0], "cells": [8, 4]}
    fixed = [{"on": "top", "displacement": [0, -0.005], "potential": 0.01}, potential]
    case = {"mesh": mesh, "material": keys, "fixed": fixed, "contact": {"on": "bottom"}}
    plain = solve(parse_case(case))
    body = Body([given], [Fixed("top", [0, -0.005], 0.01), Fixed("bottom", potential=0.0)])
    same = solve(Problem(block(), body, Contact("bottom")))
    assert same.contact_force == pytest.approx(plain.contact_force, rel=1e-10)
    assert same.charges is not None
    assert same.charges.electrodes == pytest.approx(plain.charges.electrodes, rel=1e-8)
