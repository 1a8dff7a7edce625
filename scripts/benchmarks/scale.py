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
    rows, least, n = [], {}, "19" if coarse else "43"
    for ranks in (1, 2, 4):
        words = [*command("weak"), "1", n]
        arrays = measured(words, ranks)["python"]
        solved = measured([*words, "--solve"], ranks)
        least = least or {"memory": solved["memory"], "arrays": arrays}
        rows.append(
            {
                "ranks": ranks,
                "unknowns": solved["unknowns"],
                "memory per rank (MB)": solved["memory"] / 1e6,
                "over one rank": solved["memory"] / least["memory"],
                "arrays of Python (MB)": arrays / 1e6,
                "theirs over one rank": arrays / least["arrays"],
                "iterations": solved["iterations"],
            }
        )
    return rows


def pair(coarse: bool) -> list[Run]:
    """Return forces of two bodies on several ranks, and times of their pairing."""
    rows, known, n = [], None, "18" if coarse else "40"
    for ranks in (1, 2, 3, 4):
        run = measured([*command("weak"), "2", n, "--solve", "--length", "4"], ranks)
        forces = np.array(run["forces"])
        known = forces if known is None else known
        rows.append(
            {
                "ranks": ranks,
                "unknowns": run["unknowns"],
                "contact nodes": run["contact nodes"],
                "linear solves": run["solves"],
                "difference of the forces": np.linalg.norm(forces - known) / np.linalg.norm(known),
                "pairing (s)": run["pairing"],
                "a linear solve (s)": run["a linear solve"],
                "pairing over a solve": run["pairing"] / run["a linear solve"],
                "coupling per rank (kB)": run["coupling"] / 1e3,
            }
        )
    return rows


def read(coarse: bool) -> list[Run]:
    """Return the costs of reading a large mesh on ranks."""
    with TemporaryDirectory(dir=Path.cwd()) as folder:
        file = str(Path(folder) / "cube.xdmf")
        started([*command("reading"), "make", file, "70" if coarse else "150"])
        run = measured([*command("reading"), "read", file], 4)
    memory = run["memory"] / 1e6
    return [{"ranks": run["ranks"], "cells": run["cells"], "memory in all (MB)": memory}]


TABLES = {
    "weak": (weak, "Slices of a bar on a foundation, one per rank"),
    "pair": (pair, "Two bars on each other, the same on all numbers of ranks"),
    "read": (read, "A cube of tetrahedra of which each rank reads its share"),
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, and write a table."""
    made = parser(__doc__, "scale")
    made.add_argument("table", choices=TABLES)
    given = made.parse_args(arguments)
    rows_of, caption = TABLES[given.table]
    Report(given.out).table(f"scale-{given.table}", caption, rows_of(given.coarse))


if __name__ == "__main__":
    main()
