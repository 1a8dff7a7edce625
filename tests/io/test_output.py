"""The files that a solve leaves, on any number of ranks.

What is said of the sides of two bodies.
"""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from contact import parse_case
from contact.interface.multipliers import Multipliers
from contact.methods.options import OPTIONS, with_method
from contact.results.bodies import sides
from contact.results.contact_nodes import contact_table, tangent_of
from contact.solving import solve
from tests.problems.pairs import case
from tests.problems.written import block, electric, rows_of, written

# Debian's adios2 would take its serial library in a run without mpirun.
os.environ.setdefault("ADIOS2_ALWAYS_USE_MPI", "1")

COLUMNS = {
    2: "x y weight gap u_n u_t pressure tau bound status".split(),
    3: "x y z weight gap u_n u_tx u_ty u_tz pressure tau_x tau_y tau_z bound status".split(),
}


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize(("dim", "degree"), [(2, 1), (2, 2), (3, 1), (3, 2)])
def test_fixed_formats(dim: int, degree: int, shared_tmp_path: Path) -> None:
    """Names, columns and counts are those that other programs read."""
    solution = solve(block(dim, degree))
    summary, rows = written(solution, shared_tmp_path)
    assert summary["converged"] is True
    assert summary["cells"] == solution.problem.domain.mesh.topology.index_map(dim).size_global
    assert len(summary["contact_force"]) == dim
    assert set(summary["kkt"]) == {"equilibrium", "contact", "friction"}
    assert set(summary["seconds"]) == {"setup", "solve", "output"}
    assert list(rows[0]) == COLUMNS[dim]
    status = [row["status"] for row in rows]
    assert summary["contact_nodes"] == sum(s != "open" for s in status)
    assert summary["stick_nodes"] == status.count("stick") > 0
    assert summary["slip_nodes"] == status.count("slip") > 0
    history = rows_of(shared_tmp_path / "history.csv")
    assert len(history) == summary["outer_iterations"]
    records = solution.history
    assert [len(row["steps"].split()) for row in history] == [len(r.steps) for r in records]
    known = [[int(n) for n in row["active_set"].split("/") if n] for row in history]
    assert known == [list(record.sizes or ()) for record in records]
    assert known[-1] == [status.count(name) for name in ("open", "stick", "slip")]
    assert len(summary["inner_iterations"]) == summary["outer_iterations"]
    for name in ("fields.vtu", "contact.vtu"):
        assert (shared_tmp_path / name).is_file()
    assert not list(shared_tmp_path.glob(".*")), "nothing half written is left"


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("dim", [2, 3])
def test_electric_outputs(dim: int, shared_tmp_path: Path) -> None:
    """A piezoelectric body adds potentials, charges and two columns; charges balance."""
    summary, rows = written(solve(electric(dim)), shared_tmp_path)
    assert list(rows[0]) == [*COLUMNS[dim], "phi", "d_n"]
    assert summary["phi_min"] < summary["phi_max"]
    through = sum(float(row["weight"]) * float(row["d_n"]) for row in rows)
    assert abs(through) > 1e-3
    assert abs(summary["total_charge"]) <= 1e-8 * abs(through)


@pytest.mark.parametrize("method", ["newton", "uzawa"])
def test_raw_residuals_are_written_beside_their_floors(method: str, tmp_path: Path) -> None:
    """The rounding floor was subtracted: equilibrium was 0.0."""
    solution = solve(block(2, solver={"method": method}))
    summary, _ = written(solution, tmp_path)
    kkt, floors = summary["kkt"], summary["rounding"]
    assert 0 < kkt["equilibrium"] <= max(1e-8, floors["equilibrium"])
    assert kkt.keys() == floors.keys() and 0 < floors["equilibrium"] < 1e-8


@pytest.mark.core
@pytest.mark.parallel
@pytest.mark.parametrize("dim", [2, 3])
def test_same_on_any_number_of_ranks(dim: int, shared_tmp_path: Path) -> None:
    """The table of all ranks is that of one, row by row."""
    together = contact_table(solve(block(dim), comm=MPI.COMM_WORLD).contact)
    alone = contact_table(solve(block(dim), comm=MPI.COMM_SELF).contact)
    assert alone is not None
    if together is None:
        return
    for name, values in alone.items():
        if name == "status":
            assert list(values) == list(together[name])
        else:
            # All displacements are compared with the imposed one: u_n is zero but for rounding.
            scale = 0.02 if name.startswith("u_") else np.abs(values).max() or 1.0
            np.testing.assert_allclose(together[name], values, rtol=0, atol=1e-8 * scale)


@pytest.mark.core
def test_rows_follow_the_contact_part(shared_tmp_path: Path) -> None:
    """In the plane neighbours are neighbours, also on an arc and in several pieces."""
    disc = block(
        2,
        mesh={"generator": "half_disc", "size": 2.0, "contact_size": 0.5},
        fixed=[{"on": "top", "displacement": [0.0, -0.1]}],
        contact={
            "on": "contact",
            "foundation": {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]},
        },
    )
    table = contact_table(solve(disc).contact)
    assert table is not None
    points = np.column_stack([table["x"], table["y"]])
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert np.ptp(points[:, 0]) > 15, "both halves of the arc are there"
    assert steps.max() < 2.5
    assert np.all(np.diff(points[:, 0]) > -1e-12)

    parts = {"two": [{"side": "bottom", "to": 0.5}, {"side": "bottom", "from": 1.5}]}
    pieces = block(
        2,
        2,
        contact={"on": "two"},
        mesh={"generator": "rectangle", "size": [2.0, 1.0], "cells": [8, 4], "parts": parts},
    )
    table = contact_table(solve(pieces).contact)
    assert table is not None
    np.testing.assert_allclose(table["x"], [*np.arange(5) / 8, *(1.5 + np.arange(5) / 8)])


@pytest.mark.core
def test_tangent() -> None:
    """On the bottom the tangent points along x."""
    np.testing.assert_allclose(tangent_of(np.array([[0.0, -1.0]])), [[1.0, 0.0]])


@pytest.mark.core
@pytest.mark.parallel
def test_contact_force_balances_the_supports(shared_tmp_path: Path) -> None:
    """The force on the foundation is that of the load, in size and direction."""
    case = block(
        2,
        fixed=[{"on": "left", "displacement": [0.0, "free"]}],
        load=[{"on": "top", "traction": [0.0, "-0.1*(1+x)"]}],
    )
    summary, rows = written(solve(case), shared_tmp_path)
    assert summary["contact_force"][1] == pytest.approx(-0.4, rel=1e-8)
    weighted = sum(float(row["weight"]) * float(row["pressure"]) for row in rows)
    assert weighted == pytest.approx(0.4, rel=1e-8)


@pytest.mark.parallel
@pytest.mark.parametrize("method", ["newton", "uzawa"])
def test_ranks_without_cells_write_and_draw_too(method: str, shared_tmp_path: Path) -> None:
    """Two triangles: with three ranks one has none."""
    case = block(2, mesh={"generator": "rectangle", "size": [1.0, 1.0], "cells": [1, 1]})
    solution = solve(case, with_method(case.solver, OPTIONS[method]))
    assert solution.converged
    summary, rows = written(solution, shared_tmp_path, figures=True)
    assert summary["cells"] == 2
    assert summary["contact_nodes"] == len(rows)
    if MPI.COMM_WORLD.rank == 0:
        assert len(list(shared_tmp_path.glob("figure-*.png"))) == 2


def on_another(support, mesh=(), **sections):
    """Return the solution of a block on another, without friction, that is constrained or moved."""
    given = case(friction={"law": "none"}, **sections)
    given["fixed"].append(support)
    given["mesh"].update(mesh)
    solution = solve(parse_case(given), comm=MPI.COMM_SELF)
    assert solution.converged
    return solution


@pytest.mark.parametrize(("share", "warned"), [(0.1, True), (1e-5, False)])
def test_what_a_method_leaves_at_partly_covered_nodes_is_no_pressure(share, warned):
    """An open node's is zero by Newton's method, rounding by others."""
    solution = on_another(
        {"on": "upper_left", "displacement": [0.0, "free"]}, mesh={"lower_width": 1.5}
    )
    covered = solution.problem.geometries[0].covered
    assert (covered < 0.5).any()
    pressure = np.where(covered < 0.5, share, 1.0) * solution.state.multipliers.contact.max()
    multipliers = Multipliers(pressure, solution.state.multipliers.friction)
    changed = replace(solution, state=replace(solution.state, multipliers=multipliers))
    words = [text for text in sides(changed) if "less than half" in text]
    assert bool(words) == warned


@pytest.mark.parametrize(("way", "warned"), [(0.05, False), (0.9, True)])
def test_what_slides_further_than_a_facet_faces_something_else(way, warned):
    solution = on_another({"on": "upper_top", "displacement": [way, -0.01]}, load=[])
    words = [text for text in sides(solution) if "along the surface" in text]
    assert bool(words) == warned


def test_what_slides_there_and_back_faced_something_else_in_between():
    moved = {"on": "upper_top", "displacement": ["0.9*(1 - abs(t - 1))", -0.01]}
    solution = on_another(moved, load=[], evolution={"times": [0.0, 2.0], "steps": [2]})
    assert np.abs(solution.slip).max() < 0.1
    (words,) = [text for text in sides(solution) if "along the surface" in text]
    assert "slide by up to 0.9" in words
