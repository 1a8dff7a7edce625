"""Libraries that write to a disk, kept from ending the process where it is full.

ADIOS2 and HDF5 throw where a disk is full, and again where what has failed is closed by its
destructor, which ends a process; on several ranks those that had room wait for the others. So
the room is asked for first; and what fails all the same, for others write to the disk too, is
never destroyed.
"""

from __future__ import annotations

import ctypes
import errno
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from mpi4py import MPI

from contact.output.folder import on_root
from contact.output.transaction import ROOM

#: Bytes that each rank adds to a file besides the numbers: names, offsets, extremes.
OVERHEAD = 16384


def claim_room(comm: MPI.Intracomm, folder: Path, own: int) -> None:
    """Check that there is room for files. Collective.

    Parameters
    ----------
    comm
        The ranks that will write them.
    folder
        Where to.
    own
        Bytes that this rank will write.

    Raises
    ------
    InputError
        If there is not.
    """
    needed = comm.allreduce(own, op=MPI.SUM)

    def ask() -> None:
        # Quotas do not show in what a file system says that it has left.
        path = folder / ROOM
        try:
            with path.open("wb") as file:
                os.posix_fallocate(file.fileno(), 0, needed)
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(folder)) from None
        finally:
            path.unlink(missing_ok=True)

    on_root(comm, ask)


@contextmanager
def library_errors(path: Path) -> Iterator[None]:
    """Turn what a library says while it writes a file into an OSError."""
    try:
        yield
    except RuntimeError as error:
        number = errno.ENOSPC if "No space left" in str(error) else errno.EIO
        raise OSError(number, os.strerror(number), str(path)) from error


#: Writers that have failed. Some libraries abort the process where they clean up after these.
abandoned: list[str] = []


@contextmanager
def closing(open_: Callable[[], Any]) -> Iterator[Any]:
    """Yield what writes a file, and close it; where that fails, it is left as it is.

    Parameters
    ----------
    open_
        Makes the writer, which has a method ``close``.
    """
    writer = open_()
    try:
        yield writer
        writer.close()
    except RuntimeError:
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(writer))  # not to be destroyed
        abandoned.append(type(writer).__name__)
        raise
