"""Put the results of a run in the place of an earlier run's, all of them or none.

A run writes its members into ``.contact-new/new`` of the folder, ``summary.json`` the last: from
then on they are complete. Then each member takes its place, the earlier one of its name, and the
earlier ones that have no successor, going to ``.contact-new/old``. The order of the renames says
at every moment which steps are to come:

1. the earlier ``summary.json`` goes first: no summary stands beside members of another run;
2. the other members change places one by one, a new one that is still in ``new`` not having
   moved yet, so that the file of its name is the earlier one;
3. the new ``summary.json`` comes last.

Whoever finds ``new/summary.json`` continues at 2 (`recover`); whoever finds none has nothing to
continue: all under ``.contact-new`` is either not complete or not needed any more.

``summary.json`` names the members under "files". These alone are removed by a later run.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import stat
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path

from contact.errors import InputError

STAGE = ".contact-new"
SUMMARY = "summary.json"
#: File that asks for room on the disk before members are written; killed runs leave it.
ROOM = "room"
#: Key of the summary under which the names of the members stand.
MANIFEST = "files"

#: Names that runs may write. Summaries may be of anybody: no other names are taken from them.
_MEMBER = re.compile(r"[A-Za-z0-9][\w-]*\.(json|csv|bp|npz|xdmf|h5|vtkhdf|pvd|vtu|png|pdf|svg|gif)")
#: Files of ADIOS2 in a folder of fields.
_ADIOS = re.compile(r"(data|md|mmd)\.(\d+|idx)|profiling\.json|active")

#: Names that every run writes or may write.
MEMBERS = (
    SUMMARY,
    "contact.csv",
    "history.csv",
    "steps.csv",
    "contact-steps.csv",
    "contact.vtu",
    "contact-against.csv",
    "contact-against.vtu",
    "fields.pvd",
    "fields.vtu",
    "fields.bp",
    "cells.bp",
    "fields.xdmf",
    "fields.h5",
    "checkpoint.npz",
    "figure-contact.png",
    "figure-loop.png",
    "figure-zones.png",
    "figure-energy.png",
    "figure-deformed.png",
    "figure-potential.png",
)
#: Further names, of fields a step.
_STEP = re.compile(r"fields-\d{4,}\.vtu")


def check_members(folder: Path, names: tuple[str, ...] = MEMBERS) -> None:
    """Check that all under the names of members may be replaced.

    Raises
    ------
    InputError
        If something is no file where a file is expected, or no folder of ADIOS2's files where
        a folder is: nothing of that kind is ours, and it is neither followed nor overwritten.
    """
    for name in names:
        _check_member(folder / name)


def check_foreign(folder: Path, names: Sequence[str] | None = None) -> None:
    """Check that all under the names of members is of a run, by its summary.

    Parameters
    ----------
    folder
        Of the results.
    names
        Of the members; by default all that runs may write.

    Raises
    ------
    InputError
        If there is something else, which a run would replace.
    """
    own = _members(folder / SUMMARY)
    if names is None:
        names = (*MEMBERS, *filter(_STEP.fullmatch, sorted(os.listdir(folder))))
    for name in names:
        if name not in own and kind(folder / name) is not None:
            raise InputError(
                f"{folder / name}: given {kind(folder / name)} that no run's {SUMMARY} there names "
                "as its own; accepted: --overwrite to replace it, or another folder"
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
    for path in _files(new):
        # A disk or a server may refuse as late as here.
        _sync(path)
    # Not in `new`, where its presence would say that it is whole.
    draft = folder / STAGE / SUMMARY
    text = json.dumps(summary | {MANIFEST: members}, indent=2, allow_nan=False)
    draft.write_text(text + "\n", encoding="utf-8")
    _sync(draft)
    check_members(folder, tuple(members))
    os.replace(draft, new / SUMMARY)


def add(folder: Path, files: Sequence[Path]) -> None:
    """Put further members, which stand in ``new``, beside those of a complete run.

    The summary names them before they are there: a name without a file does no harm, but a
    later run would leave a file without a name.
    """
    names = tuple(path.name for path in files)
    check_foreign(folder, names)
    check_members(folder, names)
    summary = json.loads((folder / SUMMARY).read_bytes())
    summary[MANIFEST] = sorted({*_members(folder / SUMMARY), *names})
    draft = folder / STAGE / SUMMARY
    draft.write_text(json.dumps(summary, indent=2, allow_nan=False) + "\n", encoding="utf-8")
    _sync(draft)
    os.replace(draft, folder / SUMMARY)
    for path in files:
        os.replace(path, folder / path.name)


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
            f"{stage}: given {found} that no run has left there; accepted: a folder without it"
        )
    if kind(stage / "new" / SUMMARY) == "a file":
        names = tuple(path.name for path in (stage / "new").iterdir())
        check_members(stage / "new", names)
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
    arrived = set(_members(new / SUMMARY)) - left
    earlier = _members(folder / SUMMARY) or _members(old / SUMMARY)
    leaving = (set(earlier) - arrived) | left
    for name in sorted(leaving, key=lambda name: name != SUMMARY):
        _check_member(folder / name)
        if kind(folder / name) is not None:
            os.rename(folder / name, old / name)
        if name in left and name != SUMMARY:
            os.rename(new / name, folder / name)
    os.rename(new / SUMMARY, folder / SUMMARY)


def _return(folder: Path) -> None:
    """Undo `_advance`, from wherever it has come to."""
    new, old = folder / STAGE / "new", folder / STAGE / "old"
    for name in _members(new / SUMMARY):
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


def _members(summary: Path) -> list[str]:
    """Return the members that a summary names; none if it is not there or not ours."""
    if kind(summary) != "a file":
        return []
    with suppress(ValueError, RecursionError):
        content = json.loads(summary.read_bytes())
        names = content.get(MANIFEST) if isinstance(content, dict) else None
        if isinstance(names, list):
            return [n for n in names if isinstance(n, str) and _MEMBER.fullmatch(n)]
    return []


def _check_member(path: Path) -> None:
    found, expected = kind(path), "a folder" if path.suffix == ".bp" else "a file"
    if found not in (None, expected):
        raise InputError(
            f"{path}: given {found} where the results have {expected}; accepted: a folder without "
            "it"
        )
    if found == "a folder":
        for inner in path.iterdir():
            if not _ADIOS.fullmatch(inner.name) or kind(inner) != "a file":
                raise InputError(
                    f"{path}: given a folder with {inner.name} in it, which is not of a run; "
                    "accepted: a folder without it"
                )


def kind(path: Path) -> str | None:
    """Return the kind of a file, without following or opening it; None where there is none."""
    try:
        mode = path.lstat().st_mode
    except FileNotFoundError:
        return None
    for test, words in (
        (stat.S_ISREG, "a file"),
        (stat.S_ISDIR, "a folder"),
        (stat.S_ISLNK, "a symbolic link"),
        (stat.S_ISFIFO, "a named pipe"),
    ):
        if test(mode):
            return words
    return "a device or socket"


def _files(folder: Path) -> Iterator[Path]:
    return (path for path in folder.rglob("*") if path.is_file())


def _sync(path: Path) -> None:
    with path.open("rb") as file:
        os.fsync(file.fileno())
