"""The folder of the checkpoints of a run: files a step, and a manifest that says which are its own.

That names the files with their SHA-256, and the digests of their input.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Collection, Mapping
from contextlib import suppress
from pathlib import Path

from mpi4py import MPI

from contact.errors import InputError
from contact.io.folder import kind, listed, read_json, write_whole
from contact.io.shares import Arrays, piece_of, read_share
from contact.ranks import on_each, on_root

#: Folder of the checkpoints in that of the results, that of a run which has not ended a step yet,
#: and the case in it.
FOLDER, FRESH, CASE = "checkpoints", "checkpoints.new", "case.toml"
#: The manifest; the name of a file until it is whole, on other ranks with their numbers.
MANIFEST, DRAFT = "manifest.json", ".contact-draft"
#: Names that a manifest may have: it is data of whoever wrote it.
_LISTED = re.compile(r"(\d{5}|nodes(-\d{5})?)(\.\d{4,})?\.npz|case\.toml")


def case_of(folder: Path) -> Path:
    """Return where the case of an interrupted evolution stands. On one rank.

    Raises
    ------
    InputError
        If there is none.
    """
    return files_of(folder)[0].parent / CASE


def kept_case(folder: Path) -> str | None:
    """Return the case of the checkpoints in a folder; None without any. On one rank."""
    with suppress(InputError):
        return case_of(folder).read_text(encoding="utf-8", errors="replace")
    return None


def stored_input(folder: Path) -> tuple[Path, dict[str, str]]:
    """Return the file of the case, as it was written, and the digests of its files. On one rank.

    Raises
    ------
    InputError
        If there are no checkpoints, or the case has changed.
    """
    path = case_of(folder)
    _read_whole(path, _manifest(path.parent).get(path.name))
    digests = read_json(path.with_name(MANIFEST)).get("digest")
    return path, digests if isinstance(digests, dict) else {}


def discard(folder: Path) -> None:
    """Remove the checkpoints of a run that has come to its end. On one rank."""
    for place in (folder / FOLDER, folder / FRESH):
        if _manifest(place):
            remove(place)


def files_of(folder: Path) -> list[Path]:
    """Return the checkpoints in a folder, one after the other."""
    for name in (FOLDER, FRESH):
        known, found = _manifest(folder / name), list[Path]()
        while (path := folder / name / name_of(len(found) + 1)).is_file() and path.name in known:
            found.append(path)
        if found:
            return found
    raise InputError(
        f"--restart {folder}: no checkpoints there; accepted: the folder of an evolution that was "
        "ended before its last step, of one mesh (none are kept with [mesh.adapt])",
        "no-checkpoint",
    )


def name_of(count: int) -> str:
    """Return the name of the checkpoint of a step."""
    return f"{count:05d}.npz"


def _number(name: str) -> int:
    """Return the number of the step of a file, of places of nodes the first step with them."""
    digits = re.search(r"\d{5}", name)
    return 0 if digits is None else int(digits[0]) + name.startswith("nodes")


def _manifest(place: Path) -> dict[str, str]:
    """Return the SHA-256 of the files that a run has left in a folder; nothing without any."""
    return listed(place / MANIFEST, _LISTED) if kind(place) == "a folder" else {}


def _list(place: Path, files: Mapping[str, str], digest: Mapping[str, str] | None = None) -> None:
    """Write a manifest, by default with the digests of the one before."""
    digest = read_json(place / MANIFEST).get("digest") if digest is None else digest
    text = json.dumps({"files": files, "digest": digest}, indent=1)
    write_whole(place / MANIFEST, text.encode(), place / DRAFT)


def check_own(folder: Path) -> None:
    """Refuse to replace checkpoints that no run has left.

    Raises
    ------
    InputError
        If there are files that no manifest names, or something else than a folder.
    """
    for place in (folder / FOLDER, folder / FRESH):
        given = kind(place)
        if given == "a folder":
            known = _manifest(place)
            own = {MANIFEST, *known} if known else set()
            names = [path.name for path in place.iterdir() if not path.name.startswith(DRAFT)]
            given = next((name for name in names if name not in own), None)
        if given is not None:
            raise InputError(
                f"{place}: given {given}, which no run has left there; accepted: a folder of "
                "results without it, checkpoints of the evolution go there",
                "not-ours",
            )


def remove(place: Path) -> None:
    """Remove the files that a manifest names, the first step first, and an empty folder."""
    drafts = [path.name for path in place.glob(DRAFT + "*")]
    for name in (*sorted(_manifest(place)), *drafts, MANIFEST):
        (place / name).unlink(missing_ok=True)
    with suppress(OSError):  # it is not there, or not empty
        place.rmdir()


def replace_earlier(folder: Path) -> None:
    """Put the checkpoints of a new run in the place of those of an earlier one."""
    check_own(folder)
    remove(folder / FOLDER)
    (folder / FRESH).rename(folder / FOLDER)


def cut(folder: Path, count: int) -> None:
    """Keep the checkpoints up to a step, for those of another course to follow."""
    place = files_of(folder)[0].parent
    kept = _manifest(place)
    later = [name for name in kept if _number(name) > count]
    for name in later:
        (place / name).unlink(missing_ok=True)
    _list(place, {name: kept[name] for name in kept if name not in later})
    if place.name == FRESH:  # where a run was ended between removal and renaming
        replace_earlier(folder)


def save(
    comm: MPI.Intracomm,
    place: Path,
    name: str,
    data: bytes | None,
    digest: Mapping[str, str] | None = None,
) -> None:
    """Write the pieces of the ranks that have one, of a file by its name. Collective.

    Their names in the manifest come first: no file is without one.
    """
    path = piece_of(place / name, comm.rank)
    own = {} if data is None else {path.name: hashlib.sha256(data).hexdigest()}
    sums = comm.gather(own)

    def enter() -> None:
        known, new = _manifest(place), {k: v for some in sums or () for k, v in some.items()}
        for piece in new.keys() - known.keys():
            if kind(place / piece) is not None:
                raise InputError(
                    f"{place / piece}: no run has left it; accepted: a folder without it",
                    "not-ours",
                )
        _list(place, known | new, digest)

    on_root(comm, enter)
    draft = piece_of(place / DRAFT, comm.rank)
    on_each(comm, lambda: None if data is None else write_whole(path, data, draft))


def _read_whole(path: Path, digest: str | None) -> bytes:
    """Return the contents of a file with a SHA-256.

    Raises
    ------
    InputError
        If they are not as they were written.
    """
    data = path.read_bytes() if path.is_file() else b""
    if hashlib.sha256(data).hexdigest() != digest:
        raise InputError(
            f"{path}: no checkpoint, or a damaged one; accepted: as a run has left it",
            "no-checkpoint",
        )
    return data


def load(comm: MPI.Intracomm, path: Path, once: Collection[str]) -> tuple[Arrays, Arrays]:
    """Return the arrays of a file of the manifest as `read_share` does. Collective."""

    def own() -> dict[str, str]:
        known = _manifest(path.parent)
        return {name: known[name] for name in known if name.partition(".")[0] == path.stem}

    sums = on_root(comm, own)
    return read_share(comm, path, lambda piece: _read_whole(piece, sums.get(piece.name)), once)
