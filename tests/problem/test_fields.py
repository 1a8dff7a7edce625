"""Forces and charges are in balance each among their own, however large the others are.

What is put together in Python is what a case of the same words stands for.
"""

import numpy as np
import pytest
from mpi4py import MPI

from contact import (
    Body,
    Contact,
    Fixed,
    Friction,
    Load,
    Material,
    Problem,
    evolve,
    make_material,
    solve_steps,
)
from contact.case.file import parse_case
from contact.problem.residuals import evaluate
from contact.problem.state import State
from contact.solving import solve
from tests.problems.mechanics import close
from tests.problems.put_together import block, problem
from tests.problems.raw_balance import imbalance

TOLERANCE = 1e-8


def section(method: str, linear: str = "auto", coupling=1e-9, top=1e6, unit=1.0, volt=1.0, **law):
    """Return a bar with a potential on top, drawn down at the right; stresses in a unit."""
    shared = {"e31": -0.54, "e33": 1.58, "e15": 1.23}
    crystal = {name: coupling * unit * volt * value for name, value in shared.items()}
    crystal |= {name: 0.8 * unit * volt**2 for name in ("beta11", "beta33")}
    clamp = {"on": "left", "displacement": [0.0, 0.0], "potential": 0.0}
    return {
        "mesh": {"generator": "rectangle", "size": [4.0, 1.0], "cells": [8, 2]},
        "material": {"young": unit, "poisson": 0.3, "piezo": crystal, **law},
        "fixed": [clamp, {"on": "top", "potential": top / volt}],
        "load": [{"on": "right", "traction": [0.0, -0.005 * unit]}],
        "contact": {"on": "bottom"},
        "friction": {"law": "coulomb", "mu": 0.3},
        "solver": {"method": method, "linear": linear, "tolerance": TOLERANCE},
    }


def solved(*arguments, **options):
    return solve(parse_case(section(*arguments, **options)), comm=MPI.COMM_SELF)


@pytest.mark.parametrize("linear", ["lu", "iterative"])
@pytest.mark.parametrize("method", ["newton", "uzawa", "penalty"])
@pytest.mark.parametrize("law", [{}, {"law": "log", "yield_strain": 0.005}])
def test_small_forces_beside_large_charges(method, linear, law):
    """Half of the forces of the penalty method were out of balance, and it had converged."""
    found = solved(method, linear, **law)
    assert found.converged, found.outcome.reason
    raw = imbalance(found, section(method, linear, **law))
    assert raw.electrified > 1e7 * raw.applied
    assert raw.force < 2 * TOLERANCE * raw.applied
    assert raw.charge < 2 * TOLERANCE * raw.electrified


@pytest.mark.core
@pytest.mark.parametrize("top", [0.0, 1e6])
def test_each_field_is_out_of_balance_by_itself(top):
    """Without a given potential the strain alone charges the body, by a part in 1e9."""
    found = solved("newton", top=top)
    problem, state = found.problem, found.state
    body = problem.body
    free = np.concatenate([body.free.ravel(), np.zeros(body.global_unknowns.size, dtype=bool)])
    shake = np.random.default_rng(0).choice((-1.0, 1.0), free.size) * free
    for field in (body.component_norms.mechanical, ~body.component_norms.mechanical):
        spoilt = state.x + 1e-4 * np.where(field, shake * np.abs(state.x[field]).max(), 0.0)
        assert evaluate(problem, State(spoilt, state.multipliers)).equilibrium > 1e-5
    assert evaluate(problem, state).equilibrium < TOLERANCE


@pytest.mark.core
def test_what_a_potential_exerts_is_what_acts():
    """No load, nothing touched: the forces of the potential alone bend the body."""
    apart = section("newton") | {"contact": {"on": "bottom", "gap": 10.0}, "load": []}
    found = solve(parse_case(apart), comm=MPI.COMM_SELF)
    assert found.converged, found.outcome.reason
    raw = imbalance(found, apart)
    assert 0 < found.outcome.residuals.equilibrium_rounding < TOLERANCE
    assert raw.force < TOLERANCE * raw.applied


@pytest.mark.parametrize("method", ["newton", "uzawa", "penalty"])
@pytest.mark.parametrize("linear", ["lu", "iterative"])
def test_counts_and_residuals_in_any_units(method, linear):
    """MINRES ended at a size of the solution, and compared residuals in two units."""
    units, volts = (1.0, 2.0**40, 2.0**-30), (1.0, 2.0**-14, 2.0**26)
    found = [
        solved(method, linear, 1.0, 1.0, unit, volt)
        for unit, volt in zip(units, volts, strict=True)
    ]
    counts = [
        (one.counters.linear_solves, one.counters.factorizations, len(one.history)) for one in found
    ]
    assert all(one.converged for one in found)
    assert len(set(counts)) == 1, counts
    iterations = [one.counters.linear_iterations for one in found]
    # equal but for rounding
    assert iterations == pytest.approx(3 * iterations[:1], rel=0.02)
    forces = [np.array(one.contact_force) / unit for one, unit in zip(found, units, strict=True)]
    assert np.allclose(forces, forces[0], rtol=1e-9, atol=0)


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
    potential = {"on": "bottom", "potential": 0.0}
    mesh = {"generator": "rectangle", "size": [2.0, 1.0], "cells": [8, 4]}
    fixed = [{"on": "top", "displacement": [0, -0.005], "potential": 0.01}, potential]
    case = {"mesh": mesh, "material": keys, "fixed": fixed, "contact": {"on": "bottom"}}
    plain = solve(parse_case(case))
    for given in ([make_material(2, **keys)], Material(**keys)):
        body = Body(given, [Fixed("top", [0, -0.005], 0.01), Fixed("bottom", potential=0.0)])
        same = solve(Problem(block(), body, Contact("bottom")))
        assert same.contact_force == pytest.approx(plain.contact_force, rel=1e-10)
        assert same.charges is not None
        assert same.charges.electrodes == pytest.approx(plain.charges.electrodes, rel=1e-8)
