"""The penalty method, Algorithm 3, against the multiplier solution of the same problem."""

from __future__ import annotations

import numpy as np
import pytest
from mpi4py import MPI

from contact import solve
from contact.case.build import build_problem
from contact.case.file import parse_case
from contact.errors import InputError
from contact.mesh import grid as domain
from contact.methods.options import FixedPointOptions, PenaltyOptions
from contact.model.body import Body, Fixed, Load
from contact.model.contact import Contact
from contact.model.formula import Expression
from contact.model.friction import Friction
from contact.model.obstacle import GapFunction, Plane
from contact.problem.problem import ContactProblem
from contact.thesis.fixed_point import FixedPoint
from contact.thesis.penalty import PenalisedLaw, Penalty, Regularisation
from forms.hencky import Linear
from forms.laws import ConstantCoefficient, SlipCoefficient
from tests.problems import mechanics
from tests.problems.clamped import clamped

ZERO = Expression(0.0)


def bar(cells: int = 8, load: float = -0.005, coefficient=None, degree: int = 1, **friction):
    """Return Example 7.2 on `cells` squares a unit length."""
    law = Friction(coefficient, **friction)
    return mechanics.bar(MPI.COMM_WORLD, cells, load, degree=degree, friction=law)


def relative(problem: ContactProblem, a, b) -> float:
    difference = problem.comm.allreduce(float(np.sum((a - b) ** 2)), op=MPI.SUM)
    return float(np.sqrt(difference / problem.comm.allreduce(float(np.sum(b**2)), op=MPI.SUM)))


@pytest.mark.core
@pytest.mark.parametrize("load", [-0.005, -0.05])
def test_error_and_pressure_fall_like_eps(load):
    problem = bar(load=load, coefficient=ConstantCoefficient(0.5))
    owned = problem.body.owned
    reference, outcome = FixedPoint(problem, FixedPointOptions(tolerance=1e-11)).solve()
    assert outcome.converged
    x = reference.x[:owned]
    errors, pressures = [], []
    for eps in (1e-7, 1e-8, 1e-9):
        state, outcome = Penalty(problem, PenaltyOptions(eps_contact=eps)).solve()
        assert outcome.converged, outcome.reason
        assert outcome.residuals.equilibrium <= 1e-8
        errors.append(relative(problem, state.x[:owned], x))
        pressure = reference.multipliers.contact
        difference = problem.nodes.norm(state.multipliers.contact - pressure)
        pressures.append(difference / problem.nodes.norm(pressure))
    assert np.log10(errors[1] / errors[2]) == pytest.approx(1.0, abs=0.1)
    assert np.log10(pressures[1] / pressures[2]) == pytest.approx(1.0, abs=0.1)
    assert errors[2] < 1e-5


@pytest.mark.core
@pytest.mark.parallel
def test_without_friction_the_penetration_is_eps_times_the_pressure():
    problem = bar()
    penalty = Penalty(problem, PenaltyOptions(eps_contact=1e-5))
    state, outcome = penalty.solve()
    assert outcome.converged
    assert len(penalty.history) == 1
    normal_gap = problem.interface.normal_gap(problem.nodal(state))
    touching = state.multipliers.contact > 0
    assert np.allclose(normal_gap[touching], -1e-5 * state.multipliers.contact[touching])
    # The Signorini residual is the penetration: c eps with c = E/size = 1/4.
    assert outcome.residuals.contact == pytest.approx(0.25e-5, rel=1e-6)


@pytest.mark.core
@pytest.mark.parametrize("material_step", ["secant", "tangent", "auto"])
def test_all_ways_lead_to_the_same_solution(material_step):
    problem = bar(load=-0.05, coefficient=SlipCoefficient(0.5, 0.2, 1e5))
    solutions = []
    for step in ("auto", material_step):
        options = PenaltyOptions(eps_contact=1e-3, material_step=step, tolerance=1e-10)
        state, outcome = Penalty(problem, options).solve()
        assert outcome.converged, outcome.reason
        solutions.append(state.x[: problem.body.owned])
    assert relative(problem, solutions[1], solutions[0]) < 1e-8


def stiff():
    """Return the solve of Example 7.2 with a small compliance, by implicit steps from early on.

    Full steps jumped between sticking and sliding nodes there, and were given up.
    """
    problem = bar(coefficient=SlipCoefficient(0.5, 0.2, 1e3))
    return Penalty(problem, PenaltyOptions(eps_contact=1e-7))


def test_small_eps_are_reached_from_larger_ones():
    """From zero, Algorithm 3 creeps and stalls there."""
    problem = bar(coefficient=SlipCoefficient(0.5, 0.2, 1e5))
    larger, outcome = Penalty(problem, PenaltyOptions(eps_contact=1e-8)).solve()
    assert outcome.converged
    penalty = Penalty(problem, PenaltyOptions(eps_contact=1e-9))
    smaller, outcome = penalty.solve(larger)
    assert outcome.converged, outcome.reason
    limit, outcome = FixedPoint(problem, FixedPointOptions(tolerance=1e-11)).solve(smaller)
    assert outcome.converged
    errors = [relative(problem, state.x, limit.x) for state in (larger, smaller)]
    assert errors[1] < 0.2 * errors[0]


def test_the_two_parameters_are_separate():
    problem = bar(coefficient=ConstantCoefficient(0.5))
    solutions = {}
    for contact, slip in ((1e-4, None), (1e-4, 1e-4), (1e-4, 1e-6)):
        options = PenaltyOptions(eps_contact=contact, eps_slip=slip)
        state, outcome = Penalty(problem, options).solve()
        assert outcome.converged
        solutions[contact, slip] = state.x[: problem.body.owned]
    same, other = solutions[1e-4, None], solutions[1e-4, 1e-6]
    assert relative(problem, same, solutions[1e-4, 1e-4]) < 1e-12
    assert relative(problem, other, same) > 1e-3


def test_thesis_stopping_counts_like_table_7_2():
    counts = []
    for eps in (1e-2, 1e-3, 1e-4):
        problem = bar(cells=16, coefficient=SlipCoefficient(0.5, 0.2, 1e5))
        options = PenaltyOptions(
            eps_contact=eps, stopping="thesis", material_step="secant", tolerance=1e-4
        )
        penalty = Penalty(problem, options)
        assert penalty.solve()[1].converged
        counts.append(len(penalty.history))
    assert counts == sorted(counts)
    assert 4 <= counts[0] <= 9  # 6 in the thesis, of another mesh


def test_a_stop_by_small_change_is_not_convergence():
    problem = bar(coefficient=SlipCoefficient(0.5, 0.2, 1e5))
    options = PenaltyOptions(eps_contact=1e-6, stopping="thesis", material_step="secant")
    _, outcome = Penalty(problem, options).solve()
    assert not outcome.converged
    assert "criterion is met, but the equilibrium residual" in outcome.reason


@pytest.mark.parametrize("radius", [0.0, 0.3])
def test_smoothed_pressure(radius):
    problem = bar(coefficient=ConstantCoefficient(0.5), radius=radius)
    reference, outcome = FixedPoint(problem, FixedPointOptions(tolerance=1e-10)).solve()
    assert outcome.converged
    state, outcome = Penalty(problem, PenaltyOptions(eps_contact=1e-8)).solve()
    assert outcome.converged, outcome.reason
    owned = problem.body.owned
    assert relative(problem, state.x[:owned], reference.x[:owned]) < 1e-4


@pytest.mark.core
@pytest.mark.parametrize("law", ["lagged", "implicit"])
@pytest.mark.parametrize("dim", [2, 3])
def test_blocks_are_the_derivative_of_the_forces(law, dim):
    box = (
        domain.rectangle(MPI.COMM_SELF, [0, 0], [1, 1], [3, 3])
        if dim == 2
        else domain.box(MPI.COMM_SELF, [0, 0, 0], [1, 1, 1], [2, 2, 2])
    )
    body = Body(Linear(1.0, 0.3), [Fixed("top", [ZERO] * dim)])
    gap = GapFunction(lambda x: np.zeros(len(x)))
    friction = Friction(SlipCoefficient(0.5, 0.2, 10.0))
    problem = ContactProblem(box, body, Contact("bottom", gap), friction)
    rng = np.random.default_rng(1)
    x, d = rng.normal(size=(2, problem.nodes.nodes.size, dim))
    eps = Regularisation(0.3, 0.2)
    interface = problem.interface
    model = PenalisedLaw(interface, eps, None if law == "implicit" else x + d)

    def forces(t: float):
        return model.multipliers(x + t * d).vectors(problem.nodes)

    step = 1e-6
    numerical = (forces(step) - forces(-step)) / (2 * step)
    exact = np.einsum("nij,nj->ni", model.block(x), d)
    assert np.allclose(numerical, exact, rtol=1e-6, atol=1e-7)


LAYER = {"law": "compliance", "stiffness": 1.0, "limit": np.inf}


@pytest.mark.parametrize(
    "layer",
    [
        {},
        {**LAYER, "layer": 0.1},
        {**LAYER, "layer": np.inf},
        {**LAYER, "layer": 0.1, "lagged": True},
    ],
    ids=["rigid", "layer", "no rigid part", "lagged"],
)
def test_the_tangent_is_the_derivative_of_the_residual(layer):
    square = domain.rectangle(MPI.COMM_SELF, [0, 0], [1, 1], [3, 3])
    load = Load("left", [Expression(0.02), Expression(0.01)])
    body = Body(Linear(1.0, 0.3), [Fixed("top", [ZERO] * 2)], [load])
    contact = Contact("bottom", GapFunction(lambda x: np.full(len(x), 0.05)), **layer)
    problem = ContactProblem(square, body, contact, Friction(SlipCoefficient(0.5, 0.2, 10.0)))
    options = PenaltyOptions(eps_contact=0.3, eps_slip=0.2, material_step="tangent")
    penalty = Penalty(problem, options)
    penalty.solve(problem.start())
    snes = penalty._solvers[False].snes
    x, way, exact, before, after = (snes.getSolution().duplicate() for _ in range(5))
    free = problem.body.free.ravel()[: x.size]
    x.array[:], way.array[:] = 0.1 * free * np.random.default_rng(1).normal(size=(2, x.size))
    tangent, step = snes.getJacobian()[0], 1e-6
    snes.computeJacobian(x, tangent)
    tangent.mult(way, exact)
    snes.computeFunction(x - step * way, before)
    snes.computeFunction(x + step * way, after)
    error = (after - before).array / (2 * step) - exact.array
    assert np.abs(error).max() < 1e-6 * np.abs(exact.array).max()


def test_friction_by_the_potential_is_that_of_the_pressure_of_the_layer():
    case = steel()
    case["mesh"]["cells"] = [4, 1]
    piezo = {"e31": -0.5, "e33": 1.0, "e15": 0.7, "beta11": 1.0, "beta33": 1.0}
    case["material"] = {"young": 1.0, "poisson": 0.3, "piezo": piezo}
    case["fixed"][0]["potential"] = 0.0
    case["contact"] |= {**LAYER, "layer": 0.3, "potential_range": 10.0}
    problem = build_problem(parse_case(case), MPI.COMM_SELF)
    x, d = 0.1 * np.random.default_rng(1).normal(size=(2, problem.nodes.size, 3))
    model, step = PenalisedLaw(problem.interface, Regularisation(0.3, 0.2)), 1e-6
    before, after = (model.multipliers(x + t * d).vectors(problem.nodes) for t in (-step, step))
    exact = np.einsum("nij,nj->ni", model.block(x), d)
    assert np.allclose((after - before) / (2 * step), exact, rtol=1e-6, atol=1e-9)


def block(fixed, gap: float, force: float = -0.1):
    square = domain.rectangle(MPI.COMM_WORLD, [0, gap], [1, 1], [4, 4])
    body = Body(Linear(1.0, 0.3), fixed, [Load("top", [ZERO, Expression(force)])])
    return ContactProblem(square, body, Contact("bottom", Plane((0.0, 0.0), (0.0, 1.0))))


@pytest.mark.parametrize("gap", [0.0, 0.2])
def test_a_body_that_only_the_foundation_holds(gap):
    problem = block([Fixed("left", [ZERO, None])], gap)
    penalty = Penalty(problem, PenaltyOptions(eps_contact=1e-6))
    state, outcome = penalty.solve()
    assert outcome.converged, outcome.reason
    assert np.allclose(state.multipliers.contact, 0.1)


def test_a_body_that_nothing_holds_does_not_converge():
    problem = block([Fixed("left", [ZERO, None])], 0.2, force=0.1)
    try:
        _, outcome = Penalty(problem, PenaltyOptions(max_outer=3, max_inner=50)).solve()
    except InputError as error:  # the factorisation found the singularity
        assert "singular" in str(error)
    else:
        assert not outcome.converged


def steel(**solver) -> dict:
    """Return a steel bar of 4 m by 1 m under 1 MPa, in SI units."""
    return clamped(
        [4.0, 1.0],
        [32, 8],
        material={"young": 210e9, "poisson": 0.3},
        load=[{"on": "top", "traction": [0.0, -1e6]}],
        friction={"law": "coulomb", "mu": 0.3},
        solver={"method": "penalty", **solver},
    )


def test_a_foundation_that_is_too_soft_is_no_convergence():
    solution = solve(parse_case(steel(eps_contact=1e-4)))
    assert not solution.converged
    assert solution.outcome.residuals.equilibrium < 1e-8
    assert "the contact residual is 1.00e+04" in solution.outcome.reason


def test_rounding_ends_the_inner_iterations():
    """With a stiffness of 1e14 no step makes the residual smaller: SNES must see it."""
    problem = block([Fixed("left", [ZERO, None])], 0.2)
    penalty = Penalty(problem, PenaltyOptions(eps_contact=1e-14, tolerance=1e-12, max_inner=5000))
    _, outcome = penalty.solve()
    assert not outcome.converged
    assert "the residual stalled at" in outcome.reason
    assert "eps_contact" in outcome.reason
