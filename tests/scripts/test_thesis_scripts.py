"""Scripts beside the thesis on coarse meshes: set-ups, stopping by (6.40), refinement, norms."""

import numpy as np
import pytest

from contact import build_problem, solve
from contact.model.friction import Friction
from scripts.cases import bar
from scripts.reporting import Report
from scripts.studies import corner, pressure_convergence, refinement_8, sensitivity
from scripts.studies.dual_norm import DualNorm
from scripts.studies.hertz_exact import Line, Point
from scripts.thesis import setups, stopping_8_3
from tests.problems.written import rows_of


def test_constants_are_those_of_the_thesis(tmp_path):
    setups.constants(Report(tmp_path))
    for row in rows_of(tmp_path / "table-8-1.csv"):
        assert float(row["case file by the thesis"]) == pytest.approx(1.0, abs=1e-5)


def test_example_8_3_stops_after_two_iterations(tmp_path):
    stopping_8_3.main(["--coarse", "--out", str(tmp_path)])
    found = rows_of(tmp_path / "stopping-8-3.csv")
    (honest,) = [r for r in found if r["case"] == "as printed" and "solved" in r["inner loop"]]
    assert [int(honest[key]) for key in list(honest)[2:5]] == [2, 2, 2]
    (early,) = [r for r in found if r["case"] == "as printed" and "0.25 E" in r["inner loop"]]
    assert int(early["(6.40), phi scaled"]) > 2


def test_pressure_inside():
    """A pressure 1 + x over [0, 4] without half a unit at either end: 3 + 6."""
    x = np.array([0.0, 1.0, 2.5, 4.0])
    assert refinement_8.inside(x, 1 + x, 0.5) == pytest.approx(9.0)


def test_the_dual_norm_of_a_pressure_is_the_energy_that_it_makes():
    """Theorem 4.4 is an equality without friction for a linear body: u - u_eps is made by p."""
    case = bar(4, -0.005, 1e4, "material={law='linear', young=1.0, poisson=0.3}")
    case = case.model_copy(update={"friction": Friction()})
    problem = build_problem(case)
    exact = solve(problem, case.solver)
    measure, distances = DualNorm(problem), []
    for eps in (1e-2, 1e-3):
        options = bar(4, -0.005, 1e4, "solver.method=penalty", f"solver.eps_contact={eps}").solver
        penalised = solve(problem, options)
        distances.append(measure.pressure(exact.pressure - penalised.pressure))
        moved = measure.displacement(exact.state.x, penalised.state.x)
        assert distances[-1] == pytest.approx(moved, rel=1e-6)
    assert distances[0] / distances[1] == pytest.approx(10, rel=0.1)


def test_sensitivity(tmp_path):
    sensitivity.study(Report(tmp_path), "radius", coarse=True)
    found = rows_of(tmp_path / "sensitivity-radius-table.csv")
    assert {row["converged"] for row in found} == {"True"}


@pytest.mark.slow
def test_the_pressure_converges_in_the_dual_norm(tmp_path):
    found = pressure_convergence.main(["--coarse", "--out", str(tmp_path)])
    assert len(found) == 10
    for key, errors in found.items():
        if key[0] == "conforming":  # straight edges, whose polygons pressures feel to first order
            assert errors[1, 1] < 0.6 * errors[0, 1], key
            assert errors[:, 0].max() < 0.04, key
            assert errors[1, 0] < 0.02, key
            continue
        assert errors[1, 1] < 0.55 * errors[0, 1], key
        assert errors[1, 0] < 0.7 * errors[0, 0], key


@pytest.mark.parametrize("exact", [Line(), Point()], ids=["line", "point"])
def test_hertz_inside_is_in_equilibrium(exact):
    """Displacements by formulas: divergence by differences, pressure and gap at the surface."""
    d = 2 if isinstance(exact, Line) else 3
    x = np.array([[0.31, 0.7], [0.4, 0.2], [0.9, 0.3]])[[0, 1, 2] if d == 3 else [0, 2]]
    step, law, axes = 1e-4, exact.law, np.eye(d)[:, :, None]

    def stress(x):
        pairs = ((exact.displacement(x + step * e), exact.displacement(x - step * e)) for e in axes)
        gradient = np.array([(up - down) / (2 * step) for up, down in pairs])
        strain = (gradient + gradient.swapaxes(0, 1)) / 2
        spread = np.einsum("iik->k", strain) * np.eye(d)[:, :, None]
        return 2 * law.shear * strain + (law.bulk - 2 * law.shear / 3) * spread

    pairs = [(stress(x + step * e)[j], stress(x - step * e)[j]) for j, e in enumerate(axes)]
    divergence = sum((up - down) / (2 * step) for up, down in pairs)
    assert np.abs(divergence).max() < 1e-6 * np.abs(stress(x)).max()
    if d == 2:
        near = np.array([[0.0, 0.2, 0.4, 0.8], [2e-4] * 4])
        assert stress(near)[1, 1] == pytest.approx(-exact.pressure(near.T), abs=1e-7)
        assert np.abs(stress(near)[0, 1]).max() < 1e-3 * exact.peak
        near[1] = 0.0
        assert exact.gap(near)[:3] == pytest.approx(-exact.displacement(near)[1, :3], abs=1e-15)
    else:  # far from the contact, the force that its pressure adds up to
        far = np.array([[0.0], [0.0], [200.0]])
        force = 2 / 3 * np.pi * exact.radius**2 * exact.peak
        assert stress(far)[2, 2] == pytest.approx(-3 * force / (2 * np.pi * 200.0**2), rel=1e-3)


def test_corner_exponents(tmp_path):
    """90 degrees: sin(pi lambda/2)^2 = 1 - lambda^2 for nu = 1/2, and 0.711 for nu = 0.3."""
    power = corner.exponent(0.5)
    assert np.sin(np.pi / 2 * power) ** 2 == pytest.approx(1 - power**2, abs=1e-12)
    assert power == pytest.approx(0.5946, abs=1e-4)
    assert corner.exponent(0.3) == pytest.approx(0.7112, abs=1e-4)
    fitted = corner.main(["--coarse", "--out", str(tmp_path)])
    assert fitted[-1] == pytest.approx(corner.exponent(0.3), abs=0.03)
