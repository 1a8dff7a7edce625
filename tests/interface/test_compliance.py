"""The compliant layer and the current: closed forms of one column, by each method."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from mpi4py import MPI

from contact import solve as solve_case
from contact.mesh.grid import box, rectangle
from contact.methods.newton import Newton
from contact.methods.options import NewtonOptions, PenaltyOptions
from contact.model.body import Body, Fixed
from contact.model.contact import Contact
from contact.model.foundation import Layer
from contact.model.friction import Friction
from contact.problem.problem import ContactProblem
from contact.thesis.fixed_point import FixedPoint
from forms.hencky import Linear
from forms.laws import (
    Compliance,
    ConstantCoefficient,
    PotentialFactor,
)
from forms.ops import positive_part
from tests.problems.compliance import PIEZO_REGIMES, REGIMES, LayerColumn
from tests.problems.everywhere import agree
from tests.problems.mechanics import affine_vector, flat, leaning_block, solve


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
    assert np.abs(problem.interface.foundation.layer_pressure(nodal) - layer).max() < 1e-10 * max(
        layer, 1
    )
    assert np.abs(loop.state.multipliers.contact - rest).max() < 1e-10 * max(layer + rest, 1)
    if column.piezo:
        assert np.abs(problem.body.phi_scale * nodal[:, -1] - potential).max() < 1e-10


@pytest.mark.core
@pytest.mark.parametrize("regime", REGIMES)
@pytest.mark.parametrize(("dim", "degree"), [(2, 1), (2, 2), (3, 1)])
def test_elastic_column(regime, dim, degree):
    assert check_column(REGIMES[regime], dim, degree) == regime


@pytest.mark.core
@pytest.mark.parametrize("regime", PIEZO_REGIMES)
@pytest.mark.parametrize(("dim", "degree"), [(2, 1), (2, 2), (3, 1)])
def test_piezoelectric_column_with_potential_dependent_stiffness(regime, dim, degree):
    assert check_column(PIEZO_REGIMES[regime], dim, degree) == regime


@pytest.mark.core
@pytest.mark.parametrize("regime", PIEZO_REGIMES)
def test_insulated_piezoelectric_column_without_dependence(regime):
    column = replace(PIEZO_REGIMES[regime], k_e=0.0, h_nu=PotentialFactor(60.0))
    assert check_column(column) == regime


@pytest.mark.core
def test_current_through_a_gap_that_closes():
    column = replace(PIEZO_REGIMES["linear"], delta=4.0)
    assert check_column(column) == "linear"


@pytest.mark.core
@pytest.mark.parametrize("push", [0.3, 0.8, 2.0])
def test_no_rigid_part(push):
    column = LayerColumn(push, gap=np.inf, p_nu=Compliance(np.inf))
    assert check_column(column) == "linear"


#: With the layer linearised about an iterate, each slope leads back to the other state.
STIFF = LayerColumn(0.12, p_nu=Compliance(1e-4), h_nu=PotentialFactor(1e4))


def test_a_stiff_column_does_not_cycle_between_open_and_saturated():
    assert check_column(STIFF) == "linear"


#: Columns that Newton's method and the penalty method solve.
COLUMNS = {
    **REGIMES,
    **{f"piezo-{regime}": column for regime, column in PIEZO_REGIMES.items()},
    "stiff": STIFF,
    "endless": replace(STIFF, gap=np.inf),
}


@pytest.mark.core
@pytest.mark.parametrize("column", COLUMNS.values(), ids=COLUMNS)
def test_newton_on_columns(column):
    newton = Newton(column.problem(), NewtonOptions(tolerance=1e-11))
    assert newton.solve()[1].converged
    check_solution(column, newton)


@pytest.mark.parametrize("column", COLUMNS.values(), ids=COLUMNS)
def test_penalty_on_columns(column):
    # Full steps would cycle between the open and the saturated layer.
    eps = 1e-7
    solution = solve_case(
        column.problem(), PenaltyOptions(eps_contact=eps, tolerance=1e-11, max_inner=50)
    )
    assert solution.converged, solution.outcome
    u_n, _, layer, rest, _ = column.solution()
    assert np.abs(solution.normal_displacement - u_n).max() < 1e-10 + 2 * eps * rest
    assert np.abs(solution.pressure - layer - rest).max() < 1e-9 + 100 * eps * rest


@pytest.mark.parametrize("regime", ["linear", "saturated", "rigid"])
def test_lagged_layer_reaches_the_same_solution(regime):
    # As in the thesis; it contracts only where the layer is softer than the column.
    h_nu = PotentialFactor(15.0, 1.5, 8.0)
    pushes = {"linear": 0.18, "saturated": 0.3, "rigid": 0.8}
    for piezo in (False, True):
        column = LayerColumn(pushes[regime], piezo, h_nu=h_nu, p_nu=Compliance(0.06))
        assert check_column(replace(column, lagged=True)) == regime


@pytest.mark.core
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
    assert np.abs(problem.interface.foundation.layer_pressure(nodal) - share).max() < 1e-10
    assert np.abs(loop.state.multipliers.contact - (pressure - share)).max() < 1e-10
    assert np.abs(loop.state.multipliers.friction[:, 0] - mu * pressure).max() < 1e-10
    assert np.abs(nodal[:, 0] - slip).max() < 1e-10


@pytest.mark.core
@pytest.mark.parallel(alone=False)
def test_ranks_agree_on_a_layer_in_space():
    # Held at the left, pressed and pushed on top, on a layer with a rigid part behind.
    def problem(comm):
        bare = leaning_block(comm, 3)
        layer = Layer(0.004, Compliance(0.003), PotentialFactor(4.0))
        update = {"law": "compliance", "foundation": flat(0.005), "layer": layer}
        contact = bare.contacts[0].model_copy(update=update)
        return ContactProblem(bare.domain, bare.description, contact)

    def quantities(loop):
        nodal, nodes = loop.problem.nodal(loop.state), loop.problem.nodes
        layer, multipliers = (
            loop.problem.interface.foundation.layer_pressure(nodal),
            loop.state.multipliers,
        )
        sums = [
            nodes.sum(values) for values in (layer, multipliers.contact, *multipliers.friction.T)
        ]
        assert min(sums[:2]) > 0
        return {"displacement": nodes.maximum(np.linalg.norm(nodal, axis=1)), "sums": sums}

    agree(lambda comm: solve(problem(comm), tolerance=1e-11), quantities)


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
