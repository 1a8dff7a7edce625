"""Work and errors of one rank for all, which else wait for ever; sums; values of neighbours."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar

import numpy as np
from mpi4py import MPI
from numpy.typing import ArrayLike, NDArray

from contact.errors import InputError
from contact.typing import Array

P = ParamSpec("P")
T = TypeVar("T")


class OnRanks(Protocol):
    """An object of which each rank has a part."""

    comm: MPI.Intracomm


S = TypeVar("S", bound=OnRanks)


@contextmanager
def on_all_ranks(comm: MPI.Intracomm) -> Iterator[None]:
    """Raise on all ranks the error of one of them. Collective."""
    failure = None
    try:
        yield
    except Exception as error:
        failure = error
    if not summed(comm, failure is not None):
        return
    from contact._compat import lasting  # loads PETSc, whose options come before it

    failures = lasting(comm).allgather(failure)
    for known in (failure, *failures):
        if known is not None:
            raise known


def together(method: Callable[Concatenate[S, P], T]) -> Callable[Concatenate[S, P], T]:
    """Let the error of a method on one rank be that of all, which makes it collective."""

    @wraps(method)
    def called(self: S, *args: P.args, **kwargs: P.kwargs) -> T:
        with on_all_ranks(self.comm):
            return method(self, *args, **kwargs)

    return called


def on_root(comm: MPI.Intracomm, action: Callable[[], T]) -> T:
    """Do something on rank 0; its result, or its error, is that of all ranks. Collective.

    Raises
    ------
    InputError
        Also where the system refuses something: see `refused`.
    """
    result = on_each(comm, lambda: action() if comm.rank == 0 else None)
    return comm.bcast(result)  # type: ignore[no-any-return]


def on_each(comm: MPI.Intracomm, action: Callable[[], T]) -> T:
    """Do something on each rank; the error of one of them is that of all. Collective.

    Raises
    ------
    InputError
        Also where the system refuses something: see `refused`.
    """
    result: Any = None
    with on_all_ranks(comm):
        try:
            result = action()
        except OSError as error:
            raise refused(error) from None
    return result  # type: ignore[no-any-return]


def summed(comm: MPI.Comm, values: ArrayLike) -> Array:
    """Return the sums over all ranks of values of the same shape on each. Collective.

    They are sent as they are: pickled, a number of NumPy takes twenty times as long.
    """
    sums = np.array(values, dtype=np.float64, order="C")
    comm.Allreduce(MPI.IN_PLACE, sums, op=MPI.SUM)
    return sums


def largest(comm: MPI.Comm, value: float) -> float:
    """Return the largest number over all ranks, NaN on all where it is on one. Collective."""
    found = np.array([-np.inf if np.isnan(value) else value, np.isnan(value)])
    comm.Allreduce(MPI.IN_PLACE, found, op=MPI.MAX)
    return float(np.nan if found[1] else found[0])


def exchanged(
    comm: MPI.Comm, ranks: NDArray[np.integer[Any]], *arrays: NDArray[Any]
) -> tuple[NDArray[Any], ...]:
    """Send rows of arrays to ranks, and return those that this rank is sent. Collective.

    Ranks that nothing is sent to get no message but its length.

    Parameters
    ----------
    comm
        Communicator.
    ranks
        Where each row goes, shape (n,).
    arrays
        Of the same kinds and shapes of rows on all ranks, shapes (n, ...).

    Returns
    -------
    The rank that sent each row, ascending, shape (m,), and the rows in the order in which it sent
    them, shapes (m, ...).
    """
    counts = np.bincount(ranks, minlength=comm.size)
    coming = np.empty_like(counts)
    comm.Alltoall(counts, coming)
    order = np.argsort(ranks, kind="stable")
    to, by = (np.append(0, np.cumsum(sizes)) for sizes in (counts, coming))
    found: list[NDArray[Any]] = [np.repeat(np.arange(comm.size), coming)]
    for array in arrays:
        rows, here = array[order], np.empty((by[-1], *array.shape[1:]), dtype=array.dtype)
        waiting = [comm.Irecv(here[by[k] : by[k + 1]], k) for k in np.flatnonzero(coming)]
        waiting += [comm.Isend(rows[to[k] : to[k + 1]], k) for k in np.flatnonzero(counts)]
        MPI.Request.Waitall(waiting)
        found.append(here)
    return tuple(found)


def boxes(comm: MPI.Comm, points: Array) -> Array:
    """Return the lower and upper corners of the boxes around the points of each rank. Collective.

    Of shape (ranks, 2, d); around no points, upper corners are below lower ones.
    """
    none = np.full(points.shape[1], np.inf)
    own = [points.min(axis=0), points.max(axis=0)] if len(points) else [none, -none]
    found = np.empty((comm.size, 2, points.shape[1]))
    comm.Allgather(np.array(own), found)
    return found


def near_boxes(
    comm: MPI.Comm, points: Array, asked: Array, reach: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the ranks that ask for points near theirs, and which these are. Collective.

    Each rank tells the others a box, and gets the points in it alone.

    Parameters
    ----------
    comm
        Communicator.
    points
        Those of this rank that others may ask for, shape (n, d).
    asked
        Those that this rank asks for, shape (m, d).
    reach
        How far around the box of these (length).

    Returns
    -------
    The rank and the row of each point to be sent, in the order of the ranks, shape (k,).
    """
    rows = [
        np.flatnonzero(np.all((points >= lower - reach) & (points <= upper + reach), axis=1))
        for lower, upper in boxes(comm, asked)
    ]
    return np.repeat(np.arange(comm.size), [some.size for some in rows]), np.concatenate(rows)


def neighbours(
    comm: MPI.Comm, points: Array, values: Array, reach: float, asked: Array | None = None
) -> Array:
    """Return the values at points near those of this rank, from the ranks that have them.

    Collective.

    Parameters
    ----------
    comm
        Communicator.
    points, values
        Those of this rank, shapes (n, d) and (n, k).
    reach
        How far around the box of its points a rank asks (length).
    asked
        Points that this rank asks for instead, shape (m, d).

    Returns
    -------
    In the order of the ranks, shape (near, k).
    """
    ranks, rows = near_boxes(comm, points, points if asked is None else asked, reach)
    return exchanged(comm, ranks, values[rows])[1]


def refused(error: OSError) -> InputError:
    """Return a refusal of the system in words."""
    where = "a file" if error.filename is None else error.filename
    return InputError(
        f"{where}: {error.strerror or error}; accepted: a place to write to, with room for the "
        "results (earlier results are kept)",
        "cannot-write",
    )
