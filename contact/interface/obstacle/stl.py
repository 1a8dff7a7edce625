"""STL files, binary or text."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from contact.errors import InputError
from contact.typing import Array

#: Bytes of a binary file before its triangles, and of each triangle.
HEADER, EACH = 84, 50

_VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)")


def read_stl(path: str | Path) -> Array:
    """Return the corners of the triangles of an STL file, shape (m, 3, 3), none degenerate.

    Raises
    ------
    InputError
        If the file cannot be read, or holds no triangles.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; accepted: an STL file") from None
    corners = _binary(data) if _is_binary(data) else _text(path, data)
    if corners.size and not np.all(np.isfinite(corners)):
        raise InputError(f"{path}: coordinates that are no numbers; accepted: an STL file")
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0)
    corners = corners[area > 1e-10 * longest**2]
    if len(corners) == 0:
        raise InputError(f"{path}: no triangles; accepted: an STL file, binary or text")
    return corners


def _is_binary(data: bytes) -> bool:
    count = int.from_bytes(data[80:84], "little") if len(data) >= HEADER else -1
    return len(data) == HEADER + EACH * count


def _binary(data: bytes) -> Array:
    kind = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    return np.frombuffer(data, kind, offset=HEADER)["corners"].astype(np.float64)


def _text(path: Path, data: bytes) -> Array:
    found = _VERTEX.findall(data)
    try:
        numbers = np.array(found, dtype=np.float64)
    except ValueError:
        raise InputError(
            f"{path}: coordinates that are no numbers; accepted: an STL file"
        ) from None
    if len(found) % 3:
        raise InputError(f"{path}: triangles without three corners; accepted: an STL file")
    return numbers.reshape(-1, 3, 3)
