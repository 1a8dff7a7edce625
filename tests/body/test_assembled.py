"""Forces and operators of a body: derivatives of the assembled energy, whatever the law."""

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI

from contact.body.description import Body
from contact.history import BodyState
from contact.linear.operator import SparseOperator
from contact.model.body import Fixed
from contact.model.contact import Contact
from contact.problem.problem import ContactProblem
from forms.hencky import energy_density
from forms.kinematics import strain
from tests.problems.materials import LAWS, XI
from tests.problems.mechanics import Affine, bar, leaning_block, pressed_block


def problems():
    for name, law in LAWS.items():
        yield f"{name} P1", bar(MPI.COMM_SELF, 4, law=law)
        yield f"{name} P2", bar(MPI.COMM_SELF, 2, law=law, degree=2)
    solid = leaning_block(MPI.COMM_SELF, 1, 2)
    yield "norm in space P2", solid
    floating = pressed_block(MPI.COMM_SELF, 3, 1)
    held = Body(LAWS["norm"], [Fixed("left", [Affine((0.0,) * 3)] * 3)])
    yield (
        "norm in space P1",
        ContactProblem(floating.domain, held, Contact("bottom", floating.contacts[0].foundation)),
    )


@pytest.fixture(scope="module")
def cases():
    return dict(problems())


NAMES = [f"{name} P{p}" for name in LAWS for p in (1, 2)]
NAMES += ["norm in space P2", "norm in space P1"]


def scattered(problem, seed):
    """Return a random displacement with strains around and beyond yield, and a direction."""
    random, unknowns = np.random.default_rng(seed), problem.body.owned
    size = 3 * XI / problem.domain.mesh.geometry.x.max()
    x = size * random.standard_normal(unknowns)
    direction = random.standard_normal(unknowns) * problem.body.free.ravel()
    return x, direction / np.linalg.norm(direction)


def operator_at(problem, kind, x):
    """Return the operator of the body, linearised at unknowns, without any blocks."""
    nodes, bs = problem.nodes.nodes, problem.body.block_size
    operator = SparseOperator(problem.body, nodes)
    operator.update(kind, BodyState(x), np.zeros((nodes.size, bs, bs)))
    return operator


@pytest.mark.core
@pytest.mark.parametrize("case", NAMES)
def test_internal_forces_are_the_derivative_of_the_assembled_energy(cases, case):
    """B(u; u, v) = d/dt M(u + t v), with shear strains and all."""
    problem, body = cases[case], cases[case].body
    base, direction = scattered(problem, 1)
    at = body.function(base)
    u, _ = body.split(at)
    degree = 1 if body.degree == 1 else 4
    dx = problem.domain.dx(metadata={"quadrature_degree": degree})
    stored = fem.form(energy_density(problem.description.law, strain(u)) * dx)
    work, h = float(body.internal_forces(BodyState(base)) @ direction), 1e-5 * XI
    energies = []
    for t in (2, 1, -1, -2):
        at.x.array[:] = base + t * h * direction
        energies.append(fem.assemble_scalar(stored))
    slope = (8 * (energies[1] - energies[2]) - (energies[0] - energies[3])) / (12 * h)
    assert work == pytest.approx(slope, rel=1e-5, abs=1e-9)


@pytest.mark.core
@pytest.mark.parametrize("case", NAMES)
def test_tangent_is_the_derivative_of_the_internal_forces(cases, case):
    problem, body = cases[case], cases[case].body
    base, direction = scattered(problem, 2)
    matrix = operator_at(problem, "tangent", base).matrix
    vector, product = matrix.createVecs()
    vector.array[:] = direction
    matrix.mult(vector, product)
    h = 1e-6 * XI
    forces = [body.internal_forces(BodyState(base + t * h * direction)) for t in (1, -1)]
    slope = np.where(problem.body.free.ravel(), (forces[0] - forces[1]) / (2 * h), 0.0)
    assert np.linalg.norm(product.array - slope) < 2e-4 * np.linalg.norm(slope)


@pytest.mark.parametrize("case", ["norm P1", "norm P2", "norm in space P2"])
def test_the_secant_form_with_frozen_modulus(cases, case):
    """B(u; v, w) is linear and symmetric in v and w; B(u; u, w) are the internal forces."""
    problem, body = cases[case], cases[case].body
    x, _ = scattered(problem, 3)
    forces = body.internal_forces(BodyState(x))
    matrix = operator_at(problem, "secant", x).matrix
    assert matrix.isSymmetric(1e-12)
    free = problem.body.free.ravel()
    vector, product = matrix.createVecs()
    # Columns of fixed unknowns are eliminated: take their displacement as 0.
    vector.array[:] = np.where(free, x, 0.0)
    inner = body.internal_forces(BodyState(np.where(free, x, 0.0)), secant_at=x)
    matrix.mult(vector, product)
    assert np.abs(product.array - inner)[free].max() < 1e-13
    twice = body.internal_forces(BodyState(2 * x), secant_at=x)  # the frozen modulus stays
    assert np.abs(twice - 2 * forces).max() < 1e-13
