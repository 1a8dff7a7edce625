"""Semismooth Newton: against the block relaxation, its rate, nested meshes.

Cells that are stretched away from the foundation hide no error of the pressure.
A method that fails leaves the best of what it has met.
What the end of a solve says: `converged` and `reason` both come from the residuals.
"""

import tomllib
from dataclasses import dataclass

import numpy as np
import pytest
from mpi4py import MPI

from contact import load_case
from contact.case.build import build_problem
from contact.case.file import parse_case
from contact.errors import InputError
from contact.interface.multipliers import Multipliers
from contact.mesh.entities import elongation
from contact.mesh.grid import box, rectangle
from contact.methods.newton import Newton
from contact.methods.options import (
    OPTIONS,
    FixedPointOptions,
    NewtonOptions,
    PenaltyOptions,
    with_method,
)
from contact.methods.report import Best, Outcome, Stagnation
from contact.model.friction import Friction
from contact.problem.problem import ContactProblem
from contact.problem.residuals import Residuals, evaluate
from contact.problem.state import State
from contact.refining import coarser_cases
from contact.solving import solve
from contact.thesis.fixed_point import FixedPoint
from contact.thesis.penalty import Penalty
from forms.hencky import Log
from forms.laws import ConstantCoefficient, SlipCoefficient
from scripts.cases import bar
from tests.problems import mechanics
from tests.problems.clamped import clamped
from tests.problems.everywhere import agree
from tests.problems.mechanics import bar_case, newton

SELF = MPI.COMM_SELF


def compare(one: ContactProblem, other: ContactProblem, tolerance: float) -> None:
    """Solve one problem by Newton's method, condensed and whole, its twin by block relaxation."""
    slow, outcome = FixedPoint(other, FixedPointOptions(tolerance=1e-10)).solve()
    assert outcome.converged
    size = np.abs(slow.x).max()
    atol = tolerance * slow.multipliers.contact.max()
    for condense in (True, False):
        fast = newton(one, condense=condense)
        assert (fast.counters.contact_solves > 0) == condense
        found = fast.state
        assert np.allclose(found.x, slow.x, rtol=0, atol=tolerance * size)
        assert np.allclose(found.multipliers.contact, slow.multipliers.contact, rtol=0, atol=atol)
        assert np.allclose(found.multipliers.friction, slow.multipliers.friction, rtol=0, atol=atol)


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
    x, multipliers = slow.x, slow.multipliers
    slip = problem.nodes.tangential_component(problem.nodal(slow))
    rounding_stress = 1e-11 * multipliers.contact.max()
    is_open = multipliers.contact < 1e3 * rounding_stress
    assert is_open.any()
    pressure = np.where(is_open, rounding_stress, multipliers.contact)
    against = np.where(is_open[:, None], -rounding_stress * np.sign(slip), 0.0)
    fast = Newton(problem, NewtonOptions(tolerance=1e-9))
    state, outcome = fast.solve(State(x, Multipliers(pressure, multipliers.friction + against)))
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
    assert np.allclose(method.state.multipliers.contact, 0.02, rtol=1e-9)


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
    assert method.semismooth.step.operator.iterative
    assert np.allclose(exact.state.x, method.state.x, rtol=0, atol=1e-9)


@pytest.mark.core
def test_nested_meshes_change_nothing():
    plain = solve(bar_case(32), comm=SELF)
    nested = solve(bar_case(32, "solver.nested=true"), comm=SELF)
    assert plain.outcome.converged and nested.outcome.converged
    assert np.allclose(plain.multipliers.contact, nested.multipliers.contact, rtol=0, atol=1e-8)


def test_nested_levels_halve_the_cells():
    case = bar_case(64, "solver.nested=true")
    # A mesh of 65 x 17 nodes still pays; those below it are used when they are asked for.
    assert [c.mesh.cells for c in coarser_cases(case)] == [(64, 16), (128, 32)]
    assert [c.mesh.cells for c in coarser_cases(case, 2)] == [(128, 32)]
    assert coarser_cases(case, 5)[0].mesh.cells == (16, 4)


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
        multipliers, nodes = method.state.multipliers, method.problem.nodes
        return {
            "p": nodes.maximum(multipliers.contact),
            "friction": nodes.norm(multipliers.friction),
        }

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


def column(**solver):
    """Solve a sheared column of four rows of cells, each a hundred times as high as wide."""
    load = [{"on": "top", "traction": [2e-3, "-0.01*(1 + x/4)"]}]
    return solve(parse_case(clamped([4.0, 16.0], [100, 4], load=load, solver=solver)))


@pytest.mark.parametrize("r", [pytest.param(0.1, marks=pytest.mark.slow), 1.0])
def test_a_small_r_does_not_end_far_from_the_pressure(r):
    """It was 3e-5 off at a tolerance of 1e-8: E/size, of a body that high, weighed no gap."""
    exact = column(tolerance=1e-13).pressure
    found = column(method="uzawa", r=r, tolerance=1e-8, max_inner=20000)
    assert found.converged, found.outcome.reason
    assert np.abs(found.pressure - exact).max() <= 5e-6 * exact.max()


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        ((16, 4), 1.0),
        ((4, 400), 1.0),
        # (1/4) over twice 1/400, and in space by the shortest edge of facets
        ((1600, 4), 50.0),
        ((40, 40, 2), 0.5 / (2 / 40)),
        ((2, 2, 40), 1.0),
    ],
)
def test_how_much_longer_cells_are(cells, expected):
    if len(cells) == 2:
        domain = rectangle(SELF, (0.0, 0.0), (4.0, 1.0), cells)
    else:
        domain = box(SELF, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), cells)
    found = elongation(domain.mesh, domain.facets("bottom"))
    assert found == pytest.approx(expected, rel=0.01)


def test_the_least_residual_is_the_best_and_no_number_is_none():
    best: Best[str] = Best()
    for name, residual in (("lost", np.nan), ("far", np.inf)):
        best.see(name, residual)
    assert best.iterate is None
    for name, residual in (("a", 0.5), ("b", 0.1), ("c", 0.2), ("d", np.nan)):
        best.see(name, residual)
    assert best.iterate == "b"


@pytest.mark.parametrize("factor", [3.0, np.nan], ids=["worse", "no numbers"])
@pytest.mark.parametrize("stopping", ["residual", "thesis"])
@pytest.mark.parametrize(
    ("method", "options"), [(FixedPoint, FixedPointOptions), (Penalty, PenaltyOptions)]
)
def test_the_best_iterate_is_left_where_the_last_one_is_worse(
    monkeypatch, method, options, stopping, factor
):
    """Of the penalty method that ended without numbers, these were the solution."""
    problem = mechanics.bar(
        MPI.COMM_SELF, 4, -0.05, friction=Friction(ConstantCoefficient(0.5)), law=None
    )
    limits = options(tolerance=1e-14, max_outer=4)
    limits = mechanics.unchecked(limits, stopping=stopping, eps_fp=1e-30)
    solver, kind = method(problem, limits), type(problem.start())
    whole = solver._step

    def spoilt(*arguments):
        made = whole(*arguments)
        if len(solver.history) < 3:
            return made
        solver.state = kind(factor * solver.state.x, solver.state.multipliers)
        return made

    monkeypatch.setattr(solver, "_step", spoilt)
    state, outcome = solver.solve()
    assert not outcome.converged
    # The penalty method solves for equilibrium, and the laws hold as its penalties let them.
    name = "equilibrium" if method is Penalty else "largest"
    sizes = [getattr(record.residuals, name) for record in solver.history]
    assert not sizes[-1] <= min(sizes[:-1])
    if stopping == "residual":
        assert outcome.residuals == evaluate(problem, state)
        assert getattr(outcome.residuals, name) == min(sizes[:-1])
    else:
        assert getattr(outcome.residuals, name) == pytest.approx(sizes[-1], nan_ok=True)


@pytest.mark.parametrize(("rate", "given_up"), [(0.4, False), (0.8, False), (0.95, True)])
def test_steps_together_make_progress_where_they_halve_the_measure_in_time(rate, given_up):
    stagnation = Stagnation(limit=8, progress=0.5, cumulative=True)
    assert any(stagnation(rate**step) for step in range(40)) == given_up


def test_each_step_by_itself_is_compared_with_the_best_one():
    stagnation = Stagnation(limit=8, progress=0.5)
    assert [stagnation(0.8**step) for step in range(10)] == 8 * [False] + 2 * [True]


def test_what_rises_again_is_compared_with_the_last_progress():
    stagnation = Stagnation(limit=3, progress=0.5, cumulative=True)
    assert [stagnation(at) for at in (1.0, 0.6, 0.9, 0.45, 0.6, 0.5, 0.3)] == 6 * [False] + [True]
    assert stagnation.best == 0.3


ALLOWED = Residuals(1e-8, 1e-8, 1e-8)
MET = Residuals(1e-9, 0.0, 1e-10)
FLOORS = (5e-8, 0.0, 0.0)


@pytest.mark.core
@pytest.mark.parametrize("ended", ["", "not converged in 200 steps", "the residual stalled"])
def test_what_has_converged_is_said_to_have_met_its_residuals(ended):
    """The reason of a ring in a clearance was "not converged in 200 steps", with exit 0."""
    outcome = Outcome(MET, ALLOWED, ended)
    assert outcome.converged
    assert outcome.reason == "all residuals <= 1e-08"


@pytest.mark.core
@pytest.mark.parametrize(
    ("ended", "reason"),
    [
        ("", "the contact residual is 1.00e-06, above 1e-08"),
        ("not converged in 3 steps", "not converged in 3 steps: the contact residual is 1.00e-06"),
        ("it stalled at 3.1e-02", "it stalled at 3.1e-02: the contact residual is 1.00e-06"),
    ],
)
def test_a_residual_explains_a_failure(ended, reason):
    outcome = Outcome(Residuals(1e-9, 1e-6, 0.0), ALLOWED, ended)
    assert not outcome.converged
    assert outcome.reason.startswith(reason)


@pytest.mark.core
def test_a_residual_below_its_floor_alone_is_met_to_rounding():
    outcome = Outcome(Residuals(3e-8, 0.0, 0.0, FLOORS), ALLOWED, "stalled")
    assert outcome.converged
    words = "all residuals <= 1e-08, to rounding: the equilibrium residual is 3.00e-08, its floor "
    assert outcome.reason == words + "5.00e-08"
    beyond = Outcome(Residuals(6e-8, 0.0, 0.0, FLOORS), ALLOWED, "stalled")
    assert not beyond.converged and "to rounding" not in beyond.reason


@pytest.mark.core
def test_a_criterion_of_its_own_is_named():
    """Where the residuals are met, and where they are not."""
    words = "the thesis's criterion is met"
    assert Outcome(MET, ALLOWED, criterion=words).reason == words
    assert Outcome(Residuals(1.0, 0.0, 0.0), ALLOWED, criterion=words).reason.startswith(
        f"{words}, but "
    )


@pytest.mark.parametrize("most", [1, 5, 200])
@pytest.mark.parametrize("method", ["newton", "uzawa"])
def test_convergence_is_that_of_the_residuals_in_a_problem_built_anew(method, most):
    changes = ["mesh.cells=[32,8]", "friction.mu=0.6", "load.0.traction.1=-0.02"]
    case = load_case("scripts/cases/bar.toml", changes)
    solution = solve(case, with_method(case.solver, OPTIONS[method], max_outer=most))
    residuals, allowed = evaluate(build_problem(case), solution.state), solution.outcome.allowed
    names = "equilibrium", "contact", "friction"
    met = all(getattr(residuals, name) <= 1.01 * getattr(allowed, name) for name in names)
    assert solution.converged == met
    assert solution.converged or most < 200
