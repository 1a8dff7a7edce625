"""The files of a solution: summary, tables, fields, checkpoint, figures."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from contact.arguments import expect
from contact.io.checkpoint import write_checkpoint
from contact.io.fields import gathered, write_fields, write_grid, write_vtu
from contact.io.folder import ResultFolder, result_folder
from contact.io.tables import write_columns, write_mappings
from contact.ranks import on_all_ranks, on_root
from contact.results.contact_nodes import (
    contact_surface,
    contact_table,
    opposite_surface,
    opposite_table,
)
from contact.results.options import OutputOptions
from contact.results.quantities import quantities, values_of
from contact.results.quantity import (
    ADAPT,
    AGAINST,
    HISTORY,
    NODES,
    OPPOSITE,
    STEPS,
    SUMMARY,
    SURFACE,
)
from contact.results.solution import Results

if TYPE_CHECKING:
    from contact.plot.run import Run


def write_outputs(
    solution: Results, folder: str | Path | ResultFolder, figures: bool = False
) -> None:
    """Write summary, tables, fields and all that is asked for. Collective.

    The files replace those of an earlier run together: whatever fails, the folder has all earlier
    results or all new ones. Other files in it are not touched.

    Parameters
    ----------
    solution
        The solution; the seconds that the output takes are added to it.
    folder
        Where to; it is made if need be. A run that takes long holds it from its beginning, by
        `result_folder`.
    figures
        Whether to draw the figures too.

    Raises
    ------
    InputError
        If it is given something else, the folder cannot be written to, or has no room, or
        something that is no result stands in the way.
    OSError
        If a library fails to write on this rank; others may wait for it.
    """
    expect("write_outputs", solution, "a Solution", isinstance(solution, Results))
    fits = isinstance(folder, str | Path | ResultFolder)
    expect("write_outputs: folder", folder, "the name of a folder, or a ResultFolder", fits)
    if isinstance(folder, ResultFolder):
        _replace(solution, folder, figures)
    else:
        with result_folder(folder, solution.problem.comm) as place:
            _replace(solution, place, figures)


def written(solution: Results) -> Run | None:
    """Return the results in the files as figures read them; None but on rank 0. Collective."""
    from contact.plot.run import read_run  # which takes a while to load

    comm = solution.problem.comm
    with ExitStack() as stack:
        folder = stack.enter_context(TemporaryDirectory()) if comm.rank == 0 else ""
        whole = replace(solution, output=OutputOptions(), seconds={**solution.seconds})
        write_outputs(whole, comm.bcast(folder))
        return read_run(Path(folder)) if comm.rank == 0 else None


def _replace(solution: Results, folder: ResultFolder, figures: bool) -> None:
    begin, comm = time.perf_counter(), solution.problem.comm
    failures: list[Exception] = []

    def write(new: Path) -> Mapping[str, Any]:
        opposite = opposite_surface(solution.problem, solution.state)
        write_grid(comm, contact_surface(solution.contact, solution.state), new / SURFACE)
        whole = None if opposite is None else gathered(comm, opposite)
        table, records = contact_table(solution.contact), solution.history

        def write_tables() -> None:
            write_columns(new / NODES, table)
            if whole is not None:
                write_vtu(new / OPPOSITE, whole)
                write_columns(new / AGAINST, opposite_table(solution.problem, whole))
            rows = [values_of(HISTORY, record) for record in records]
            write_mappings(new / HISTORY, rows, [quantity.name for quantity in quantities(HISTORY)])
            if solution.steps:
                write_mappings(new / STEPS, [record.row for record in solution.steps])
            if solution.adaptation:
                write_mappings(new / ADAPT, solution.adaptation)

        on_root(comm, write_tables)
        _write_contact_steps(solution, new / "contact-steps.csv")
        if solution.output.fields != "none":
            write_fields(solution, new)
        if solution.output.checkpoint:
            write_checkpoint(solution, new / "checkpoint.npz")
        solution.seconds["output"] += time.perf_counter() - begin
        summary = {key: _plain(value) for key, value in values_of(SUMMARY, solution).items()}
        if figures:
            try:
                _draw(solution, new, summary)
            except Exception as error:
                failures.append(error)
        return summary

    folder.replace(write)
    # A figure that fails is no reason to lose the rest.
    with on_all_ranks(comm):
        for failure in failures:
            raise failure


def _write_contact_steps(solution: Results, path: Path) -> None:
    """Write the contact nodes of all steps. Collective."""
    for k, record in enumerate(solution.steps):
        table = contact_table(solution.at_step(record.state).contact)
        table = {"t": np.full(len(table["x"]), record.state.time), **table}
        on_root(solution.problem.comm, partial(write_columns, path, table, more=k > 0))


def _draw(solution: Results, folder: Path, summary: Mapping[str, Any]) -> None:
    """Draw the figures from the files. Collective."""
    from contact.plot.figures import draw, read_run  # which take a while to load

    run = None
    if solution.output.fields != "vtu":
        run = written(solution)
    elif solution.problem.comm.rank == 0:
        run = read_run(folder, summary)
    if run is not None:
        draw(run, folder)


def _plain(value: Any) -> Any:
    """Return a value of JSON: null in place of NaN and infinity."""
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, list | np.ndarray):
        return [_plain(item) for item in value]
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and not math.isfinite(value) else value
