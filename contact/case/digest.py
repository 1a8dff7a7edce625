"""Digests of all that a case is computed from: the case itself and each file that it reads."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path

from contact.case.file import Case
from contact.case.section import FilePath, walk
from contact.errors import InputError
from contact.library.materials import PACKAGED

#: Sections that say how a problem is solved and shown, not which one it is.
MANNER = frozenset({"title", "case", "solver", "output"})

#: Name of the case itself among the digests; the other names are keys of files.
CASE = "case"


def digest(case: Case) -> dict[str, str]:
    """Return the SHA-256 of the case and of each file that it reads. On one rank.

    Title, names of units, `[solver]` and `[output]` do not count, nor does where a file lies.

    Returns
    -------
    The digest of the resolved case under `CASE`, and that of each file under its key
    (``mesh.file``, ``contact.foundation.file``, ``material.0.library``).

    Raises
    ------
    InputError
        If a file cannot be read.
    """
    said = case.model_dump(
        by_alias=True, exclude_none=True, exclude={*MANNER}, context={"path": lambda path: ""}
    )
    found = {CASE: hashlib.sha256(json.dumps(said, sort_keys=True).encode()).hexdigest()}
    for key, path in _files(case):
        try:
            with open(path, "rb") as file:
                found[key] = hashlib.file_digest(file, "sha256").hexdigest()
        except OSError as error:
            reason = error.strerror or "not readable"
            raise InputError(
                f"{case.source}: {key}: {path}: {reason}; accepted: a file that can be read"
            ) from None
    return found


def difference(before: Mapping[str, str], now: Mapping[str, str]) -> str | None:
    """Name in words the first difference between two digests; None if they agree."""
    for key in (*before, *(key for key in now if key not in before)):
        if before.get(key) != now.get(key):
            return "the case" if key == CASE else f"the file {key}"
    return None


def check_digest(folder: Path, before: Mapping[str, str], now: Mapping[str, str]) -> None:
    """Refuse, by an InputError, to continue checkpoints of a folder that other input made."""
    place = difference(before, now)
    if place is not None:
        raise InputError(
            f"--restart {folder}: {place} has changed since the checkpoints were written; "
            "accepted: the same case with the same files, solved and shown as you like"
        )


def _files(case: Case) -> Iterator[tuple[str, Path]]:
    """Give the files that a case reads, each with its key."""
    for key, value, _ in walk(case):
        if isinstance(value, FilePath):
            yield key, Path(value)
    for key, material in case.materials:
        if material.name is not None and material.library is None:
            yield f"{key}.library", PACKAGED
