"""Hencky's laws against an independent energy, written in NumPy from (1.11) and (7.8).

Assumption (h1), as it is reported, against the constants that each law is known to have.
"""

from itertools import pairwise

import numpy as np
import pytest
import ufl
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from forms.hencky import Linear, Log, UserLaw, energy_density, secant_stress, stress
from forms.kinematics import deviator_squared, von_mises
from forms.monotonicity import check_monotonicity
from forms.plane_stress import hencky_of, in_plane_stress
from tests.problems.materials import LAWS, XI

every_law = pytest.mark.parametrize("name", LAWS)


def modulus(name, t):
    """Return the secant modulus g(t) by the printed formulas."""
    law = LAWS[name]
    shear = law.young / 2 / (1 + law.poisson)
    if name == "linear":
        return shear
    if name == "user":
        return 0.3 + 0.5 * np.exp(-t / XI)
    xi, s = (XI, t) if law.argument == "norm" else (XI**2, t**2)
    g = shear if s <= xi else shear * xi / s * (np.log(s / xi) + 1)
    return max(g, law.g_min)


def energy(name, eps):
    """M of (1.11) for a plane or solid strain, by numerical integration."""
    law, full = LAWS[name], np.zeros((3, 3))
    full[: len(eps), : len(eps)] = eps
    dev = full - np.trace(full) / 3 * np.eye(3)
    t = np.sqrt(np.sum(dev**2))
    kinks = [k for k in kinks_of(name) if k < t]
    pieces = [0.0, *kinks, t]
    shear = sum(
        quad(lambda s: 2 * modulus(name, s) * s, a, b, epsabs=0, epsrel=1e-12)[0]
        for a, b in pairwise(pieces)
    )
    bulk = law.young / 3 / (1 - 2 * law.poisson)
    return bulk / 2 * np.trace(full) ** 2 + shear


def kinks_of(name):
    """Yield, and where the floor starts."""
    law = LAWS[name]
    if not isinstance(law, Log):
        return []
    start = np.sqrt(law._floor_start) if law.g_min > 0 else np.inf
    return [XI, start]


def number(expression):
    """Evaluate an expression without coordinates; UFL makes plain floats of some."""
    return float(expression if isinstance(expression, int | float) else expression(()))


def tensor(eps):
    return ufl.as_tensor(eps.tolist())


@st.composite
def strains(draw, dim):
    """Symmetric strains from far below to twelve times the yield strain."""
    entries = draw(st.lists(st.floats(-1, 1), min_size=9, max_size=9))
    size = draw(st.sampled_from([0.1, 0.9, 1.0, 1.1, 3.0, 12.0])) * XI
    eps = np.array(entries).reshape(3, 3)[:dim, :dim]
    return size * (eps + eps.T) / 2


both_strains = st.one_of(strains(2), strains(3))


@pytest.mark.core
@every_law
@given(eps=both_strains)
@settings(max_examples=40, deadline=None)
def test_energy(name, eps):
    expected = energy(name, eps)
    assert number(energy_density(LAWS[name], tensor(eps))) == pytest.approx(
        expected, rel=1e-9, abs=1e-16
    )


@pytest.mark.core
@every_law
@given(eps=both_strains)
@settings(max_examples=40, deadline=None)
def test_stress_is_the_derivative_of_the_energy(name, eps):
    sigma = np.array([[number(stress(LAWS[name], tensor(eps))[i, j]) for j in range(3)]
                      for i in range(3)])  # fmt: skip
    h = 1e-6 * XI
    for i in range(len(eps)):
        for j in range(len(eps)):
            # One entry, not the symmetric pair: M is a function of the symmetric part.
            step = np.zeros_like(eps)
            step[i, j] = step[j, i] = h
            slope = (energy(name, eps + step) - energy(name, eps - step)) / (2 * h)
            expected = slope if i == j else slope / 2
            assert sigma[i, j] == pytest.approx(expected, rel=2e-5, abs=1e-8)


@pytest.mark.core
@given(eps=strains(2))
@settings(max_examples=40, deadline=None)
def test_the_stress_out_of_the_plane(eps):
    """Plane strain is a solid whose eps_zz is held at 0: sigma_zz resists it."""
    law = LAWS["norm"]
    full = np.zeros((3, 3))
    full[:2, :2] = eps
    flat, solid = stress(law, tensor(eps)), stress(law, tensor(full))
    for i in range(3):
        for j in range(3):
            assert number(flat[i, j]) == pytest.approx(number(solid[i, j]), abs=1e-15)
    up, down = full.copy(), full.copy()
    h = 1e-6 * XI
    up[2, 2], down[2, 2] = h, -h
    slope = (energy("norm", up) - energy("norm", down)) / (2 * h)
    assert number(flat[2, 2]) == pytest.approx(slope, rel=2e-5, abs=1e-8)
    s = np.array([[number(flat[i, j]) for j in range(3)] for i in range(3)])
    dev = s - np.trace(s) / 3 * np.eye(3)
    assert number(von_mises(flat)) == pytest.approx(np.sqrt(1.5 * np.sum(dev**2)), abs=1e-15)


@pytest.mark.core
@given(eps=both_strains)
@settings(max_examples=30, deadline=None)
def test_deviator(eps):
    full = np.zeros((3, 3))
    full[: len(eps), : len(eps)] = eps
    dev = full - np.trace(full) / 3 * np.eye(3)
    assert number(deviator_squared(tensor(eps))) == pytest.approx(np.sum(dev**2), rel=1e-13)


@pytest.mark.core
@pytest.mark.parametrize("argument", ["norm", "square"])
def test_the_law_of_the_thesis(argument):
    law = Log(1.0, 0.3, yield_strain=XI, argument=argument)
    limit = XI if argument == "norm" else np.sqrt(XI)
    assert law.bulk == pytest.approx(1 / (3 - 6 * 0.3))
    assert law.shear == pytest.approx(1 / (2 + 2 * 0.3))
    below, at, above = (law.secant_modulus((f * limit) ** 2) for f in (0.5, 1.0, 1 + 1e-6))
    assert below == at == law.shear
    assert above == pytest.approx(law.shear, rel=1e-11)  # C1: the first difference is quadratic
    t = np.linspace(0, 10 * limit, 1001)
    for points in (t, t.tolist()[7]):
        q = np.square(points)
        assert np.all(law.secant_modulus(q) <= law.shear)
    symbolic = law.secant_modulus(ufl.as_ufl(float(t[700] ** 2)))
    assert number(symbolic) == pytest.approx(law.secant_modulus(t[700] ** 2), rel=1e-14)


@pytest.mark.parametrize("bad", [dict(argument="cube"), dict(g_min=-0.1), dict(g_min=0.5)])
def test_a_law_that_makes_no_sense_is_refused(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        Log(1.0, 0.3, yield_strain=XI, **bad)


@pytest.mark.core
def test_the_secant_stress_takes_the_modulus_from_the_frozen_strain():
    law = LAWS["norm"]
    frozen, eps = np.diag([4 * XI, -4 * XI]), np.diag([XI / 10, 0.0])
    sigma = secant_stress(law, tensor(frozen), tensor(eps))
    g = modulus("norm", np.sqrt(32) * XI)
    expected = (law.bulk - 2 * g / 3) * XI / 10 + 2 * g * XI / 10
    assert number(sigma[0, 0]) == pytest.approx(expected, rel=1e-12)


def test_a_law_without_a_value_is_refused():
    with pytest.raises(
        ValueError, match=r"modulus: the function returns \[nan\] at t = 0.*one finite number"
    ):
        UserLaw(1.0, 0.3, modulus=lambda t: (t - 1.0) ** 0.5)


@pytest.mark.core
def test_monotonicity_is_reported():
    law, t_max = Log(1.0, 0.3, yield_strain=XI), 0.4
    report = check_monotonicity(law, t_max)
    assert report.holds
    assert report.alpha == pytest.approx(law.shear * XI / t_max, rel=1e-3)
    assert report.beta == pytest.approx(law.shear, rel=1e-12)
    assert report.g_0 == pytest.approx(law.secant_modulus(t_max**2), rel=1e-12)
    assert report.largest == pytest.approx(law.shear, rel=1e-12)
    # With the square as the argument the law softens beyond xi = e xi_0.
    square = Log(1.0, 0.3, yield_strain=XI, argument="square")
    turn = np.sqrt(np.e * XI)
    assert check_monotonicity(square, 0.99 * turn).holds
    assert not check_monotonicity(square, 1.05 * turn).holds
    # A floor keeps (h1) on every range: alpha is the slope where the floor begins.
    floored = Log(1.0, 0.3, yield_strain=XI, g_min=0.1)
    start = np.sqrt(floored._floor_start)
    for t_max in (2 * start, 10 * start):
        alpha = check_monotonicity(floored, t_max, 20000).alpha
        assert alpha == pytest.approx(floored.shear * XI / start, rel=1e-2)
    assert check_monotonicity(Linear(1.0, 0.3), 0.0).holds


@pytest.mark.core
@pytest.mark.parametrize(("poisson", "dim", "holds"), [
    (-0.5, 2, False), (0.12, 2, False), (0.13, 2, True), (-0.01, 3, False), (0.01, 3, True),
])  # fmt: skip
def test_g_is_bounded_by_the_bulk_modulus(poisson, dim, holds):
    """(h1)(a): g <= (d/2) k_0, so nu >= 1/8 in the plane and nu >= 0 in space, g being mu_1."""
    report = check_monotonicity(Linear(1.0, poisson), 0.1, dim=dim)
    assert (report.hardens, report.bounded, report.holds) == (True, holds, holds)
    assert report.ceiling == pytest.approx(dim / 2 / (3 - 6 * poisson))


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.499])
def test_plane_stress_has_the_constants_of_its_material(poisson):
    """They were means with the stiffness across, 28 times too large at 0.499."""
    law, _ = in_plane_stress(Linear(2.0, poisson))
    assert (law.young, law.poisson) == pytest.approx((2.0, poisson))
    log = Log(2.0, 0.3, yield_strain=1e-3)
    assert hencky_of(in_plane_stress(log)[0]) == log
