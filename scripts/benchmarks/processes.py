"""Measurements are processes of their own, and print their measurements."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from typing import Any

Run = dict[str, Any]


def command(script: str) -> list[str]:
    """Return how a script of this folder is started."""
    return [sys.executable, "-m", f"scripts.benchmarks.{script}"]


def started(words: Sequence[str], ranks: int = 1, limit: float | None = None) -> str:
    """Return the output of a process, within a limit (seconds).

    Raises
    ------
    RuntimeError
        If it fails.
    """
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OMPI_MCA_mpi_yield_when_idle": "1"}
    parallel = ["mpirun", "-n", str(ranks), "--oversubscribe"] if ranks > 1 else []
    done = subprocess.run(
        [*parallel, *words], env=environment, capture_output=True, text=True, timeout=limit
    )
    if done.returncode != 0:
        raise RuntimeError(f"{' '.join(words)} failed:\n{done.stderr[-2000:]}")
    return done.stdout


def measured(words: Sequence[str], ranks: int = 1, limit: float | None = None) -> Run:
    """Return the JSON in the last line of a process's output."""
    found: Run = json.loads(started(words, ranks, limit).strip().splitlines()[-1])
    return found


def run(*arguments: str, ranks: int = 1) -> Run:
    """Run `bench_one` in a process of its own."""
    return measured([*command("bench_one"), *arguments], ranks)


def columns(rows: Sequence[Run]) -> dict[str, list[Any]]:
    """Return rows as columns."""
    return {key: [row.get(key) for row in rows] for key in rows[0]}
