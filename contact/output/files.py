"""What a solve leaves in its folder: summary, tables, fields, checkpoint.

Every file is written under another name first and then renamed, so that a reader never sees
half of one.
"""

from __future__ import annotations

import csv
import json
import math
import os
import shutil
import time
from collections.abc import Callable, Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import has_adios2, io
from mpi4py import MPI

from contact.output import environment
from contact.output.balances import charge_balance
from contact.output.fields import DerivedFields, linear, unknowns
from contact.output.solution import Solution
from contact.output.table import Table, contact_table, csv_columns

HISTORY = (
    "iteration",
    "inner",
    "equilibrium",
    "contact",
    "friction",
    "change",
    "seconds",
    "note",
    "contact_solves",
)


def write_outputs(solution: Solution, folder: str | Path) -> None:
    """Write ``summary.json``, ``contact.csv``, ``history.csv`` and the fields. Collective.

    Fields and figures of an earlier run in the folder are removed, its checkpoint is not.

    Parameters
    ----------
    solution
        The solution; the seconds that the output takes are added to it.
    folder
        Where to; it is made if need be.
    """
    begin, folder, comm = time.perf_counter(), Path(folder), solution.problem.comm
    table = contact_table(solution)
    if comm.rank == 0:
        folder.mkdir(parents=True, exist_ok=True)
        _clear(folder)
        assert table is not None  # on rank 0
        columns = csv_columns(table)
        rows = zip(*(column.tolist() for column in columns.values()), strict=True)
        write_csv(folder / "contact.csv", columns, rows)
        write_csv(folder / "history.csv", HISTORY, _history(solution))
    comm.barrier()
    if solution.output.fields != "none":
        write_fields(solution, folder)
    if solution.output.checkpoint:
        from contact.output.checkpoint import write_checkpoint

        _replace(comm, folder / "checkpoint.bp", lambda to: write_checkpoint(solution, to))
    solution.seconds["output"] += time.perf_counter() - begin
    summary = summarise(solution, table)
    if comm.rank == 0:
        text = json.dumps(_finite(summary), indent=2, allow_nan=False)
        _write(folder / "summary.json", text + "\n")
    comm.barrier()


def _clear(folder: Path) -> None:
    """Remove what would be taken for results of this run. On one rank.

    The summary goes first and comes last: without it a folder is not complete.
    """
    shutil.rmtree(folder / "fields.bp", ignore_errors=True)
    shutil.rmtree(folder / "cells.bp", ignore_errors=True)
    for name in ("summary.json", "fields.xdmf", "fields.h5"):
        (folder / name).unlink(missing_ok=True)
    for figure in folder.glob("figure-*.png"):
        figure.unlink()


def summarise(solution: Solution, table: Table | None) -> dict[str, Any]:
    """Return the contents of ``summary.json``. Collective.

    Parameters
    ----------
    solution
        The solution.
    table
        Its contact table, None on ranks other than 0.
    """
    problem, records = solution.problem, solution.history.records
    status = np.array([]) if table is None else table["status"]
    counts = problem.comm.bcast({s: int(np.sum(status == s)) for s in ("open", "stick", "slip")})
    mesh, counters = problem.domain.mesh, solution.counters
    kkt = solution.outcome.kkt
    summary: dict[str, Any] = {
        "title": solution.title,
        "converged": solution.converged,
        "reason": solution.outcome.reason,
        "method": solution.method,
        "dofs": problem.equilibrium.layout.unknowns,
        "cells": mesh.topology.index_map(mesh.topology.dim).size_global,
        "ranks": problem.comm.size,
        "outer_iterations": len(records),
        "inner_iterations": [record.inner for record in records],
        "linear_solves": counters.linear_solves,
        "linear_iterations": counters.linear_iterations,
        "factorizations": counters.factorizations,
        "contact_solves": counters.contact_solves,
        "kkt": {"equilibrium": kkt.equilibrium, "contact": kkt.contact, "friction": kkt.friction},
        "max_pressure": problem.nodes.maximum(solution.pressure),
        "contact_force": solution.contact_force.tolist(),
        "max_displacement": _largest_displacement(solution),
        "max_dev_strain": solution.max_dev_strain,
        "contact_nodes": counts["stick"] + counts["slip"],
        "stick_nodes": counts["stick"],
        "slip_nodes": counts["slip"],
        "contact_direction": problem.contact.foundation.direction,
        "notes": solution.notes,
        "warnings": solution.warnings,
    }
    if problem.piezoelectric:
        summary |= _electric(solution)
    return summary | {"seconds": solution.seconds, "versions": environment.versions()}


def _largest_displacement(solution: Solution) -> float:
    problem = solution.problem
    body = problem.equilibrium
    u = solution.state.x[: body.owned].reshape(-1, body.block_size)[:, : problem.dim]
    largest = float(np.linalg.norm(u, axis=1).max(initial=0.0))
    return float(problem.comm.allreduce(largest, op=MPI.MAX))


def _electric(solution: Solution) -> dict[str, Any]:
    problem, body = solution.problem, solution.problem.equilibrium
    scaled = solution.state.x[: body.owned].reshape(-1, body.block_size)[:, -1]
    phi = body.phi_scale * scaled
    charges = charge_balance(problem, solution.state)
    return {
        "phi_min": problem.comm.allreduce(float(phi.min(initial=math.inf)), op=MPI.MIN),
        "phi_max": problem.comm.allreduce(float(phi.max(initial=-math.inf)), op=MPI.MAX),
        "total_charge": charges.total,
        "charges": asdict(charges),
    }


def _history(solution: Solution) -> Iterable[tuple[Any, ...]]:
    for r in solution.history.records:
        k = r.kkt
        yield (
            r.iteration,
            r.inner,
            k.equilibrium,
            k.contact,
            k.friction,
            r.change,
            r.seconds,
            r.note,
            r.contact,
        )


def write_fields(solution: Solution, folder: Path) -> None:
    """Write ``fields.bp`` and ``cells.bp``, or ``fields.xdmf``. Collective.

    ``fields.bp`` holds all fields at the nodes, the derived ones averaged there; ``cells.bp``
    the derived ones as they are, cell by cell: one VTX file has one kind of elements only.
    Without ADIOS2, or on demand, both go to ``fields.xdmf``, of degree 1 at most.
    """
    problem, x = solution.problem, solution.state.x
    derived = DerivedFields(problem.equilibrium, x)
    comm = problem.comm
    at_nodes = [*unknowns(problem.equilibrium, x).values(), *derived.nodes().values()]
    in_cells = list(derived.cells().values())
    if has_adios2 and solution.output.fields == "vtx":

        def write_vtx(path: Path, functions: list[Any]) -> None:
            with io.VTXWriter(comm, path, functions, engine="BP4") as file:
                file.write(0.0)

        _replace(comm, folder / "fields.bp", lambda to: write_vtx(to, at_nodes))
        _replace(comm, folder / "cells.bp", lambda to: write_vtx(to, in_cells))
        return
    # The name of the HDF5 file stands in the XDMF file: a folder is moved, not the name changed.
    partial = folder / ".part-fields"
    if comm.rank == 0:
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir()
    comm.barrier()
    with io.XDMFFile(comm, partial / "fields.xdmf", "w") as file:
        file.write_mesh(problem.domain.mesh)
        for function in at_nodes:
            file.write_function(linear(function))
    comm.barrier()
    if comm.rank == 0:
        for name in ("fields.h5", "fields.xdmf"):
            os.replace(partial / name, folder / name)
        partial.rmdir()
    comm.barrier()


def write_csv(path: Path, header: Iterable[str], rows: Iterable[Iterable[Any]]) -> None:
    """Write a table, numbers to the last digit. On one rank."""
    with _partial(path).open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)
    os.replace(_partial(path), path)


def _write(path: Path, text: str) -> None:
    _partial(path).write_text(text, encoding="utf-8")
    os.replace(_partial(path), path)


def _partial(path: Path) -> Path:
    return path.with_name(f".{path.name}.part")


def _replace(comm: MPI.Intracomm, path: Path, write: Callable[[Path], None]) -> None:
    """Write a file or folder by all ranks under another name, then put it in its place."""
    partial = path.with_name(f".part-{path.name}")
    if comm.rank == 0:
        shutil.rmtree(partial, ignore_errors=True)
    comm.barrier()
    write(partial)
    comm.barrier()
    if comm.rank == 0:
        shutil.rmtree(path, ignore_errors=True)
        os.replace(partial, path)
    comm.barrier()


def _finite(value: Any) -> Any:
    """Return a value with null for what JSON cannot say: NaN and infinity."""
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_finite(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
