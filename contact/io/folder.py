"""The folder of a run's results: locked for one run at a time, and replaced as a whole.

New files are written into `STAGE` in the folder, ``summary.json`` last: with it they are complete,
and `settle` moves them to their places. A run that is killed before leaves the earlier results; one
that is killed later leaves the new ones, which the next run or figure puts in their places.
``summary.json`` names the files of its run under "files": these alone are ever removed.

Rank 0 alone looks at the folder and decides for all.
"""

from __future__ import annotations

import fcntl
import json
import logging
import os
import platform
import re
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpi4py import MPI

from contact.errors import InputError
from contact.methods.signals import signals_held
from contact.ranks import on_root

logger = logging.getLogger("contact.io")

LOCK, STAGE, SUMMARY = ".contact-lock", ".contact-new", "summary.json"
#: The earlier summary, while new files move to their places.
EARLIER = "earlier.json"
#: Key of the summary with the names of the files of its run.
FILES = "files"

#: Names of results.
_RESULT = re.compile(
    r"summary\.json|(history|steps|adapt|contact|contact-steps|contact-against)\.csv|"
    r"(contact|fields)(-\d{4,})?\.vtu|contact-against\.vtu|(contact|fields)\.pvd|"
    r"(fields|cells)\.bp|fields\.(xdmf|h5)|checkpoint\.npz|"
    r"figure-(contact|loop|zones|energy|deformed|potential)\.png"
)


@dataclass(frozen=True)
class ResultFolder:
    """A folder that belongs to the ranks of this run; made by `result_folder`."""

    path: Path
    comm: MPI.Intracomm

    def replace(self, write: Callable[[Path], Mapping[str, object]]) -> None:
        """Replace the results of an earlier run; where `write` fails, these stay. Collective.

        It writes all files but the summary into a folder, and returns the contents of that.
        """
        new = self.path / STAGE
        try:
            on_root(self.comm, lambda: new.mkdir())
            summary = write(new)
            on_root(self.comm, lambda: _complete(self.path, summary))
        except BaseException:
            if self.comm.rank == 0:
                shutil.rmtree(new, ignore_errors=True)
            raise
        # No rank may end, and the others with it, while rank 0 moves the files.
        with signals_held():
            self.comm.barrier()
            on_root(self.comm, lambda: settle(self.path))


@contextmanager
def result_folder(
    path: str | Path, comm: MPI.Intracomm, overwrite: bool = False
) -> Iterator[ResultFolder]:
    """Make a folder if need be, and keep other runs out of it. Collective.

    Files of an interrupted run are put in order first. Folders that were made here and stay empty
    are removed in the end. Files with names of results that no run has left are refused, unless
    they may be overwritten.
    """
    path = Path(path)
    stack, together = ExitStack(), False
    on_root(comm, lambda: _take(stack, path, overwrite))
    try:
        with stack:
            yield ResultFolder(path, comm)
        together = True
    except InputError:  # wrong input is so on all ranks
        together = True
        raise
    finally:
        if together:  # no rank finds the lock or the folder, which rank 0 removes
            comm.barrier()


def _take(stack: ExitStack, path: Path, overwrite: bool) -> None:
    """Make, lock and check a folder until the stack is left, or at once where that fails."""
    with ExitStack() as making:
        _lock_and_check(making, path, overwrite)
        stack.push(making.pop_all())


def _lock_and_check(stack: ExitStack, path: Path, overwrite: bool) -> None:
    try:
        for place in [p for p in (path, *path.parents) if not p.exists()][::-1]:
            place.mkdir()
            stack.callback(_remove_empty, place)
        stack.enter_context(_locked(path))
        settle(path)
    except OSError as error:
        reason = error.strerror or "not writable"
        raise InputError(
            f"--out {path}: {reason}; accepted: a folder to write to", "cannot-write"
        ) from None
    check_names(path, filter(_RESULT.fullmatch, sorted(os.listdir(path))), overwrite)


def _remove_empty(folder: Path) -> None:
    with suppress(OSError):  # as a rule it has results
        folder.rmdir()


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Lock a folder for this process; the lock of a process that is killed vanishes."""
    path = folder / LOCK
    while True:
        number = os.open(path, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
        with open(number, "r+", errors="replace") as lock:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise InputError(
                    f"--out {folder}: another run works in it ({lock.read(200).strip()}); "
                    "accepted: a folder of its own, or the same after that run",
                    "folder-locked",
                ) from None
            except OSError:
                logger.warning("%s: its file system has no locks; run once at a time in it", folder)
            # The run that had it may have removed it between the two.
            if not (path.exists() and os.path.samestat(os.fstat(lock.fileno()), path.stat())):
                continue
            lock.truncate(0)
            lock.write(f"process {os.getpid()} on {platform.node()}\n")
            lock.flush()
            try:
                yield
            finally:
                path.unlink(missing_ok=True)  # while it is locked: nobody else has it
            return


def check_names(folder: Path, names: Iterator[str] | Sequence[str], overwrite: bool) -> None:
    """Refuse to replace files that the summary does not name, or a folder by a file."""
    own = listed(folder / SUMMARY)
    for name in names:
        path, expected = folder / name, "a folder" if name.endswith(".bp") else "a file"
        if not os.path.lexists(path):
            continue
        found = "a folder" if path.is_dir() else "a file"
        if found != expected:
            raise InputError(
                f"{path}: given {found} where the results have {expected}; accepted: a folder "
                "without it",
                "not-ours",
            )
        if not overwrite and name not in own:
            raise InputError(
                f"{path}: given {found} that no run's {SUMMARY} there names as its own; accepted: "
                "a folder without it, or contact solve --overwrite to replace it",
                "not-ours",
            )


def _complete(folder: Path, summary: Mapping[str, object]) -> None:
    """Write the summary of the new files, by which they are complete, with their names."""
    new = folder / STAGE
    names = sorted([*os.listdir(new), SUMMARY])
    check_names(folder, names, overwrite=True)
    for path in new.rglob("*"):
        _to_disk(path)
    _write_summary(new / SUMMARY, summary, names)


def settle(folder: Path) -> None:
    """Move complete new files to their places, and remove incomplete ones.

    It may be ended at any moment, and then called again. The earlier summary goes first, and the
    new one comes last: none stands beside files of another run.
    """
    new = folder / STAGE
    if (new / SUMMARY).is_file():
        if (folder / SUMMARY).is_file():
            os.replace(folder / SUMMARY, new / EARLIER)
        names = listed(new / SUMMARY)
        for name in listed(new / EARLIER):
            if name not in names:
                _remove(folder / name)
        for name in sorted(names, key=lambda name: name == SUMMARY):
            if (new / name).exists():
                if (new / name).is_dir():
                    _remove(folder / name)
                os.replace(new / name, folder / name)
    shutil.rmtree(new, ignore_errors=True)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


@contextmanager
def added(folder: Path) -> Iterator[Path]:
    """Yield a place for further files of the results in a folder, to which they are moved then.

    On one rank, which has the folder from `result_folder`.
    """
    new = folder / STAGE
    new.mkdir()
    try:
        yield new
        names = os.listdir(new)
        check_names(folder, names, overwrite=False)
        # Named before they are there: a later run would leave a file without a name.
        every = {*listed(folder / SUMMARY), *names}
        _write_summary(folder / SUMMARY, read_json(folder / SUMMARY), sorted(every))
        for name in names:
            os.replace(new / name, folder / name)
    finally:
        shutil.rmtree(new, ignore_errors=True)


def _write_summary(path: Path, summary: Mapping[str, object], names: list[str]) -> None:
    text = json.dumps({**summary, FILES: names}, indent=2, allow_nan=False) + "\n"
    write_whole(path, lambda draft: draft.write_text(text, encoding="utf-8"))


def listed(summary: Path) -> list[str]:
    """Return the names of the files of a run; none from a summary that no run has written."""
    content = read_json(summary)
    names = content.get(FILES) if isinstance(content.get("versions"), dict) else None
    return [name for name in names or () if Path(name).name == name]


def write_whole(path: Path, write: Callable[[Path], object]) -> None:
    """Let a file be written beside its place, and move it there when it is on the disk."""
    draft = path.with_name(f".{path.name}.part")
    write(draft)
    _to_disk(draft)
    os.replace(draft, path)


def _to_disk(path: Path) -> None:
    if path.is_file():
        with path.open("rb") as file:
            os.fsync(file.fileno())


def read_json(path: Path) -> dict[str, Any]:
    """Return the table in a file; an empty one if there is no such file, or it is no table."""
    with suppress(OSError, ValueError, RecursionError):
        content = json.loads(path.read_bytes())
        if isinstance(content, dict):
            return content
    return {}
