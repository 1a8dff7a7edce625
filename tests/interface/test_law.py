"""The foundation's answer node by node: derivatives, and the weak form that it stands for.

What is no layer is refused, and what is unusual of one is said.
"""

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
from contact.interface.foundation import FoundationLaw
from contact.interface.nodes import ContactNodes
from contact.methods.options import OPTIONS, NewtonOptions
from contact.model.foundation import Conductor, Layer
from contact.problem.problem import ContactProblem
from forms.foundation import compliance, electric_contact
from forms.laws import (
    Compliance,
    PerfectConductivity,
    PotentialFactor,
    RampConductivity,
    ShiftedConductivity,
    Truncation,
)
from forms.ops import positive_part
from tests.problems.compliance import PIEZO_REGIMES, LayerColumn
from tests.problems.mechanics import leaning_block, solve


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
        normal,
        tangent,
        rng.uniform(0.0, 0.4, n),
        np.zeros(n),
        block_size,
    )


@pytest.mark.core
def test_a_part_of_the_conductivity_is_that_of_a_smaller_k_e():
    rng = np.random.default_rng(5)
    nodes, x = random_nodes(50, 2, 3, rng), rng.standard_normal((50, 3))
    pressure = rng.uniform(-1.0, 1.0, 50)

    def foundation(k_e: float) -> FoundationLaw:
        conductor = Conductor(ShiftedConductivity(k_e, 2.0), 1.5, Truncation(1.0))
        return FoundationLaw(nodes, None, conductor, 1.7, 1.0)

    less, small = foundation(4.0).conducting(0.25), foundation(1.0)
    assert np.abs(less.charge(x, pressure)).max() > 0.1
    assert less.charge(x, pressure) == pytest.approx(small.charge(x, pressure))
    assert less.block(x, pressure, full=True) == pytest.approx(small.block(x, pressure, full=True))


@pytest.mark.core
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("psi", [ShiftedConductivity(0.7, 2.0), RampConductivity(0.7, 2.0)])
def test_jacobian_is_the_derivative_of_the_force(dim, psi):
    rng = np.random.default_rng(3)
    nodes = random_nodes(200, dim, dim + 1, rng)
    layer = Layer(0.2, Compliance(0.3), PotentialFactor(5.0, 2.0, 3.0))
    law = FoundationLaw(nodes, layer, Conductor(psi, 1.5, Truncation(4.0)), 1.7, 1.0)
    x = rng.standard_normal((200, dim + 1))
    pressure = law.layer_pressure(x) - 100.0  # no node presses on the rigid part
    jacobian = law.block(x, pressure, full=True)
    assert np.count_nonzero(jacobian[:, 0, -1]) > 20  # layer reached, h_nu rising
    assert np.count_nonzero(jacobian[:, -1, 0]) > 20
    h = 1e-7
    for k in range(dim + 1):
        step = np.zeros(dim + 1)
        step[k] = h
        slope = (law.force(x + step, pressure) - law.force(x - step, pressure)) / (2 * h)
        assert np.abs(jacobian[:, :, k] - slope).max() < 1e-6


@pytest.mark.core
def test_block_is_the_symmetric_part_without_the_frozen_factors():
    rng = np.random.default_rng(4)
    nodes = random_nodes(50, 2, 3, rng)
    layer = Layer(0.2, Compliance(0.3), PotentialFactor(5.0, 1.0))
    conductor = Conductor(ShiftedConductivity(0.7, 0.0), 1.5)
    law = FoundationLaw(nodes, layer, conductor, 1.7, 1.0)
    x = rng.standard_normal((50, 3))
    block = law.block(x, np.zeros(50))
    assert np.allclose(block, block.transpose(0, 2, 1), rtol=1e-14)
    # Without dependence of h_nu on the potential and of psi on the gap nothing is left out.
    assert np.allclose(block, law.block(x, np.zeros(50), full=True), rtol=1e-14)


@pytest.mark.core
def test_what_rounding_leaves_of_a_multiplier_conducts_nothing():
    """A body that hung free was said to have a known potential, after 1e-19 of a pressure."""
    nodes = random_nodes(3, 2, 3, np.random.default_rng(5))
    law = FoundationLaw(nodes, None, Conductor(PerfectConductivity(0.7), 1.5), 1.0, 1.0)
    # Open, pressed, and deep in but without a pressure: the constraint is about to press there.
    depth = nodes.gap + np.array([-0.5, 0.0, 0.1])
    x = np.column_stack([depth[:, None] * nodes.normal, np.zeros(3)])
    charge = law.charge(x, np.array([1e-19, 0.1, 0.0]))
    assert charge == pytest.approx([0.0, -0.7 * 1.5, -0.7 * 1.5], abs=0)
    layered = replace(law, layer=Layer(0.2, Compliance(0.3), PotentialFactor(5.0, 1.0)))
    x = np.column_stack([(nodes.gap - 0.1)[:, None] * nodes.normal, np.zeros(3)])
    assert layered.charge(x, layered.layer_pressure(x)) == pytest.approx([-0.7 * 1.5] * 3)


@pytest.mark.core
def test_the_forms_j_1_and_l_are_the_nodal_force_and_charge():
    column = replace(PIEZO_REGIMES["linear"], delta=4.0)
    problem = column.problem()
    body, state = problem.body, solve(problem).state
    u, phi = body.split(body.function(state.x))
    v, xi = body.split(ufl.TestFunction(body.space))
    nu = ufl.FacetNormal(problem.domain.mesh)
    ds = problem.domain.ds("bottom")(metadata={"quadrature_rule": "vertex", "quadrature_degree": 1})
    j_1 = compliance(u, v, nu, column.p_nu, column.h_nu, column.touch, phi - column.phi_f)
    psi, phi_l = ShiftedConductivity(column.k_e, column.delta), Truncation(np.inf)
    current = electric_contact(u, phi, xi, nu, psi, phi_l, column.gap, column.phi_f)
    nodes, law, nodal = problem.nodes, problem.interface.foundation, problem.nodal(state)
    pressure = law.layer_pressure(nodal)
    at_nodes = np.zeros((2, *nodal.shape))
    at_nodes[0, :, :2] = pressure[:, None] * nodes.normal
    at_nodes[1, :, 2] = body.phi_scale * law.charge(nodal, pressure)
    for form, given in zip((j_1, current), at_nodes, strict=True):
        vector = fem.assemble_vector(fem.form(form * ds)).array
        expected = np.zeros_like(vector)
        nodes.add_jump_transposed(nodes.weight[:, None] * given, expected)
        assert np.abs(expected).max() > 0.1
        assert np.abs(vector - expected).max() < 1e-12


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
NO_LAYERS = [
    Layer(0.2, Made(lambda s: 0.01 + positive_part(s), ONE), Made(ONE, ZERO)),
    Layer(0.2, Made(lambda s: -positive_part(s), ONE), Made(ONE, ZERO)),
    Layer(0.2, Made(np.sqrt, ONE), Made(ONE, ZERO)),
    Layer(0.2, Compliance(0.1), PotentialFactor(-1.0)),
    Layer(0.2, Compliance(0.1), Made(lambda s: 1 / s, ZERO)),
    Layer(0.2, positive_part, Made(ONE, ZERO)),
    Layer(-0.1, Compliance(0.1), PotentialFactor(1.0)),
    Layer(np.nan, Compliance(0.1), PotentialFactor(1.0)),
]


@pytest.mark.parametrize("layer", NO_LAYERS)
def test_what_is_no_layer_is_refused(layer):
    bare = leaning_block(MPI.COMM_SELF, 2)
    contact = bare.contacts[0].model_copy(update={"law": "compliance", "layer": layer})
    with pytest.raises(InputError, match=r"\[layer-law\]"):
        ContactProblem(bare.domain, bare.description, contact)


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


def test_layer_thicker_than_the_gap_presses_at_rest():
    column = LayerColumn(0.0, touch=-0.1, gap=0.05)
    solution = solve_case(column.problem(), NewtonOptions(tolerance=1e-11))
    assert solution.converged
    u_n, _, layer, _, _ = column.solution()
    assert layer > 1.0
    assert np.allclose(solution.normal_displacement, u_n, rtol=0, atol=1e-10)
    assert not any("p_nu" in warning for warning in solution.warnings)
