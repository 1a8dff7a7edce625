"""The tables that a solve leaves: ``contact.csv`` and ``history.csv``."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from contact.methods.report import Record
from contact.output.solution import Solution
from contact.output.table import Table, csv_columns

#: Columns of ``history.csv``, and what they say of a record.
HISTORY: Mapping[str, Callable[[Record], Any]] = {
    "iteration": lambda record: record.iteration,
    "inner": lambda record: record.inner,
    "equilibrium": lambda record: record.kkt.equilibrium,
    "contact": lambda record: record.kkt.contact,
    "friction": lambda record: record.kkt.friction,
    "change": lambda record: record.change,
    "seconds": lambda record: record.seconds,
    "note": lambda record: record.note,
    "contact_solves": lambda record: record.contact,
}


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
    records = solution.history.records
    rows = ([value(record) for value in HISTORY.values()] for record in records)
    write_csv(folder / "history.csv", HISTORY, rows)


def write_table(columns: Table, path: Path) -> None:
    """Write columns. On one rank."""
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    write_csv(path, columns, rows)


def write_csv(path: Path, header: Iterable[str], rows: Iterable[Iterable[Any]]) -> None:
    """Write a table, numbers to the last digit. On one rank."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(header)
        writer.writerows(rows)
