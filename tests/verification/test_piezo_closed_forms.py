"""Closed forms 2 and 3: a piezoelectric column and a capacitor on a conductive foundation."""

import numpy as np
import pytest
from mpi4py import MPI

from contact.thesis.fixed_point import FixedPoint
from tests.problems.mechanics import solve
from tests.problems.piezo import PERMITTIVITY, SCALED, SI, Column, potential

COMM = MPI.COMM_WORLD

COLUMNS = {
    "insulated": Column(),
    "conductive": Column(k_e=1.0, phi_f=32.0),
    "driven": Column(k_e=0.3, phi_f=-5.0, top=7.0),
    "capacitor": Column(pressure=0.5, k_e=2.0, phi_f=32.0, top=3.0, coupling=0.0),
}


def errors(solver: FixedPoint, column: Column, units):
    """Return the largest relative errors of displacement and potential over all nodes."""
    s, phi_b = column.solution()
    body = solver.problem.body
    dim, height = body.dim, body.layout.points[:, -1]
    x = solver.state.x[: body.owned].reshape(-1, body.block_size)
    exact_u = s * height[:, None] * np.eye(dim)[-1]
    exact_phi = phi_b + (column.top - phi_b) * height / column.height
    phi = body.phi_scale * x[:, -1] / units.potential
    wrong_u = np.abs(x[:, :dim] - exact_u).max(initial=0) / abs(s * column.height)
    wrong_phi = np.abs(phi - exact_phi).max(initial=0) / max(abs(phi_b), abs(column.top))
    return COMM.allreduce(wrong_u, MPI.MAX), COMM.allreduce(wrong_phi, MPI.MAX)


@pytest.mark.core
def test_printed_values():
    assert Column().solution()[1] == pytest.approx(4.512861, abs=5e-7)
    s, phi = Column(k_e=1.0, phi_f=32.0).solution()
    assert (s, phi) == pytest.approx((-0.2538964, 12.663908), abs=5e-7)


@pytest.mark.core
def test_capacitor_formula():
    column = COLUMNS["capacitor"]
    biot = column.k_e * column.height / PERMITTIVITY["beta33"]
    expected = (column.top + biot * column.phi_f) / (1 + biot)
    assert column.solution()[1] == pytest.approx(expected, rel=1e-14)


@pytest.mark.core
@pytest.mark.parallel(2)
@pytest.mark.parametrize("units", [SCALED, SI], ids=["scaled", "SI"])
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("name", COLUMNS)
def test_column(name, dim, units):
    column = COLUMNS[name]
    problem = column.problem(COMM, dim, units)
    solver = solve(problem, 1e-12)
    assert max(errors(solver, column, units)) < 1e-10
    pressure = solver.state.multipliers.contact / units.stress
    assert np.allclose(pressure, column.pressure, rtol=1e-10)


@pytest.mark.core
@pytest.mark.parametrize(
    ("dim", "given"), [(2, {"degree": 2}), (3, {"degree": 2}), (2, {"perfect": True})]
)
def test_second_degree_and_perfect_conductor(dim, given):
    column = COLUMNS["conductive"]
    solver = solve(column.problem(COMM, dim, **given), 1e-12)
    assert max(errors(solver, column, SCALED)) < 1e-10


@pytest.mark.core
@pytest.mark.parametrize("dim", [2, 3])
def test_lagged_charge_has_the_same_limit(dim):
    column = Column(k_e=0.1, phi_f=32.0)
    problem = column.problem(COMM, dim, lagged=True)
    solver = solve(problem, 1e-12)
    assert max(errors(solver, column, SCALED)) < 1e-10
    assert len(solver.history) > 3


@pytest.mark.core
@pytest.mark.parallel(2)
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("name", ["insulated", "conductive"])
def test_units_do_not_matter(name, dim):
    """SI and scaled units: the same solution to 1e-8 after the same iterations."""
    column, runs = COLUMNS[name], []
    for units in (SCALED, SI):
        problem = column.problem(COMM, dim, units, mu=0.2)
        solver = solve(problem, 1e-12)
        phi = potential(problem, solver.state) / units.potential
        steps = [record.inner for record in solver.history]
        runs.append((problem.nodal(solver.state)[:, :dim], phi, steps))
    assert np.allclose(runs[0][0], runs[1][0], rtol=1e-8, atol=1e-8)
    assert np.allclose(runs[0][1], runs[1][1], rtol=1e-8, atol=1e-8)
    assert runs[0][2] == runs[1][2]
