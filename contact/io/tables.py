"""Tables as CSV files, and the keys and columns of the output files in words. On one rank."""

from __future__ import annotations

import csv
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from contact.results.contact_nodes import Table
from contact.results.quantities import quantities
from contact.results.quantity import Quantity


def write_csv(
    path: Path, header: Iterable[str], rows: Iterable[Iterable[Any]], more: bool = False
) -> None:
    """Write rows, numbers to the last digit, or more rows of a table."""
    with path.open("a" if more else "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        if not more:
            writer.writerow(header)
        writer.writerows(rows)


def read_rows(path: Path) -> tuple[list[str], list[dict[str, str]]]:
    """Read the header and the rows of a table; nothing of a damaged one."""
    with path.open(newline="", encoding="utf-8-sig") as file:
        try:
            header, *rows = csv.reader(file, strict=True)
            return header, [dict(zip(header, row, strict=True)) for row in rows]
        except (ValueError, csv.Error):
            return [], []


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


def described(file: str) -> Iterator[tuple[str, Quantity, str]]:
    """Yield the name of a key, column or field, its quantity, and the description there."""
    for quantity in quantities(file):
        name, text = quantity.name, quantity.text
        if file.endswith(".csv") and quantity.component:
            name = quantity.component.format(name=name, axis="x")
        if file != quantity.files[0]:
            text = f"As in `{quantity.files[0]}`."
        if name != quantity.name:
            text += " Likewise the other components."
        yield name, quantity, text


def files_help(*names: str) -> str:
    """Return the keys or columns of some files, for the command line's help."""
    lines = []
    for file in names:
        lines += ["", f"{'columns' if file.endswith('.csv') else 'keys'} of {file}:"]
        for name, quantity, text in described(file):
            unit = f" ({quantity.unit})" if quantity.unit else ""
            text = f"{_first(text)}{unit}"
            lines += textwrap.wrap(f"  {name:<19} {text}", 98, subsequent_indent=22 * " ")
    return "\n".join([*lines, "", "signs, units, all files: docs/output.md"]).lstrip("\n")


def _first(text: str) -> str:
    """Return the first statement of a text, without Markdown."""
    for end in (". ", ": ", "; "):
        text = text.partition(end)[0]
    return text.rstrip(".").replace("`", "")
