"""The folder of a run's results: locked for one run at a time, and replaced as a whole.

A run writes its members into ``.contact-new/new`` of the folder, ``summary.json`` the last: from
then on they are complete. Then each member takes its place, the earlier one of its name, and the
earlier ones that have no successor, going to ``.contact-new/old``. The order of the renames says
at every moment which steps are to come:

1. the earlier ``summary.json`` goes first: no summary stands beside members of another run;
2. the other members change places one by one, a new one that is still in ``new`` not having
   moved yet, so that the file of its name is the earlier one;
3. the new ``summary.json`` comes last.

Whoever finds ``new/summary.json`` continues at 2 (`recover`); whoever finds none has nothing to
continue. ``summary.json`` names the members under "files": these alone are removed by a later run.

Rank 0 alone looks at the folder and decides for all.
"""

from __future__ import annotations

import errno
import fcntl
import json
import logging
import os
import platform
import re
import shutil
import stat
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from mpi4py import MPI

from contact.errors import InputError
from contact.methods.signals import signals_held
from contact.ranks import on_root

logger = logging.getLogger("contact.io")

LOCK, STAGE, SUMMARY = ".contact-lock", ".contact-new", "summary.json"
#: File that asks for room on the disk before members are written; killed runs leave it.
ROOM = "room"
#: Key of the summary under which the names of the members stand.
MANIFEST = "files"

#: Names that each run may write, and those that a summary may name: it may be of anybody.
_RESULT = re.compile(
    r"summary\.json|(history|steps|adapt)\.csv|contact(-steps|-against)?(\.\d{4,})?\.csv|"
    r"(contact(-against)?|(contact|fields)(-\d{4,})?)(\.\d{4,})?\.p?vtu|contact\.pvd|"
    r"fields\.(pvd|bp|xdmf|h5)|cells\.bp|checkpoint(\.\d{4,})?\.npz|"
    r"figure-(contact|loop|zones|energy|deformed|potential)\.png"
)
_MEMBER = re.compile(
    r"[A-Za-z0-9][\w-]*(\.\d{4,})?\.(json|csv|bp|npz|xdmf|h5|vtkhdf|pvd|p?vtu|png|pdf|svg|gif)"
)
#: Files of ADIOS2 in a folder of fields.
_ADIOS = re.compile(r"(data|md|mmd)\.(\d+|idx)|profiling\.json|active")
#: Answers of file systems without locks.
_NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)


@dataclass(frozen=True)
class ResultFolder:
    """A folder that belongs to the ranks of this run; made by `result_folder`."""

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
            new = on_root(self.comm, lambda: begin(self.path))
            summary = write(new)
            on_root(self.comm, lambda: complete(self.path, dict(summary)))
        except BaseException:
            if self.comm.rank == 0:
                discard(self.path)
            raise
        # No rank may end, and the others with it, while rank 0 moves the members.
        with signals_held():
            self.comm.barrier()
            on_root(self.comm, lambda: swap(self.path))


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
    if (path / STAGE).is_dir():
        with suppress(InputError, OSError):
            _release(path, *_take(path, overwrite=True))


def _take(path: Path, overwrite: bool) -> tuple[int, list[Path]]:
    """Make, lock and check a folder; return the lock and the folders that were made."""
    made: list[Path] = []
    lock = -1
    try:
        made = [place for place in (path, *path.parents) if not place.exists()]
        path.mkdir(parents=True, exist_ok=True)
        lock = _lock(path)
        recover(path)
        check_members(path, overwrite=overwrite)
    except (InputError, OSError) as error:
        _release(path, lock, made)
        if isinstance(error, InputError):
            raise
        reason = error.strerror or "not writable"
        raise InputError(
            f"--out {path}: {reason}; accepted: a folder to write to", "cannot-write"
        ) from None
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
    wrong = InputError(f"{path} is no file of ours; accepted: a folder without it", "not-ours")
    while True:
        # Neither a link is followed nor a pipe waited for.
        flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK
        try:
            lock = os.open(path, flags, 0o666)
        except OSError as error:
            if error.errno in (errno.ELOOP, errno.EISDIR, errno.ENXIO):
                raise wrong from None
            raise
        try:
            if not stat.S_ISREG(os.fstat(lock).st_mode):
                raise wrong
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
            "or the same after that run",
            "folder-locked",
        ) from None
    except OSError as error:
        if error.errno not in _NO_LOCKS:
            raise
        logger.warning("%s: its file system has no locks; run once at a time in it", folder)


def check_members(folder: Path, names: Iterable[str] | None = None, overwrite: bool = True) -> None:
    """Check that all under the names of members, by default all of results, may be replaced.

    Raises
    ------
    InputError
        If something is no file where a file is expected, or no folder of ADIOS2's files where
        a folder is: nothing of that kind is ours, and it is neither followed nor overwritten.
        Without `overwrite` also if something is there that the summary does not name.
    """
    own = listed(folder / SUMMARY)
    for name in filter(_RESULT.fullmatch, sorted(os.listdir(folder))) if names is None else names:
        path = folder / name
        found, expected = kind(path), "a folder" if path.suffix == ".bp" else "a file"
        if found not in (None, expected):
            raise InputError(
                f"{path}: given {found} where the results have {expected}; accepted: a folder "
                "without it",
                "not-ours",
            )
        for inner in path.iterdir() if found == "a folder" else ():
            if not _ADIOS.fullmatch(inner.name) or kind(inner) != "a file":
                raise InputError(
                    f"{path}: given a folder with {inner.name} in it, which is not of a run; "
                    "accepted: a folder without it",
                    "not-ours",
                )
        if found is not None and not overwrite and name not in own:
            raise InputError(
                f"{path}: given {found} that no run's {SUMMARY} there names as its own; accepted: "
                "--overwrite to replace it, or another folder",
                "not-ours",
            )


def begin(folder: Path) -> Path:
    """Make an empty place for new members and return it."""
    recover(folder)
    for name in ("old", "new"):  # before anything is written: a full disk refuses folders too
        (folder / STAGE / name).mkdir(parents=True)
    return folder / STAGE / "new"


def complete(folder: Path, summary: dict[str, object]) -> None:
    """Write the summary of the new members, by which they are complete, with their names."""
    new = folder / STAGE / "new"
    members = sorted({path.name for path in new.iterdir()} | {SUMMARY})
    for path in new.rglob("*"):
        if path.is_file():  # a disk or a server may refuse as late as here
            _sync(path)
    check_members(folder, members)
    os.replace(_draft(folder, summary, members), new / SUMMARY)


def add(folder: Path, files: Sequence[Path]) -> None:
    """Put further members, which stand in ``new``, beside those of a complete run.

    The summary names them before they are there: a name without a file does no harm, but a
    later run would leave a file without a name.
    """
    names = [path.name for path in files]
    check_members(folder, names, overwrite=False)
    summary = json.loads((folder / SUMMARY).read_bytes())
    members = sorted({*listed(folder / SUMMARY), *names})
    os.replace(_draft(folder, summary, members), folder / SUMMARY)
    for path in files:
        os.replace(path, folder / path.name)


def _draft(folder: Path, summary: dict[str, object], members: list[str]) -> Path:
    """Write a summary, not in ``new``, where its presence would say that it is whole."""
    draft = folder / STAGE / SUMMARY
    text = json.dumps(summary | {MANIFEST: members}, indent=2, allow_nan=False)
    draft.write_text(text + "\n", encoding="utf-8")
    _sync(draft)
    return draft


def swap(folder: Path) -> None:
    """Put the complete new members in their places, and remove those that they replace.

    Raises
    ------
    OSError
        If that is refused: the earlier members are in their places again.
    """
    try:
        _advance(folder)
    except (OSError, InputError):
        _return(folder)
        raise
    discard(folder)


def recover(folder: Path) -> None:
    """Continue an interrupted replacement: the new members, if complete, take their places.

    Raises
    ------
    InputError
        If something that is not ours stands under the name of our temporary folder.
    """
    stage = folder / STAGE
    found = kind(stage)
    if found is None:
        return
    if found != "a folder" or not all(_is_stage(path) for path in stage.iterdir()):
        raise InputError(
            f"{stage}: given {found} that no run has left there; accepted: a folder without it",
            "not-ours",
        )
    if kind(stage / "new" / SUMMARY) == "a file":
        check_members(stage / "new", os.listdir(stage / "new"))
        swap(folder)
    discard(folder)


def discard(folder: Path) -> None:
    """Remove the temporary folder, and first the summary, by which it is complete."""
    with suppress(OSError):
        (folder / STAGE / "new" / SUMMARY).unlink()
    shutil.rmtree(folder / STAGE, ignore_errors=True)


def _advance(folder: Path) -> None:
    new, old = folder / STAGE / "new", folder / STAGE / "old"
    left = {path.name for path in new.iterdir()}
    arrived = set(listed(new / SUMMARY)) - left
    earlier = listed(folder / SUMMARY) or listed(old / SUMMARY)
    leaving = (set(earlier) - arrived) | left
    for name in sorted(leaving, key=lambda name: name != SUMMARY):
        check_members(folder, [name])
        if kind(folder / name) is not None:
            os.rename(folder / name, old / name)
        if name in left and name != SUMMARY:
            os.rename(new / name, folder / name)
    os.rename(new / SUMMARY, folder / SUMMARY)


def _return(folder: Path) -> None:
    """Undo `_advance`, from wherever it has come to."""
    new, old = folder / STAGE / "new", folder / STAGE / "old"
    for name in listed(new / SUMMARY):
        if kind(new / name) is None and kind(folder / name) is not None:
            os.rename(folder / name, new / name)
    if old.is_dir():
        for path in sorted(old.iterdir(), key=lambda path: path.name == SUMMARY):
            os.rename(path, folder / path.name)
    discard(folder)


def _is_stage(path: Path) -> bool:
    """Whether a run may have left this in its temporary folder."""
    if path.name == SUMMARY:
        return kind(path) == "a file"
    if path.name not in ("new", "old") or kind(path) != "a folder":
        return False
    return all(name == ROOM or _MEMBER.fullmatch(name) for name in os.listdir(path))


def listed(manifest: Path, pattern: re.Pattern[str] = _MEMBER) -> dict[str, str]:
    """Return the files that a manifest names, with their checksums, if it has any.

    It may be of anybody: names that do not match the pattern are left out, and so are all of a
    summary that does not say by which versions it was made, as each of ours does.
    """
    content = read_json(manifest)
    if manifest.name == SUMMARY and not isinstance(content.get("versions"), dict):
        return {}
    known = content.get(MANIFEST)
    sums = known if isinstance(known, dict) else {}
    names = known if isinstance(known, list | dict) else ()
    return {n: str(sums.get(n)) for n in names if isinstance(n, str) and pattern.fullmatch(n)}


def replace_whole(path: Path, write: Callable[[Path], object]) -> None:
    """Let a file be written into a folder of its own beside it, and move it there. On one rank."""
    with TemporaryDirectory(prefix=".contact-", dir=path.parent) as drafts:
        draft = Path(drafts) / path.name
        write(draft)
        os.replace(draft, path)


def write_whole(path: Path, data: bytes, draft: Path) -> None:
    """Write a file under another name, and rename it when it is on the disk. On one rank."""
    draft.write_bytes(data)
    _sync(draft)
    os.replace(draft, path)


def read_json(path: Path) -> dict[str, Any]:
    """Return the table in a file; an empty one if there is no such file, or it is no table."""
    if kind(path) == "a file":
        with suppress(ValueError, RecursionError):
            content = json.loads(path.read_bytes())
            if isinstance(content, dict):
                return content
    return {}


def kind(path: Path) -> str | None:
    """Return the kind of a file, without following or opening it; None where there is none."""
    try:
        mode = stat.filemode(path.lstat().st_mode)
    except FileNotFoundError:
        return None
    known = {"-": "a file", "d": "a folder", "l": "a symbolic link", "p": "a named pipe"}
    return known.get(mode[0], "a device or socket")


def _sync(path: Path) -> None:
    with path.open("rb") as file:
        os.fsync(file.fileno())
