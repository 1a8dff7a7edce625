"""A case as text: the TOML file that says the same with the defaults written out."""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

from contact.case.file import Case, override, parse_case
from contact.errors import InputError

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def to_toml(case: Case, dimension: int | None = None, anchored: bool = False) -> str:
    """Return a case file that gives the same case again, without the keys that its method ignores.

    Parameters
    ----------
    case
        The case.
    dimension
        Of its mesh, if it is known: keys without effect there are left out.
    anchored
        Whether files are given with their whole paths, for a case that is read from anywhere.
    """
    ignored = {"space": {"kinematics"}} if dimension == 3 else None
    context = {"path": os.path.abspath} if anchored else None
    data = case.model_dump(by_alias=True, exclude_none=True, exclude=ignored, context=context)
    return "\n".join(_table(data, ())).strip() + "\n"


def number_at(case: Case, key: str) -> float:
    """Return the number at a key of a case, ``load.0.traction.1``.

    Raises
    ------
    InputError
        If there is none.
    """
    place: Any = tomllib.loads(to_toml(case))
    for name in key.split("."):
        if isinstance(place, list) and name.isdigit() and int(name) < len(place):
            place = place[int(name)]
        else:
            # Parameters of a mesh generator may stand in [mesh] itself.
            inner = place.get("parameters", {}) if isinstance(place, Mapping) else {}
            place = {**inner, **place}.get(name) if isinstance(place, Mapping) else None
    if isinstance(place, bool) or not isinstance(place, int | float):
        words = "nothing" if place is None else f"{place!r}"
        raise InputError(
            f"{case.source}: {key}: {words} stands there; accepted: a key with a number",
            "no-number",
        )
    return float(place)


def with_number(case: Case, key: str, value: float) -> Case:
    """Return a case with another number at a key; see `number_at`."""
    data = tomllib.loads(to_toml(case, anchored=True))
    override(data, f"{key}={float(value)!r}", case.source)
    return parse_case(data, ".", case.source)


def _table(table: Mapping[str, Any], path: tuple[str, ...]) -> Iterator[str]:
    """Write the values of a table, then the tables in it."""
    inner = {key: value for key, value in table.items() if _holds_tables(value)}
    for key, value in table.items():
        if key not in inner and value != {} and not (value == () and not path):
            yield f"{_key(key)} = {literal(value)}"
    for key, value in inner.items():
        place = (*path, key)
        name = ".".join(_key(part) for part in place)
        many = not isinstance(value, Mapping)
        for entry in value if many else (value,):
            # A table that holds nothing but tables needs no heading of its own.
            if many or not all(_holds_tables(item) for item in entry.values()):
                yield f"\n[[{name}]]" if many else f"\n[{name}]"
            yield from _table(entry, place)


def _holds_tables(value: Any) -> bool:
    if isinstance(value, Mapping):
        return bool(value)
    return isinstance(value, list | tuple) and any(isinstance(item, Mapping) for item in value)


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else literal(key)


def literal(value: Any) -> str:
    """Return a number, text, switch, or a list or table of these as TOML."""
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return f"[{', '.join(literal(item) for item in value)}]"
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{_key(key)} = {literal(item)}' for key, item in value.items())} }}"
    return str(value)
