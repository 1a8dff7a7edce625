"""The command line in processes of its own, on one rank or several."""

import os
import shlex
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import pytest

from scripts.benchmarks.processes import launcher

CLONE = Path(__file__).parents[2]
BAR = CLONE / "scripts/cases/bar.toml"
SMALL = ["--set", "mesh.cells=[16, 4]", "--quiet"]
#: Variables of Open MPI and of MPICH.
OF_RANKS = ("OMPI_", "PMIX_", "PRTE_", "PMI_", "HYDI_", "MPI_LOCAL")
RANKS = pytest.mark.parametrize("ranks", [1, 2])


def environment() -> dict[str, str]:
    """Return the environment without what says that this is a rank itself."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(OF_RANKS)}
    own = {"btl": "self,sm", "topo": "basic", "mpi_yield_when_idle": "1"}
    root = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    mca = {f"OMPI_MCA_{key}": value for key, value in own.items()}
    return kept | root | mca | {"PYTHONPATH": str(CLONE), "OMP_NUM_THREADS": "1"}


def command(*arguments: str, ranks: int = 1, before: str = "") -> list[str]:
    """Return what starts the command line, after some Python."""
    # PETSc takes -c for an option of its own.
    program = f"import sys\n{before}\nfrom contact.__main__ import run\nsys.argv[0] = ''\nrun()"
    return [*launcher(ranks), sys.executable, "-c", program, *arguments]


#: Runs the command lines that it reads, and says with which status each has ended.
SERVER = """
import shlex, sys
from mpi4py import MPI
{before}
from contact.cli.main import main
comm = MPI.COMM_WORLD
while line := comm.bcast(sys.stdin.readline() if comm.rank == 0 else None):
    status = main(shlex.split(line))
    comm.barrier()
    if comm.rank == 0:
        print("status", status, file=sys.stderr, flush=True)
"""


@contextmanager
def served(
    ranks: int = 1, seconds: float = 300, before: str = ""
) -> Iterator[Callable[..., tuple[int, str]]]:
    """Yield a function that runs a command line in a kept process: its status and what it said."""
    process = subprocess.Popen(
        [*launcher(ranks), sys.executable, "-c", SERVER.format(before=before)],
        env=environment(), text=True,
        stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
    )  # fmt: skip
    assert process.stdin is not None and process.stderr is not None
    requests, said = process.stdin, process.stderr

    def run(*arguments: str) -> tuple[int, str]:
        print(shlex.join(arguments), file=requests, flush=True)
        text = ""
        for line in said:
            if line.startswith("status "):
                return int(line.split()[1]), text
            text += line
        return process.wait(), text

    guard = threading.Timer(seconds, process.kill)
    guard.start()
    try:
        with process:
            yield run
            requests.close()
            assert process.wait() == 0, said.read()
    finally:
        guard.cancel()
        process.kill()


class Process(NamedTuple):
    """A process of the machine: its number, its name, who started it, and its session."""

    pid: int
    name: str
    parent: int
    session: int


def processes() -> Iterator[Process]:
    """Yield the processes of the machine, but for zombies."""
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            name, _, rest = stat.read_text().rpartition(")")
        except OSError:
            continue
        state, parent, _, session = rest.split()[:4]
        if state != "Z":
            yield Process(int(stat.parent.name), name, int(parent), int(session))
