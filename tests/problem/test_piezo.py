"""Piezoelectric bodies: poling, turned bodies, and the electric contact."""

import numpy as np
import pytest
from mpi4py import MPI

from contact import FixedPointOptions, InputError, Material, NewtonOptions
from contact.methods.newton import Newton
from contact.results.resultants import charge_balance
from contact.thesis.fixed_point import FixedPoint
from forms.laws import (
    RampConductivity,
)
from forms.piezo import (
    Piezo,
)
from tests.problems.mechanics import solve
from tests.problems.piezo import (
    COUPLING,
    PERMITTIVITY,
    SCALED,
    example,
    potential,
)

COMM = MPI.COMM_WORLD
CRYSTAL = SCALED.crystal()


def crystal_of(dim: int, **changes) -> Piezo:
    constants = {**COUPLING, **PERMITTIVITY, **changes}
    section = Material(young=1.0, poisson=0.3, piezo=constants)
    made = section.in_body(dim).piezo
    assert made is not None
    return made


def test_poling_of_the_case_file():
    assert np.array_equal(crystal_of(3).e, CRYSTAL.e)
    axis = np.array([1.0, -2.0, 0.5])
    turned = crystal_of(3, poling=axis.tolist())
    unit = axis / np.linalg.norm(axis)
    along = np.einsum("ijk,i,j,k", turned.e, unit, unit, unit)
    assert along == pytest.approx(COUPLING["e33"], rel=1e-14)
    assert unit @ turned.beta @ unit == pytest.approx(PERMITTIVITY["beta33"], rel=1e-14)
    # In the plane by an angle from x; upwards unless said otherwise.
    assert np.allclose(crystal_of(2).e, crystal_of(2, poling=90.0).e, atol=1e-14)
    right = crystal_of(2, poling=0.0)
    assert right.e[0, 0, 0] == pytest.approx(COUPLING["e33"], rel=1e-14)
    assert right.e[0, 1, 1] == pytest.approx(COUPLING["e31"], rel=1e-14)
    assert right.e[1, 0, 1] == pytest.approx(COUPLING["e15"], rel=1e-14)


def test_plane_body_refuses_a_crystal_that_leaves_the_plane(monkeypatch):
    monkeypatch.setattr("tests.problems.piezo.pzt", lambda *_: CRYSTAL.poled_along([1.0, 1.0, 1.0]))
    with pytest.raises(InputError, match=r"\[material-constants\]"):
        example(COMM, (4, 2))


def test_printed_ramp_does_not_conduct(monkeypatch):
    monkeypatch.setattr("tests.problems.piezo.ShiftedConductivity", RampConductivity)
    ramp = example(COMM, (16, 8), -10.0)
    bare = example(COMM, (16, 8), -10.0, k_e=0.0)
    found, expected = (potential(one, solve(one).state) for one in (ramp, bare))
    assert np.allclose(found, expected, rtol=1e-8)


@pytest.mark.core
def test_truncation_limits_the_charge():
    problem = example(COMM, (16, 8), -10.0, limit=3.0)
    solver = solve(problem)
    charge = charge_balance(problem, solver.state)
    assert np.abs(potential(problem, solver.state) - 32.0).min() > 3.0
    # The node at the clamped end is an electrode's; the foundation takes 3 k_e elsewhere.
    assert charge.foundation == pytest.approx(-3.0 * problem.nodes.weight.sum(), rel=1e-9)


OPTIONS = {Newton: NewtonOptions(), FixedPoint: FixedPointOptions()}


@pytest.mark.parametrize("limit", [np.inf, 1.0])
@pytest.mark.parametrize("method", OPTIONS)
def test_body_without_ground(method, limit):
    """The foundation alone sets the level of the potential, also where its charge is truncated."""
    found = []
    for phi_f in (0.0, 32.0):
        problem = example(COMM, (16, 8), -10.0, phi_f=phi_f, limit=limit, grounded=False)
        solver = method(problem, OPTIONS[method])
        assert solver.solve()[1].converged
        assert charge_balance(problem, solver.state).imbalance < 1e-8
        found.append(potential(problem, solver.state) - phi_f)
    assert np.allclose(found[0], found[1], rtol=1e-6, atol=1e-6)


@pytest.mark.core
@pytest.mark.parametrize("k_e", [1e-3, 1e-2, 1e-1])
def test_lagged_and_implicit_current_agree(k_e):
    found = []
    for lagged in (False, True):
        problem = example(COMM, (16, 8), k_e=k_e, lagged=lagged)
        solver = solve(problem)
        found.append((potential(problem, solver.state), len(solver.history)))
    assert np.allclose(found[0][0], found[1][0], rtol=1e-7, atol=1e-7)
    assert found[0][1] <= found[1][1]
