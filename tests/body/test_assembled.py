"""Forces and operators of a body: derivatives of the assembled energy, whatever the law.

The terms of the residual of a body, each by its closed form for linear fields.
Forms of a large body are those of its parts.
"""

from dataclasses import replace

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

from contact import Body, Case, Contact, Elastic, Fixed, Linear, Load, build_problem, parse_case
from contact.body import materials
from contact.body.equilibrium import BodyEquilibrium
from contact.body.loads import assembled
from contact.history import BodyState
from contact.linear.layout import times
from contact.linear.operator import SparseOperator
from contact.mesh.domain import compiled
from contact.mesh.grid import rectangle
from contact.problem.problem import ContactProblem
from contact.problem.residuals import evaluate
from forms.hencky import energy_density
from forms.kinematics import strain
from tests.problems.materials import LAWS, XI
from tests.problems.mechanics import Affine, bar, leaning_block, pressed_block
from tests.problems.piezo import SCALED


def problems():
    for name, law in LAWS.items():
        yield f"{name} P1", bar(MPI.COMM_SELF, 4, law=law)
        yield f"{name} P2", bar(MPI.COMM_SELF, 2, law=law, degree=2)
    solid = leaning_block(MPI.COMM_SELF, 1, 2)
    yield "norm in space P2", solid
    floating = pressed_block(MPI.COMM_SELF, 3, 1)
    supported = Body(LAWS["norm"], [Fixed("left", [Affine((0.0,) * 3)] * 3)])
    yield (
        "norm in space P1",
        ContactProblem(
            floating.domain, supported, Contact("bottom", floating.contacts[0].foundation)
        ),
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
    inner = body.secant_forces(BodyState(np.where(free, x, 0.0), secant_at=x))
    matrix.mult(vector, product)
    assert np.abs(product.array - inner)[free].max() < 1e-13
    twice = body.secant_forces(BodyState(2 * x, secant_at=x))  # the frozen modulus stays
    assert np.abs(twice - 2 * forces).max() < 1e-13


COMM = MPI.COMM_WORLD


@pytest.mark.core
@pytest.mark.parallel(2)
@pytest.mark.filterwarnings("ignore:Load.force=")
def test_each_term_of_the_residual():
    """R(x; z) of [0, 2] x [0, 1] with u = (a x, b y), phi = c y, v = (x, 2 y), xi = 3 y."""
    a, b, c = 0.3, -0.2, 0.7
    law, crystal = Linear(58.7, 0.3), SCALED.crystal().in_plane()
    loads = [
        Load(body_force=[0.5, 0.25], body_charge=0.4),
        Load("top", traction=[1.0, -0.5], pressure=2.0, charge=0.3),
        Load("right", force=[0.8, 0.6]),
    ]
    elastic = Elastic("right", [3.0, 2.0], normal=5.0)
    fixed = Fixed("left", [0.0, 0.0], potential=0.0)
    described = Body(law, fixed, loads, piezo=crystal, elastic=elastic)
    body = BodyEquilibrium(rectangle(COMM, (0, 0), (2, 1), (4, 3)), described)

    points = body.layout.points
    x, z = (
        np.column_stack([points * scales[:2], scales[2] * points[:, 1] / body.phi_scale])
        for scales in np.array([[a, b, c], [1.0, 2.0, 3.0]])
    )
    body.forms.put(body.nodal(body.local(x.ravel())), np.zeros(0))
    terms = body.forms.residual(body.forms.split(ufl.TestFunction(body.space)))
    work = [assembled(compiled(term.form), body.owned) @ z.ravel() for term in terms]
    found = [COMM.allreduce(float(value), op=MPI.SUM) for value in work]

    strain, field = np.diag([a, b, 0.0]), np.array([0.0, c, 0.0])
    stress = (law.bulk - 2 / 3 * law.shear) * (a + b) * np.eye(3) + 2 * law.shear * strain
    stress += np.einsum("ijk,i->jk", crystal.e, field)
    charge = np.einsum("ijk,jk->i", crystal.e, strain) - crystal.beta @ field
    known = {
        "internal forces": 2 * (stress[0, 0] + 2 * stress[1, 1] + 3 * charge[1]),
        "elastic supports": (3 + 5) * 2 * a * 2 + 2 * b * 2 / 3,
        "body force": -(0.5 * 2 + 0.25 * 2),
        "traction": -(1.0 * 2 - 0.5 * 4),
        "resultant": -(0.8 * 2 + 0.6 * 1),
        "pressure": 2.0 * 4,
        "body charge": 0.4 * 3,
        "charge": -0.3 * 6,
    }
    assert found == pytest.approx([*known.values()], rel=1e-12, abs=1e-12)


def case(**material: object) -> Case:
    """Return a block on an elastic support, with some material."""
    return parse_case(
        {
            "title": "block",
            "mesh": {"generator": "box", "size": [2.0, 1.0, 1.0], "cells": [4, 2, 2]},
            "material": {"young": 1.0, "poisson": 0.3, **material},
            "fixed": [{"on": "left", "displacement": [0.0, 0.0, 0.0]}],
            "elastic": [{"on": "right", "normal": 0.1}],
            "load": [{"on": "top", "traction": [0.0, 0.005, -0.02]}],
            "contact": {"on": "bottom"},
            "friction": {"law": "coulomb", "mu": 0.3},
        }
    )


@pytest.mark.parallel
@pytest.mark.parametrize(
    "material",
    [{"law": "log", "yield_strain": 0.02}, {"law": "j2", "yield_stress": 0.01, "hardening": 0.1}],
)
def test_parts_add_up_to_the_body(
    material: dict[str, object], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Matrices and residuals are the same; ranks with few cells have as many parts, empty ones."""
    found = []
    for size in (materials.CHUNK, 5):
        monkeypatch.setattr(materials, "CHUNK", size)
        problem = build_problem(case(**material), COMM)
        body, state = problem.body, problem.start()
        x = np.sin(17.0 * body.layout.points).ravel() * 0.02
        state = type(state)(body.local(x), state.multipliers, state.time, state.history)
        matrix = body.create_matrix()
        products = []
        for kind in ("secant", "tangent", "secant"):
            body.assemble(matrix, kind, state)
            products.append(times(matrix, np.cos(np.arange(body.owned, dtype=float))))
        frozen = replace(state, secant_at=body.local(x / 2))
        forces = body.internal_forces(state), body.secant_forces(frozen)
        found.append((len(body.forms.secant), evaluate(problem, state), *products, *forces))
    (one, plain, *whole), (many, parted, *sums) = found
    assert many - one >= COMM.allreduce(body.cells[0].size, op=MPI.MAX) // 20 > 0
    assert plain.largest == pytest.approx(parted.largest, rel=1e-12)
    for values, other in zip(whole, sums, strict=True):
        np.testing.assert_allclose(values, other, rtol=0, atol=1e-13 * max(abs(values), default=1))
