"""Tables as CSV files. On one rank."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from contact.results.grid import Table


def write_csv(
    path: Path, header: Iterable[str], rows: Iterable[Iterable[Any]], more: bool = False
) -> None:
    """Write rows, numbers to the last digit, or more rows of a table."""
    with path.open("a" if more else "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        if not more:
            writer.writerow(header)
        writer.writerows(rows)


def write_columns(path: Path, columns: Table, more: bool = False) -> None:
    """Write columns of equal length, or more rows of a table."""
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    write_csv(path, columns, rows, more)


def write_mappings(
    path: Path, rows: Sequence[Mapping[str, Any]], header: Iterable[str] = ()
) -> None:
    """Write rows of named values, under the names in the header and all others."""
    names = list(dict.fromkeys([*header, *(name for row in rows for name in row)]))
    write_csv(path, names, ([row.get(name) for name in names] for row in rows))
