"""How the scripts of this folder write their tables and figures.

Each table or figure is a CSV file with the numbers, for a figure a PNG and a PDF file, and a
Markdown fragment of the same name with caption and remarks. `results_page.py` puts the fragments
together.
"""

from __future__ import annotations

import argparse
import csv
import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from cycler import cycler
from matplotlib import rcParams
from matplotlib.figure import Figure
from mpi4py import MPI
from PIL import Image

from contact import Case, NotConvergedError, Solution, solve
from contact.methods.method import METHODS
from contact.methods.options import Options
from contact.methods.report import Outcome, Record
from contact.plot.run import Run
from contact.plot.style import STYLE
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.writing import written

#: Widths of figures of one column, 85 mm, and of two (inches).
ONE_COLUMN, TWO_COLUMNS = 85 / 25.4, 175 / 25.4

#: Dots per inch of pictures, and of images in a PDF.
DPI, PDF_DPI = 300, 200

rcParams.update(STYLE)
rcParams.update(
    {"font.size": 8, "axes.titlesize": 8, "legend.fontsize": 7, "figure.figsize": (TWO_COLUMNS, 4)}
)
rcParams["axes.prop_cycle"] = cycler(
    # Okabe and Ito's palette, which readers who do not see all colours tell apart.
    color=["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000"]
)


#: Columns of equal lengths by their names, or rows, each with its values by these names.
Columns = Mapping[str, Sequence[Any]]
Table = Columns | Sequence[Mapping[str, Any]]


@dataclass(frozen=True)
class Report:
    """A folder that tables and figures are written to, by rank 0."""

    #: The folder; it is made if need be.
    out: Path
    #: Whether coarse meshes are asked for: quick, for tests.
    coarse: bool = False

    @classmethod
    def of(cls, text: str, script: str, arguments: Sequence[str] | None = None) -> Report:
        """Return the report that --out and --coarse, options of every script, ask for."""
        given = parser(text, script).parse_args(arguments)
        return cls(given.out, given.coarse)

    def table(self, name: str, caption: str, given: Table, note: str = "") -> None:
        """Print a table and write it."""
        if MPI.COMM_WORLD.rank > 0:
            return
        columns = _columns(given)
        self._csv(name, columns)
        rows = [[text(value) for value in row] for row in zip(*columns.values(), strict=True)]
        lines = [list(columns), *rows]
        widths = [max(len(line[k]) for line in lines) for k in range(len(columns))]
        print(f"\n{caption}")
        for line in lines:
            print("  ".join(cell.rjust(w) for cell, w in zip(line, widths, strict=True)))
        if note:
            print(note)
        escaped = ([cell.replace("|", "\\|") for cell in line] for line in lines)
        body = [f"| {' | '.join(line)} |" for line in escaped]
        body.insert(1, "|" + " --- |" * len(columns))
        self._fragment(name, caption, "\n".join(body), note)

    def figure(
        self,
        name: str,
        caption: str,
        figure: Figure,
        data: Columns,
        note: str = "",
    ) -> None:
        """Write a figure and the numbers that it shows (columns may have unequal lengths)."""
        if MPI.COMM_WORLD.rank > 0:
            return
        self.out.mkdir(parents=True, exist_ok=True)
        for ending, dpi in (("png", DPI), ("pdf", PDF_DPI)):
            figure.savefig(
                self.out / f"{name}.{ending}", dpi=dpi, bbox_inches="tight", pad_inches=0.02
            )
        pack(self.out / f"{name}.png")
        length = max(len(column) for column in data.values())
        padded = {key: [*column, *[""] * (length - len(column))] for key, column in data.items()}
        self._csv(name, padded)
        self._fragment(name, caption, f"![{caption}]({name}.png)", note)

    def numbers(self, name: str, given: Table) -> None:
        """Write numbers that are too many for a page."""
        if MPI.COMM_WORLD.rank == 0:
            self._csv(name, _columns(given))

    def _csv(self, name: str, columns: Columns) -> None:
        self.out.mkdir(parents=True, exist_ok=True)
        with (self.out / f"{name}.csv").open("w", newline="") as stream:
            writer = csv.writer(stream)
            writer.writerow(columns)
            writer.writerows(zip(*columns.values(), strict=True))

    def _fragment(self, name: str, caption: str, body: str, note: str) -> None:
        parts = [f"**{caption}**", body, *([note] if note else []), f"Numbers: `{name}.csv`"]
        (self.out / f"{name}.md").write_text("\n\n".join(parts) + "\n")


def _columns(given: Table) -> Columns:
    """Return a table as columns, those of its first row; None where another has no value."""
    if isinstance(given, Mapping):
        return given
    return {key: [row.get(key) for row in given] for key in given[0]}


def empty(*names: str) -> dict[str, list[Any]]:
    """Return the columns of a table without rows."""
    return {name: [] for name in names}


def append(columns: Mapping[str, list[Any]], *row: Any) -> None:
    """Append a row to columns of equal lengths."""
    for column, value in zip(columns.values(), row, strict=True):
        column.append(value)


def pack(path: Path) -> None:
    """Write a PNG file with a palette of its own: a third of the size."""
    with Image.open(path) as picture:
        packed = picture.convert("RGB").quantize(256, dither=Image.Dither.NONE)
    packed.save(path, optimize=True, dpi=(DPI, DPI))


def text(value: Any) -> str:
    """Return a value as it stands in a table."""
    if isinstance(value, str):
        return value
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, int | np.integer):
        return str(value)
    if value is None or np.isnan(value):
        return "—"
    return f"{value:.4g}"


def subplots(
    rows: int = 1,
    columns: int = 1,
    size: tuple[float, float] = (TWO_COLUMNS, 2.8),
    **shared: Any,
) -> tuple[Figure, Any]:
    """Return a figure and its axes, in the style of `contact.plot`."""
    figure = Figure(figsize=size)
    return figure, figure.subplots(rows, columns, **shared)


def parser(text: str, script: str) -> argparse.ArgumentParser:
    """Return a parser with the options --out and --coarse."""
    made = argparse.ArgumentParser(description=text.splitlines()[0])
    made.add_argument("--out", type=Path, default=Path("results") / script)
    made.add_argument("--coarse", action="store_true", help="coarse meshes: quick, for tests")
    # A table solves a hundred problems; `contact solve` tells the warnings of each.
    logging.getLogger("contact").setLevel(logging.ERROR)
    return made


def solved(case: Case, problem: ContactProblem | None = None) -> Solution:
    """Solve a case, or stop the script. Collective."""
    solution = solve(case) if problem is None else solve(problem, case.solver)
    solution.units = case.case.units
    if not solution.converged:
        raise NotConvergedError(f"{case.title}: {solution.outcome.reason}")
    return solution


def run_of(solution: Solution) -> Run | None:
    """Return the run that figures of a solution are drawn from, without its title. Collective."""
    run = written(solution)
    return None if run is None else replace(run, title="")


def iterates(
    problem: ContactProblem, settings: Options, first: int = 1
) -> tuple[list[State], list[int], Outcome]:
    """Return the states that the outer iterations have left, their solves, and how they ended.

    Collective.
    """
    found: list[State] = []
    solves: list[int] = []

    def keep(record: Record) -> None:
        if record.iteration >= first:
            found.append(method.state)
            solves.append(record.inner)

    method = METHODS[settings.method](problem, settings, keep)
    _, outcome = method.solve()
    return found, solves, outcome


def observed_orders(parameter: Sequence[float], errors: Sequence[float]) -> list[float]:
    """Return the slopes between neighbours in a doubly logarithmic plot, after a NaN."""
    slopes = np.diff(np.log(errors)) / np.diff(np.log(parameter))
    return [np.nan, *slopes.tolist()]
