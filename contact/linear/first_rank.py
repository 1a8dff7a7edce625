"""Work of the first rank for all, so that the others need not hold the data of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from mpi4py import MPI

T = TypeVar("T")


def together(comm: MPI.Intracomm, work: Callable[[], T]) -> T:
    """Return the result of each rank; raise on all the error of a single one. Collective.

    The others would wait for it for ever.

    Parameters
    ----------
    comm
        The ranks.
    work
        The work of this rank, without the others.
    """
    if comm.size == 1:
        return work()
    found, error = None, None
    try:
        found = work()
    except Exception as caught:
        error = caught
    for other in comm.allgather(error):
        if other is not None:
            raise other
    return found  # type: ignore[return-value]


def from_first(comm: MPI.Intracomm, work: Callable[[], T]) -> T:
    """Return the result of the first rank on all, or raise its error. Collective."""
    found = together(comm, lambda: work() if comm.rank == 0 else None)
    return comm.bcast(found)  # type: ignore[return-value]
