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
            numbered = [(i, row) for i, row in enumerate(csv.reader(file), 1) if row]
        if not numbered:
            raise ValueError("it is empty")
        names = [name.strip() for name in numbered[0][1]]
        if len(set(names)) < len(names):
            raise ValueError("a name stands twice")
        if all(map(_is_number, names)):
            raise ValueError("its first row has numbers")
        values = np.array([_numbers(number, names, row) for number, row in numbered[1:]])
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; accepted: a CSV file", "data-file") from None
    except ValueError as error:
        raise InputError(
            f"{path}: {error}; accepted: a row of names, then rows of numbers with decimal points, "
            "separated by commas",
            "data-file",
        ) from None
    columns = values.reshape(-1, len(names)).T
    return dict(zip(names, columns, strict=True))


def _is_number(text: str) -> bool:
    try:
        return bool(np.isfinite(float(text)))
    except ValueError:
        return False


def _numbers(number: int, names: Sequence[str], row: Sequence[str]) -> list[float]:
    """Return the numbers of a row, or raise a ValueError that says where there is none."""
    if len(row) != len(names):
        raise ValueError(f"row {number} has {len(row)} values for {len(names)} names")
    found = []
    for name, text in zip(names, row, strict=True):
        try:
            found.append(float(text))
        except ValueError:
            raise ValueError(f"row {number}, column {name}: {text!r} is no number") from None
    return found
