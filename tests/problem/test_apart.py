"""Bodies that nothing connects are judged each by itself, however large the loads of others.

Residuals of bodies that touch nothing, or next to nothing.
"""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from contact.case.file import parse_case
from contact.methods.options import FixedPointOptions, NewtonOptions, PenaltyOptions
from contact.model.body import Fixed
from contact.model.rigid import Motion
from contact.problem.problem import ContactProblem
from contact.problem.residuals import evaluate, residual_as_pressures, residual_forces
from contact.problem.state import State
from contact.results.remarks import rounding, untouched
from contact.solving import solve, solve_steps
from contact.solving import solve as solve_case
from tests.problems.apart import blocks, pressed
from tests.problems.clamped import clamped
from tests.problems.mechanics import bar, pressed_block, turn
from tests.problems.piezo import pzt

COMM, LITTLE = MPI.COMM_WORLD, 1e-10
METHODS = {"newton": NewtonOptions, "uzawa": FixedPointOptions}


def of_second(solution, values):
    """Return values at the contact nodes of the second block, in order. Collective."""
    nodes = solution.problem.nodes
    points, values = nodes.gather(nodes.points[:, 0]), nodes.gather(values)
    return values[np.argsort(points)][np.sort(points) > 1.5]


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("linear", ["lu", "iterative"])
@pytest.mark.parametrize("method", METHODS)
def test_a_body_beside_one_that_is_pressed_far_more(method, linear):
    """Newton's method with multigrid left its contact forces off by 5e-6, and had converged."""
    # Forces are off by some five times the residual, which is anything below the tolerance.
    options = METHODS[method](linear=linear, tolerance=1e-9)
    beside = solve(pressed(blocks(COMM), 0.01, 0.01 * LITTLE), options, comm=COMM)
    exact = solve(pressed(blocks(COMM), 0.01, 0.01), NewtonOptions(tolerance=1e-12), comm=COMM)
    assert beside.converged, beside.outcome.reason
    found, known = (of_second(one, one.state.multipliers.contact) for one in (beside, exact))
    assert np.linalg.norm(found / LITTLE - known) < 1e-8 * np.linalg.norm(known)


@pytest.mark.parametrize("linear", ["lu", "iterative"])
def test_solves_of_the_block_relaxation(linear):
    """What accelerates it, and an iterative solver, saw the larger forces alone."""
    domain, options = blocks(MPI.COMM_SELF, n=8), FixedPointOptions(linear=linear)
    found = [solve(pressed(domain, 0.01, 0.01 * share), options) for share in (1.0, LITTLE)]
    assert all(one.converged for one in found)
    even, beside = (one.counters.linear_solves for one in found)
    assert beside < 1.3 * even


@pytest.fixture(scope="module")
def beside():
    return solve(pressed(blocks(MPI.COMM_SELF), 0.01, 0.01 * LITTLE), comm=MPI.COMM_SELF)


def test_where_nothing_touches_is_no_solution(beside):
    """At rest the second block does not touch: nothing is in balance with its loads."""
    problem, state = beside.problem, beside.state
    kept = problem.body.layout.points[:, 0] < 1.5
    x = np.where(np.repeat(kept, 2), state.x, 0.0)
    pressed_nodes = problem.nodes.points[:, 0] < 1.5
    multipliers = replace(
        state.multipliers,
        contact=np.where(pressed_nodes, state.multipliers.contact, 0.0),
        friction=state.multipliers.friction * pressed_nodes[:, None],
    )
    assert evaluate(problem, state).largest < 1e-8
    assert evaluate(problem, State(x, multipliers)).equilibrium > 0.1


@pytest.mark.core
@pytest.mark.parametrize("name", ["contact", "friction"])
def test_the_laws_hold_on_each_body(beside, name):
    """A pressure of another sign, and a friction far beyond its bound."""
    problem, state = beside.problem, beside.state
    second = problem.nodes.points[:, 0] > 1.5
    pressure, friction = state.multipliers.contact.copy(), state.multipliers.friction.copy()
    if name == "contact":
        pressure[second] *= -1
    else:
        friction[second] *= 100
    spoilt = State(state.x, replace(state.multipliers, contact=pressure, friction=friction))
    assert getattr(evaluate(problem, spoilt), name) > 0.1


def test_charges_of_each_body():
    """Potentials of the second block are wrong by their own size."""
    supports = [
        Fixed("held", [0.0, 0.0], potential=0.0),
        Fixed("top0", potential=1.0),
        Fixed("top1", potential=LITTLE),
    ]
    problem = pressed(
        blocks(MPI.COMM_SELF),
        0.01,
        0.01 * LITTLE,
        piezo=pzt(2),
        fixed=supports,
    )
    found = solve(problem, comm=MPI.COMM_SELF)
    assert found.converged, found.outcome.reason
    x, body = found.state.x.copy(), problem.body
    wrong = body.free[:, -1] & (body.layout.points[:, 0] > 1.5)
    body.nodal(x)[wrong, -1] = 0.0
    assert evaluate(problem, State(x, found.state.multipliers)).equilibrium > 0.01


@pytest.mark.parametrize("linear", ["lu", "iterative"])
@pytest.mark.parametrize("method", METHODS)
def test_what_is_left_of_a_body_that_is_no_longer_loaded(method, linear):
    """Nothing acts on it any more: what a solver leaves of its displacements is not its scale."""
    given = pressed(blocks(MPI.COMM_SELF), 0.01, 0.01, gap=0.001)
    first, second = given.description.loads
    loads = (first, second.model_copy(update={"amplitude": lambda t: float(t == 1)}))
    body = replace(given.description, loads=loads)
    problem = ContactProblem(given.domain, body, given.contacts)
    found = solve_steps(problem, [1.0, 2.0], METHODS[method](linear=linear))
    assert found.converged, found.outcome.reason
    assert np.abs(of_second(found, found.state.multipliers.contact)).max() < 1e-14


def test_forces_that_are_rounding_do_not_press():
    """Nodes with pressures of 6e-30 stuck, and 3.1 of all forces were out of balance."""
    given = pressed(blocks(MPI.COMM_SELF), -0.01, 0.01)
    first, second = given.description.loads
    loads = (first, second.model_copy(update={"amplitude": lambda t: 1.0 if t <= 1 else 0.0}))
    problem = ContactProblem(given.domain, replace(given.description, loads=loads), given.contacts)
    found = solve_steps(problem, [1.0, 2.0])
    rng, nodes = np.random.default_rng(1), found.problem.nodes
    on_second = nodes.points[:, 0] > 1.5
    x, multipliers = found.state.x.copy(), found.state.multipliers
    loaded = found.problem.body.layout.points[:, 0] > 1.5
    body = found.problem.body.nodal(x)
    body[loaded] = 1e-29 * rng.standard_normal(body[loaded].shape)
    body[~found.problem.body.free] = 0.0
    pressure = np.where(on_second, 6e-30 * rng.random(on_second.size), 0.0)
    found.state = replace(found.state, x=x, multipliers=replace(multipliers, contact=pressure))
    assert np.abs(found.displacement.x.array).max() > 1e-3
    assert set(found.status) == {"open"}
    assert not [*rounding(found)]
    assert not [*untouched(found)]


@pytest.mark.parametrize(("remaining", "gap"), [(0.0, 0.001), (1e-6, 0.001), (0.0, 0.0)])
@pytest.mark.parametrize("method", [NewtonOptions, FixedPointOptions, PenaltyOptions])
def test_what_presses_no_longer_is_not_unknown(method, remaining, gap):
    """Multipliers of 1e-25 and less on open nodes: contact forces were "known to 400 of them"."""
    given = pressed(blocks(MPI.COMM_SELF), 0.01, 0.01, mu=0.0, gap=gap)
    first, second = given.description.loads
    loads = (first, second.model_copy(update={"amplitude": lambda t: 1.0 if t <= 1 else remaining}))
    problem = ContactProblem(given.domain, replace(given.description, loads=loads), given.contacts)
    for linear in ("lu", "iterative"):
        options = method(linear=linear)
        found = solve_steps(problem, [0.5, 1.0, 2.0, 3.0], options)
        assert found.converged, found.outcome.reason
        left = residual_as_pressures(problem, found.state, residual_forces(problem, found.state))
        assert max(found.outcome.residuals.pressure_rounding, left) < 1e-3


@pytest.mark.parametrize("given", [True, False])
def test_what_moves_freely_joins_bodies(given):
    """A foundation in front of both passes forces on, unless it moves as is given."""
    height = 0.001 if given else None
    motion = Motion([0.0, height], [0.0], [0.0, 0.0 if given else 0.01], [0.0], [0.0, 0.0])
    problem = pressed(blocks(MPI.COMM_SELF), 0.0, 0.0, mu=0.0, rigid=motion)
    shares = problem.body.component_norms
    assert shares.count == (3 if given else 1)
    assert len(set(shares.connected_component)) == (2 if given else 1)
    assert set(shares.behind) == {*range(shares.count)} - {*shares.connected_component} or not given


@pytest.mark.parallel
def test_sizes_do_not_depend_on_ranks():
    """Here each rank has a part of one block at most, or none."""
    sizes = []
    for comm in (MPI.COMM_SELF, COMM):
        problem = pressed(blocks(comm, (1.0, 3.0, 2.0)), 1.0, 1e-5, 0.0)
        residual = residual_forces(problem, problem.start())
        sizes.append(np.sort(problem.body.norms(residual)[0]))
    assert np.allclose(*sizes, rtol=1e-12, atol=0)
    assert np.count_nonzero(sizes[0]) == 2


def test_residuals_of_an_open_body():
    problem = bar(MPI.COMM_SELF, 4, 0.005)  # lifted: nothing touches but near the clamp
    rest = problem.start()
    assert evaluate(problem, rest).contact == 0
    assert evaluate(problem, rest).equilibrium == pytest.approx(1.0)
    sunk = np.zeros((problem.nodes.size, 2))
    sunk[:, 1] = -0.01
    x = rest.x.copy()
    problem.nodes.add_jump_transposed(sunk, x)
    assert evaluate(problem, State(x, rest.multipliers)).contact > 0.5


@pytest.mark.parametrize("method", ["newton", "uzawa"])
def test_a_gap_out_of_reach_does_not_excuse_small_loads(method):
    """The problem is homogeneous: of small loads half the friction was missing, and converged."""
    forces = []
    for load in (1e-3, 1e-16):
        section = clamped(
            [4.0, 1.0],
            [16, 4],
            load=[{"on": "top", "traction": [0.0, -load]}],
            contact={"on": "bottom", "gap": "where(x < 3, 0, 1)"},
            friction={"law": "coulomb", "mu": 0.3},
            solver={"method": method},
        )
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
        away = State(x.ravel(), problem.start().multipliers)
        assert evaluate(problem, away).equilibrium > 1e-3
