"""Two elastic bodies against Hertz, Cattaneo and Mindlin."""

import numpy as np
import pytest

from contact import build_problem, load_case, parse_case, solve
from contact.results.contact_nodes import contact_table
from scripts.cases import CASES
from scripts.studies.cylinder_block import finite, half_planes
from scripts.studies.mindlin import turn, turn_of_cylinders
from scripts.studies.robustness.__main__ import AGREE, solved
from scripts.studies.robustness.problems import problems
from scripts.studies.two_bodies import approach, middle, pressed


def hertz_line(table, modulus, radius):
    """Return half width and largest pressure of Hertz's line contact, found over exact.

    The half width is found by the second moment of the pressure, a^2/4.
    """
    x, p = table["x"], table["pressure"]
    share = table["weight"] * p
    force = share.sum() * (2 if x.min() >= 0 else 1)
    a = np.sqrt(4 * force * radius / (np.pi * modulus))
    found = 2 * np.sqrt((share * x**2).sum() / share.sum())
    return found / a, p.max() / (2 * force / (np.pi * a)), a


def effective(first, second, poisson=0.3):
    """Return E* of two materials."""
    return 1 / ((1 - poisson**2) * (1 / first + 1 / second))


@pytest.mark.core
@pytest.mark.parametrize("mu", [0.0, 0.1])
def test_steel_cylinder_on_an_aluminium_block(mu):
    """NAFEMS R0094-1 (SSNP154): a 6.21 and p_0 3585.37 of Hertz at 35 kN a millimetre."""
    given = {
        "mesh": {"generator": "cylinder_on_block"},
        "material": [
            {"on": "cylinder", "young": 210e3, "poisson": 0.3},
            {"on": "block", "young": 70e3, "poisson": 0.3},
        ],
        "fixed": [
            {"on": "symmetry", "displacement": [0.0, "free"]},
            {"on": "block_bottom", "displacement": [0.0, 0.0]},
        ],
        "load": [{"on": "top", "traction": [0.0, -350.0]}],
        "contact": {"on": "arc", "against": "block_top"},
        "friction": {"law": "coulomb", "mu": mu} if mu else {"law": "none"},
    }
    solution = solve(parse_case(given))
    assert solution.converged
    table = contact_table(solution.contact)
    width, _, a = hertz_line(table, effective(210e3, 70e3), 50.0)
    assert a == pytest.approx(6.2146, rel=2e-3)
    # Friction narrows the contact of unlike materials a little; without it there is Hertz.
    expected, summit, _ = half_planes(mu, 100)
    assert width * a == pytest.approx(expected, rel=5e-3)
    assert table["pressure"].max() == pytest.approx(summit, rel=8e-3)
    assert expected == pytest.approx(a, rel=1e-3 if mu == 0 else 0.02)
    up = -solution.contact_force[1]
    assert up == pytest.approx(17500.0, rel=1e-9)
    assert middle(solution) == pytest.approx(-1.2710 if mu == 0 else -1.2649, rel=3e-3)


def test_a_contact_that_grows_sticks_in_more_of_it():
    """Half planes: Spence's ratio for beta/mu = 1.43, 0.40 where shear does not press, in steps."""
    _, once, static = half_planes(0.1, 100)
    _, summit, grown = half_planes(0.1, 100, steps=16)
    assert static < 0.2 and grown == pytest.approx(0.39, abs=0.02)
    assert summit == pytest.approx(once, rel=1e-3)


def test_finite_rotations_let_the_block_sink_deeper():
    """code_aster has them; the same law by other means tells what linear kinematics leaves out."""
    domain = build_problem(load_case(CASES / "cylinder-on-block.toml", ["mesh.contact_size=1.2"]))
    linear, rotated = (finite(domain.domain, 1.0, rotations, 1) for rotations in (False, True))
    assert rotated == pytest.approx(-1.3069, rel=6e-3)
    assert linear == pytest.approx(-1.2710, rel=6e-3)


@pytest.mark.parametrize(
    ("kinematics", "degree", "push"), [("axisymmetric", 1, 2.0), ("plane_strain", 2, 1.0)]
)
def test_round_bodies(kinematics, degree, push):
    """SSNV104's balls, and cylinders: Hertz's a, p_0 and approach at the force that acts."""
    errors = []
    for count in (5, 10, 20):
        small, large = (pressed(kinematics, degree, u, count) for u in (push / 4, push))
        found = [small.a, large.a, small.p_0, large.p_0, approach(small, large, kinematics)]
        errors.append(np.abs(np.array(found) - 1).max())
    assert errors[0] < 0.02 and errors[1] < 0.01 and errors[2] < 0.005


def test_loop_of_two_balls():
    """Mindlin and Deresiewicz: what friction takes of a turn is the area of the loop, in space."""
    loop = turn(poisson=0.0, elements=6, sectors=6, steps=2)
    assert 0.6 < loop.share < 0.8
    assert loop.area / loop.exact == pytest.approx(1, abs=0.07)
    assert loop.dissipation / loop.exact == pytest.approx(1, abs=0.03)


def test_loop_of_two_cylinders():
    """In the plane it is 5 % too large with six elements of degree 1, and converges."""
    assert turn_of_cylinders(elements=6, steps=2) == pytest.approx(1, abs=0.06)
    assert turn_of_cylinders(elements=12, steps=2, degree=2) == pytest.approx(1, abs=0.015)


@pytest.mark.core
def test_no_pressure_stands_on_an_axis():
    """Of degree 2 a function on the axis has the integral 0, and carries no multiplier."""
    for size in (0.5, 10 / 23):
        given = {
            "mesh": {"generator": "two_balls", "contact_size": size},
            "space": {"kinematics": "axisymmetric", "degree": 2},
            "material": {"young": 20e3, "poisson": 0.3},
            "fixed": [
                {"on": "upper_cut", "displacement": ["free", -2.0]},
                {"on": "lower_cut", "displacement": ["free", 2.0]},
            ],
            "contact": {"on": "upper_arc", "against": "lower_arc"},
        }
        table = contact_table(solve(parse_case(given)).contact)
        assert table["x"].min() > 0.1 * size and table["pressure"].max() < 3100


def test_curved_sides_of_degree_2():
    """Facets that bulge as the bodies do: pressures of neighbours lie on one curve."""
    case = load_case(CASES / "cylinder-on-block.toml", ["friction.mu=0", "space.degree=2"])
    table = contact_table(solve(case).contact)
    x, pressure = table["x"], table["pressure"]
    a = 6.2146
    near = x < 0.8 * a
    exact = 3585.4 * np.sqrt(1 - (x[near] / a) ** 2)
    np.testing.assert_allclose(pressure[near], exact, rtol=5e-3)


def half_cylinders(size, steps):
    """Press two half cylinders on each other, then push the upper one along."""
    return {
        "mesh": {
            "generator": "two_half_cylinders",
            "contact_size": size,
            "contact_width": 0.7,
        },
        "material": {"young": 1000.0, "poisson": 0.3},
        "fixed": [
            {"on": "upper_cut", "displacement": ["0.02*max(t-1,0)", "-0.1*min(t,1)"]},
            {"on": "lower_cut", "displacement": [0.0, 0.0]},
        ],
        "contact": {"on": "upper_arc", "against": "lower_arc"},
        "friction": {"law": "coulomb", "mu": 0.3},
        "evolution": {"times": [0.0, 1.0, 2.0], "steps": [1, steps]},
    }


@pytest.mark.core
def test_partial_slip_of_two_half_cylinders():
    """Cattaneo and Mindlin: c/a = sqrt(1 - Q/(mu P)), whatever the number of steps."""
    modulus, mu = effective(1000.0, 1000.0), 0.3
    away = []
    for size, steps in ((0.04, 1), (0.02, 2)):
        solution = solve(parse_case(half_cylinders(size, steps)))
        assert solution.converged
        table = contact_table(solution.contact)
        x, tau, weight = table["x"], np.abs(table["tau"]), table["weight"]
        width, pressure, a = hertz_line(table, modulus, 5.0)
        assert width == pytest.approx(1, abs=6e-3) and pressure == pytest.approx(1, abs=6e-3)
        share = (weight * tau).sum() / (mu * (weight * table["pressure"]).sum())
        assert 0.35 < share < 0.45
        c = a * np.sqrt(1 - share)
        sticks = np.abs(x[table["status"] == "stick"])
        spacing = np.diff(x[np.abs(x) < a]).mean()
        assert (sticks.max() + spacing / 2) / a == pytest.approx(c / a, abs=size)
        p_0 = 2 * (weight * table["pressure"]).sum() / (np.pi * a)
        full, inner = (np.sqrt(np.maximum(1 - (x / r) ** 2, 0)) for r in (a, c))
        exact = mu * p_0 * (full - c / a * inner)
        away.append(np.sqrt((weight * (tau - exact) ** 2).sum() / (weight * exact**2).sum()))
    assert away[1] < 0.05 and away[1] < 0.8 * away[0]


@pytest.mark.core
@pytest.mark.parametrize("seed", range(4))
def test_random_pairs(seed, tmp_path):
    """Newton's method converges; Uzawa's finds the same displacements."""
    (problem,) = problems("pairs", f"two_blocks-{seed}")
    row, solution = solved(problem, "newton", None, tmp_path)
    assert row["end"] == "right", row
    if seed < 2:
        row, _ = solved(problem, "uzawa", solution, tmp_path)
        assert row["end"] == "right" and row["difference"] <= AGREE, row
