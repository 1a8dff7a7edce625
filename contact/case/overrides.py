"""Values given on the command line (``--set key=value``) in place of the case file's."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Mapping
from typing import Any

from contact.case.showing import clipped, path_of, shown
from contact.errors import InputError

#: Most keys above the last one of a path: no table lies as deep.
DEEPEST = 15

#: Most digits of a number of a list's entry.
LONGEST_INDEX = 9


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
        _assign(data, path.strip(), read_value(path, text.strip(), source), source)


def _refusal(source: str, path: str, words: str) -> InputError:
    return InputError(f"{source}: --set {clipped(path)}: {words}")


def _split(text: str, source: str) -> tuple[str, str]:
    path, equals, value = text.partition("=")
    if not equals or not path.strip():
        raise _refusal(source, text, "no assignment; accepted: path.to.key=value")
    return path, value


def read_value(path: str, text: str, source: str) -> Any:
    """Read a TOML value; what is none and does not look like one is a text.

    Parameters
    ----------
    path, text
        The key and what is given for it.
    source
        What messages call the case.
    """
    try:
        table = tomllib.loads(f"value = {text}")
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        if text and text[0] not in "[{\"'":
            return text
        words = f"{shown(text)} is broken ({clipped(str(error))}); accepted: a TOML value"
        raise _refusal(source, path, words) from None
    except ValueError:
        # Python reads whole numbers up to a limit of digits only.
        words = f"{shown(text)} has too many digits; accepted: a TOML value"
        raise _refusal(source, path, words) from None
    # A value with line breaks could smuggle in further keys.
    return table["value"] if set(table) == {"value"} else text


def _assign(data: dict[str, Any], path: str, value: Any, source: str) -> None:
    *parents, last = path.split(".")
    if len(parents) > DEEPEST:
        words = f"{len(parents) + 1} keys deep; accepted: at most {DEEPEST + 1}"
        raise _refusal(source, path, words)
    place: Any = data
    for i, key in enumerate(parents):
        if isinstance(place, dict):
            place = place.setdefault(key, {})
        else:
            place = place[_index(place, key, parents[:i], path, source)]
        if not isinstance(place, dict | list):
            words = f"{path_of(parents[: i + 1])} is {shown(place)}, no table"
            raise _refusal(source, path, f"{words}; accepted: keys of tables")
    if isinstance(place, dict):
        place[last] = value
    else:
        place[_index(place, last, parents, path, source)] = value


def _index(place: list[Any], key: str, above: list[str], path: str, source: str) -> int:
    number = key.isascii() and key.isdigit() and len(key) <= LONGEST_INDEX
    if not number or int(key) >= len(place):
        accepted = f"0 to {len(place) - 1}" if len(place) > 1 else "0" if place else "none"
        words = f"{path_of(above)} has no entry {clipped(key)}; accepted: {accepted}"
        raise _refusal(source, path, words)
    return int(key)
