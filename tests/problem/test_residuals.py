"""The residuals that decide: zero at the solution, and each fault raises the right one."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI

from contact import Body, Contact, Fixed, Friction, Load, parse_case
from contact.mesh.grid import rectangle
from contact.problem import residuals
from contact.problem.problem import ContactProblem
from contact.problem.residuals import Residuals, evaluate, residual_forces
from contact.problem.state import State
from contact.solving import solve as solve_case
from contact.tolerances import MOST_ROUNDING
from forms.hencky import Log
from forms.laws import SlipCoefficient
from tests.problems.mechanics import (
    constant,
    flat,
    leaning_block,
    solve,
)

SMALL = 1e-10


class Solved:
    """A solution with open, sticking and sliding nodes, that can be spoilt and restored."""

    def __init__(self, problem):
        self.loop = solve(problem, SMALL)
        self.problem, self.nodes = problem, problem.nodes
        self.state, self.multipliers = self.loop.state, self.loop.state.multipliers
        self.base = self.residuals()
        self.nodal = problem.nodal(self.state)
        self.bound = problem.interface.bound(self.nodal, self.multipliers)
        self.pressed = self.multipliers.contact > 1e-3 * self.multipliers.contact.max()
        size = np.linalg.norm(self.multipliers.friction, axis=1)
        self.sticks = self.pressed & (size < 0.95 * self.bound)
        self.slides = self.pressed & ~self.sticks & (size > 0.999 * self.bound)
        self.open = self.multipliers.contact < 1e-9 * self.multipliers.contact.max()

    def residuals(self, nodal=None, multipliers=None):
        """Return the residuals with a displacement added at the contact nodes, or new forces."""
        x = self.state.x.copy()
        if nodal is not None:
            self.problem.nodes.add_jump_transposed(nodal, x)
        return evaluate(self.problem, State(x, multipliers or self.multipliers))

    def along(self, chosen, component):
        """Return nodal vectors along the normal, or along the friction force where there is any."""
        friction = self.multipliers.friction
        size = np.linalg.norm(friction, axis=1)[:, None]
        unit = np.where(size > 0, friction / np.where(size > 0, size, 1), 0.0)
        directions = self.nodes.normal if component == "normal" else unit
        return directions * chosen[:, None]


@pytest.fixture(scope="module", params=["plane", "space"])
def solved(request):
    if request.param == "plane":
        # Rolled up to the right: open nodes, and some that stick and slide.
        domain = rectangle(MPI.COMM_SELF, [0.0, 0.0], [4.0, 1.0], [24, 6])
        zero = constant(0.0, 2)
        body = Body(
            Log(1.0, 0.3, yield_strain=0.01),
            [Fixed("left", [constant(0.01, 2), constant(-0.01, 2)])],
            [Load("right", [zero, constant(0.0015, 2)])],
        )
        friction = Friction(SlipCoefficient(0.2, 0.2, 10.0))
        problem = ContactProblem(domain, body, Contact("bottom", flat()), friction)
    else:
        problem = leaning_block(MPI.COMM_SELF, 2, mu=0.2)
    found = Solved(problem)
    assert found.sticks.any() or found.slides.any()
    return found


@pytest.mark.core
def test_zero_at_the_solution(solved):
    assert solved.base.largest <= SMALL


@pytest.mark.core
def test_a_wrong_displacement_is_out_of_equilibrium(solved):
    problem = solved.problem
    random = np.random.default_rng(0)
    body = problem.body
    shake = 1e-4 * random.standard_normal(body.owned) * body.free.ravel()
    shake.reshape(-1, body.block_size)[problem.nodes.nodes] = 0.0
    found = evaluate(problem, State(solved.state.x + shake, solved.multipliers))
    assert found.equilibrium > 1e-4
    assert found.contact <= SMALL
    assert found.friction <= SMALL


def test_rounding_is_a_small_part_of_the_loads(solved, monkeypatch):
    """Of a body that has flown away, or is far softer than at rest."""
    problem = solved.problem
    body = problem.body
    shake = np.random.default_rng(0).standard_normal(body.owned) * body.free.ravel()
    shake.reshape(-1, body.block_size)[problem.nodes.nodes] = 0.0
    strict = evaluate(problem, State(solved.state.x + 1e-4 * shake, solved.multipliers))
    monkeypatch.setattr(residuals, "MARGIN", 1e30)
    for size in (1e-4, 1e-4 * 2 * MOST_ROUNDING / strict.equilibrium):
        found = evaluate(problem, State(solved.state.x + size * shake, solved.multipliers))
        assert found.equilibrium > 0.99 * MOST_ROUNDING


@pytest.mark.parametrize("degree", [1, 2])
def test_rounding_is_what_no_solve_gets_rid_of(degree):
    """Forces out of balance stall at a quarter of it, whatever bends; and nothing else is it."""
    load = [{"on": "top", "traction": [0.0, -1e-10]}]
    supports = [{"on": side, "displacement": [0.0, 0.0]} for side in ("left", "right")]
    section = {
        "mesh": {"generator": "rectangle", "size": [200.0, 1.0], "cells": [400, 2]},
        "space": {"degree": degree},
        "material": {"young": 1.0, "poisson": 0.3},
        "contact": {"on": "bottom", "gap": 0.1},
    }
    solution = solve_case(
        parse_case({**section, "fixed": supports, "load": load}), comm=MPI.COMM_SELF
    )
    problem, state = solution.problem, solution.state
    body, found = problem.body, solution.outcome.residuals
    stalled = body.norm(body.unbalanced(residual_forces(problem, state)))
    assert solution.converged
    assert found.equilibrium_rounding > 1e-11  # beside loads and reactions
    assert 0 < found.equilibrium <= found.floors[0]
    assert found.significant == 0
    known = residuals.rounding_forces(problem, state, body.internal_forces(state))
    assert 0.1 < stalled / known[0, 0] < 0.5
    spoilt = state.x.copy()
    spoilt[: body.owned] += 1e-9 * body.free.ravel() * np.abs(spoilt).max()
    assert (
        evaluate(problem, State(spoilt, state.multipliers)).equilibrium
        > 100 * found.equilibrium_rounding
    )


@pytest.mark.core
def test_penetration_and_gaps_under_pressure_break_the_contact_law(solved):
    for sign in (1e-4, -1e-4):
        found = solved.residuals(nodal=sign * solved.along(solved.pressed, "normal"))
        assert found.contact > 1e-5
        assert found.equilibrium > 1e-6
    if solved.open.any():
        opened = solved.residuals(nodal=-1e-4 * solved.along(solved.open, "normal"))
        assert opened.contact <= SMALL


@pytest.mark.core
def test_a_wrong_pressure(solved):
    multipliers = solved.multipliers
    pressure = multipliers.contact * np.where(solved.pressed, 1.01, 1.0)
    found = solved.residuals(multipliers=replace(multipliers, contact=pressure))
    assert found.equilibrium > 1e-4
    assert found.contact <= SMALL  # any pressure will do where the gap is closed
    if solved.slides.any():
        assert found.friction > 1e-4
    glued = multipliers.contact - 1e-3 * multipliers.contact.max() * solved.open
    if solved.open.any():
        assert solved.residuals(multipliers=replace(multipliers, contact=glued)).contact > 1e-5
    pulled = replace(multipliers, contact=-multipliers.contact)
    assert solved.residuals(multipliers=pulled).contact > 0.5


@pytest.mark.core
def test_a_wrong_friction_force(solved):
    multipliers = solved.multipliers
    if solved.sticks.any():
        # A sticking node may carry any force within its bound.
        less = multipliers.friction * np.where(solved.sticks, 0.9, 1.0)[:, None]
        found = solved.residuals(multipliers=replace(multipliers, friction=less))
        assert found.friction <= SMALL
        assert found.equilibrium > 1e-5
    if solved.slides.any():
        for factor in (0.9, 1.1, -1.0):
            spoilt = multipliers.friction * np.where(solved.slides, factor, 1.0)[:, None]
            found = solved.residuals(multipliers=replace(multipliers, friction=spoilt))
            assert found.friction > 1e-5
            assert found.contact <= SMALL


@pytest.mark.core
def test_slip_of_a_sticking_node_and_slip_the_wrong_way(solved):
    if solved.sticks.any():
        found = solved.residuals(nodal=1e-4 * solved.along(solved.sticks, "tangent"))
        assert found.friction > 1e-6
        assert found.contact <= SMALL
    if solved.slides.any():
        back = -2 * solved.nodes.tangential_component(solved.nodal) * solved.slides[:, None]
        assert solved.residuals(nodal=back).friction > 1e-5


@pytest.mark.core
def test_the_bound_is_that_of_the_final_pressure_and_slip(solved):
    """A solution for another coefficient does not pass."""
    problem = solved.problem
    friction = Friction(SlipCoefficient(0.15, 0.1, 10.0))
    contact = problem.contacts[0].model_copy(update={"friction": friction})
    other = ContactProblem(problem.domain, problem.description, contact)
    assert evaluate(other, solved.state).friction > 1e-4
    assert evaluate(problem, solved.state).largest <= SMALL


@pytest.mark.core
def test_a_query_changes_nothing(solved):
    """Residuals, forces and operators are those of the state that is asked for, in any order."""
    problem, body = solved.problem, solved.problem.body
    other = State(0.3 * solved.state.x, solved.multipliers, 0.5)
    matrices = [body.create_matrix() for _ in range(2)]
    body.assemble(matrices[0], "secant", solved.state)
    first = evaluate(problem, solved.state), body.internal_forces(solved.state)
    evaluate(problem, other)
    body.assemble(matrices[1], "tangent", other)
    body.secant_forces(replace(other, secant_at=solved.state.x))
    body.assemble(matrices[1], "secant", solved.state)
    matrices[1].axpy(-1.0, matrices[0])
    assert matrices[1].norm() == 0.0
    assert evaluate(problem, solved.state) == first[0]
    assert np.array_equal(body.internal_forces(solved.state), first[1])
    with pytest.raises(ValueError, match="read-only"):
        solved.state.x[:] = 0.0


def test_a_node_without_numbers_far_from_all_others_is_no_equilibrium(solved):
    """Neither supports nor contact nodes see it: the residual was said to be 0."""
    body, x = solved.problem.body, solved.state.x.copy()
    points = body.space.tabulate_dof_coordinates()
    middle = np.argmin(np.linalg.norm(points - points.mean(axis=0), axis=1))
    body.nodal(x)[middle, 0] = np.nan
    found = evaluate(solved.problem, State(x, solved.multipliers))
    assert np.isfinite(found.contact) and np.isfinite(found.friction)
    assert found.largest == np.inf


def test_what_is_no_number_has_not_converged():
    assert Residuals(0.0, float("nan"), 0.0).largest == np.inf
    assert Residuals(float("inf"), 0.0, 0.0).largest == np.inf
    assert Residuals(1e-9, 3e-9, 2e-9).largest == 3e-9
