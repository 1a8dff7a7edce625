"""Memory that is freed goes back to the system, and phases need little beside the solver."""

import gc
import os
import subprocess
import sys
import tracemalloc
from collections.abc import Callable

import numpy as np
import pytest
from mpi4py import MPI

from contact import build_problem
from contact.body import elements
from contact.problem.problem import ContactProblem
from contact.problem.rigid_modes import unsupported
from contact.results.error_estimate import estimated
from scripts.benchmarks.bench_one import block

#: A program of its own, for the tests ask the allocator to keep memory.
FREED = """
from pathlib import Path

import numpy as np

import contact._compat


def resident():
    status = Path("/proc/self/status").read_text()
    return float(status.split("VmRSS:")[1].split()[0]) / 1024


before = resident()
values = np.ones(10_000_000)
with_them = resident()
del values
print(with_them - before, resident() - before)
"""


def test_freed_arrays_are_returned() -> None:
    """SuperLU_DIST, once it is loaded, has the allocator keep them."""
    plain = {k: v for k, v in os.environ.items() if not k.startswith(("MALLOC_", "OMPI_", "PMIX_"))}
    words = [sys.executable, "-c", FREED]
    done = subprocess.run(words, env=plain, capture_output=True, text=True, check=True)
    taken, left = map(float, done.stdout.split())
    assert taken > 70
    assert left < 10


def growth(action: Callable[[ContactProblem], object]) -> float:
    """Return the bytes that an action on one of two blocks needs for each unknown more.

    What is compiled for a load takes some MB on any mesh.
    """
    peaks, unknowns = [], []
    for cells in (8, 16):
        problem = build_problem(block(cells), MPI.COMM_SELF)
        action(problem)  # forms that are made once are no matter here
        gc.collect()
        tracemalloc.start()
        try:
            action(problem)
            peaks.append(tracemalloc.get_traced_memory()[1])
        finally:
            tracemalloc.stop()
        unknowns.append(problem.body.layout.unknowns)
    return float(np.diff(peaks)[0] / np.diff(unknowns)[0])


def test_review_and_rigid_modes_need_less_than_the_matrix(monkeypatch: pytest.MonkeyPatch) -> None:
    """That takes some 520 bytes an unknown, and is no more, or not all yet, then."""
    monkeypatch.setattr(elements, "CHUNK", 500)
    assert growth(lambda problem: estimated(problem, problem.start())) < 450
    assert growth(unsupported) < 200
