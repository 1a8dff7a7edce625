"""The figure of a sweep: results over the values of its last key, a line for each of the others."""

from __future__ import annotations

import csv
import itertools
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from contact.errors import InputError
from contact.output.figures.figures import image
from contact.output.figures.style import (
    BLUE,
    GREEN,
    GREY,
    NARROW,
    ORANGE,
    SKY,
    Look,
    page_width,
    sheet,
)
from contact.ranks import refused

#: Columns that are drawn by default, as far as they vary.
DRAWN = (
    *(f"contact_force_{axis}" for axis in "xyz"),
    *("max_pressure", "contact_area", "max_displacement", "max_von_mises", "dissipation"),
)
#: Lines, by turns.
LINES = [*itertools.product(("-", "--", ":"), (BLUE, ORANGE, GREEN, SKY, GREY))]


def plot_sweep(
    folder: Path, columns: Sequence[str], formats: Sequence[str], look: Look
) -> list[Path]:
    """Draw ``figure-sweep`` from the ``sweep.csv`` of a folder; return the files. On one rank.

    Parameters
    ----------
    folder
        Of the sweep.
    columns
        To draw; by default those of `DRAWN` that vary.
    formats, look
        Endings of the files, and choices for the figure.

    Raises
    ------
    InputError
        If the table is damaged, or has no such column.
    """
    keys, rows = _read(folder / "sweep.csv")
    found = [name for name in rows[0] if name not in keys]
    for name in columns:
        if name not in found:
            accepted = ", ".join(column for column in found if column != "input")
            raise InputError(f"--field {name}: no such column of sweep.csv; accepted: {accepted}")
    drawn = list(columns) or [n for n in DRAWN if n in found and len({r[n] for r in rows}) > 1]
    if not drawn:
        raise InputError(f"{folder}: no result of the sweep varies; accepted: --field COLUMN")
    files = []
    with matplotlib.rc_context(look.style):
        figure = _figure(keys, rows, drawn)
        for ending in formats:
            files.append(folder / f"figure-sweep.{ending}")
            draft = folder / f".contact-figure-sweep.{ending}"
            try:
                draft.write_bytes(image(figure, ending))
                os.replace(draft, files[-1])
            except OSError as error:
                raise refused(error) from None
    return files


def _read(path: Path) -> tuple[list[str], list[dict[str, str]]]:
    """Return the swept keys, and the rows."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file, strict=True))
        keys = [*itertools.takewhile(lambda name: name != "converged", rows[0])]
    except (OSError, ValueError, IndexError, csv.Error):
        keys = []
    if not keys or any(None in row.values() for row in rows):
        raise InputError(f"{path}: damaged, or no table of a sweep; accepted: a sweep's folder")
    return keys, rows


def _figure(keys: Sequence[str], rows: Sequence[dict[str, str]], drawn: Sequence[str]) -> Figure:
    """Return the figure: a panel for each column."""
    *others, last = keys
    lines = list(dict.fromkeys(tuple(row[key] for key in others) for row in rows))
    across = 2 if len(drawn) > 1 else 1
    down = -(-len(drawn) // across)
    tall = 0.5 if page_width() < NARROW else 0.4
    figure = sheet((tall if across > 1 else 0.66) * down + (0.1 if len(lines) > 1 else 0.0))
    panels = np.ravel(figure.subplots(down, across, squeeze=False))
    for panel, name in zip(panels, drawn, strict=False):
        for line, (style, colour) in zip(lines, itertools.cycle(LINES), strict=False):
            own = [row for row in rows if tuple(row[key] for key in others) == line]
            words = ", ".join(f"{k} = {_short(v)}" for k, v in zip(others, line, strict=True))
            _line(panel, last, name, own, linestyle=style, color=colour, label=words)
        panel.set_xlabel(last)
        panel.set_ylabel(_label(name))
        panel.yaxis.set_major_locator(MaxNLocator(5))
        panel.grid(alpha=0.25)
    figure.align_ylabels()
    for panel in panels[len(drawn) :]:
        panel.axis("off")
    if len(lines) > 1:
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=2)
    return figure


def _label(name: str) -> str:
    """Return a column in words: a component by its axis."""
    words = name.removeprefix("max_").replace("_", " ").replace("von mises", "von Mises stress")
    if words[-2:] in (" x", " y", " z"):
        words = f"{words[:-2]}, ${words[-1]}$"
    return f"largest {words}" if name.startswith("max_") else words


def _short(text: str) -> str:
    """Return a number with six digits; anything else as it is."""
    try:
        return f"{float(text):.6g}"
    except ValueError:
        return text


def _line(panel: Axes, key: str, name: str, rows: Sequence[dict[str, str]], **look: Any) -> None:
    """Draw a line, over numbers in their order, or over texts one after the other."""
    try:
        values = np.array([float(row[name]) for row in rows])
    except ValueError:
        raise InputError(f"--field {name}: no numbers; accepted: a column of numbers") from None
    try:
        places = np.array([float(row[key]) for row in rows])
    except ValueError:
        panel.plot([row[key] for row in rows], values, marker="o", markersize=3, **look)
        return
    order = np.argsort(places)
    panel.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    panel.plot(places[order], values[order], marker="o", markersize=3, **look)
