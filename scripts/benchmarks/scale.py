"""Many ranks as tables: weak scaling, two bodies on 1 to 4 ranks, a mesh of 20 M cells.

``python3 -m scripts.benchmarks.scale weak|pair|read [--out DIR] [--coarse]``: 250,000 unknowns a
rank on 1, 2 and 4 ranks; bars on each other with 2 M unknowns on 1 to 4 ranks; a file of 20 M cells
that 4 ranks read and check. With ``--coarse`` a tenth of the unknowns and cells.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from scripts.benchmarks.processes import Run, command, measured, started
from scripts.reporting import Report, parser


def weak(coarse: bool) -> list[Run]:
    """Return memory and messages of slices, one a rank."""
    rows, n = list[Run](), 19 if coarse else 43
    for ranks in (1, 2, 4):
        counted = measured([*command("weak"), "1", str(n)], ranks)
        rows.append(counted | measured([*command("weak"), "1", str(n), "--solve"], ranks))
        rows[-1]["memory over one rank"] = rows[-1]["memory"] / rows[0]["memory"]
        rows[-1]["arrays over one rank"] = rows[-1]["python"] / rows[0]["python"]
    return rows


def pair(coarse: bool) -> list[Run]:
    """Return forces of two bodies on several ranks, and times of their pairing."""
    rows, n = list[Run](), 18 if coarse else 40
    for ranks in (1, 2, 3, 4):
        words = [*command("weak"), "2", str(n), "--solve", "--length", "4"]
        rows.append(measured(words, ranks))
        force, known = (np.array(row["forces"]) for row in (rows[-1], rows[0]))
        rows[-1]["difference"] = float(np.linalg.norm(force - known) / np.linalg.norm(known))
        rows[-1]["pairing over a solve"] = rows[-1]["pairing"] / rows[-1]["a linear solve"]
    return rows


def read(coarse: bool) -> list[Run]:
    """Return the costs of reading a large mesh on ranks."""
    with TemporaryDirectory(dir=Path.cwd()) as folder:
        file = str(Path(folder) / "cube.xdmf")
        started([*command("reading"), "make", file, "70" if coarse else "150"])
        return [measured([*command("reading"), "read", file], ranks) for ranks in (4,)]


TABLES = {
    "weak": (weak, "Slices of a bar on a foundation, one per rank"),
    "pair": (pair, "Two bars on each other, the same on all numbers of ranks"),
    "read": (read, "A cube of tetrahedra of which each rank reads its share"),
}

#: Columns of the tables, the measured value of each, and the size of its unit.
SHOWN: dict[str, dict[str, tuple[str, float]]] = {
    "weak": {
        "ranks": ("ranks", 1),
        "unknowns": ("unknowns", 1),
        "memory per rank (MB)": ("memory", 1e6),
        "over one rank": ("memory over one rank", 1),
        "arrays of Python (MB)": ("python", 1e6),
        "theirs over one rank": ("arrays over one rank", 1),
        "iterations": ("iterations", 1),
    },
    "pair": {
        "ranks": ("ranks", 1),
        "unknowns": ("unknowns", 1),
        "contact nodes": ("contact nodes", 1),
        "linear solves": ("solves", 1),
        "difference of the forces": ("difference", 1),
        "pairing (s)": ("pairing", 1),
        "a linear solve (s)": ("a linear solve", 1),
        "pairing over a solve": ("pairing over a solve", 1),
        "coupling per rank (kB)": ("coupling", 1e3),
    },
    "read": {
        "ranks": ("ranks", 1),
        "cells": ("cells", 1),
        "memory in all (MB)": ("memory", 1e6),
    },
}


def tabulated(table: str, runs: Sequence[Run]) -> list[Run]:
    """Return the rows of a table, given the runs."""
    return [
        {n: run[key] / unit if unit > 1 else run[key] for n, (key, unit) in SHOWN[table].items()}
        for run in runs
    ]


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, and write a table."""
    made = parser(__doc__, "scale")
    made.add_argument("table", choices=TABLES)
    given = made.parse_args(arguments)
    measure, caption = TABLES[given.table]
    Report(given.out).table(
        f"scale-{given.table}", caption, tabulated(given.table, measure(given.coarse))
    )


if __name__ == "__main__":
    main()
