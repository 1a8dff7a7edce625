"""Semismooth Newton: against the block relaxation, its rate, its fall-backs, nested meshes."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from mpi4py import MPI

from contact.build import build_problem
from contact.case.file import Case, parse_case
from contact.case.nesting import coarser_cases
from contact.errors import InputError
from contact.interface.friction import Friction
from contact.interface.linearised import Moduli, linearise
from contact.interface.multipliers import Multipliers
from contact.interface.status import CLOSED, FREE, SLIDES, STICKS
from contact.methods.fixed_point import FixedPoint
from contact.methods.load_steps import load_steps
from contact.methods.newton import Newton
from contact.methods.options import FixedPointOptions, NewtonOptions
from contact.methods.report import Outcome
from contact.problem.kkt import KKT, evaluate
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.solving import solve
from forms.hencky import Linear, Log
from forms.laws import ConstantCoefficient, Coulomb, SlipCoefficient
from scripts.cases import bar
from tests.problems import mechanics

SELF = MPI.COMM_SELF


def newton(problem: ContactProblem, **options) -> Newton:
    method = Newton(problem, NewtonOptions(**{"tolerance": 1e-10, **options}))
    _, outcome = method.solve()
    assert outcome.converged, outcome
    return method


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


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("f2", [-0.005, -0.05])
def test_newton_and_block_relaxation_agree_on_the_bar(degree, f2):
    friction = Friction(ConstantCoefficient(0.5))
    pair = [mechanics.bar(SELF, 8, f2, degree=degree, friction=friction) for _ in range(2)]
    compare(*pair, 1e-7)


def test_they_agree_in_space_where_sliding_nodes_turn():
    compare(mechanics.leaning_block(SELF), mechanics.leaning_block(SELF), 1e-7)


def test_they_agree_with_a_smoothed_pressure():
    friction = Friction(ConstantCoefficient(0.5), radius=0.3)
    pair = [mechanics.bar(SELF, 8, friction=friction) for _ in range(2)]
    compare(*pair, 1e-7)


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
    assert len(fast.history.records) == 1
    assert np.allclose(state.x, x, rtol=0, atol=1e-8 * np.abs(x).max())


def test_the_last_steps_square_the_residual():
    law = Log(1.0, 0.3, yield_strain=0.01)
    problem = mechanics.bar(SELF, 16, -0.02, law=law, friction=Friction(ConstantCoefficient(0.4)))
    records = newton(problem, tolerance=1e-12, keep="never").history.records
    assert len(records) <= 12
    before, after = records[-2].kkt.largest, records[-1].kkt.largest
    # gamma leaves 1e-4 of the interface residual, the material's part is squared
    assert after < max(2e-4 * before, 1e-13)


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


def test_friction_whose_coefficient_depends_on_the_pressure():
    law = Fading(0.6, 0.01)
    pair = [mechanics.bar(SELF, 8, -0.05, friction=Friction(law=law)) for _ in range(2)]
    compare(*pair, 1e-7)
    solution = solve(bar(8, -0.05, 1.0), friction=law)
    slides = solution.status == "slip"
    assert slides.any()
    size, pressure = np.linalg.norm(solution.friction, axis=1), solution.pressure
    assert np.allclose(size[slides], law(0.0, pressure[slides]), rtol=1e-6)


def test_the_iterative_solver_finds_the_same_solution():
    direct, iterative = mechanics.leaning_block(SELF, 4), mechanics.leaning_block(SELF, 4)
    exact = newton(direct, linear="lu")
    method = newton(iterative, linear="iterative")
    assert method.whole.operator.iterative
    assert np.allclose(exact.state.x, method.state.x, rtol=0, atol=1e-9)


@pytest.mark.parametrize("dimension", [2, 3])
def test_blocks_are_the_derivative_of_the_contact_forces(dimension):
    """Compare with finite differences at a sliding and sticking iterate, away from kinks."""
    problem = mechanics.bar(SELF, 4) if dimension == 2 else mechanics.leaning_block(SELF, 2)
    friction = replace(problem.interface.friction, law=Coulomb(ConstantCoefficient(0.4)))
    interface = replace(problem.interface, friction=friction)
    rng = np.random.default_rng(3)
    nodal = 1e-3 * rng.standard_normal((problem.nodes.gap.size, dimension))
    n, nodes = nodal.shape[0], problem.nodes
    forces = Multipliers(
        rng.uniform(0.5, 1.0, n),
        np.einsum("nij,nj->ni", nodes.tangent, 0.3 * rng.standard_normal((n, dimension))),
    )
    moduli = Moduli(20.0, 20.0, 20.0)
    before = np.full(n, FREE, dtype=np.int8)
    base = linearise(interface, nodal, forces, moduli, before, forces.pressure * 0.4)
    assert {CLOSED + SLIDES, CLOSED + STICKS} <= set(base.status.tolist())
    sticks = base.status & STICKS > 0
    # a sticking node pushes with lambda + gamma u_tau, a pressed one with p + gamma (u_nu - rho)
    direction = 1e-6 * rng.standard_normal(nodal.shape)
    moved = linearise(interface, nodal + direction, forces, moduli, before, forces.pressure * 0.4)
    difference = moved.forces.vectors(problem.nodes) - base.forces.vectors(problem.nodes)
    predicted = np.einsum("nij,nj->ni", base.blocks, direction)[:, :dimension]
    assert np.allclose(difference[sticks], predicted[sticks], rtol=1e-6, atol=1e-12)
    normal = nodes.normal_component(difference)
    assert np.allclose(normal, nodes.normal_component(predicted), rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("softening", [0.25, np.inf])
def test_falling_friction_is_followed_as_far_as_allowed(softening):
    """With no limit, the block is the derivative of mu(|u_tau|) p along the slip."""
    problem = mechanics.bar(SELF, 4, friction=Friction(SlipCoefficient(0.5, 0.2, 1e3)))
    nodes = problem.nodes
    nodal = np.zeros((nodes.nodes.size, 2))
    nodal[:, 0] = 1e-3
    pressure = np.full(nodes.nodes.size, 0.5)
    forces = Multipliers(pressure, 0.3 * pressure[:, None] * [1.0, 0.0])
    moduli = Moduli(200.0, 20.0, 1e6)
    before = np.full(nodes.nodes.size, CLOSED + SLIDES, dtype=np.int8)
    base = linearise(problem.interface, nodal, forces, moduli, before, softening=softening)
    assert base.settled
    step = np.array([1e-8, 0.0])
    moved = linearise(problem.interface, nodal + step, forces, moduli, before, softening=softening)
    change = (moved.forces.friction - base.forces.friction)[:, 0] / step[0]
    assert np.all(change < -0.25 * 20.0)
    expected = np.maximum(change, -softening * moduli.nodal)
    assert np.allclose(base.blocks[:, 0, 0], expected, rtol=1e-4)


def bar_case(n: int, *changes: str) -> Case:
    """Return Example 7.2 with ten times its load and a constant mu."""
    return bar(n, -0.05, 1.0, "friction.mu=0.5", "solver.tolerance=1e-10", *changes)


def test_nested_meshes_save_steps_and_change_nothing():
    plain = solve(bar_case(32), comm=SELF)
    nested = solve(bar_case(32, "solver.nested=true"), comm=SELF)
    assert plain.outcome.converged and nested.outcome.converged
    assert nested.counters.factorizations < plain.counters.factorizations <= 2
    assert max(nested.counters.linear_solves, plain.counters.linear_solves) <= 8
    assert np.allclose(plain.forces.pressure, nested.forces.pressure, rtol=0, atol=1e-8)


def test_nested_levels_halve_the_cells():
    case = bar_case(64, "solver.nested=true")
    # A mesh of 65 x 17 nodes still pays; those below it are used when they are asked for.
    assert [c.mesh.cells for c in coarser_cases(case)] == [(64, 16), (128, 32)]
    assert [c.mesh.cells for c in coarser_cases(case, 2)] == [(128, 32)]
    assert coarser_cases(case, 5)[0].mesh.cells == (16, 4)


def test_a_linear_material_is_assembled_once_and_solved_exactly():
    problem = mechanics.bar(
        SELF, 8, law=Linear(1.0, 0.3), friction=Friction(ConstantCoefficient(0.5))
    )
    method = newton(problem)
    assert method.counters.factorizations == 1
    assert method.counters.linear_solves <= 2
    whole = newton(problem, condense=False)
    assert whole.counters.factorizations <= whole.counters.linear_solves <= 8


@pytest.mark.parametrize(
    ("friction", "note"),
    [
        (Friction(ConstantCoefficient(0.5)), "frozen friction"),
        (Friction(), "block relaxation"),
    ],
)
def test_slower_methods_take_over_where_newton_gives_up(friction, note):
    problem = mechanics.bar(SELF, 8, -0.05, friction=friction)
    method = newton(problem, max_iterations=2, condense=False)
    assert any(record.note.startswith(note) for record in method.history.records)


@pytest.mark.parametrize("method", ["newton", "uzawa"])
def test_the_number_of_outer_iterations_is_limited(method):
    solution = solve(bar_case(8, f"solver.method={method}", "solver.max_outer=2"), comm=SELF)
    assert not solution.outcome.converged
    # the frictionless start of the fixed point is its iteration 0
    assert len(solution.history.records) <= 3


def test_load_steps_that_end_early_have_not_converged():
    """The last step's convergence was taken for that of the whole load."""
    case = {
        "mesh": {"generator": "rectangle", "size": [40.0, 1.0], "cells": [80, 2]},
        "material": {"young": 1.0, "poisson": 0.3},
        "fixed": [{"on": side, "displacement": [0.0, 0.0]} for side in ("left", "right")],
        "load": [{"on": "top", "traction": [0.0, -3.90625e-5]}],
        "contact": {"on": "bottom", "gap": 0.3},
        "friction": {"law": "coulomb", "mu": 0.3},
    }
    problem = build_problem(parse_case(case), SELF)
    method = Newton(problem, NewtonOptions())
    loads: list[float] = []

    class FailsLate:
        """Two steps of load, the second of which fails."""

        search = method.search

        def run(self, iterate, note="", bound=None, goal=0.0):
            loads.append(iterate.state.time)
            residual = 0.0 if iterate.state.time <= 0.25 else 1.0
            kkt = KKT(residual, residual, residual)
            return iterate, Outcome(kkt, method.options.allowed, "" if residual == 0 else "no")

    iterate, outcome = load_steps(FailsLate())
    assert max(loads) > 0.25
    assert not outcome.converged
    assert "load steps ended at 0.25 of the load" in outcome.reason
    assert iterate.state.time == 1.0
    assert outcome.kkt == evaluate(problem, iterate.state)


def test_a_method_cannot_call_itself_converged(monkeypatch):
    """What it says of its end is one thing, the residuals of the whole problem another."""

    def boast(method: Newton, start=None):
        outcome = Outcome(KKT(0.0, 0.0, 0.0), KKT(1.0, 1.0, 1.0), "all is well")
        return method.problem.start(0.1), outcome

    monkeypatch.setattr(Newton, "solve", boast)
    solution = solve(bar_case(4), comm=SELF)
    assert not solution.converged
    assert solution.outcome.kkt == evaluate(solution.problem, solution.state)
    assert solution.state.time == 1.0
    assert "all is well, but the equilibrium residual is 1.00e+00" in solution.outcome.reason


def test_the_best_iterate_is_what_is_left_of_a_failure():
    """Where the limit ends the fall-backs, what they were left at may be far from anything."""
    problem = mechanics.bar(SELF, 8, -0.05, friction=Friction(ConstantCoefficient(0.5)))
    limits = NewtonOptions(tolerance=1e-14, condense=False, max_outer=6, max_iterations=3)
    method = Newton(problem, limits)
    state, outcome = method.solve()
    assert not outcome.converged
    assert "frozen friction" in method.history.records[-1].note
    assert outcome.kkt == evaluate(problem, state)
    assert outcome.kkt.largest == min(record.kkt.largest for record in method.history.records)


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


def test_friction_alone_may_hold_a_body():
    solution = solve(parse_case(pushed_block(0.004)), comm=SELF)
    assert solution.outcome.converged
    assert np.allclose(solution.contact_force[1:], [0.004, -0.05], rtol=1e-7)


def test_more_than_friction_can_hold_is_refused():
    with pytest.raises(InputError, match="pull the body off"):
        build_problem(parse_case(pushed_block(0.04)), SELF)


@pytest.mark.parallel
def test_ranks_agree():
    world = MPI.COMM_WORLD
    shared, alone = mechanics.leaning_block(world), mechanics.leaning_block(SELF)
    method, reference = newton(shared), newton(alone)
    assert np.isclose(
        shared.nodes.maximum(method.state.forces.pressure),
        reference.state.forces.pressure.max(),
        rtol=1e-9,
    )
    assert np.isclose(
        shared.nodes.norm(method.state.forces.friction),
        alone.nodes.norm(reference.state.forces.friction),
        rtol=1e-9,
    )
