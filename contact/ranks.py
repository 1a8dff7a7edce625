"""Collective helpers: run on the root, re-raise errors on all ranks, reduce, exchange rows."""

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
    """Raise the error of one rank on all, which else wait for it for ever. Collective."""
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


def collective(method: Callable[Concatenate[S, P], T]) -> Callable[Concatenate[S, P], T]:
    """Decorate a method of which each rank does a part: errors of one are raised on all."""

    @wraps(method)
    def called(self: S, *args: P.args, **kwargs: P.kwargs) -> T:
        with on_all_ranks(self.comm):
            return method(self, *args, **kwargs)

    return called


def on_root(comm: MPI.Intracomm, action: Callable[[], T]) -> T:
    """Run an action on rank 0; broadcast its result, or raise its error on all. Collective.

    An OSError is raised as an InputError (`refused`).
    """
    result = on_each(comm, lambda: action() if comm.rank == 0 else None)
    return comm.bcast(result)  # type: ignore[no-any-return]


def on_each(comm: MPI.Intracomm, action: Callable[[], T]) -> T:
    """Run an action on each rank; raise the error of one on all, as `on_root`. Collective."""
    result: Any = None
    with on_all_ranks(comm):
        try:
            result = action()
        except OSError as error:
            raise refused(error) from None
    return result  # type: ignore[no-any-return]


def summed(comm: MPI.Comm, values: ArrayLike) -> Array:
    """Sum an array over all ranks; by buffers, 20 times as fast as pickled. Collective."""
    sums = np.array(values, dtype=np.float64, order="C")
    comm.Allreduce(MPI.IN_PLACE, sums, op=MPI.SUM)
    return sums


def largest(comm: MPI.Comm, value: float) -> float:
    """Return the largest number over all ranks, NaN if one has NaN. Collective."""
    found = np.array([-np.inf if np.isnan(value) else value, np.isnan(value)])
    comm.Allreduce(MPI.IN_PLACE, found, op=MPI.MAX)
    return float(np.nan if found[1] else found[0])


def exchanged(
    comm: MPI.Comm, ranks: NDArray[np.integer[Any]], *arrays: NDArray[Any]
) -> tuple[NDArray[Any], ...]:
    """Send rows of arrays to ranks, and return the received rows. Collective.

    Given the destination of each row, shape (n,), and arrays (n, ...), of the same types and shapes
    of rows on all ranks. Returned are the source of each row, ascending, shape (m,), and the rows
    in the order in which they were sent, shapes (m, ...).
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


def bounding_boxes(comm: MPI.Comm, points: Array) -> Array:
    """Return corners of each rank's points, (ranks, 2, d); upper < lower if none. Collective."""
    none = np.full(points.shape[1], np.inf)
    own = [points.min(axis=0), points.max(axis=0)] if len(points) else [none, -none]
    found = np.empty((comm.size, 2, points.shape[1]))
    comm.Allgather(np.array(own), found)
    return found


def neighbours(
    comm: MPI.Comm, points: Array, values: Array, reach: float, asked: Array | None = None
) -> Array:
    """Return values at points of any rank in the bounding box of this one's. Collective.

    Points (n, d) and values (n, k) are those of this rank; the box is that of the points `asked`
    (by default all of them), enlarged by `reach` (length). The result has the shape (near, k), in
    the order of the ranks.
    """
    rows = [
        np.flatnonzero(np.all((points >= lower - reach) & (points <= upper + reach), axis=1))
        for lower, upper in bounding_boxes(comm, points if asked is None else asked)
    ]
    ranks = np.repeat(np.arange(comm.size), [some.size for some in rows])
    return exchanged(comm, ranks, values[np.concatenate(rows)])[1]


def refused(error: OSError) -> InputError:
    """Return an OSError as an InputError."""
    where = "a file" if error.filename is None else error.filename
    return InputError(
        f"{where}: {error.strerror or error}; accepted: a place to write to, with room for the "
        "results (earlier results are kept)",
        "cannot-write",
    )
