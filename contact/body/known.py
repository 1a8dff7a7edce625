"""The last answers to a question that several ask, who do not know of each other."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np
from mpi4py import MPI

from contact.typing import Array


class LastAnswers:
    """Remembers some answers, and what they were answers to.

    Parameters
    ----------
    comm
        Ranks that ask together.
    count
        How many.
    """

    def __init__(self, comm: MPI.Intracomm, count: int) -> None:
        self._comm = comm
        self._known: deque[tuple[tuple[Array, ...], Array]] = deque(maxlen=count)

    def __call__(self, asked: tuple[Array, ...], find: Callable[[], Array]) -> Array:
        """Return what `find` returns, without asking it about the same arrays twice. Collective."""
        same = np.array([_equal(asked, before) for before, _ in self._known], dtype=bool)
        self._comm.Allreduce(MPI.IN_PLACE, same, op=MPI.LAND)
        if not same.any():
            self._known.append((tuple(array.copy() for array in asked), find()))
            return self._known[-1][1].copy()
        return self._known[int(np.argmax(same))][1].copy()


def _equal(one: tuple[Array, ...], other: tuple[Array, ...]) -> bool:
    return len(one) == len(other) and all(map(np.array_equal, one, other))
