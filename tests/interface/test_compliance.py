"""The compliant layer and the current: laws, derivatives, closed forms of one column."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

from contact import InputError
from contact import solve as solve_case
from contact.body.description import Body, Fixed
from contact.interface.current import Conductor
from contact.interface.friction import Friction
from contact.interface.layer import Layer
from contact.interface.nodes import ContactNodes
from contact.interface.response import FoundationResponse
from contact.mesh.grid import box, rectangle
from contact.methods.fixed_point import FixedPoint
from contact.methods.newton import Newton
from contact.methods.options import OPTIONS, NewtonOptions, PenaltyOptions
from contact.problem.problem import Contact, ContactProblem
from forms.foundation import compliance
from forms.hencky import Linear
from forms.laws import (
    Compliance,
    ConstantCoefficient,
    PotentialFactor,
    RampConductivity,
    ShiftedConductivity,
    Truncation,
)
from forms.ops import positive_part
from tests.problems.compliance import PIEZO_REGIMES, REGIMES, LayerColumn
from tests.problems.mechanics import affine_vector, flat, leaning_block, solve


def random_nodes(n: int, dim: int, block_size: int, rng: np.random.Generator) -> ContactNodes:
    """Return contact nodes without a mesh, for the pointwise laws."""
    normal = rng.standard_normal((n, dim))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    tangent = np.eye(dim) - normal[:, :, None] * normal[:, None, :]
    return ContactNodes(
        MPI.COMM_SELF,
        np.arange(n, dtype=np.int32),
        np.zeros((n, dim)),
        np.ones(n),
        normal,
        tangent,
        rng.uniform(0.0, 0.4, n),
        block_size,
    )


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("psi", [ShiftedConductivity(0.7, 2.0), RampConductivity(0.7, 2.0)])
def test_jacobian_is_the_derivative_of_the_force(dim, psi):
    rng = np.random.default_rng(3)
    nodes = random_nodes(200, dim, dim + 1, rng)
    layer = Layer(0.2, Compliance(0.3), PotentialFactor(5.0, 2.0, 3.0))
    response = FoundationResponse(nodes, layer, Conductor(psi, 1.5, Truncation(4.0)), 1.7, 1.0)
    x = rng.standard_normal((200, dim + 1))
    pressure = response.layer_pressure(x) - 100.0  # no node presses on the rigid part
    jacobian = response.jacobian(x, pressure)
    assert np.count_nonzero(jacobian[:, 0, -1]) > 20  # layer reached, h_nu rising
    assert np.count_nonzero(jacobian[:, -1, 0]) > 20
    h = 1e-7
    for k in range(dim + 1):
        step = np.zeros(dim + 1)
        step[k] = h
        slope = (response.force(x + step, pressure) - response.force(x - step, pressure)) / (2 * h)
        assert np.abs(jacobian[:, :, k] - slope).max() < 1e-6


def test_block_is_the_symmetric_part_without_the_frozen_factors():
    rng = np.random.default_rng(4)
    nodes = random_nodes(50, 2, 3, rng)
    layer = Layer(0.2, Compliance(0.3), PotentialFactor(5.0, 1.0))
    conductor = Conductor(ShiftedConductivity(0.7, 0.0), 1.5)
    response = FoundationResponse(nodes, layer, conductor, 1.7, 1.0)
    x = rng.standard_normal((50, 3))
    block = response.block(x, np.zeros(50))
    assert np.allclose(block, block.transpose(0, 2, 1), rtol=1e-14)
    # Without dependence of h_nu on the potential and of psi on the gap nothing is left out.
    assert np.allclose(block, response.jacobian(x, np.zeros(50)), rtol=1e-14)


def check_column(column: LayerColumn, dim: int = 2, degree: int = 1, **options) -> str:
    """Compare the fixed point with the exact solution; return the regime."""
    problem = column.problem(dim, degree)
    check_solution(column, solve(problem, tolerance=1e-11, **options))
    return column.solution()[-1]


def check_solution(column: LayerColumn, loop: FixedPoint | Newton) -> None:
    u_n, potential, layer, rest, _ = column.solution()
    problem = loop.problem
    nodal = problem.nodal(loop.state)
    assert np.abs(problem.nodes.normal_component(nodal) - u_n).max() < 1e-10
    assert np.abs(problem.interface.response.layer_pressure(nodal) - layer).max() < 1e-10 * max(
        layer, 1
    )
    assert np.abs(loop.state.forces.pressure - rest).max() < 1e-10 * max(layer + rest, 1)
    if column.piezo:
        assert np.abs(problem.equilibrium.phi_scale * nodal[:, -1] - potential).max() < 1e-10


@pytest.mark.parametrize("regime", REGIMES)
@pytest.mark.parametrize(("dim", "degree"), [(2, 1), (2, 2), (3, 1)])
def test_elastic_column(regime, dim, degree):
    assert check_column(REGIMES[regime], dim, degree) == regime


@pytest.mark.parametrize("regime", PIEZO_REGIMES)
@pytest.mark.parametrize(("dim", "degree"), [(2, 1), (2, 2), (3, 1)])
def test_piezoelectric_column_with_potential_dependent_stiffness(regime, dim, degree):
    assert check_column(PIEZO_REGIMES[regime], dim, degree) == regime


@pytest.mark.parametrize("regime", PIEZO_REGIMES)
def test_insulated_piezoelectric_column_without_dependence(regime):
    column = replace(PIEZO_REGIMES[regime], k_e=0.0, h_nu=PotentialFactor(60.0))
    assert check_column(column) == regime


def test_current_through_a_gap_that_closes():
    column = replace(PIEZO_REGIMES["linear"], delta=4.0)
    assert check_column(column) == "linear"


@pytest.mark.parametrize("push", [0.3, 0.8, 2.0])
def test_no_rigid_part(push):
    column = LayerColumn(push, gap=np.inf, p_nu=Compliance(np.inf))
    assert check_column(column) == "linear"


@dataclass(frozen=True)
class Quadratic:
    """A user's law: p_nu(s) = [s]^+^2."""

    def __call__(self, s):
        return positive_part(s) ** 2

    def derivative(self, s):
        return 2 * positive_part(s)


@dataclass(frozen=True)
class Softening:
    """A user's stiffness: h_nu(s) = 900 / (1 + s^2/8)."""

    def __call__(self, s):
        return 900.0 / (1 + s**2 / 8)

    def derivative(self, s):
        return -900.0 * s / 4 / (1 + s**2 / 8) ** 2


@pytest.mark.parametrize("push", [0.05, 0.3, 2.0])
@pytest.mark.parametrize("piezo", [False, True])
def test_laws_of_the_user(push, piezo):
    column = LayerColumn(push, piezo, Quadratic(), Softening(), k_e=0.3)
    assert check_column(column) == {0.05: "open", 0.3: "linear", 2.0: "rigid"}[push]


#: With the layer linearised about an iterate, each slope leads back to the other state.
STIFF = LayerColumn(0.12, p_nu=Compliance(1e-4), h_nu=PotentialFactor(1e4))


def test_a_stiff_column_does_not_cycle_between_open_and_saturated():
    assert check_column(STIFF) == "linear"


@pytest.mark.parametrize(
    "column",
    [*REGIMES.values(), *PIEZO_REGIMES.values(), STIFF, replace(STIFF, gap=np.inf)],
    ids=[*REGIMES, *(f"piezo-{regime}" for regime in PIEZO_REGIMES), "stiff", "endless"],
)
def test_newton_on_columns(column):
    newton = Newton(column.problem(), NewtonOptions(tolerance=1e-11))
    assert newton.solve()[1].converged
    assert newton.counters.linear_solves <= 8
    check_solution(column, newton)


@pytest.mark.parametrize(
    "column",
    [*REGIMES.values(), *PIEZO_REGIMES.values(), STIFF, replace(STIFF, gap=np.inf)],
    ids=[*REGIMES, *(f"piezo-{regime}" for regime in PIEZO_REGIMES), "stiff", "endless"],
)
def test_penalty_on_columns(column):
    # Full steps would cycle between the open and the saturated layer.
    eps = 1e-7
    solution = solve_case(
        column.problem(), PenaltyOptions(eps_contact=eps, tolerance=1e-10, max_inner=50)
    )
    assert solution.converged, solution.outcome
    u_n, _, layer, rest, _ = column.solution()
    assert np.abs(solution.normal_displacement - u_n).max() < 1e-10 + 2 * eps * rest
    assert np.abs(solution.pressure - layer - rest).max() < 1e-9 + 100 * eps * rest


@dataclass(frozen=True)
class Made:
    """A law made of two functions."""

    value: Callable[[np.ndarray], np.ndarray]
    slope: Callable[[np.ndarray], np.ndarray]

    def __call__(self, s):
        return self.value(s)

    def derivative(self, s):
        return self.slope(s)


ONE, ZERO = (lambda s: 1.0 + 0 * s), (lambda s: 0 * s)
NO_LAYERS = {
    "presses before": Layer(0.2, Made(lambda s: 0.01 + positive_part(s), ONE), Made(ONE, ZERO)),
    "p_nu is negative": Layer(0.2, Made(lambda s: -positive_part(s), ONE), Made(ONE, ZERO)),
    "p_nu or its derivative is no number": Layer(0.2, Made(np.sqrt, ONE), Made(ONE, ZERO)),
    "h_nu is negative": Layer(0.2, Compliance(0.1), PotentialFactor(-1.0)),
    "h_nu or its derivative": Layer(0.2, Compliance(0.1), Made(lambda s: 1 / s, ZERO)),
    "p_nu has no method": Layer(0.2, positive_part, Made(ONE, ZERO)),
    "thickness is -0.1": Layer(-0.1, Compliance(0.1), PotentialFactor(1.0)),
    "thickness is nan": Layer(np.nan, Compliance(0.1), PotentialFactor(1.0)),
}


@pytest.mark.parametrize("words", NO_LAYERS)
def test_what_is_no_layer_is_refused(words):
    bare = leaning_block(MPI.COMM_SELF, 2)
    contact = replace(bare.contacts[0], layer=NO_LAYERS[words])
    with pytest.raises(InputError, match=words):
        ContactProblem(bare.domain, bare.body, contact)


def hump(s):
    return positive_part(s) * np.exp(-positive_part(s) / 0.05)


def hump_slope(s):
    return np.where(s > 0, (1 - s / 0.05) * np.exp(-positive_part(s) / 0.05), 0.0)


@pytest.mark.parametrize("method", ["uzawa", "newton", "penalty"])
def test_falling_law_is_solved_with_a_warning(method):
    column = LayerColumn(0.3, p_nu=Made(hump, hump_slope))
    solution = solve_case(column.problem(), OPTIONS[method](tolerance=1e-10))
    assert solution.converged, solution.outcome
    assert any("p_nu falls" in warning for warning in solution.warnings)
    assert np.allclose(solution.normal_displacement, column.solution()[0], rtol=0, atol=1e-8)


def test_layer_thicker_than_the_gap_presses_at_rest_with_a_warning():
    column = LayerColumn(0.0, touch=-0.1, gap=0.05)
    solution = solve_case(column.problem(), NewtonOptions(tolerance=1e-11))
    assert solution.converged
    assert any("presses on the body at rest" in warning for warning in solution.warnings)
    u_n, _, layer, _, _ = column.solution()
    assert layer > 1.0
    assert np.allclose(solution.normal_displacement, u_n, rtol=0, atol=1e-10)
    plain = solve_case(REGIMES["linear"].problem(), NewtonOptions())
    assert not any("layer" in warning or "p_nu" in warning for warning in plain.warnings)


@pytest.mark.parametrize("regime", ["linear", "saturated", "rigid"])
def test_lagged_layer_reaches_the_same_solution(regime):
    # As in the thesis; it contracts only where the layer is softer than the column.
    h_nu = PotentialFactor(15.0, 1.5, 8.0)
    pushes = {"linear": 0.18, "saturated": 0.3, "rigid": 0.8}
    for piezo in (False, True):
        column = LayerColumn(pushes[regime], piezo, h_nu=h_nu, p_nu=Compliance(0.06))
        assert check_column(replace(column, lagged=True)) == regime


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize(("c_nu", "rigid"), [(0.4, False), (0.2, True)])
def test_friction_bound_takes_the_layer_and_the_rigid_part_together(dim, c_nu, rigid):
    # Closed form 1, pressed into a layer: u = (s + gamma y, -depth - a y).
    squeeze, push, mu, depth = 0.01, 0.03, 0.5, 0.05
    law = Linear(1.0, 0.3)
    pressure = (law.bulk + 4 * law.shear / 3) * squeeze
    slip = push - mu * pressure / law.shear
    gradient, offset = np.zeros((dim, dim)), np.zeros(dim)
    gradient[0, -1], gradient[-1, -1] = push - slip, -squeeze
    offset[0], offset[-1] = slip, -depth
    imposed = affine_vector(gradient, offset)
    sides = ["left", "right", "top"] + ["front", "back"] * (dim == 3)
    if dim == 2:
        domain = rectangle(MPI.COMM_WORLD, [0.0, 0.0], [1.0, 1.0], [4, 3])
    else:
        domain = box(MPI.COMM_WORLD, [0.0] * 3, [1.0] * 3, [3, 3, 2])
    # The layer takes all of the pressure, or a part of it and the rigid part the rest.
    share = pressure * (0.3 if rigid else 1.0)
    gap = depth if rigid else depth + 0.01
    touch = depth - share / c_nu
    layer = Layer(gap - touch, Compliance(np.inf), PotentialFactor(c_nu))
    problem = ContactProblem(
        domain,
        Body(law, [Fixed(side, imposed) for side in sides]),
        Contact("bottom", flat(gap), layer),
        Friction(ConstantCoefficient(mu)),
    )
    loop = solve(problem, tolerance=1e-11)
    nodal = problem.nodal(loop.state)
    assert problem.nodes.size > 0
    assert np.abs(problem.nodes.normal_component(nodal) - depth).max() < 1e-10
    assert np.abs(problem.interface.response.layer_pressure(nodal) - share).max() < 1e-10
    assert np.abs(loop.state.forces.pressure - (pressure - share)).max() < 1e-10
    assert np.abs(loop.state.forces.friction[:, 0] - mu * pressure).max() < 1e-10
    assert np.abs(nodal[:, 0] - slip).max() < 1e-10


def test_the_form_j_1_is_the_nodal_force():
    column = PIEZO_REGIMES["linear"]
    problem = column.problem()
    body, state = problem.equilibrium, solve(problem).state
    u, phi = body.split(body.function(state.x))
    v, _ = body.split(ufl.TestFunction(body.space))
    nu = ufl.FacetNormal(problem.domain.mesh)
    ds = problem.domain.ds("bottom")(metadata={"quadrature_rule": "vertex", "quadrature_degree": 1})
    form = compliance(u, v, nu, column.p_nu, column.h_nu, column.touch, phi - column.phi_f)
    vector = fem.assemble_vector(fem.form(form * ds)).array
    nodal = np.zeros_like(vector)
    pressure = problem.interface.response.layer_pressure(problem.nodal(state))
    nodes = problem.nodes
    nodes.transpose((nodes.weight * pressure)[:, None] * nodes.normal, nodal)
    assert np.abs(nodal).max() > 1.0
    assert np.abs(vector - nodal).max() < 1e-12


@pytest.mark.parallel
def test_ranks_agree_on_a_layer_in_space(comm):
    # Held at the left, pressed and pushed on top, on a layer with a rigid part behind.
    def problem(comm):
        bare = leaning_block(comm, 3)
        layer = Layer(0.004, Compliance(0.003), PotentialFactor(4.0))
        contact = replace(bare.contacts[0], foundation=flat(0.005), layer=layer)
        return ContactProblem(bare.domain, bare.body, contact)

    found = []
    for ranks in (comm, MPI.COMM_SELF):
        loop = solve(problem(ranks), tolerance=1e-11)
        nodal, nodes = loop.problem.nodal(loop.state), loop.problem.nodes
        layer = loop.problem.interface.response.layer_pressure(nodal)
        found.append(
            [
                nodes.maximum(np.linalg.norm(nodal, axis=1)),
                nodes.sum(layer),
                nodes.sum(loop.state.forces.pressure),
                *(nodes.sum(column) for column in loop.state.forces.friction.T),
            ]
        )
    shared, alone = np.array(found)
    assert np.all(alone[:3] > 0)
    assert np.abs(shared - alone).max() < 1e-8 * np.abs(alone).max()
