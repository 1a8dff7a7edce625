"""What the first rank works out for all, so that the others need not hold what it takes."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar

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


def with_questions(
    comm: MPI.Intracomm, work: Callable[[Callable[..., Any]], T], answer: Callable[..., Any]
) -> T:
    """Return on all ranks what the first one works out, asking all of them. Collective.

    Loops whose ends depend on rounding are so the same on all of them, whatever their processors.

    Parameters
    ----------
    comm
        The ranks.
    work
        What the first one does, given whom to ask.
    answer
        What all ranks do together with the arguments of a question; the first one is told what it
        returns there. What one of them raises, all do.
    """
    found, error = None, None
    if comm.rank == 0:
        broken: list[BaseException] = []

        def ask(*question: Any) -> Any:
            comm.bcast(question)
            try:
                return together(comm, lambda: answer(*question))
            except BaseException as caught:
                broken.append(caught)
                raise

        try:
            found = work(ask)
        except Exception as caught:
            if broken:
                raise
            error = caught  # the others are waiting, and are to end as this one does
        comm.bcast(None)
    else:
        while (question := comm.bcast(None)) is not None:
            together(comm, partial(answer, *question))
    found, error = comm.bcast((found, error))
    if error is not None:
        raise error
    return found  # type: ignore[return-value]
