"""What the first rank works out for all, so that the others need not hold what it takes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from mpi4py import MPI

from contact.typing import Array


def from_first(comm: MPI.Intracomm, work: Callable[[], Array], *shape: int) -> Array:
    """Return on all ranks what the first one works out. Collective.

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
    found = np.ascontiguousarray(work()) if comm.rank == 0 else np.empty(shape)
    comm.Bcast(found)
    return found
