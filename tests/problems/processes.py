"""The command line in processes of its own, on one rank or several."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

CLONE = Path(__file__).parents[2]
BAR = CLONE / "scripts/cases/bar.toml"
SMALL = ["--set", "mesh.cells=[16, 4]", "--quiet"]
RANKS = pytest.mark.parametrize("ranks", [1, 2])


def environment() -> dict[str, str]:
    """Return the environment without what says that this is a rank itself."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_", "PMIX_", "PRTE_"))}
    own = {"btl": "self,sm", "topo": "basic", "mpi_yield_when_idle": "1"}
    root = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    mca = {f"OMPI_MCA_{key}": value for key, value in own.items()}
    return kept | root | mca | {"PYTHONPATH": str(CLONE), "OMP_NUM_THREADS": "1"}


def command(*arguments: str, ranks: int = 1, before: str = "") -> list[str]:
    """Return what starts the command line, after some Python."""
    program = f"import sys\n{before}\nfrom contact.cli.main import run\nrun()"
    launch = [] if ranks == 1 else ["mpirun", "--oversubscribe", "-n", str(ranks)]
    return [*launch, sys.executable, "-c", program, *arguments]


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
