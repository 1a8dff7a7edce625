"""Errors between meshes, and coarse versions of the convergence studies of the scripts.

The script of Table 7.1 on a coarse mesh.
The inf-sup constant of the nodal multipliers does not depend on the mesh size.
"""

from __future__ import annotations

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI

from contact.mesh.grid import rectangle
from contact.mesh.transfer import carry, refined
from forms.hencky import energy_density
from forms.kinematics import strain
from scripts.reporting import Report
from scripts.studies import convergence_mechanics as study
from scripts.studies import nonlocal_friction
from scripts.studies.error_norms import errors
from scripts.studies.fixed_point_rates import fixed_points, secant_rate
from scripts.studies.inf_sup import SERIES, constant
from scripts.studies.mesh_series import grade, pulled
from scripts.thesis import figures_mechanics, table_7_1, table_7_2
from tests.problems.mechanics import bar
from tests.problems.written import rows_of


def function(domain, degree, formula):
    f = fem.Function(fem.functionspace(domain.mesh, ("Lagrange", degree, (2,))))
    f.interpolate(formula)
    return f


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("degree", [1, 2])
def test_nested_meshes_lose_nothing(comm, degree):
    coarse = rectangle(comm, [0.0, 0.0], [2.0, 1.0], [6, 3])
    fine = refined(coarse)
    wild = function(coarse, degree, lambda x: np.sin(9 * x[:2] + 1))
    there = carry(wild, fem.functionspace(fine.mesh, ("Lagrange", degree, (2,))))
    back = carry(there, wild.function_space)
    assert np.allclose(back.x.array, wild.x.array, atol=1e-10)


@pytest.mark.core
@pytest.mark.parallel
def test_non_matching_meshes_keep_polynomials(comm):
    one = rectangle(comm, [0.0, 0.0], [2.0, 1.0], [7, 3])
    other = rectangle(comm, [0.0, 0.0], [2.0, 1.0], [5, 4], diagonal="left")

    def formula(x):
        return np.vstack([1 + x[0] - 2 * x[1], 3 * x[1] - x[0]])

    made = carry(function(one, 1, formula), fem.functionspace(other.mesh, ("Lagrange", 2, (2,))))
    assert np.allclose(made.x.array, function(other, 2, formula).x.array, atol=1e-10)


@pytest.mark.core
@pytest.mark.parallel
def test_norms(comm):
    problem = bar(comm, 4)
    body = problem.body
    u = fem.Function(body.space)
    u.interpolate(lambda x: np.vstack([0.01 * x[0], 0 * x[0]]))
    norm = errors(body, u.x.array, None)
    assert norm.l2 == pytest.approx(0.01 * np.sqrt(64 / 3))
    assert norm.h1 == pytest.approx(0.02)
    # Within the elastic limit B(u; u, u) is twice the energy.
    density = energy_density(problem.description.law, strain(u))
    energy = fem.assemble_scalar(fem.form(density * problem.domain.dx))
    assert norm.energy**2 == pytest.approx(2 * comm.allreduce(energy))
    assert errors(body, u.x.array, u).h1 == 0.0
    ratio = norm / norm
    assert (ratio.l2, ratio.h1, ratio.energy) == (1.0, 1.0, 1.0)


def test_a_grid_is_pulled_towards_lines():
    """Elements beside a line are n^-power wide; lines, and what is in the middle, stay."""
    x = pulled(np.linspace(0.0, 1.0, 9), 2.0)
    assert x[[0, 1, 4, 7, 8]] == pytest.approx([0.0, 0.5 / 16, 0.5, 1 - 0.5 / 16, 1.0])
    domain = rectangle(MPI.COMM_SELF, [0.0, 0.0], [4.0, 1.0], [16, 4])
    grade(domain, 2.0, ((0.0, 2.0, 4.0), (0.0, 1.0)))
    found = np.unique(domain.mesh.geometry.x[:, 0])
    assert found[[0, 1, 8, 9, 16]] == pytest.approx([0.0, 1 / 16, 2.0, 2 + 1 / 16, 4.0])
    assert np.unique(domain.mesh.geometry.x[:, 1]) == pytest.approx([0.0, 1 / 8, 0.5, 7 / 8, 1.0])


def test_graded_meshes_give_back_what_the_corners_take(tmp_path):
    found = study.graded_meshes(Report(tmp_path, coarse=True))
    uniform, graded = (found[f"P1, power {q:g}"] for q in (1.0, 1.5))
    assert np.all(graded < 0.93 * uniform)
    orders = [np.log2(table[0] / table[1])[1] for table in (uniform, graded)]
    assert orders[1] > orders[0] + 0.05


@pytest.mark.slow
def test_figure_7_6(tmp_path):
    found = study.figure_7_6(Report(tmp_path, coarse=True))
    for label, table in found.items():
        orders = np.log2(table[:-1] / table[1:])
        assert np.all(orders[:, 0] > 1.3), label
        assert np.all(orders[:, 1:] > 0.7), label
    assert np.all(found["P2, f2 = -0.005"][1] < 0.5 * found["P1, f2 = -0.005"][1])
    for suffix in ("png", "csv", "md"):
        assert (tmp_path / f"figure-7-6.{suffix}").is_file()


def test_known_solutions(tmp_path):
    found = study.known_solutions(Report(tmp_path, coarse=True))
    for label, table in found.items():
        degree = 1 if "P1" in label else 2
        orders = np.log2(table[-2] / table[-1])[:2]
        low = np.array([degree + 1, degree]) - 0.1
        if "Signorini" in label:
            low = np.array([1.8, 0.95 if degree == 1 else 1.3])
        assert np.all(orders > low), label
    assert all(float(row["residual"]) <= 1e-9 for row in rows_of(tmp_path / "known-solutions.csv"))


def test_theorem_4_3(tmp_path):
    for table in study.theorem_4_3(Report(tmp_path, coarse=True)).values():
        assert np.all(np.log2(table[:-1] / table[1:]) > 0.7)


@pytest.mark.slow
def test_rates_of_the_fixed_points(tmp_path):
    """Theorems 3.2 and 4.5: linear convergence, with friction or without."""
    rates = fixed_points(Report(tmp_path, coarse=True))
    rows = {row["iteration"]: row for row in rows_of(tmp_path / "fixed-point-rates.csv")}
    assert set(rows) == set(rates)
    for label, rate in rates.items():
        assert rate < 0.9
        if "mu" not in label:
            bound = float(rows[label]["Kacanov's bound"])
            assert 0.5 * bound < rate < 1.02 * bound, label


def test_rate_of_the_secant_iteration():
    assert secant_rate(0.04) == 0.0
    assert secant_rate(0.05 * np.e) == pytest.approx(0.5)
    assert secant_rate(0.05 * np.e**4) == pytest.approx(0.8)


@pytest.mark.slow
def test_theorem_4_2(tmp_path):
    values = (1e-3, 1e-8, 1e-9)
    found = table_7_2.study(Report(tmp_path), 8, values)
    for label, distances in found.items():
        order = np.log10(distances[1] / distances[2])
        assert order == pytest.approx(1.0, abs=0.1), label


@pytest.mark.slow
def test_table_7_2(tmp_path):
    table_7_2.write_table(Report(tmp_path), 8)
    rows = rows_of(tmp_path / "table-7-2.csv")
    assert [int(row["thesis"]) for row in rows] == [6, 9, 13, 14, 10, 14, 15, 16]
    assert all(float(row["residual of (PV_eps)"]) <= 1e-8 for row in rows)
    counts = [int(row["(4.38)"]) for row in rows]
    assert counts[:4] == sorted(counts[:4])
    assert counts[4:] == sorted(counts[4:])


@pytest.mark.slow
def test_smoothing_radius(tmp_path):
    solutions = nonlocal_friction.study(Report(tmp_path), 8, -0.005)
    forces = np.array([solution.contact_force for solution in solutions.values()])
    assert np.allclose(forces[:, 1], forces[0, 1], rtol=0.01)
    # A radius of h or less is no smoothing.
    assert np.allclose(solutions["h"].pressure, solutions["0"].pressure, rtol=1e-6, atol=1e-10)


@pytest.mark.slow
def test_figures_mechanics(tmp_path):
    figures_mechanics.main(["--coarse", "--out", str(tmp_path)])
    for name in ("7-4a", "7-4b", "7-5a", "7-5b", "7-7a", "7-7b", "7-8a", "7-8b"):
        assert (tmp_path / f"figure-{name}.png").stat().st_size > 3_000
        assert (tmp_path / f"figure-{name}.csv").is_file()
    assert (tmp_path / "multipliers-and-penalty.png").is_file()


@pytest.mark.slow
def test_the_table(tmp_path, capsys):
    found = table_7_1.main(["--cells", "4", "--out", str(tmp_path)])
    assert len(found) == len(table_7_1.rows()) == 8
    for runs in found:
        # The rules of the thesis leave residuals well above those of converged ones.
        assert runs["converged"].residual <= 1e-8
        assert runs["printed"].residual > 1e-7
        assert runs["thesis"].residual < 1e-4
        assert 3 <= runs["converged"].outer <= 20
        assert runs["converged"].square <= 9
        assert runs["single"].residual <= 1e-8
        assert runs["single"].solves < 0.5 * runs["converged"].solves
    rows = rows_of(tmp_path / "table-7-1.csv")
    assert [int(row["thesis"]) for row in rows] == [3, 3, 4, 6, 5, 5, 6, 8]
    assert [int(row["to 1e-8"]) for row in rows] == [runs["converged"].outer for runs in found]
    assert "| f2 | rho | thesis |" in (tmp_path / "table-7-1.md").read_text()
    assert "Table 7.1" in capsys.readouterr().out


@pytest.mark.parametrize("load", table_7_1.LOADS)
def test_r_taken_at_its_word(load):
    """It stops far from the solution, or not at all."""
    limits = "solver.r=2.5e4", "solver.max_inner=2000", "solver.max_outer=6"
    found = table_7_1.run(8, load, 1e5, *table_7_1.STOPPING, table_7_1.PLAIN, *limits)
    assert found.residual > 1e-4


@pytest.mark.parametrize(
    ("name", "degree", "cells", "least"),
    [
        ("uniform", 1, (4, 8, 16), 0.62),
        ("uniform", 2, (4, 8), 0.58),
        ("alternating", 1, (4, 8, 16), 0.45),
        ("crosspoints", 1, (4, 8, 16), 0.62),
        ("crosspoints", 2, (4, 8), 0.58),
        ("uniform, 3-D", 1, (2, 4), 0.55),
        ("uniform, 3-D", 2, (2,), 0.55),
        ("crosspoints, 3-D", 2, (2,), 0.55),
    ],
)
def test_multipliers_are_stable(name, degree, cells, least):
    """Bounded from below, at crosspoints, between unlike edges, and on quadratic triangles."""
    kind, levels = SERIES[name][0], 1 if "3-D" in name else 3
    found = [constant(kind, kind.make(n), degree, levels)[0] for n in cells]
    assert least < min(found) <= max(found) < 1, found
    assert max(found) - min(found) < 0.15 * max(found)
