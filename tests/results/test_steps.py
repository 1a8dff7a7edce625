"""What an evolution writes: a row a step, the contact nodes of all steps, fields with time."""

import json

import numpy as np
import pytest
from mpi4py import MPI

from contact import build_problem, evolve, parse_case, solve, write_outputs
from contact.plot.run import read_grid
from contact.results.resultants import rigid_columns
from tests.problems.bar import changed
from tests.problems.clamped import clamped
from tests.problems.mechanics import close
from tests.problems.piezo import COUPLING, PERMITTIVITY
from tests.problems.rigid import plate
from tests.problems.written import rows_of

SELF = MPI.COMM_SELF
PRESS = {"time": [0.0, 1.0, 2.0], "value": [0.0, 1.0, 0.2]}
STEPS = {"times": [0.0, 1.0, 2.0], "steps": [2, 3], "amplitudes": {"press": PRESS}}
PIEZO = {**COUPLING, **PERMITTIVITY}


def case_of(**changes):
    given = {"evolution": STEPS, "load__0__amplitude": "press", "material__law": "linear"}
    given |= {"material__yield_strain": None, **changes}
    if given["load__0__amplitude"] is None:
        del given["load__0__amplitude"]
    return parse_case(changed(**given))


@pytest.mark.core
def test_tables(tmp_path):
    solution = solve(case_of(), comm=SELF)
    write_outputs(solution, tmp_path)
    steps = rows_of(tmp_path / "steps.csv")
    assert [float(row["t"]) for row in steps] == pytest.approx([0.5, 1, 4 / 3, 5 / 3, 2])
    nodes = rows_of(tmp_path / "contact-steps.csv")
    last = rows_of(tmp_path / "contact.csv")
    assert len(nodes) == 5 * len(last)
    assert [{k: v for k, v in row.items() if k != "t"} for row in nodes[-len(last) :]] == last
    for row in steps:
        here = [node for node in nodes if node["t"] == row["t"]]
        force = sum(float(node["weight"]) * float(node["pressure"]) for node in here)
        assert float(row["contact_force_y"]) == pytest.approx(-force, rel=1e-12)
        assert float(row["max_pressure"]) == max(float(node["pressure"]) for node in here)
        touching = sum(node["status"] != "open" for node in here)
        assert int(row["contact_nodes"]) == touching
    assert float(steps[1]["contact_force_y"]) < float(steps[-1]["contact_force_y"]) < 0
    assert sum(int(row["factorizations"]) for row in steps) == solution.counters.factorizations
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["contact_force"][1] == float(steps[-1]["contact_force_y"])
    files = set(summary["files"])
    assert {"steps.csv", "contact-steps.csv", "fields.pvd", "fields-0004.vtu"} <= files
    assert {"contact.pvd", "contact-0000.vtu", "contact-0004.vtu"} <= files
    for name in ("fields.pvd", "contact.pvd"):
        assert (tmp_path / name).read_text().count("DataSet") == 5
    for k, row in enumerate(steps):
        surface = read_grid(tmp_path / f"contact-{k:04d}.vtu")
        force = np.nansum(surface["traction"] * surface["weight"][:, None], axis=0)
        assert force[1] == pytest.approx(float(row["contact_force_y"]), rel=1e-10)


@pytest.mark.parametrize("fields", ["vtx", "xdmf", "vtu"])
def test_fields_of_every_second_step(tmp_path, fields):
    solution = solve(case_of(output={"fields": fields, "every": 2}), comm=SELF)
    write_outputs(solution, tmp_path)
    written = {path.name for path in tmp_path.iterdir()}
    if fields == "vtu":
        assert {name for name in written if name.startswith("fields-")} == {
            f"fields-000{k}.vtu" for k in range(3)
        }
    else:
        assert written >= ({"fields.bp", "cells.bp"} if fields == "vtx" else {"fields.xdmf"})


@pytest.mark.core
def test_formulas_in_t_say_what_amplitudes_do():
    by_name = solve(case_of(), comm=SELF)
    traction = "-0.005*where(t < 1, t, 1 - 0.8*(t - 1))"
    by_formula = solve(
        case_of(load__0__amplitude=None, load__0__traction=[0.0, traction]), comm=SELF
    )
    for one, two in zip(by_name.steps, by_formula.steps, strict=True):
        assert np.abs(one.state.x - two.state.x).max() < 1e-12
    assert repr(by_name.steps[0]).startswith("<StepRecord: t = 0.5, max_pressure = ")
    assert len(repr(by_name.steps)) < 200 * len(by_name.steps)


def test_prescribed_values_in_t():
    """A formula in t and x on a support; what has the constant amplitude always acts."""
    case = case_of(load__0__amplitude="constant", fixed__0__displacement=["0.001*t*y", 0.0])
    solution = solve(case, comm=SELF)
    problem = solution.problem
    x = problem.body.space.tabulate_dof_coordinates()
    left = np.flatnonzero(x[:, 0] == 0)
    for record in solution.steps:
        found = record.state.x.reshape(-1, 2)[left, 0]
        np.testing.assert_allclose(found, 0.001 * record.state.time * x[left, 1], atol=1e-16)
    force = [record.row["contact_force_y"] for record in solution.steps]
    assert max(force) < 0.9 * min(force)  # the load stays


@pytest.mark.core
def test_python_and_the_case_file_agree():
    case = case_of()
    states = list(evolve(build_problem(case, SELF), case.evolution.ends, case.solver))
    for state, record in zip(states, solve(case, comm=SELF).steps, strict=True):
        assert close(state, record.state, atol=1e-14)


@pytest.mark.core
def test_charges_of_a_sensor(tmp_path):
    """A piezoelectric bar on a conductive foundation whose potential knows the time."""
    material = {"law": "linear", "young": 58.7102, "poisson": 0.3912, "piezo": PIEZO}
    case = case_of(
        material=material,
        fixed=[{"on": "left", "displacement": [0.0, 0.0], "potential": 0.0}],
        electric={"k_e": 1.0, "phi_f": "0.01*t"},
    )
    solution = solve(case, comm=SELF)
    for record in solution.steps:
        row = record.row
        assert row["charge_left"] + row["charge_foundation"] == pytest.approx(0, abs=1e-10)
    charges = [record.row["charge_left"] for record in solution.steps]
    assert np.ptp(charges) > 1e-4
    energy = np.array([0.0, *(record.row["energy"] for record in solution.steps)])
    defect = [r.row["work"] - r.row["dissipation"] for r in solution.steps] - np.diff(energy)
    assert np.abs(defect).max() < 0.05 * energy.max()
    assert np.all(energy[1:] > 0)


def test_unloading_is_warned_of():
    case = parse_case(
        changed(
            evolution=STEPS,
            load__0__amplitude="press",
            load__0__traction=[0.0, -0.2],
            material__yield_strain=0.01,
        )
    )
    solution = solve(case, comm=SELF)
    (words,) = [text for text in solution.warnings if "nonlinear elasticity" in text]
    assert "% of the body unload from the plastic range" in words
    loaded = {**STEPS, "steps": [2, 1], "amplitudes": {"press": {**PRESS, "value": [0, 1, 2]}}}
    case = case.model_copy(update={"evolution": parse_case(changed(evolution=loaded)).evolution})
    assert not any("nonlinear" in text for text in solve(case, comm=SELF).warnings)


def test_the_summary_has_the_most_that_rounding_was_granted(tmp_path):
    """A slender beam that is let go at the end: the last step has nothing to be rounded."""
    press = {"time": [0.0, 1.0, 2.0], "value": [0.0, 1.0, 0.0]}
    tables = clamped(
        [200.0, 1.0], [200, 1],
        load=[{"on": "right", "traction": [0.0, -1e-9], "amplitude": "press"}],
        contact={"on": "bottom", "gap": 1.0},
        evolution={**STEPS, "steps": [1, 1], "amplitudes": {"press": press}},
    )  # fmt: skip
    solution = solve(parse_case(tables), comm=SELF)
    write_outputs(solution, tmp_path)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert solution.outcome.residuals.equilibrium_rounding == 0
    assert summary["rounding"]["equilibrium"] == solution.steps[0].equilibrium_rounding > 1e-13


@pytest.mark.core
def test_rigid_parts_and_reactions_have_columns():
    """A plate under a force: its way and force, as of a foundation; reactions balance with it."""
    steps = {"times": [0.0, 1.0], "steps": [2]}
    rows = [record.row for record in solve(plate(evolution=steps), comm=SELF).steps]
    for row, share in zip(rows, (0.5, 1.0), strict=True):
        assert row["rigid_force_y"] == pytest.approx(-0.02 * share)
        assert row["rigid_moment"] == pytest.approx(0.002 * share)
        assert row["rigid_y"] < 0 and row["rigid_rotation"] != 0
        balance = row["rigid_force_x"] + row["reaction_x_left"] - row["contact_force_x"]
        assert abs(balance) < 1e-10


def test_several_rigid_parts_are_told_apart_by_their_names():
    moving = {"displacement": [0.0, -0.1], "rotation": 0.0, "force": [1.0, 2.0], "moment": 0.5}
    several = {"rigid_parts": {"top": moving, "left": moving}}
    columns = rigid_columns(several, "displacement", "force")
    assert columns["rigid_y_top"] == columns["rigid_y_left"] == -0.1
    assert columns["rigid_force_x_top"] == 1.0
    both = rigid_columns({"rigid": moving, "rigid_parts": {"top": moving}}, "displacement")
    assert {"rigid_x", "rigid_x_top"} <= {*both}
