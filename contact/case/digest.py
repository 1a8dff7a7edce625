"""Input compared: the case of an earlier run, and the files that it read, with those at hand."""

from __future__ import annotations

import hashlib
import os
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import quote

from contact.case.file import Case
from contact.errors import InputError, shown
from contact.library.materials import PACKAGED
from contact.mesh.reader import mesh_files
from contact.model.section import FilePath, walk

#: Key of the mesh file.
MESH = "mesh.file"

#: Keys of files.
FILES = ("file", "library")

#: Sections that say how a problem is solved and shown, not which one it is.
MANNER = frozenset({"title", "case", "solver", "output"})


def digest(case: Case) -> dict[str, str]:
    """Return the SHA-256 of the files that a case reads, by their keys. On one rank."""
    given = [(key, Path(value)) for key, value in walk(case) if isinstance(value, FilePath)]
    for key, material in case.materials:
        if material.name is not None and material.library is None:
            given.append((f"{key}.library", PACKAGED))
    found = {}
    for key, path in given:
        try:
            for file in mesh_files(path) if key == MESH else [path]:
                # No spaces: the table of a sweep separates digests by them.
                inner = "" if file == path else f"/{quote(os.path.relpath(file, path.parent))}"
                with open(file, "rb") as stream:
                    found[key + inner] = hashlib.file_digest(stream, "sha256").hexdigest()
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", str(error)) or "not readable"
            where = getattr(error, "filename", None) or path
            raise InputError(
                f"{case.source}: {key}: {where}: {reason}; accepted: a file that can be read",
                "file-name",
            ) from None
    return found


def check_files(where: str, made: str, before: Mapping[str, str], now: Mapping[str, str]) -> None:
    """Refuse to continue results that were made from other files, by digests of then and now."""
    for key in (*before, *now):
        if before.get(key) != now.get(key):
            raise InputError(
                f"{where}: the file {key} has changed since {made}; accepted: the same file, or "
                "another folder",
                "changed-input",
            )


def check_same(
    where: str,
    found: str,
    before: object,
    case: str,
    accepted: str,
    ignored: frozenset[str] = MANNER,
) -> None:
    """Refuse to replace or continue `found`, files of a case `before`, if it is another."""
    said = "that do not say of which case they are"
    with suppress(ValueError, RecursionError):
        tables = [tomllib.loads(before if isinstance(before, str) else "="), tomllib.loads(case)]
        old, new = ({k: v for k, v in t.items() if k not in ignored} for t in tables)
        place = next(_differences(old, new), None)
        if place is None:
            return
        said = f"of another case: there {place}"
    raise InputError(f"{where}: given {found} {said}; accepted: {accepted}", "other-case")


def _differences(before: Any, now: Any, path: str = "") -> Iterator[str]:
    """Yield the differences in words, key by key."""
    if isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        before, now = dict(enumerate(before)), dict(enumerate(now))
    if isinstance(before, dict) and isinstance(now, dict):
        for key in {**before, **now}:
            place = f"{path}.{key}" if path else key
            if key not in before or key not in now:
                yield f"{place} is {'given' if key in before else 'missing'}"
            else:
                yield from _differences(before[key], now[key], place)
    elif before != now and not (before != before and now != now):
        if path.rpartition(".")[2] not in FILES or not _may_be_one(str(before), str(now)):
            yield f"{path} is {shown(before)}, here {shown(now)}"


def _may_be_one(before: str, now: str) -> bool:
    """Tell whether paths may be of one file: a relative one ends another as seen elsewhere."""
    if os.path.isabs(before) and os.path.isabs(now):
        return False
    short, long = sorted(
        ([part for part in Path(path).parts if part != ".."] for path in (before, now)), key=len
    )
    return bool(short) and long[-len(short) :] == short
