"""What messages quote of a case: on one line, as in the case file, and never too long."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

#: Most characters of a quoted value, a key, a path of keys, and a list of what is accepted.
VALUE, KEY, PATH, LIST = 60, 60, 100, 300


def shown(given: Any) -> str:
    """Show what the user gave as in the case file."""
    try:
        text = str(given) if isinstance(given, float) else json.dumps(given, default=str)
    except ValueError:
        # Python writes out integers up to a limit of digits only.
        text = "a whole number of thousands of digits"
    except RecursionError:
        text = "a deeply nested list"
    return clipped(text, VALUE)


def clipped(text: str, length: int = PATH) -> str:
    """Cut a text that is too long, and show what is no printable character by its code."""
    text = text if len(text) <= length else text[: length - 3] + "..."
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def path_of(keys: Iterable[str]) -> str:
    """Join keys to a path, as on the command line; a long one loses its middle."""
    text = ".".join(clipped(key, KEY) for key in keys)
    return text if len(text) <= PATH else f"{text[: PATH // 2 - 3]}...{text[-PATH // 2 :]}"


def listed(options: Iterable[str]) -> str:
    """List what is accepted; of very many, the first ones and how many more there are."""
    given = [clipped(option) for option in options]
    kept, length = 0, 0
    while kept < len(given) and length < LIST:
        length += len(given[kept]) + 2
        kept += 1
    more = f" and {len(given) - kept} more" if kept < len(given) else ""
    return ", ".join(given[:kept]) + more
