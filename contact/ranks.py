"""Work and errors of one rank for all, which else wait for ever; values of neighbouring ranks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import numpy as np
from mpi4py import MPI

from contact.errors import InputError
from contact.typing import Array

T = TypeVar("T")


@contextmanager
def on_all_ranks(comm: MPI.Intracomm) -> Iterator[None]:
    """Raise on all ranks the error of one of them. Collective."""
    failure = None
    try:
        yield
    except Exception as error:
        failure = error
    from contact._compat import lasting  # loads PETSc, whose options come before it

    failures = lasting(comm).allgather(failure)
    for known in (failure, *failures):
        if known is not None:
            raise known


def on_root(comm: MPI.Intracomm, action: Callable[[], T]) -> T:
    """Do something on rank 0; its result, or its error, is that of all ranks. Collective.

    Raises
    ------
    InputError
        Also where the system refuses something: see `refused`.
    """
    result: Any = None
    with on_all_ranks(comm):
        try:
            result = action() if comm.rank == 0 else None
        except OSError as error:
            raise refused(error) from None
    return comm.bcast(result)  # type: ignore[no-any-return]


def neighbours(comm: MPI.Comm, points: Array, values: Array, reach: float) -> Array:
    """Return the values at points near those of this rank, from the ranks that have them.

    Each rank tells the others where its points are, and gets no more than it asks for. Collective.

    Parameters
    ----------
    comm
        Communicator.
    points, values
        Those of this rank, shapes (n, d) and (n, k).
    reach
        How far around the box of its points a rank asks (length).

    Returns
    -------
    In the order of the ranks, shape (near, k).
    """
    none = np.full(points.shape[1], np.inf)
    low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else (none, -none)
    sent = [
        values[np.all((points >= lower - reach) & (points <= upper + reach), axis=1)]
        for lower, upper in comm.allgather((low, high))
    ]
    return np.concatenate(comm.alltoall(sent))


def refused(error: OSError) -> InputError:
    """Return a refusal of the system in words."""
    where = "a file" if error.filename is None else error.filename
    return InputError(
        f"{where}: {error.strerror or error}; accepted: a place to write to, with room for the "
        "results (earlier results are kept)"
    )
