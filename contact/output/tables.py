"""The tables that a solve leaves: ``contact.csv`` and ``history.csv``."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from contact.output.solution import Solution
from contact.output.table import Table, csv_columns

HISTORY = (
    "iteration",
    "inner",
    "equilibrium",
    "contact",
    "friction",
    "change",
    "seconds",
    "note",
    "contact_solves",
)


def write_tables(solution: Solution, table: Table, folder: Path) -> None:
    """Write ``contact.csv`` and ``history.csv``. On one rank.

    Parameters
    ----------
    solution, table
        The solution and its contact table.
    folder
        Where to.
    """
    write_table(csv_columns(table), folder / "contact.csv")
    write_csv(folder / "history.csv", HISTORY, _history(solution))


def write_table(columns: Table, path: Path) -> None:
    """Write columns. On one rank."""
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    write_csv(path, columns, rows)


def _history(solution: Solution) -> Iterable[tuple[Any, ...]]:
    for r in solution.history.records:
        k = r.kkt
        yield (
            r.iteration,
            r.inner,
            k.equilibrium,
            k.contact,
            k.friction,
            r.change,
            r.seconds,
            r.note,
            r.contact,
        )


def write_csv(path: Path, header: Iterable[str], rows: Iterable[Iterable[Any]]) -> None:
    """Write a table, numbers to the last digit. On one rank."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)
