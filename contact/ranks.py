"""Work of one rank, and errors of one rank, for all: the others would wait for it for ever."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

from mpi4py import MPI

from contact.errors import InputError

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


def refused(error: OSError) -> InputError:
    """Return a refusal of the system in words."""
    where = "a file" if error.filename is None else error.filename
    return InputError(
        f"{where}: {error.strerror or error}; accepted: a place to write to, with room for the "
        "results (earlier results are kept)"
    )
