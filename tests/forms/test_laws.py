"""Laws on the contact boundary: bounds, derivatives, and UFL against NumPy."""

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from hypothesis import given
from hypothesis import strategies as st
from mpi4py import MPI

from forms.laws import (
    Compliance,
    ConstantCoefficient,
    Coulomb,
    PerfectConductivity,
    PotentialFactor,
    RampConductivity,
    ShiftedConductivity,
    SlipCoefficient,
    Tresca,
    Truncation,
)

FRICTION = [
    ConstantCoefficient(0.3),
    SlipCoefficient(0.5, 0.2, 100.0),
    SlipCoefficient(0.5, 0.2, 6e7),
    SlipCoefficient(0.5, -0.2, 10.0),
    SlipCoefficient(0.5, 0.2, 0.0),
]
LAWS = [Coulomb(SlipCoefficient(0.5, 0.2, 10.0)), Tresca(np.array([0.1, 0.4]))]
#: Law, kinks.
OTHERS = [
    (Truncation(0.5), (-0.5, 0.5)),
    (Truncation(np.inf), ()),
    (RampConductivity(2.0, 3.0), (0.0, 1 / 3)),
    (ShiftedConductivity(2.0, 3.0), (-1 / 3, 0.0)),
    (Compliance(0.5), (0.0, 0.5)),
    (Compliance(np.inf), (0.0,)),
    (PotentialFactor(10.0, 2.0, 0.7), (-0.7, 0.0, 0.7)),
    (PotentialFactor(10.0), (0.0,)),
]
name = str


@pytest.mark.core
@pytest.mark.parametrize("mu", FRICTION, ids=name)
@given(a=st.floats(0, 10), b=st.floats(0, 10), scale=st.sampled_from([1e-8, 1e-3, 1.0, 1e3]))
def test_friction_coefficients_keep_their_bounds(mu, a, b, scale):
    s = scale * np.array([a, b])
    values = mu(s)
    assert np.all(values >= 0)
    assert np.all(values <= mu.maximum)
    tolerance = 1e-15 + 1e-12 * abs(s[0] - s[1])
    assert abs(values[0] - values[1]) <= mu.lipschitz * abs(s[0] - s[1]) * (1 + 1e-9) + tolerance


@pytest.mark.core
@pytest.mark.parametrize("mu", FRICTION, ids=name)
def test_the_bounds_of_friction_coefficients_are_sharp(mu):
    s = np.concatenate([[0.0], np.geomspace(1e-12, 1e12, 200)])
    assert mu(s).max() == pytest.approx(mu.maximum, rel=1e-6)
    assert np.abs(mu.derivative(s)).max() == pytest.approx(mu.lipschitz, rel=1e-12)


@pytest.mark.core
def test_the_coefficient_of_the_thesis():
    mu = SlipCoefficient(0.5, 0.2, 100.0)
    assert mu(0.0) == pytest.approx(0.6)
    assert mu(0.0101806) == pytest.approx(0.5 + 0.2 / (1.01806 + 2))
    assert (mu.maximum, mu.lipschitz) == pytest.approx((0.6, 0.05 * 100))


@pytest.mark.core
def test_a_coefficient_may_differ_from_node_to_node():
    mu = ConstantCoefficient(np.array([0.1, 0.4, 0.2]))
    assert mu.maximum == 0.4
    assert mu(np.zeros(3)).tolist() == [0.1, 0.4, 0.2]
    assert ConstantCoefficient(np.array([])).maximum == 0.0  # a rank without contact nodes


@pytest.mark.core
@pytest.mark.parametrize("law", LAWS, ids=name)
def test_friction_laws_know_their_derivatives(law):
    slip, pressure, h = np.array([0.02, 0.3]), np.array([0.5, 2.0]), 1e-6
    by_slip = (law(slip + h, pressure) - law(slip - h, pressure)) / (2 * h)
    by_pressure = (law(slip, pressure + h) - law(slip, pressure - h)) / (2 * h)
    assert np.allclose(law.by_slip(slip, pressure), by_slip, rtol=1e-6)
    assert np.allclose(law.by_pressure(slip, pressure), by_pressure, rtol=1e-6)
    assert np.all(law(slip, pressure) <= law.maximum * pressure)


def slopes(law, s, h=1e-6):
    return (law(s + h) - law(s - h)) / (2 * h)


@pytest.mark.core
@pytest.mark.parametrize("mu", FRICTION, ids=name)
def test_derivatives_of_friction_coefficients(mu):
    scale = 1 / max(getattr(mu, "rho", 1.0), 1.0)
    s = scale * np.linspace(0.01, 5, 50)
    expected = slopes(mu, s, 1e-5 * scale)
    assert mu.derivative(s) == pytest.approx(expected, rel=1e-6, abs=1e-9 / scale)


@pytest.mark.core
@pytest.mark.parametrize(("law", "kinks"), OTHERS, ids=name)
def test_derivatives_away_from_kinks(law, kinks):
    s = np.linspace(-2, 2, 401) + 1e-3
    for kink in kinks:
        s = s[np.abs(s - kink) > 1e-3]
    assert law.derivative(s) == pytest.approx(slopes(law, s), rel=1e-7, abs=1e-7)
    # At a kink: a value between the two slopes.
    for kink in kinks:
        left, right = law.derivative(np.array([kink - 1e-3, kink + 1e-3]))
        at = law.derivative(np.array([kink]))[0]
        assert min(left, right) - 1e-12 <= at <= max(left, right) + 1e-12


@pytest.mark.core
@pytest.mark.parametrize(("law", "kinks"), OTHERS, ids=name)
def test_laws_are_monotone_where_the_theory_needs_it(law, kinks):
    s = np.linspace(-2, 2, 401)
    if not isinstance(law, PotentialFactor):
        assert np.all(np.diff(law(s)) >= 0)
    assert np.all(np.isfinite(law(s)))


@pytest.mark.core
def test_values_of_the_printed_laws():
    assert Truncation(0.5)(np.array([-2.0, 0.1, 2.0])).tolist() == [-0.5, 0.1, 0.5]
    ramp, shifted = RampConductivity(2.0, 4.0), ShiftedConductivity(2.0, 4.0)
    assert ramp(np.array([-1.0, 0.0, 0.125, 1.0])).tolist() == [0.0, 0.0, 1.0, 2.0]
    assert shifted(np.array([-1.0, -0.125, 0.0, 1.0])).tolist() == [0.0, 1.0, 2.0, 2.0]
    assert Compliance(0.5)(np.array([-1.0, 0.2, 3.0])).tolist() == [0.0, 0.2, 0.5]
    factor = PotentialFactor(10.0, 2.0, 128.0)
    assert factor(np.array([0.0, -64.0, 128.0, 1e9])).tolist() == [10.0, 15.0, 20.0, 20.0]
    assert PerfectConductivity(3.0).at(None, None, np.array([True, False])).tolist() == [3.0, 0.0]


@pytest.fixture(scope="module")
def nodal():
    """Evaluate a law at the nodes of a compiled form, by the vertex rule."""
    domain = mesh.create_unit_interval(MPI.COMM_SELF, 60)
    space = fem.functionspace(domain, ("Lagrange", 1))
    s, v = fem.Function(space), ufl.TestFunction(space)
    dx = ufl.dx(domain, metadata={"quadrature_rule": "vertex", "quadrature_degree": 1})
    weight = fem.assemble_vector(fem.form(v * dx)).array.copy()

    def evaluate(law, values):
        s.x.array[:] = values
        if law(s) == 0:  # UFL has simplified it
            return np.zeros(len(values))
        return fem.assemble_vector(fem.form(law(s) * v * dx)).array / weight

    return evaluate


@pytest.mark.core
@pytest.mark.parametrize("law", [*FRICTION, *(law for law, _ in OTHERS)], ids=name)
def test_ufl_and_numpy_agree(law, nodal):
    s = np.linspace(0 if law in FRICTION else -2, 2, 61)
    assert nodal(law, s) == pytest.approx(law(s), rel=1e-13, abs=1e-15)
    slope = nodal(lambda x: law.derivative(x), s)
    assert slope == pytest.approx(law.derivative(s) + 0 * s, rel=1e-13, abs=1e-15)


@pytest.mark.core
def test_the_flag_of_the_perfect_conductor_in_ufl(nodal):
    law, s = PerfectConductivity(3.0), np.linspace(-1, 1, 61)
    flagged = nodal(lambda x: law.at(x, None, ufl.gt(x, 0.05)), s)
    assert flagged == pytest.approx(law.at(s, None, s > 0.05))
