"""The files that a solve leaves, on any number of ranks."""

import csv
import json
import os
import signal
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mpi4py import MPI

from contact.build import build_problem
from contact.case.file import Case, parse_case
from contact.linear.operator import SparseOperator
from contact.methods.load_steps import load_steps
from contact.methods.newton import Newton
from contact.methods.options import NewtonOptions, with_method
from contact.methods.report import Record
from contact.output.fields import DerivedFields
from contact.output.figures.figures import write_figures
from contact.output.files import write_outputs
from contact.output.options import OutputOptions
from contact.output.solution import Solution
from contact.output.table import contact_table, csv_columns, held_points, tangent_of
from contact.problem.kkt import evaluate
from contact.solving import solve, solve_problem

# Debian's adios2 would take its serial library in a run without mpirun.
os.environ.setdefault("ADIOS2_ALWAYS_USE_MPI", "1")

COLUMNS = {
    2: "x y weight gap u_n u_t pressure tau bound status".split(),
    3: "x y z weight gap u_n u_tx u_ty u_tz pressure tau_x tau_y tau_z bound status".split(),
}


def block(dim: int, degree: int = 1, **sections: object) -> Case:
    """Return a block pressed on a plane and pushed aside, sticking and sliding."""
    size = [2.0, 1.0] if dim == 2 else [2.0, 1.0, 1.0]
    return parse_case(
        {
            "title": "Block",
            "mesh": {
                "generator": "rectangle" if dim == 2 else "box",
                "size": size,
                "cells": [8 if degree == 1 else 4, 4] if dim == 2 else [4, 2, 2],
            },
            "space": {"degree": degree},
            "material": {"law": "log", "young": 10.0, "poisson": 0.3, "yield_strain": 0.02},
            "fixed": [{"on": "top", "displacement": [0.02, *[0.0] * (dim - 2), "-0.02-0.02*x"]}],
            "contact": {"on": "bottom"},
            "friction": {"law": "coulomb", "mu": 0.3},
            **sections,
        }
    )


PIEZO = {"e31": -5.4, "e33": 15.8, "e15": 12.3, "beta11": 8.13866, "beta33": 7.37455}


def electric(dim: int) -> Case:
    """Return a piezoelectric block on a conductive foundation."""
    return block(
        dim,
        material={"young": 58.7, "poisson": 0.39, "piezo": PIEZO},
        electric={"k_e": 1.0, "phi_f": 3.0},
        fixed=[{"on": "top", "displacement": [0.0] * (dim - 1) + [-0.02], "potential": 0.0}],
    )


def written(solution: Solution, folder: Path) -> tuple[dict[str, object], list[dict[str, str]]]:
    """Write the outputs; return the summary and the rows of the contact table."""
    write_outputs(solution, folder)
    summary = json.loads((folder / "summary.json").read_text())
    with (folder / "contact.csv").open() as file:
        return summary, list(csv.DictReader(file))


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
    history = (shared_tmp_path / "history.csv").read_text().splitlines()
    assert len(history) == 1 + summary["outer_iterations"]
    assert len(summary["inner_iterations"]) == summary["outer_iterations"]
    for name in ("fields.vtu", "contact.vtu"):
        assert (shared_tmp_path / name).is_file()
    assert not list(shared_tmp_path.glob(".*")), "nothing half written is left"


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


def test_iterations_of_the_linear_solver_are_written(tmp_path: Path) -> None:
    """Those of MINRES where it is asked for, none to speak of with a factorisation."""
    counts = []
    for kind in ("lu", "iterative"):
        case = electric(2)
        settings = replace(case.solver, linear=kind)
        summary, _ = written(solve(case.model_copy(update={"solver": settings})), tmp_path / kind)
        assert summary["converged"] is True
        counts.append(summary["linear_iterations"] / summary["linear_solves"])
    assert counts[0] <= 1 < 5 < counts[1]


@pytest.mark.parallel
@pytest.mark.parametrize("dim", [2, 3])
def test_same_on_any_number_of_ranks(dim: int, shared_tmp_path: Path) -> None:
    """The table of all ranks is that of one, row by row."""
    together = contact_table(solve(block(dim), comm=MPI.COMM_WORLD))
    alone = contact_table(solve(block(dim), comm=MPI.COMM_SELF))
    assert alone is not None
    if together is None:
        return
    for name, values in csv_columns(alone).items():
        if name == "status":
            assert list(values) == list(together[name])
        else:
            # All displacements are compared with the imposed one: u_n is zero but for rounding.
            scale = 0.02 if name.startswith("u_") else np.abs(values).max() or 1.0
            np.testing.assert_allclose(together[name], values, rtol=0, atol=1e-8 * scale)


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
    table = contact_table(solve(disc))
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
    table = contact_table(solve(pieces))
    assert table is not None
    np.testing.assert_allclose(table["x"], [*np.arange(5) / 8, *(1.5 + np.arange(5) / 8)])


def test_tangent() -> None:
    """On the bottom the tangent points along x."""
    np.testing.assert_allclose(tangent_of(np.array([[0.0, -1.0]])), [[1.0, 0.0]])


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


def test_fields_can_be_read_back(shared_tmp_path: Path) -> None:
    """fields.bp holds all fields at the nodes, with the values of the solution."""
    adios2 = pytest.importorskip("adios2")
    solution = solve(block(2))
    solution.output = OutputOptions(fields="vtx")
    written(solution, shared_tmp_path)
    with adios2.FileReader(str(shared_tmp_path / "fields.bp"), MPI.COMM_SELF) as file:
        names = set(file.available_variables())
        u = file.read("displacement")
    assert {"displacement", "stress", "von_mises", "dev_strain"} <= names
    largest = np.linalg.norm(u, axis=1).max()
    x = solution.state.x.reshape(-1, 2)
    assert largest == pytest.approx(np.linalg.norm(x, axis=1).max(), rel=1e-12)


@pytest.mark.parallel
def test_xdmf(shared_tmp_path: Path) -> None:
    """Without VTX the fields go to XDMF, for P2 interpolated to P1."""
    solution = solve(block(2, 2))
    solution.output = OutputOptions(fields="xdmf")
    written(solution, shared_tmp_path)
    text = (shared_tmp_path / "fields.xdmf").read_text()
    assert all(name in text for name in ("displacement", "stress", "von_mises", "dev_strain"))
    assert sorted(path.name for path in shared_tmp_path.iterdir()) == [
        "contact.csv",
        "contact.vtu",
        "fields.h5",
        "fields.xdmf",
        "history.csv",
        "summary.json",
    ]


@pytest.mark.parametrize("format_", ["xdmf", "vtx"])
def test_a_failed_write_leaves_the_earlier_results(
    format_: str, shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All of a run take their places when all of them are complete."""
    from dolfinx import io

    def fail(*_: Any, **__: Any) -> None:
        raise OSError("no space left on device")

    solution = solve(block(2))
    written(solution, shared_tmp_path)
    solution.output = OutputOptions(fields=format_)
    monkeypatch.setattr(io.XDMFFile, "write_function", fail)
    monkeypatch.setattr(io, "VTXWriter", fail)
    before = json.loads((shared_tmp_path / "summary.json").read_text())
    with pytest.raises(OSError, match="no space"):
        write_outputs(solution, shared_tmp_path)
    assert sorted(path.name for path in shared_tmp_path.iterdir()) == before["files"]
    assert json.loads((shared_tmp_path / "summary.json").read_text()) == before


@pytest.mark.parallel
@pytest.mark.parametrize("degree", [1, 2])
def test_derived_fields_of_a_known_strain(degree: int) -> None:
    """Homogeneous compression: the stress is (1.13), in the cells and at the nodes."""
    problem = build_problem(block(2, degree))
    points = problem.equilibrium.space.tabulate_dof_coordinates()
    x = problem.equilibrium.rest()
    x[1::2] = -0.05 * points[:, 1]
    fields = DerivedFields(problem.equilibrium, x)
    law, t = problem.body.law, 0.05 * np.sqrt(2 / 3)
    g = float(law.secant_modulus(t**2))
    across = -0.05 * (law.bulk - 2 * g / 3)
    stress = np.diag([across, across - 0.1 * g, across]).ravel()
    for made in (fields.cells(), fields.nodes()):
        np.testing.assert_allclose(made["stress"].x.array.reshape(-1, 9) - stress, 0, atol=1e-12)
        np.testing.assert_allclose(made["von_mises"].x.array, 0.1 * g, rtol=1e-10)
        np.testing.assert_allclose(made["dev_strain"].x.array, t, rtol=1e-10)
    assert max(e.strain for e in fields.extremes()) == pytest.approx(t, rel=1e-12)


@pytest.mark.parametrize(
    "kind", [pytest.param("P1", marks=pytest.mark.parallel), "P2", "piezoelectric"]
)
def test_checkpoint(kind: str, shared_tmp_path: Path) -> None:
    """A problem built on a checkpoint and restored from it is solved already."""
    pytest.importorskip("adios4dolfinx", exc_type=ImportError)
    from contact.output.checkpoint import read_checkpoint

    case = electric(2) if kind == "piezoelectric" else block(2, int(kind[1]))
    solution = solve(case)
    solution.output = OutputOptions(checkpoint=True)
    written(solution, shared_tmp_path)
    checkpoint = read_checkpoint(shared_tmp_path / "checkpoint.bp")
    read, given = checkpoint.domain, solution.problem.domain
    for kind in ("parts", "regions"):
        sizes = [
            {name: MPI.COMM_WORLD.allreduce(s.size) for name, s in getattr(domain, kind).items()}
            for domain in (read, given)
        ]
        assert sizes[0] == sizes[1]
    problem = build_problem(case, domain=checkpoint.domain)
    assert evaluate(problem, checkpoint.restore(problem)).largest <= 1e-8


def test_outputs_are_replaced(shared_tmp_path: Path) -> None:
    """A second run into the same folder leaves its own files alone, and what is not ours."""
    first, second = solve(block(2)), solve(block(2, 2))
    first.output = OutputOptions(fields="xdmf")
    write_outputs(first, shared_tmp_path, figures=True)
    assert len(list(shared_tmp_path.glob("figure-*.png"))) == 2
    (shared_tmp_path / "notes.txt").write_text("mine")
    summary, rows = written(second, shared_tmp_path)
    assert sorted(path.name for path in shared_tmp_path.iterdir()) == [
        "contact.csv",
        "contact.vtu",
        "fields.vtu",
        "history.csv",
        "notes.txt",
        "summary.json",
    ]
    assert summary["dofs"] == 2 * (2 * 4 + 1) * (2 * 4 + 1)
    assert len(rows) == 9


@pytest.mark.parametrize("dim", [2, 3])
def test_figures(dim: int, shared_tmp_path: Path) -> None:
    """All figures are drawn."""
    from contact.output.figures.figures import write_figures

    if dim == 3:
        pytest.importorskip("pyvista")
    files = write_figures(solve(electric(dim)), shared_tmp_path)
    assert [file.name for file in files] == [
        "figure-contact.png",
        "figure-deformed.png",
        "figure-potential.png",
    ]
    assert all(file.stat().st_size > 10_000 for file in files)


def test_figures_begin_at_the_edge_of_the_body() -> None:
    """The clamped corner is no contact node, but the axis and the foundation reach it."""
    from contact.output.figures.body import draw_plane
    from contact.output.figures.contact import draw_line
    from contact.output.figures.picture import picture

    case = block(
        2,
        fixed=[{"on": "left", "displacement": [0.0, 0.0]}],
        load=[{"on": "top", "traction": [0.0, -0.1]}],
    )
    solution = solve(case)
    table, held = contact_table(solution), held_points(solution.problem)
    assert table is not None
    assert table["x"].min() == 0.25
    np.testing.assert_allclose(held, [[0.0, 0.0]], atol=1e-15)
    assert draw_line(table, held=held).axes[0].get_xlim() == pytest.approx((0.0, 2.0))
    drawn = picture(solution, "von_mises", "stress")
    assert drawn is not None
    line = draw_plane(drawn, table).axes[0].lines[0].get_xdata()
    assert (np.min(line), np.max(line)) == pytest.approx((0.0, 2.0))


@pytest.mark.parametrize("nested", [False, True])
def test_the_warning_says_where_the_iteration_started(nested: bool) -> None:
    """Several solutions may exist: which one is found depends on the start."""
    case = block(
        2,
        mesh={"generator": "rectangle", "size": [2.0, 1.0], "cells": [16, 8]},
        friction={"law": "coulomb", "mu": {"law": "slip", "rho": 1e4}},
        solver={"nested": nested},
    )
    start = "the solution on a coarser mesh" if nested else "zero slip"
    assert any(f"reached from {start}" in text for text in solve(case).warnings)


@pytest.mark.parallel
def test_interrupted_solve_keeps_its_results(shared_tmp_path: Path) -> None:
    """A signal on one rank ends the solve on all of them, and what was computed is written."""
    handler = signal.getsignal(signal.SIGINT)

    def press(record: Record) -> None:
        if record.iteration == 1 and MPI.COMM_WORLD.rank == 0:
            signal.raise_signal(signal.SIGINT)

    solution = solve(block(2, solver={"method": "uzawa"}), monitor=press)
    assert not solution.converged
    assert solution.history.records[-1].iteration == 1
    summary, rows = written(solution, shared_tmp_path)
    assert summary["reason"] == "interrupted (SIGINT)"
    assert len(rows) == 9
    assert signal.getsignal(signal.SIGINT) is handler


@pytest.mark.parallel
def test_a_solve_stops_between_inner_iterations(
    shared_tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A signal in a long inner loop is not left waiting for its end."""
    solve_once = SparseOperator.solve

    def press(operator: SparseOperator, *args: Any, **options: Any) -> Any:
        if operator.counters.linear_solves == 5 and MPI.COMM_WORLD.rank == 0:
            signal.raise_signal(signal.SIGTERM)
        return solve_once(operator, *args, **options)

    monkeypatch.setattr(SparseOperator, "solve", press)
    solution = solve(block(2, solver={"method": "uzawa"}))
    assert solution.counters.linear_solves == 6
    assert solution.outcome.signal == signal.SIGTERM
    summary, _ = written(solution, shared_tmp_path)
    assert summary["reason"] == "interrupted (SIGTERM)"
    assert summary["outer_iterations"] == len(solution.history.records)


def test_an_interrupted_load_step_is_judged_by_the_full_load(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The residuals of a solve that ends in a load step are those of the problem itself."""
    problem = build_problem(block(2))
    notes = []

    def stepped(method: Newton, _: object) -> Any:
        return load_steps(method.whole_loop())

    def press(record: Record) -> None:
        notes.append(record.note)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(Newton, "_roads", stepped)
    solution = solve_problem(problem, NewtonOptions(condense=False), press)
    assert solution.outcome.signal == signal.SIGINT
    assert [note.split()[:2] for note in notes] == [["load", "0.25"]]
    state = solution.state
    assert state.time == 1.0
    np.testing.assert_array_equal(state.x, problem.equilibrium.prescribe(state.x))
    assert solution.outcome.kkt == evaluate(problem, state)


@pytest.mark.parallel
@pytest.mark.parametrize("method", ["newton", "uzawa"])
def test_ranks_without_cells_write_and_draw_too(method: str, shared_tmp_path: Path) -> None:
    """Two triangles: with three ranks one has none."""
    case = block(2, mesh={"generator": "rectangle", "size": [1.0, 1.0], "cells": [1, 1]})
    solution = solve(case, with_method(case.solver, method))
    assert solution.converged
    summary, rows = written(solution, shared_tmp_path)
    assert summary["cells"] == 2
    assert summary["contact_nodes"] == len(rows)
    write_figures(solution, shared_tmp_path)
    if MPI.COMM_WORLD.rank == 0:
        assert len(list(shared_tmp_path.glob("figure-*.png"))) == 2


@pytest.mark.parallel
def test_a_gap_that_was_forgotten() -> None:
    """A curved part without a gap fits its foundation; a plane one lies on it."""
    disc = {
        "mesh": {"generator": "half_disc", "size": 2.0, "contact_size": 0.5},
        "fixed": [{"on": "top", "displacement": [0.0, -0.01]}],
        "friction": {},
    }
    (warning,) = (
        w for w in solve(block(2, contact={"on": "contact"}, **disc)).warnings if "curved" in w
    )
    assert warning.startswith("the part contact is curved and its gap is 0 everywhere")
    plane = {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
    for other in (block(2), block(2, contact={"on": "contact", "foundation": plane}, **disc)):
        assert not any("curved and its gap" in text for text in solve(other).warnings)
