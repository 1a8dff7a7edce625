"""Measurements from CSV files: amplitudes, curves to identify parameters from."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from contact.errors import InputError
from contact.typing import Array


def read_data(path: str | Path) -> dict[str, Array]:
    """Read measurements from a CSV file with a row of names.

    Parameters
    ----------
    path
        The file; columns are separated by commas, numbers have a decimal point.

    Returns
    -------
    Column -> values, shape (n,).

    Raises
    ------
    InputError
        If the file is no such table.
    """
    path = Path(path)
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = [(i, row) for i, row in enumerate(csv.reader(file), 1) if row]
        names = [name.strip() for name in rows[0][1]] if rows else []
        if not names or len(set(names)) < len(names) or _floats(names) is not None:
            raise ValueError("its first row has no different names")
        values = []
        for number, row in rows[1:]:
            floats = _floats(row)
            if floats is None or len(row) != len(names):
                raise ValueError(f"row {number} has not one number for each of {len(names)} names")
            values.append(floats)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; accepted: a CSV file", "data-file") from None
    except ValueError as error:
        raise InputError(
            f"{path}: {error}; accepted: a row of names, then rows of numbers with decimal points, "
            "separated by commas",
            "data-file",
        ) from None
    columns = np.reshape(values, (-1, len(names))).T
    return dict(zip(names, columns, strict=True))


def _floats(texts: Sequence[str]) -> list[float] | None:
    """Return texts as numbers; None if they are not all."""
    try:
        return [float(text) for text in texts]
    except ValueError:
        return None
