"""How a run ends where it does not end by itself: in words, on all ranks, with its status."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time
import traceback
from contextlib import suppress
from pathlib import Path

from mpi4py import MPI

CONVERGED, NOT_CONVERGED, BAD_INPUT = 0, 1, 2
#: EX_SOFTWARE: a fault of the program.
CRASH = 70

#: Open MPI's programs that start ranks.
_LAUNCHERS = ("mpirun", "mpiexec", "prterun", "prted", "orterun", "orted")
#: With more ranks on a node Open MPI starts them from threads, which end before it does.
_THREADS_FROM = 32
_PR_SET_PDEATHSIG = 1

_kept: list[object] = []


def end(comm: MPI.Intracomm, text: str, status: int) -> int:
    """Print the reason for the end on this rank, and end the other ranks too."""
    if comm.size > 1 and comm.rank > 0:
        time.sleep(1)  # rank 0, if it ends for the same reason, says it for all
    print(f"contact: {text}", file=sys.stderr, flush=True)
    if comm.size > 1:
        comm.Abort(status)
    return status


def end_by_crash(comm: MPI.Intracomm) -> int:
    """Show the traceback of the exception at hand and end all ranks."""
    traceback.print_exc()
    return end(comm, "this is a fault of the program, not of its input", CRASH)


def end_in_words() -> None:
    """Give a C++ library that ends the process the status of a crash."""

    def terminate() -> None:
        print("contact: a library has ended the program", file=sys.stderr, flush=True)
        if MPI.Is_initialized() and not MPI.Is_finalized() and MPI.COMM_WORLD.size > 1:
            MPI.COMM_WORLD.Abort(CRASH)
        os._exit(CRASH)

    with suppress(OSError, AttributeError):  # another C++ library than GNU's
        callback = ctypes.CFUNCTYPE(None)(terminate)
        ctypes.CDLL("libstdc++.so.6")["_ZSt13set_terminatePFvvE"](callback)
        _kept.append(callback)


def end_with_launcher() -> None:
    """Let this rank be killed if Open MPI's launcher is: nobody else would end it."""
    parent = os.getppid()
    try:
        launcher = Path(f"/proc/{parent}/comm").read_text().strip() in _LAUNCHERS
        ranks = int(os.environ.get("OMPI_COMM_WORLD_LOCAL_SIZE", "0"))
    except (OSError, ValueError):
        return
    if launcher and 0 < ranks <= _THREADS_FROM:
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, int(signal.SIGKILL))
        if os.getppid() != parent:  # it has died meanwhile
            os.kill(os.getpid(), signal.SIGKILL)
