"""Values given on the command line (``--set key=value``) in place of the case file's."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from typing import Any

from contact.case.grammar import shown
from contact.errors import InputError


def override(
    data: dict[str, Any], overrides: Mapping[str, str] | Iterable[str], source: str
) -> None:
    """Set values in the tables of a case file, in place.

    Parameters
    ----------
    data
        Tables of the case file.
    overrides
        ``"path.to.key=value"`` each, or a mapping of paths to values.
    source
        What messages call the case.

    Raises
    ------
    InputError
        If an override has no ``=``, its path leads nowhere or its value is broken TOML.
    """
    if isinstance(overrides, Mapping):
        pairs = [(key, str(value)) for key, value in overrides.items()]
    else:
        pairs = [_split(text, source) for text in overrides]
    for path, text in pairs:
        _assign(data, path.strip(), _value(path, text.strip(), source), source)


def _split(text: str, source: str) -> tuple[str, str]:
    path, equals, value = text.partition("=")
    if not equals or not path.strip():
        raise InputError(f"{source}: --set {text}: no assignment; accepted: path.to.key=value")
    return path, value


def _value(path: str, text: str, source: str) -> Any:
    """Read a TOML value; what is none and does not look like one is a text."""
    try:
        table = tomllib.loads(f"value = {text}")
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        if text and text[0] not in "[{\"'":
            return text
        raise InputError(
            f"{source}: --set {path}: {shown(text)} is broken ({error}); accepted: a TOML value"
        ) from None
    # A value with line breaks could smuggle in further keys.
    return table["value"] if set(table) == {"value"} else text


def _assign(data: dict[str, Any], path: str, value: Any, source: str) -> None:
    *parents, last = path.split(".")
    place: Any = data
    for i, key in enumerate(parents):
        if isinstance(place, dict):
            place = place.setdefault(key, {})
        else:
            place = place[_index(place, key, parents[:i], path, source)]
        if not isinstance(place, dict | list):
            raise InputError(
                f"{source}: --set {path}: {'.'.join(parents[: i + 1])} is {shown(place)}, "
                "no table; accepted: keys of tables"
            )
    if isinstance(place, dict):
        place[last] = value
    else:
        place[_index(place, last, parents, path, source)] = value


def _index(place: list[Any], key: str, above: list[str], path: str, source: str) -> int:
    if not key.isascii() or not key.isdigit() or int(key) >= len(place):
        accepted = f"0 to {len(place) - 1}" if len(place) > 1 else "0" if place else "none"
        raise InputError(
            f"{source}: --set {path}: {'.'.join(above)} has no entry {key}; accepted: {accepted}"
        )
    return int(key)
