"""Cases compared: the input that they are computed from, and where two of them differ."""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from contact.case.file import Case
from contact.case.section import FilePath, walk
from contact.errors import InputError
from contact.library.materials import PACKAGED

#: Sections that say how a problem is solved and shown, not which one it is.
MANNER = frozenset({"title", "case", "solver", "output"})

#: Name of the case itself among the digests; the other names are keys of files.
CASE = "case"

#: Most characters of a value that a message shows.
_SHOWN = 60


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


def changed_input(before: Mapping[str, str], now: Mapping[str, str]) -> str | None:
    """Name in words the first difference between two digests; None if they agree."""
    for key in (*before, *(key for key in now if key not in before)):
        if before.get(key) != now.get(key):
            return "the case" if key == CASE else f"the file {key}"
    return None


def check_digest(folder: Path, before: Mapping[str, str], now: Mapping[str, str]) -> None:
    """Refuse, by an InputError, to continue checkpoints of a folder that other input made."""
    place = changed_input(before, now)
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


def check_same(where: str, found: str, before: object, case: str, accepted: str) -> None:
    """Refuse to replace or continue files of another case. On one rank.

    Parameters
    ----------
    where, found, accepted
        Words for the message: option and folder, the files there, the ways out.
    before, case
        The case of the files and the one at hand, as `contact check` prints them.

    Raises
    ------
    InputError
        If they differ in more than in how they are solved and shown, or `before` is no case.
    """
    said = "that do not say of which case they are"
    with suppress(ValueError, RecursionError):
        tables = [tomllib.loads(before if isinstance(before, str) else "="), tomllib.loads(case)]
        named = ({k: v for k, v in table.items() if k not in MANNER} for table in tables)
        place = difference(*named)
        if place is None:
            return
        said = f"of another case: there {place}"
    raise InputError(f"{where}: given {found} {said}; accepted: {accepted}")


def difference(before: Mapping[str, Any], now: Mapping[str, Any]) -> str | None:
    """Return the first difference between the tables of two cases in words; None without any."""
    return next(_differences(before, now), None)


def _differences(before: Any, now: Any, path: str = "") -> Iterator[str]:
    """Yield the differences in words, key by key."""
    if isinstance(before, dict) and isinstance(now, dict):
        for key in (*before, *(key for key in now if key not in before)):
            missing = object()
            pair = before.get(key, missing), now.get(key, missing)
            place = f"{path}.{key}" if path else key
            if pair[0] is missing or pair[1] is missing:
                yield f"{place} is {'missing' if pair[0] is missing else 'given'}"
            else:
                yield from _differences(*pair, place)
    elif isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        for i, pair in enumerate(zip(before, now, strict=True)):
            yield from _differences(*pair, f"{path}.{i}")
    elif before != now and not (before != before and now != now):
        yield f"{path} is {_short(before)}, here {_short(now)}"


def _short(value: Any) -> str:
    text = " ".join(json.dumps(value, ensure_ascii=False).split())
    return text if len(text) <= _SHOWN else text[:_SHOWN] + "..."
