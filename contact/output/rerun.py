"""Cases compared: a run replaces results of the same problem, others where it is asked to."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from contact.errors import InputError
from contact.output.folder import SUMMARY, read_json

#: Sections of the case file that say how a problem is solved and shown, not which one it is.
MANNER = ("title", "solver", "output")
_SHOWN = 60


def check_rerun(folder: Path, case: str) -> None:
    """Refuse to replace results of another case. On one rank.

    Parameters
    ----------
    folder
        Where the results are to go.
    case
        The case that is about to be solved, as `contact check` prints it.

    Raises
    ------
    InputError
        If the folder has results of another problem, or of one that it does not tell.
    """
    if not (folder / SUMMARY).exists():
        return
    given, before = "results that do not say of which case they are", None
    with suppress(ValueError, TypeError, RecursionError):
        before = tomllib.loads(read_json(folder / SUMMARY).get("case", 0))
    if before is not None:
        place = difference(_without(before), _without(tomllib.loads(case)))
        if place is None:
            return
        given = f"results of another case: there {place}"
    raise InputError(
        f"--out {folder}: given a folder with {given}; accepted: --overwrite to replace them, or "
        "another folder"
    )


def check_checkpoints(folder: Path, before: str, case: str, restart: bool = False) -> None:
    """Refuse to go on with checkpoints of another case, or to replace them. On one rank.

    Parameters
    ----------
    folder
        The folder of the interrupted run.
    before, case
        The case of the checkpoints there and the one at hand, as `contact check` prints them.
    restart
        Whether the run is to go on.

    Raises
    ------
    InputError
        If they differ in more than in how they are solved and shown.
    """
    place = difference(*(_without(tomllib.loads(text)) for text in (before, case)))
    if place is None:
        return
    if restart:
        raise InputError(
            f"--restart {folder}: given checkpoints of another case: there {place}; accepted: the "
            "same case, solved and shown as you like"
        )
    raise InputError(
        f"--out {folder}: given a folder with checkpoints of another case: there {place}; "
        f"accepted: --restart {folder} to go on with that, --overwrite to replace them, or "
        "another folder"
    )


def difference(before: Mapping[str, Any], now: Mapping[str, Any]) -> str | None:
    """Return the first difference between the tables of two cases in words; None without any."""
    return next(_differences(before, now), None)


def _without(case: Mapping[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in case.items() if key not in MANNER}


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
