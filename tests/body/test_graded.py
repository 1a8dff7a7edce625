"""Young's modulus as a field: a function that the stresses of a law are multiplied by."""

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI

from contact import (
    Body,
    Contact,
    Fixed,
    Friction,
    Linear,
    Load,
    Log,
    Material,
    NewtonOptions,
    Problem,
    solve,
)
from contact.mesh.domain import from_mesh
from contact.mesh.grid import rectangle
from contact.results.error_estimate import estimated
from contact.results.fields import DerivedFields

SELF, TIGHT = MPI.COMM_SELF, NewtonOptions(tolerance=1e-12)


def block(cells=8, regions=False, comm=SELF):
    plain = rectangle(comm, (0.0, 0.0), (2.0, 1.0), (2 * cells, cells))
    halves = {"left half": lambda x: x[0] <= 1 + 1e-9, "right half": lambda x: x[0] >= 1 - 1e-9}
    return from_mesh(plain.mesh, plain.parts, regions=halves if regions else None)


def pressed(domain, materials, degree=1):
    body = Body(materials, [Fixed("top", [0.005, -0.02])])
    contact = Contact("bottom", lambda x: 0.01 * (x[0] - 0.9) ** 2)
    problem = Problem(domain, body, contact, Friction(mu=0.3), degree=degree)
    solution = solve(problem, TIGHT)
    assert solution.converged
    return solution


def results(solution):
    """Return contact forces, von Mises stresses, and the estimated error with its norm."""
    multipliers = solution.state.multipliers
    fields = DerivedFields(solution.problem.body, solution.state)
    error = estimated(solution.problem, solution.state)
    return [
        multipliers.contact,
        multipliers.friction,
        fields.cells()["von_mises"].x.array,
        np.array([error.relative, error.energy]),
    ]


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("kind", ["linear", "log"])
def test_a_constant_factor_is_another_modulus(kind, degree):
    domain = block()

    def law(young):
        return Linear(young, 0.3) if kind == "linear" else Log(young, 0.3, yield_strain=0.01)

    one = results(pressed(domain, Material(law(3.0)), degree))
    other = results(pressed(domain, Material(law(2.0), factor=1.5), degree))
    for ours, theirs in zip(one, other, strict=True):
        assert ours == pytest.approx(theirs, rel=1e-9, abs=1e-12)


@pytest.mark.parallel
def test_a_factor_by_cell_is_a_region_by_itself():
    domain = block(regions=True, comm=MPI.COMM_WORLD)
    factor = fem.Function(fem.functionspace(domain.mesh, ("DG", 0)))
    factor.interpolate(lambda x: np.where(x[0] < 1, 1.0, 3.0))
    plain = [
        Material(Linear(1.0, 0.3), on="left half"),
        Material(Linear(3.0, 0.3), on="right half"),
    ]
    graded = Material(Linear(1.0, 0.3), on=["left half", "right half"], factor=factor)
    one, other = (pressed(domain, given) for given in (plain, graded))
    assert one.state.multipliers.contact == pytest.approx(
        other.state.multipliers.contact, abs=1e-12
    )
    assert one.state.x == pytest.approx(other.state.x, abs=1e-12)


@pytest.mark.core
def test_a_column_whose_modulus_grows_with_the_height():
    """u(1) = s int_0^1 dy/(1 + y) under a traction s."""
    body = Body(
        Material(Linear(1.0, 0.0), factor=lambda x: 1 + x[1]),
        [Fixed("left", [0.0, None]), Fixed("bottom", [None, 0.0])],
        [Load("top", traction=[0.0, -0.01])],
    )
    errors = []
    for degree, cells in ((1, 8), (1, 16), (2, 8)):
        problem = Problem(block(cells), body, Contact("right", 1.0), degree=degree)
        solution = solve(problem, TIGHT)
        top = problem.body.space.tabulate_dof_coordinates()[:, 1] > 1 - 1e-9
        moved = problem.body.nodal(solution.state.x)[top, 1].mean()
        errors.append(abs(moved / (-0.01 * np.log(2)) - 1))
    assert errors[0] > 3.5 * errors[1] and errors[2] < 1e-4
