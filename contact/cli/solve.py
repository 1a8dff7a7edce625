"""``contact solve``, ``demo`` and ``sweep``: a case, or a case for several values of its keys."""

from __future__ import annotations

import argparse
import logging
import signal
import sys
import time
import tomllib
from functools import partial
from pathlib import Path

import numpy as np
from mpi4py import MPI

from contact.case.build import build_problem, naming_case
from contact.case.digest import check_same
from contact.case.file import Case, load_case, override, parse_case, to_toml
from contact.cli.check import amplitude_notes
from contact.cli.main import CONVERGED, NOT_CONVERGED
from contact.cli.progress import OUTER, STEPS, SWEEP, progress
from contact.errors import InputError, counted
from contact.io.checkpoint import (
    Checkpoints,
    check_restart,
    discard,
    files_of,
    kept_case,
    read_steps,
)
from contact.io.folder import SUMMARY, read_json, result_folder
from contact.methods.report import Monitor
from contact.methods.signals import SIGNALLED, Terminated, signals_held
from contact.ranks import on_root
from contact.results.remarks import locks
from contact.solution import Solution
from contact.solving import SolveInterrupted, reviewed, solve, solve_in_steps, solve_problem
from contact.sweeping import TABLE, Axis, sweep
from contact.writing import write_outputs

#: The case of `contact demo`.
DEMO = Path(__file__).parents[1] / "cases" / "bar.toml"


def run_demo(options: argparse.Namespace, comm: MPI.Intracomm) -> int:
    """Solve the example that comes with the package."""
    options.case, options.out = DEMO, options.out or "contact-demo"
    options.plot, options.restart = True, None
    return run_solve(options, comm)


def run_solve(options: argparse.Namespace, comm: MPI.Intracomm) -> int:
    """Solve the case, and write the results. Collective."""
    case = on_root(comm, lambda: _load(options))
    out = options.restart if options.out is None else options.out
    if not out:  # the present folder is "."; this is rather a variable that is not set
        raise InputError('--out "": no folder; accepted: a folder to write to', "cannot-write")
    restart = None if options.restart is None else Path(options.restart)
    for note in amplitude_notes(case) if comm.rank == 0 else ():
        logging.getLogger("contact.case").warning(note)
    with result_folder(out, comm, options.overwrite) as folder:
        if not options.overwrite:
            on_root(comm, lambda: _check_results(folder.path, case))
        over = OUTER if case.evolution is None else STEPS
        with progress(comm, options.quiet, options.log, over) as monitor:
            try:
                solution = solve_and_keep(case, monitor, comm, folder.path, restart)
            except SolveInterrupted as interrupt:
                solution = interrupt.solution
            logging.getLogger("contact").debug(solution.outcome.reason)
        outcome = solution.outcome
        earlier = on_root(comm, (folder.path / SUMMARY).exists)
        begun = bool(solution.history or solution.steps)
        if outcome.signal and not begun and earlier:  # which are worth more
            raise Terminated if outcome.signal == signal.SIGTERM else KeyboardInterrupt
        # Results that have taken long to compute are written, signal or not.
        with signals_held() as caught:
            write_outputs(solution, folder, figures=options.plot)
            if outcome.converged:
                on_root(comm, lambda: discard(folder.path))
            number = comm.allreduce(caught[0] if caught else 0, op=MPI.MAX)
            caught.clear()
    results = [] if options.quiet else _results(solution)
    if comm.rank == 0 and not (options.quiet and outcome.converged):
        state = "converged" if outcome.converged else "stopped"
        said = f"{state}: {outcome.reason}; results in {folder.path}"
        if outcome.signal and kept_case(folder.path) is not None:
            said += f"; contact solve --restart {folder.path} goes on"
        text = "\n".join([said, *results])
        print(
            f"contact: {text}" if options.quiet else text,
            file=sys.stderr if options.quiet else None,
            flush=True,
        )
    if outcome.signal or number:
        return SIGNALLED + (outcome.signal or number)
    return CONVERGED if outcome.converged else NOT_CONVERGED


def solve_and_keep(
    case: Case,
    monitor: Monitor | None,
    comm: MPI.Intracomm,
    folder: Path,
    restart: Path | None = None,
) -> Solution:
    """Solve a case, from checkpoints in `restart`; each load step leaves one. Collective."""
    if case.evolution is None or case.adapt is not None:
        return solve(case, monitor=monitor, comm=comm)
    clock = time.perf_counter()
    problem = build_problem(case, comm)
    with naming_case(case.source):
        kept = [] if restart is None else read_steps(restart, problem)
        here = restart is not None and restart.samefile(folder)
        keep = Checkpoints(folder, problem, case, kept, here).keep
        steps = partial(solve_in_steps, times=case.evolution.step_times, kept=kept, keep=keep)
        return reviewed(solve_problem(problem, case.solver, monitor, steps), case, clock)


def _results(solution: Solution) -> list[str]:
    """Return the main results in lines. Collective."""
    nodes, status = solution.problem.nodes, solution.status
    area, sticks = solution.contact_area, nodes.sum(np.where(status == "stick", 1.0, 0.0))
    force = ", ".join(f"{component:.6g}" for component in solution.contact_force)
    seconds = ", ".join(f"{name} {value:.2f}" for name, value in solution.seconds.items())
    share = f"{sticks / area:.1%} of the contact area" if area > 0 else "nothing touches"
    shares = solution.contacts if len(solution.contacts) > 1 else {}
    rows = {
        "contact force": f"({force})",
        **{
            f"  {name}": f"({', '.join(f'{component:.6g}' for component in one.force)})"
            for name, one in shares.items()
        },
        "contact area": f"{area:.6g}",
        "largest pressure": f"{nodes.maximum(solution.pressure):.6g} {solution.units.stress or ''}",
        **({"sticking": share} if solution.problem.frictional else {}),
        "seconds": seconds,
    }
    lines = [f"  {name:18}{value}".rstrip() for name, value in rows.items()]
    if solution.error is None:
        words = "was interrupted" if solution.outcome.signal else "has not converged"
        lines.append(f"estimated discretisation error: none, for the run {words}")
    else:
        bound = ", perhaps a lower bound: the mesh may lock" if locks(solution) else ""
        share = f"{100 * solution.error.relative:.2g} % (energy norm){bound}"
        lines.append(f"estimated discretisation error {share}")
    return lines


def _load(options: argparse.Namespace) -> Case:
    """Read the case: that of its file, or that of an interrupted run. On one rank."""
    if options.restart is None:
        if options.case is None:
            raise InputError(
                "CASE.toml: missing; accepted: a case file, or --restart DIR", "missing"
            )
        if options.out is None:
            raise InputError("--out: missing; accepted: a folder to write to", "missing")
        return load_case(options.case, options.set)
    folder = Path(options.restart)
    if options.case is None:
        source, data = str(files_of(folder)[0]), tomllib.loads(kept_case(folder) or "")
        for text in options.set:
            override(data, text, source)
        case = parse_case(data, source=source)
    else:
        case = load_case(options.case, options.set)
    check_restart(folder, case)
    return case


def _check_results(folder: Path, case: Case) -> None:
    """Refuse to replace results or checkpoints of another case."""
    where, accepted = f"--out {folder}", "--overwrite to replace them, or another folder"
    if (folder / SUMMARY).exists():
        before = read_json(folder / SUMMARY).get("case")
        check_same(where, "a folder with results", before, to_toml(case), accepted)
    kept = kept_case(folder)
    if kept is not None:
        accepted = f"--restart {folder} to go on with that, {accepted}"
        check_same(where, "a folder with checkpoints", kept, to_toml(case, anchored=True), accepted)


def run_sweep(options: argparse.Namespace, comm: MPI.Intracomm) -> int:
    """Solve the case for several values of its keys. Collective."""
    if not options.over:
        raise InputError("--over: missing; accepted: --over KEY=V1,V2,...", "missing")
    if not options.out:
        raise InputError("--out: missing; accepted: a folder to write to", "missing")
    axes = [Axis.of(text) for text in options.over]
    shown = progress(comm, options.quiet, options.log, SWEEP)
    with result_folder(options.out, comm, overwrite=True) as folder, shown as monitor:
        rows = sweep(
            options.case,
            axes,
            folder.path,
            options.set,
            monitor,
            comm,
            not options.cold,
            [name.strip() for text in options.columns for name in text.split(",")],
        )
    bad = sum(row["converged"] not in (True, "True") for row in rows)
    if comm.rank == 0 and not (options.quiet and bad == 0):
        words = f", {bad} of them not converged" if bad else ""
        print(f"{counted(len(rows), 'row')}{words}: {folder.path / TABLE}")
    return NOT_CONVERGED if bad else CONVERGED
