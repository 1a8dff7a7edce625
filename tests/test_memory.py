"""Memory that is freed goes back to the system, and phases need little beside the solver."""

import tracemalloc
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from contact import build_problem
from contact.body import pointwise
from contact.output.error_estimate import estimated
from contact.problem.rigid_modes import constrained_by_supports
from scripts.benchmarks.bench_one import block


def resident() -> float:
    """Return the memory of this process (MB)."""
    status = Path("/proc/self/status").read_text()
    return float(status.split("VmRSS:")[1].split()[0]) / 1024


def test_freed_arrays_are_returned() -> None:
    """SuperLU_DIST, once it is loaded, has the allocator keep them."""
    before = resident()
    values = np.ones(10_000_000)
    assert resident() > before + 70
    del values
    assert resident() < before + 10


def peak(action: Callable[[], object], unknowns: int) -> float:
    """Return the bytes an unknown of Python's arrays that an action needs at its peak."""
    action()  # forms that are made once are no matter here
    tracemalloc.start()
    try:
        action()
        return tracemalloc.get_traced_memory()[1] / unknowns
    finally:
        tracemalloc.stop()


def test_review_and_rigid_modes_need_less_than_the_matrix(monkeypatch: pytest.MonkeyPatch) -> None:
    """That takes some 520 bytes an unknown, and is no more, or not all yet, then."""
    monkeypatch.setattr(pointwise, "CHUNK", 500)
    problem = build_problem(block(10), MPI.COMM_SELF)
    unknowns, state = problem.equilibrium.layout.unknowns, problem.start()
    assert peak(lambda: estimated(problem, state), unknowns) < 450
    assert peak(lambda: constrained_by_supports(problem), unknowns) < 200
