"""The command line: ``contact solve CASE.toml --out DIR``, ``check``, ``sweep``, ``plot``, ...

Exit status: 0 converged, 1 not converged (outputs are written), 2 bad input, or no place for the
results (one message, nothing is written), 70 a fault of the program, 130 stopped by Ctrl-C, 143
by SIGTERM (the results so far are written).
"""

from __future__ import annotations

import os
import signal
import sys
import time
import traceback
from collections.abc import Sequence
from pkgutil import resolve_name

from mpi4py import MPI

from contact.cli.arguments import parse
from contact.errors import InputError, installed
from contact.methods.signals import (
    SIGNALLED,
    Interrupted,
    Terminated,
    ending_on_signal,
    signals_held,
)
from contact.ranks import refused

CONVERGED, NOT_CONVERGED, BAD_INPUT = 0, 1, 2
#: EX_SOFTWARE: a fault of the program.
CRASH = 70

#: Command -> its function. Their modules load dolfinx, which PETSc's options have to precede.
COMMANDS = {
    "new": "contact.cli.new:run_new",
    "mesh": "contact.cli.new:run_mesh",
    "check": "contact.cli.check:run",
    "solve": "contact.cli.solve:run_solve",
    "sweep": "contact.cli.solve:run_sweep",
    "plot": "contact.cli.plot:run_plot",
    "view": "contact.cli.plot:run_view",
    "identify": "contact.cli.identify:run",
    "materials": "contact.cli.reference:run",
    "demo": "contact.cli.solve:run_demo",
    "schema": "contact.cli.reference:run",
}


def _end(comm: MPI.Intracomm, text: str, status: int) -> int:
    """Print the reason for the end on this rank, and end the other ranks too."""
    if comm.size > 1 and comm.rank > 0:
        time.sleep(1)  # rank 0, if it ends for the same reason, says it for all
    print(f"contact: {text}", file=sys.stderr, flush=True)
    if comm.size > 1:
        comm.Abort(status)
    return status


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status."""
    comm = MPI.COMM_WORLD
    try:
        with ending_on_signal(), installed():
            with signals_held():  # C++ libraries that are being loaded take no exceptions
                options, petsc = parse(sys.argv[1:] if arguments is None else arguments)
                import petsc4py

                petsc4py.init([sys.argv[0], *petsc])
                # PETSc would call it a crash that a reader, such as head, has seen enough.
                signal.signal(signal.SIGPIPE, signal.SIG_IGN)
                command = resolve_name(COMMANDS[options.command])
            status = int(command(options, comm))
            sys.stdout.flush()  # it has been read: else it is a broken pipe
            return status
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return SIGNALLED + signal.SIGPIPE
    except InputError as error:
        if comm.rank == 0:
            print(f"contact: {error}", file=sys.stderr)
        return BAD_INPUT
    except Interrupted as interrupt:
        return _end(comm, str(interrupt), SIGNALLED + interrupt.number)
    except MemoryError:
        text = "not enough memory; accepted: fewer cells, or more ranks on more machines"
        return _end(comm, str(InputError(text, "memory")), BAD_INPUT)
    except OSError as error:
        return _end(comm, str(refused(error)), BAD_INPUT)
    except KeyboardInterrupt as interrupt:
        number = signal.SIGTERM if isinstance(interrupt, Terminated) else signal.SIGINT
        return _end(comm, f"interrupted ({number.name})", SIGNALLED + number)
    except Exception:
        traceback.print_exc()
        return _end(comm, "this is a fault of the program, not of its input", CRASH)
