"""Semismooth Newton: against the block relaxation, its rate, nested meshes."""

import tomllib
from dataclasses import dataclass

import numpy as np
import pytest
from mpi4py import MPI

from contact.case.build import build_problem
from contact.case.file import parse_case
from contact.errors import InputError
from contact.interface.multipliers import Multipliers
from contact.methods.newton import Newton
from contact.methods.options import FixedPointOptions, NewtonOptions
from contact.model.friction import Friction
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.refining import coarser_cases
from contact.solving import solve
from contact.thesis.fixed_point import FixedPoint
from forms.hencky import Linear, Log
from forms.laws import ConstantCoefficient, SlipCoefficient
from scripts.cases import bar
from tests.problems import mechanics
from tests.problems.everywhere import agree
from tests.problems.mechanics import bar_case, newton

SELF = MPI.COMM_SELF


def compare(one: ContactProblem, other: ContactProblem, tolerance: float) -> None:
    """Solve one problem by Newton's method, condensed and whole, its twin by block relaxation."""
    slow, outcome = FixedPoint(other, FixedPointOptions(tolerance=1e-10)).solve()
    assert outcome.converged
    size = np.abs(slow.x).max()
    atol = tolerance * slow.forces.pressure.max()
    for condense in (True, False):
        fast = newton(one, condense=condense)
        assert (fast.counters.contact_solves > 0) == condense
        found = fast.state
        assert np.allclose(found.x, slow.x, rtol=0, atol=tolerance * size)
        assert np.allclose(found.forces.pressure, slow.forces.pressure, rtol=0, atol=atol)
        assert np.allclose(found.forces.friction, slow.forces.friction, rtol=0, atol=atol)


@pytest.mark.core
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("f2", [-0.005, -0.05])
def test_newton_and_block_relaxation_agree_on_the_bar(degree, f2):
    friction = Friction(ConstantCoefficient(0.5))
    pair = [mechanics.bar(SELF, 8, f2, degree=degree, friction=friction) for _ in range(2)]
    compare(*pair, 1e-7)


@pytest.mark.core
def test_they_agree_in_space_where_sliding_nodes_turn():
    compare(mechanics.leaning_block(SELF), mechanics.leaning_block(SELF), 1e-7)


@pytest.mark.core
def test_they_agree_with_a_smoothed_pressure():
    friction = Friction(ConstantCoefficient(0.5), radius=0.3)
    pair = [mechanics.bar(SELF, 8, friction=friction) for _ in range(2)]
    compare(*pair, 1e-7)


@pytest.mark.core
def test_they_agree_with_tresca_friction():
    friction = Friction(tresca=mechanics.constant(0.002, 2))
    pair = [mechanics.bar(SELF, 8, friction=friction) for _ in range(2)]
    compare(*pair, 1e-7)


@pytest.mark.parametrize("rho", [0.0, 1e5])
@pytest.mark.parametrize("radius", [0.0, 0.1])
def test_newton_stays_at_a_solution_that_rounding_has_touched(rho, radius):
    """Block relaxation leaves small pressures on open nodes, and friction of any direction."""
    friction = Friction(SlipCoefficient(0.5, 0.2, rho), radius=radius)
    problem = mechanics.bar(SELF, 16, -0.05, friction=friction)
    slow, outcome = FixedPoint(problem, FixedPointOptions(tolerance=1e-10)).solve()
    assert outcome.converged
    x, forces = slow.x, slow.forces
    slip = problem.nodes.tangential_component(problem.nodal(slow))
    rounding = 1e-11 * forces.pressure.max()
    is_open = forces.pressure < 1e3 * rounding
    assert is_open.any()
    pressure = np.where(is_open, rounding, forces.pressure)
    against = np.where(is_open[:, None], -rounding * np.sign(slip), 0.0)
    fast = Newton(problem, NewtonOptions(tolerance=1e-9))
    state, outcome = fast.solve(State(x, Multipliers(pressure, forces.friction + against)))
    assert outcome.converged
    assert len(fast.history) == 1  # no step
    assert np.allclose(state.x, x, rtol=0, atol=1e-8 * np.abs(x).max())


@pytest.mark.core
def test_the_last_steps_square_the_residual():
    law = Log(1.0, 0.3, yield_strain=0.01)
    problem = mechanics.bar(SELF, 16, -0.02, law=law, friction=Friction(ConstantCoefficient(0.4)))
    records = newton(problem, tolerance=1e-12, reuse="never").history
    before, after = records[-2].residuals.largest, records[-1].residuals.largest
    # gamma leaves 1e-4 of the interface residual, the material's part is squared
    assert after < max(2e-4 * before, 1e-13)


@pytest.mark.core
def test_a_body_that_only_contact_holds_is_solved():
    problem = mechanics.pressed_block(SELF, 3, gap=0.01)
    method = newton(problem)
    assert np.allclose(method.state.forces.pressure, 0.02, rtol=1e-9)


@dataclass(frozen=True)
class Fading:
    """s = mu p / (1 + p/p_0): the harder a node presses, the less of it is friction."""

    mu: float
    p_0: float

    lipschitz = 0.0

    @property
    def maximum(self):
        return self.mu

    def __call__(self, slip, pressure):
        return self.mu * pressure / (1 + pressure / self.p_0)

    def by_slip(self, slip, pressure):
        return 0 * slip

    def by_pressure(self, slip, pressure):
        return self.mu / (1 + pressure / self.p_0) ** 2


@pytest.mark.core
def test_friction_whose_coefficient_depends_on_the_pressure():
    law = Fading(0.6, 0.01)
    pair = [mechanics.bar(SELF, 8, -0.05, friction=Friction(law=law)) for _ in range(2)]
    compare(*pair, 1e-7)
    solution = solve(bar(8, -0.05, 1.0), friction=law)
    slides = solution.status == "slip"
    assert slides.any()
    size, pressure = np.linalg.norm(solution.friction, axis=1), solution.pressure
    assert np.allclose(size[slides], law(0.0, pressure[slides]), rtol=1e-6)


@pytest.mark.core
def test_the_iterative_solver_finds_the_same_solution():
    direct, iterative = mechanics.leaning_block(SELF, 4), mechanics.leaning_block(SELF, 4)
    exact = newton(direct, linear="lu")
    method = newton(iterative, linear="iterative")
    assert method.whole.step.operator.iterative
    assert np.allclose(exact.state.x, method.state.x, rtol=0, atol=1e-9)


@pytest.mark.core
def test_nested_meshes_change_nothing():
    plain = solve(bar_case(32), comm=SELF)
    nested = solve(bar_case(32, "solver.nested=true"), comm=SELF)
    assert plain.outcome.converged and nested.outcome.converged
    assert np.allclose(plain.forces.pressure, nested.forces.pressure, rtol=0, atol=1e-8)


def test_nested_levels_halve_the_cells():
    case = bar_case(64, "solver.nested=true")
    # A mesh of 65 x 17 nodes still pays; those below it are used when they are asked for.
    assert [c.mesh.cells for c in coarser_cases(case)] == [(64, 16), (128, 32)]
    assert [c.mesh.cells for c in coarser_cases(case, 2)] == [(128, 32)]
    assert coarser_cases(case, 5)[0].mesh.cells == (16, 4)


@pytest.mark.core
def test_a_condensed_body_is_solved_as_the_whole_one():
    problem = mechanics.bar(
        SELF, 8, law=Linear(1.0, 0.3), friction=Friction(ConstantCoefficient(0.5))
    )
    method = newton(problem)
    whole = newton(problem, condense=False)
    assert np.allclose(whole.state.x, method.state.x, rtol=0, atol=1e-9)


def pushed_block(push: float) -> dict:
    """Return a block that nothing but friction holds against a push along y."""
    return {
        "mesh": {"generator": "box", "size": [1.0, 1.0, 1.0], "cells": [2, 2, 2]},
        "material": {"law": "linear", "young": 1.0, "poisson": 0.3},
        "fixed": [{"on": "left", "displacement": [0.0, "free", "free"]}],
        "load": [{"on": "top", "traction": [0.0, push, -0.05]}],
        "contact": {"on": "bottom"},
        "friction": {"law": "coulomb", "mu": 0.4},
        "solver": {"tolerance": 1e-10},
    }


@pytest.mark.core
def test_friction_alone_may_hold_a_body():
    solution = solve(parse_case(pushed_block(0.004)), comm=SELF)
    assert solution.outcome.converged
    assert np.allclose(solution.contact_force[1:], [0.004, -0.05], rtol=1e-7)


@pytest.mark.core
def test_more_than_friction_can_hold_is_refused():
    with pytest.raises(InputError, match=r"\[pulled-off\]"):
        build_problem(parse_case(pushed_block(0.04)), SELF)


@pytest.mark.core
@pytest.mark.parallel(alone=False)
def test_ranks_agree():
    def quantities(method):
        forces, nodes = method.state.forces, method.problem.nodes
        return {"p": nodes.maximum(forces.pressure), "friction": nodes.norm(forces.friction)}

    agree(lambda comm: newton(mechanics.leaning_block(comm)), quantities, 1e-9)


@pytest.mark.parametrize("degree", [1, 2])
def test_an_iterative_solver_is_asked_for_more_digits_where_two_lead_nowhere(degree: int) -> None:
    """Two bodies that current and a plate join: with two digits contact nodes cycle."""
    case = parse_case(
        tomllib.loads(f"""
[mesh]
generator = "two_blocks"
lower_size = 0.3
upper_size = 0.22
[space]
degree = {degree}
[material]
young = 1.0
poisson = 0.3
piezo = {{ e31 = -0.3, e33 = 0.8, e15 = 0.6, beta11 = 1.0, beta33 = 0.9 }}
[[fixed]]
on = "lower_left"
displacement = [0.0, "free"]
[[rigid]]
on = "upper_top"
displacement = [0.002, "free"]
force = [0.0, -0.02]
[[electrode]]
on = "upper_top"
charge = 0.003
[[contact]]
on = "upper_bottom"
against = "lower_top"
friction = {{ law = "coulomb", mu = 0.3 }}
electric = {{ k_e = 2.0, delta = 5.0 }}
[[contact]]
on = "lower_bottom"
friction = {{ law = "coulomb", mu = 0.1 }}
electric = {{ k_e = 1.0, delta = 5.0 }}
""")
    )
    direct, iterative = (
        solve(case, NewtonOptions(tolerance=1e-9, condense=False, linear=kind))
        for kind in ("lu", "iterative")
    )
    assert iterative.converged
    np.testing.assert_allclose(iterative.contact_force, direct.contact_force, rtol=1e-7)
