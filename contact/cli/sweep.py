"""``contact sweep``: a case for several values of some of its keys, one row a value."""

from __future__ import annotations

import argparse
from typing import Any

from mpi4py import MPI

from contact.cli.ending import CONVERGED, NOT_CONVERGED
from contact.cli.options import add_case, add_command, add_progress
from contact.errors import InputError
from contact.output.folder import result_folder
from contact.output.reference import files_help


def add_parser(commands: Any) -> None:
    """Add the command to the parser's commands."""
    text = "solve a case for several values of some keys: sweep.csv, one row a value"
    command = add_command(
        commands,
        "sweep CASE.toml --over KEY=V1,V2,... --out DIR [options]",
        text,
        files_help("sweep.csv"),
    )
    add_case(command)
    command.add_argument(
        "--over",
        action="append",
        default=[],
        metavar="KEY=V1,V2,...",
        help="the values of a key; may be repeated, for all combinations",
    )
    command.add_argument("--out", metavar="DIR", help="folder for the table; rows in it are kept")
    command.add_argument(
        "--cold", action="store_true", help="start each solve from rest, not from the one before"
    )
    add_progress(command)


def run(options: argparse.Namespace, comm: MPI.Intracomm) -> int:
    """Sweep, and say where the table is."""
    # Not earlier: these load dolfinx, which PETSc's options have to precede.
    from contact.cli.progress import progress
    from contact.sweeping import TABLE, Axis, sweep

    if not options.over:
        raise InputError("--over: missing; accepted: --over KEY=V1,V2,...")
    if not options.out:
        raise InputError("--out: missing; accepted: a folder to write to")
    axes = [Axis.of(text) for text in options.over]
    shown = progress(comm, options.quiet, options.log)
    with result_folder(options.out, comm) as folder, shown as monitor:
        rows = sweep(
            options.case, axes, folder.path, options.set, monitor, comm, warm=not options.cold
        )
    bad = sum(row["converged"] not in (True, "True") for row in rows)
    if comm.rank == 0 and not (options.quiet and bad == 0):
        words = f", {bad} of them not converged" if bad else ""
        print(f"{len(rows)} rows{words}: {folder.path / TABLE}")
    return NOT_CONVERGED if bad else CONVERGED
