"""The last answer to a question that several ask, who do not know of each other."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from mpi4py import MPI

from contact.typing import Array


class LastAnswer:
    """Remembers one answer, and what it was an answer to.

    Parameters
    ----------
    comm
        Ranks that ask together.
    """

    def __init__(self, comm: MPI.Intracomm) -> None:
        self._comm = comm
        self._asked: tuple[Array, ...] = ()
        self._answer: Array = np.empty(0)

    def __call__(self, asked: tuple[Array, ...], find: Callable[[], Array]) -> Array:
        """Return what `find` returns, without asking it about the same arrays twice. Collective."""
        same = len(asked) == len(self._asked) and all(map(np.array_equal, asked, self._asked))
        if not self._comm.allreduce(same, op=MPI.LAND):
            self._answer = find()
            self._asked = tuple(array.copy() for array in asked)
        return self._answer.copy()
