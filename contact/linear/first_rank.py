"""What the first rank works out for all, so that the others need not hold what it takes."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

import numpy as np
from mpi4py import MPI

from contact.typing import Array

T = TypeVar("T")


def together(comm: MPI.Intracomm, work: Callable[[], T]) -> T:
    """Return what a rank works out; raise on all what one of them alone raises. Collective.

    The others would wait for it for ever.

    Parameters
    ----------
    comm
        The ranks.
    work
        What this one does, without the others.
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


def from_first(comm: MPI.Intracomm, work: Callable[[], Array], *shape: int) -> Array:
    """Return on all ranks what the first one works out, or raise what it raises. Collective.

    Parameters
    ----------
    comm
        The ranks.
    work
        What the first one does.
    shape
        Of the result.
    """
    if comm.size == 1:
        return work()
    first = comm.rank == 0
    found = together(comm, lambda: np.ascontiguousarray(work()) if first else np.empty(shape))
    comm.Bcast(found)
    return found
