"""The folder of a run's results: locked for one run at a time, and replaced as a whole.

Rank 0 alone looks at it and decides for all.
"""

from __future__ import annotations

import errno
import fcntl
import logging
import os
import platform
import stat
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from mpi4py import MPI

from contact.errors import InputError
from contact.methods.interrupt import signals_held
from contact.output import transaction

logger = logging.getLogger("contact.output")

LOCK = ".contact-lock"
#: Answers of file systems without locks.
_NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)

T = TypeVar("T")


def on_root(comm: MPI.Intracomm, action: Callable[[], T]) -> T:
    """Do something with files on rank 0; its result, or its InputError, is that of all ranks.

    Raises
    ------
    InputError
        Also where the system refuses something.
    """
    result: Any = None
    if comm.rank == 0:
        try:
            result = action()
        except InputError as error:
            result = error
        except OSError as error:
            result = refused(error)
    result = comm.bcast(result)
    if isinstance(result, InputError):
        raise result
    return result


def refused(error: OSError) -> InputError:
    """Return a refusal of the system in words."""
    where = "a file" if error.filename is None else error.filename
    return InputError(
        f"{where}: {error.strerror or error}; accepted: a place to write to, with room for the "
        "results (earlier results are kept)"
    )


@dataclass(frozen=True)
class ResultFolder:
    """A folder that belongs to this run; made by `result_folder`.

    Attributes
    ----------
    path
        Where it is.
    comm
        The ranks of the run.
    """

    path: Path
    comm: MPI.Intracomm

    def replace(self, write: Callable[[Path], Mapping[str, object]]) -> None:
        """Replace the results of an earlier run. Collective.

        Parameters
        ----------
        write
            Writes the members, all but the summary, into the folder that it is given, and
            returns the contents of the summary. Collective; where it fails, the earlier
            results stay as they are.
        """
        try:
            new = on_root(self.comm, lambda: transaction.begin(self.path))
            summary = write(new)
            on_root(self.comm, lambda: transaction.complete(self.path, dict(summary)))
        except BaseException:
            if self.comm.rank == 0:
                transaction.discard(self.path)
            raise
        # No rank may end, and the others with it, while rank 0 moves the members.
        with signals_held():
            self.comm.barrier()
            on_root(self.comm, lambda: transaction.swap(self.path))


@contextmanager
def result_folder(
    path: str | Path, comm: MPI.Intracomm, overwrite: bool = False
) -> Iterator[ResultFolder]:
    """Make a folder if need be, and keep other runs out of it. Collective.

    The files of an interrupted run are put in order first. A folder that has been made here
    and stays empty is removed in the end.

    Parameters
    ----------
    path, comm
        The folder, and the ranks of the run.
    overwrite
        Whether files may be replaced that no run has left, but have the names of results.

    Raises
    ------
    InputError
        If it cannot be written to, if another run works in it, or if something that is no
        result stands under the name of one.
    """
    path = Path(path)
    taken: list[tuple[int, list[Path]]] = []
    on_root(comm, lambda: taken.append(_take(path, overwrite)))
    together = False
    try:
        yield ResultFolder(path, comm)
        together = True
    except InputError:  # wrong input is so on all ranks
        together = True
        raise
    finally:
        for lock, made in taken:
            _release(path, lock, made)
        if together:  # no rank finds files that rank 0 is about to remove
            comm.barrier()


def settle(path: Path) -> None:
    """Put the files of an interrupted run in order, before a folder is read. On one rank.

    Nothing is done where a run is at work or the folder cannot be written to.
    """
    if (path / transaction.STAGE).is_dir():
        with suppress(InputError, OSError):
            lock, made = _take(path, overwrite=True)
            _release(path, lock, made)


def _take(path: Path, overwrite: bool) -> tuple[int, list[Path]]:
    """Make, lock and check a folder; return the lock and the folders that were made."""
    made: list[Path] = []
    lock = -1
    try:
        made = [place for place in (path, *path.parents) if not place.exists()]
        path.mkdir(parents=True, exist_ok=True)
        lock = _lock(path)
        transaction.recover(path)
        transaction.check_members(path)
        if not overwrite:
            transaction.check_foreign(path)
    except (InputError, OSError) as error:
        _release(path, lock, made)
        if isinstance(error, InputError):
            raise
        reason = error.strerror or "not writable"
        raise InputError(f"--out {path}: {reason}; accepted: a folder to write to") from None
    return lock, made


def _release(path: Path, lock: int, made: list[Path]) -> None:
    with suppress(OSError):
        if lock >= 0:
            (path / LOCK).unlink()  # while it is locked: nobody else has it
            os.close(lock)
    for place in made:
        with suppress(OSError):  # not empty, as a rule
            place.rmdir()


def _lock(folder: Path) -> int:
    """Lock a folder for this process and return the lock, which is held until it is closed."""
    path = folder / LOCK
    while True:
        # Neither a link is followed nor a pipe waited for.
        flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK
        try:
            lock = os.open(path, flags, 0o666)
        except OSError as error:
            if error.errno in (errno.ELOOP, errno.EISDIR, errno.ENXIO):
                raise _no_lock(path) from None
            raise
        try:
            if not stat.S_ISREG(os.fstat(lock).st_mode):
                raise _no_lock(path)
            _lock_file(lock, folder)
            # The run that had it may have removed it between the two.
            if path.exists() and os.path.samestat(os.fstat(lock), path.lstat()):
                os.ftruncate(lock, 0)
                os.write(lock, f"process {os.getpid()} on {platform.node()}\n".encode())
                return lock
        except BaseException:
            os.close(lock)
            raise
        os.close(lock)


def _lock_file(lock: int, folder: Path) -> None:
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        owner = os.pread(lock, 200, 0).decode(errors="replace").strip()
        raise InputError(
            f"--out {folder}: another run works in it ({owner}); accepted: a folder of its own, "
            "or the same after that run"
        ) from None
    except OSError as error:
        if error.errno not in _NO_LOCKS:
            raise
        logger.warning("%s: its file system has no locks; run once at a time in it", folder)


def _no_lock(path: Path) -> InputError:
    return InputError(f"{path} is no file of ours; accepted: a folder without it")
