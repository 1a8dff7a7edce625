"""Measurements are processes of their own, and print their measurements."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from functools import cache
from typing import Any

Run = dict[str, Any]

#: As `make test` has it: one thread a rank, and ranks that wait give way.
ENVIRONMENT = {"OMP_NUM_THREADS": "1", "OMPI_MCA_mpi_yield_when_idle": "1"}


def command(script: str) -> list[str]:
    """Return how a script of this folder is started."""
    return [sys.executable, "-m", f"scripts.benchmarks.{script}"]


@cache
def _own_cache() -> tempfile.TemporaryDirectory[str]:
    """Return a folder for compiled forms that ends with this process."""
    return tempfile.TemporaryDirectory()


@cache
def _open_mpi() -> bool:
    """Whether mpirun is that of Open MPI; else it is MPICH's."""
    asked = subprocess.run(["mpirun", "--version"], capture_output=True, text=True)
    return "Open MPI" in asked.stdout or "OpenRTE" in asked.stdout


def launcher(ranks: int) -> list[str]:
    """Return the words that start a command on ranks, of which there may be more than cores."""
    if ranks == 1:
        return []
    return ["mpirun", *(["--oversubscribe"] if _open_mpi() else []), "-n", str(ranks)]


def started(
    words: Sequence[str], ranks: int = 1, limit: float | None = None, **variables: str
) -> str:
    """Return the output of a process, within a limit (seconds), with environment variables."""
    environment = {**os.environ, **ENVIRONMENT, **variables}
    done = subprocess.run(
        [*launcher(ranks), *words], env=environment, capture_output=True, text=True, timeout=limit
    )
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(words)} failed:\n{done.stderr[-2000:]}")
    return done.stdout


def measured(
    words: Sequence[str], ranks: int = 1, limit: float | None = None, **variables: str
) -> Run:
    """Return the JSON in the last line of a process's output, see `started`."""
    found: Run = json.loads(started(words, ranks, limit, **variables).strip().splitlines()[-1])
    return found


def run(*arguments: str, ranks: int = 1) -> Run:
    """Run `bench_one` in a process of its own.

    With a small cache of compiled forms: dolfinx lists all of it for each form, which takes 15 ms
    where tests have left six thousand.
    """
    words = [*command("bench_one"), *arguments]
    return measured(words, ranks, XDG_CACHE_HOME=_own_cache().name)
