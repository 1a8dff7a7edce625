"""Cases compared: a run replaces results of the same problem, others where it is asked to."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any

from contact.errors import InputError

#: Sections of the case file that say how a problem is solved and shown, not which one it is.
MANNER = ("title", "solver", "output")
_SHOWN = 60


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
        place = difference(*(_without(table) for table in tables))
        if place is None:
            return
        said = f"of another case: there {place}"
    raise InputError(f"{where}: given {found} {said}; accepted: {accepted}")


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
