"""The command line: ``contact solve CASE.toml --out DIR``, ``check``, ``sweep``, ``plot``, ...

Exit status: 0 converged, 1 not converged (outputs are written), 2 bad input, or no place for the
results (one message, nothing is written), 70 a fault of the program, 130 stopped by Ctrl-C, 143
by SIGTERM (what a solve had reached is written).
"""

from __future__ import annotations

import argparse
import io
import logging
import os
import signal
import sys
import tempfile
from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from mpi4py import MPI

from contact.cli import materials, new, plot, sweep
from contact.cli.arguments import parse
from contact.cli.ending import (
    BAD_INPUT,
    CONVERGED,
    NOT_CONVERGED,
    end,
    end_by_crash,
    end_in_words,
    end_with_launcher,
)
from contact.cli.loading import load
from contact.errors import InputError
from contact.methods.interrupt import (
    SIGNALLED,
    Interrupted,
    Terminated,
    ending_on_signal,
    signals_held,
)
from contact.output.folder import on_root, refused, result_folder
from contact.output.rerun import check_kept, check_rerun

if TYPE_CHECKING:  # it loads dolfinx, which PETSc's options have to precede
    from contact.case.file import Case

#: Commands that read no case.
OTHERS = {"new": new.run, "plot": plot.run, "materials": materials.run, "sweep": sweep.run}

#: Seconds after a signal from which on a second one ends the writing of results too.
PATIENCE = 2.0


def _check_cache() -> None:
    """Raise an InputError if compiled forms cannot be kept. On one rank."""
    from dolfinx.jit import get_options

    cache = Path(get_options()["cache_dir"])
    try:
        cache.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=cache):
            pass
    except OSError as error:
        raise InputError(
            f"{cache}: {error.strerror or error}; accepted: a folder to keep compiled forms in, "
            "by HOME or XDG_CACHE_HOME"
        ) from None


def _solve(case: Case, options: argparse.Namespace, comm: MPI.Intracomm) -> int:
    out = options.restart if options.out is None else options.out
    assert out is not None  # asked for as the case was read
    if not out:  # the present folder is "."; this is rather a variable that is not set
        raise InputError('--out "": no folder; accepted: a folder to write to')
    restart = None if options.restart is None else Path(options.restart)
    # Not earlier: these load dolfinx, which PETSc's options have to precede.
    from contact.case.text import to_toml
    from contact.cli.progress import progress
    from contact.output.files import write_outputs
    from contact.output.resume import discard, kept_case
    from contact.solving import SolveInterrupted, solve

    with result_folder(out, comm) as folder:

        def check() -> None:
            check_rerun(folder.path, to_toml(case))
            kept = kept_case(folder.path)
            if kept is not None:
                check_kept(folder.path, kept, to_toml(case, anchored=True))

        if not options.overwrite:
            on_root(comm, check)
        with progress(comm, options.quiet, options.log) as monitor:
            try:
                solution = solve(
                    case, monitor=monitor, comm=comm, folder=folder.path, restart=restart
                )
            except SolveInterrupted as interrupt:
                solution = interrupt.solution
            logging.getLogger("contact").debug(solution.outcome.reason)
        outcome = solution.outcome
        earlier = on_root(comm, (folder.path / "summary.json").exists)
        if outcome.signal and not solution.begun and earlier:  # which are worth more
            raise Terminated if outcome.signal == signal.SIGTERM else KeyboardInterrupt
        # What has taken long to compute is written, signal or not.
        with signals_held(PATIENCE) as caught:
            write_outputs(solution, folder, figures=options.plot)
            if outcome.converged:
                on_root(comm, lambda: discard(folder.path))
            number = comm.allreduce(caught[0] if caught else 0, op=MPI.MAX)
            caught.clear()
    if comm.rank == 0 and not (options.quiet and outcome.converged):
        state = "converged" if outcome.converged else "stopped"
        text = f"{state}: {outcome.reason}; results in {folder.path}"
        print(
            f"contact: {text}" if options.quiet else text,
            file=sys.stderr if options.quiet else None,
            flush=True,
        )
    if outcome.signal or number:
        return SIGNALLED + (outcome.signal or number)
    return CONVERGED if outcome.converged else NOT_CONVERGED


def _check(case: Case, options: argparse.Namespace, comm: MPI.Intracomm) -> int:
    from contact.build import build_problem
    from contact.case.nesting import coarser_cases
    from contact.cli.describe import describe
    from contact.methods.options import NewtonOptions

    if isinstance(case.solver, NewtonOptions) and case.solver.nested:
        coarser_cases(case, case.solver.nested_levels)
    problem = build_problem(case, comm)
    text = describe(case, problem)
    if comm.rank == 0:
        print(text)
    if options.plot:
        from contact.cli.setup import save_setup

        for path in save_setup(case, problem, Path.cwd()):
            print(f"# set-up: {path.name}")
    return CONVERGED


def _own_options() -> list[str]:
    """Return options that keep PETSc from a .petscrc that lies in the working folder.

    It may hold anything, libraries to be loaded among it, and comes with a folder of somebody
    else's. The user's own, in his home, is read; any other by ``-options_file``.
    """
    own = Path.home() / ".petscrc"
    return ["-skip_petscrc", *(["-options_file", str(own)] if own.is_file() else [])]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status."""
    comm = MPI.COMM_WORLD
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # names of files may be any bytes
    end_in_words()
    end_with_launcher()
    try:
        with ending_on_signal():
            with signals_held():  # C++ libraries that are being loaded take no exceptions
                options, petsc = parse(sys.argv[1:] if arguments is None else arguments)
                import petsc4py

                petsc4py.init([sys.argv[0], *_own_options(), *petsc])
                # PETSc would call it a crash that a reader, such as head, has seen enough.
                signal.signal(signal.SIGPIPE, signal.SIG_IGN)
                if options.command in OTHERS:
                    return _told(OTHERS[options.command](options, comm))
                case = on_root(comm, lambda: load(options))
                import_module("contact.solving")
                on_root(comm, _check_cache)
            return _told({"solve": _solve, "check": _check}[options.command](case, options, comm))
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return SIGNALLED + signal.SIGPIPE
    except InputError as error:
        if comm.rank == 0:
            print(f"contact: {error}", file=sys.stderr)
        return BAD_INPUT
    except Interrupted as interrupt:
        return end(comm, str(interrupt), SIGNALLED + interrupt.number)
    except MemoryError:
        text = "not enough memory; accepted: fewer cells, or more ranks on more machines"
        return end(comm, text, BAD_INPUT)
    except OSError as error:
        return end(comm, str(refused(error)), BAD_INPUT)
    except KeyboardInterrupt as interrupt:
        number = signal.SIGTERM if isinstance(interrupt, Terminated) else signal.SIGINT
        return end(comm, f"interrupted ({number.name})", SIGNALLED + number)
    except Exception:
        return end_by_crash(comm)


def _told(status: int) -> int:
    """Return a status once all that was printed has been read."""
    sys.stdout.flush()
    return status


def run() -> NoReturn:
    """Run the command line and leave with its status."""
    status = main()
    disk = sys.modules.get("contact.output.disk")
    if disk is not None and disk.abandoned:  # their libraries must not clean up
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    sys.exit(status)
