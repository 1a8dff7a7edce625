"""The mean dilatation: its mean by quadrature, P2-P0, Cook's membrane, and all kinds of bodies."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from petsc4py import PETSc

from contact import Body, InputError, parse_case, solve
from contact.body.elements import kinematics_of
from contact.body.equilibrium import BodyEquilibrium
from contact.history import BodyState
from contact.mesh.domain import revolved
from contact.mesh.grid import box, rectangle
from contact.results.fields import DerivedFields
from forms.elasticity import Anisotropic, isotropic
from forms.hencky import Linear, Log
from forms.kinematics import deviator_squared, strain
from scripts.studies.error_norms import errors
from tests.problems import mechanics
from tests.problems.bar import changed
from tests.problems.membrane import cook
from tests.problems.piezo import pzt
from tests.problems.quadrilaterals import unit_block
from tests.problems.revolution import Tube

MEAN = "mean_dilatation"


def domain_of(kind):
    if kind in ("quadrilateral", "hexahedron"):
        return unit_block(MPI.COMM_WORLD, kind, 2)
    if kind == "solid":
        return box(MPI.COMM_WORLD, (0, 0, 0), (1, 1.2, 0.8), (2, 2, 2))
    plane = rectangle(MPI.COMM_WORLD, (0.0, 0.0), (1.0, 1.3), (3, 3))
    return revolved(plane) if kind == "revolved" else plane


def any_quadratic(space):
    made = fem.Function(space)
    made.interpolate(
        lambda x: np.stack([
            x[0] * (1 + 2 * x[1] - x[0]) + x[2] * x[1], x[1] ** 2 * 3 + x[0] * x[1] - x[2] ** 2,
            x[0] * x[2] + 2 * x[2] ** 2 - x[1],
        ])[: space.dofmap.bs]
    )  # fmt: skip
    return made


@pytest.mark.parallel
@pytest.mark.parametrize(
    ("kind", "degree"),
    [
        ("plane", 2),
        ("solid", 2),
        ("revolved", 2),
        ("quadrilateral", 1),
        pytest.param("hexahedron", 1, marks=pytest.mark.slow),
    ],
)
def test_the_trace_is_its_mean_over_the_cell_and_the_deviator_stays(kind, degree):
    domain = domain_of(kind)
    u = any_quadratic(fem.functionspace(domain.mesh, ("Lagrange", degree, (domain.dim,))))
    plain, bar = strain(u, domain.kinematics), strain(u, kinematics_of(domain, MEAN))
    piece = ufl.TestFunction(fem.functionspace(domain.mesh, ("DG", 0)))
    dx = domain.dx(metadata={"quadrature_degree": 6})

    def by_cell(value):
        return fem.assemble_vector(fem.form(value * piece * dx)).array

    trace, change = ufl.tr(bar), deviator_squared(bar - plain)
    volume, mean, same, square, changed = (
        by_cell(value) for value in (1.0, ufl.tr(plain), trace, trace**2, change)
    )
    means = np.concatenate(domain.comm.allgather(mean / volume))
    assert np.ptp(means) > 0.5
    assert same == pytest.approx(mean, rel=1e-12, abs=1e-13)
    # Constant: the mean of the square is the square of the mean.
    assert square == pytest.approx(mean**2 / volume, rel=1e-11, abs=1e-13)
    assert changed == pytest.approx(0.0, abs=1e-13)


@pytest.mark.core
@pytest.mark.parametrize("kind", ["plane", "solid", "revolved"])
def test_it_is_p2_p0_with_the_pressure_condensed(kind):
    """Energy: of the deviator in full, and of a pressure that is constant in each cell."""
    domain, law = domain_of(kind), Linear(2.0, 0.49)
    body = BodyEquilibrium(domain, Body(law, ()), 2, MEAN)
    u = any_quadratic(body.space)
    x = u.x.array.copy()
    work = body.product(body.internal_forces(BodyState(x)), x)
    piece = ufl.TestFunction(fem.functionspace(domain.mesh, ("DG", 0)))
    dx, eps = domain.dx(metadata={"quadrature_degree": 6}), strain(u, domain.kinematics)
    shear, change, volume = (
        fem.assemble_vector(fem.form(value * piece * dx)).array
        for value in (deviator_squared(eps), ufl.tr(eps), 1.0)
    )
    expected = np.sum(2 * law.shear * shear + law.bulk * change**2 / volume)
    assert work == pytest.approx(expected, rel=1e-12)


STIFF = isotropic(2.0, 0.3) + np.diag([1.0, 0, 0, 0, 0, 0.3])
MATERIALS = {
    "linear": (Linear(2.0, 0.499), None),
    "yielding": (Log(2.0, 0.3, yield_strain=1e-3), None),
    "crystal": (Anisotropic(STIFF), None),
    "piezo": (Linear(2.0, 0.3), pzt(2)),
}


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("kind", ["plane", "revolved"])
def test_homogeneous_strains_have_the_forces_of_standard_elements(kind, material):
    domain, (law, piezo) = domain_of(kind), MATERIALS[material]
    forces = []
    for element in ("standard", MEAN):
        body = BodyEquilibrium(domain, Body(law, (), piezo=piezo), 2, element)
        r, z = body.space.tabulate_dof_coordinates()[:, :2].T
        x = body.nodal(body.zero_displacement())
        x[:, 0], x[:, 1] = 0.02 * r, 0.01 * r - 0.03 * z
        x[:, 2:] = (0.05 * z)[:, None]
        forces.append(body.internal_forces(BodyState(x.ravel())))
    scale = np.abs(forces[0]).max()
    assert scale > 1e-3
    assert forces[1] == pytest.approx(forces[0], rel=0, abs=1e-13 * scale)


@pytest.mark.parametrize(
    ("kind", "material"),
    [*(("plane", material) for material in MATERIALS), ("revolved", "linear")],
)
def test_the_tangent_is_symmetric_and_that_of_the_forces(kind, material):
    domain, (law, piezo) = domain_of(kind), MATERIALS[material]
    piezo = piezo and pzt(domain.dim)
    body = BodyEquilibrium(domain, Body(law, (), piezo=piezo), 2, MEAN)
    random = np.random.default_rng(3)
    x, step = (0.01 * random.standard_normal(body.zero_displacement().size) for _ in range(2))
    matrix = body.create_matrix()
    body.assemble(matrix, "tangent", BodyState(x))
    assert matrix.isSymmetric(1e-12 * matrix.norm())
    step *= body.free.ravel()  # not across the axis
    change = body.create_matrix().createVecs()[0]
    matrix.mult(PETSc.Vec().createWithArray(step), change)
    ahead, behind = (body.internal_forces(BodyState(x + t * step)) for t in (1e-6, -1e-6))
    slope = body.layout.mask((ahead - behind) / 2e-6)
    assert np.linalg.norm(slope - change.array) < 1e-6 * np.linalg.norm(slope)


@pytest.mark.core
def test_cooks_membrane_does_not_lock():
    """Both elements of degree 2 close in on one limit, P2 from below."""
    below, above = cook(64, 2), cook(64, 2, MEAN)
    assert below < above < 1.01 * below
    assert cook(16, 2) < cook(32, 2) < below < above < cook(32, 2, MEAN) < cook(16, 2, MEAN)
    assert cook(16, 2, MEAN) == pytest.approx(above, rel=5e-3)
    assert cook(32, 1) < 0.3 * below


def bar(element, **changes):
    data = changed(mesh__cells=[16, 4], space__degree=2, space__element=element, **changes)
    solution = solve(parse_case(data))
    assert solution.converged, solution.outcome.reason
    return solution


@pytest.mark.parametrize("law", ["linear", "log"])
def test_methods_agree(law):
    """Newton condenses the linear body; with LU and the yielding one it solves the sparse one."""
    limit = {"material__yield_strain": 0.02 if law == "log" else None}
    more = {"material__law": law, "friction__mu": 0.3, **limit}
    newton = bar(MEAN, **more)
    assert abs(newton.max_displacement / bar("standard", **more).max_displacement - 1) > 1e-5
    others = {"method": "newton", "linear": "lu"}, {"method": "uzawa"}, {"method": "penalty"}
    for options, rel in zip(others, (1e-7, 1e-6, 1e-2), strict=True):
        other = bar(MEAN, solver=options, **more)
        assert other.max_displacement == pytest.approx(newton.max_displacement, rel=rel)


@pytest.mark.parametrize("n", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_multigrid_in_space(n):
    found = []
    for linear in ("lu", "iterative"):
        block = parse_case({
            "mesh": {"generator": "box", "size": [2.0, 2.0, 1.0], "cells": [2 * n, 2 * n, n]},
            "space": {"degree": 2, "element": MEAN},
            "material": {"law": "linear", "young": 1.0, "poisson": 0.499},
            "fixed": [{"on": "top", "displacement": [0.0, 0.0, -0.02]}],
            "contact": {"on": "bottom", "gap": "0.01*((x - 1)**2 + (y - 1)**2)"},
            "friction": {"law": "coulomb", "mu": 0.3},
            "solver": {"linear": linear, "tolerance": 1e-9},
        })  # fmt: skip
        solution = solve(block)
        assert solution.converged, solution.outcome.reason
        found.append(solution.contact_force)
    assert found[1] == pytest.approx(found[0], rel=1e-6, abs=1e-9)


def test_the_stress_has_a_constant_mean_in_each_cell():
    solution = bar(MEAN)
    stress = DerivedFields(solution.problem.body, solution.state).cells()["stress"]
    trace = np.einsum("cpii->cp", stress.x.array[:].reshape(-1, 3, 3, 3))
    assert np.abs(np.ptp(trace, axis=1)).max() < 1e-12 * np.abs(trace).max()
    assert np.abs(np.ptp(trace, axis=0)).max() > 0.1 * np.abs(trace).max()


def test_degree_1_is_refused_with_the_reason():
    with pytest.raises(InputError, match=r"\[value\]"):
        BodyEquilibrium(domain_of("plane"), Body(Linear(1.0, 0.3), ()), 1, MEAN)
    with pytest.raises(InputError, match=r"\[value\]"):
        BodyEquilibrium(domain_of("plane"), Body(Linear(1.0, 0.3), ()), 2, "taylor_hood")


def test_a_nearly_incompressible_tube():
    """Lame's, revolved: the hoop strain is not linear in a cell; its mean is one over rings."""
    tube = Tube(law=Linear(1.0, 0.4999))
    found = []
    for n, element in ((4, "mean_dilatation"), (8, "mean_dilatation"), (8, "standard")):
        problem = tube.problem(n, 2, element=element)
        state = mechanics.state_of(problem, 1e-10)
        known = errors(problem.body, state.x, None)
        found.append((errors(problem.body, state.x, tube.displacement) / known).l2)
    assert found[1] < 4e-5 and found[1] < found[2] / 5
    assert found[0] > 6 * found[1]
