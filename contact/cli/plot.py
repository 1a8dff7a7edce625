"""``contact plot DIR`` and ``contact view DIR``: figures of a run, from its files."""

from __future__ import annotations

import argparse
import math
import os
import re
import sys
from pathlib import Path

import pyvista
from mpi4py import MPI

from contact.cli.main import CONVERGED
from contact.errors import InputError
from contact.methods.signals import signals_held
from contact.plot.figures import FORMATS, export, plot, window
from contact.plot.run import read_run
from contact.plot.series import plot_sweep
from contact.plot.space import has_display
from contact.plot.style import Look
from contact.ranks import on_root
from contact.sweeping import TABLE

_LENGTH = re.compile(r"(\d+(?:\.\d*)?)\s*(mm|cm|in)")
_INCHES = {"mm": 1 / 25.4, "cm": 1 / 2.54, "in": 1.0}


def run_view(options: argparse.Namespace, comm: MPI.Intracomm) -> int:
    """Open a window with the body on rank 0."""
    on_root(comm, lambda: show(Path(options.folder), options.field))
    return CONVERGED


def run_plot(options: argparse.Namespace, comm: MPI.Intracomm) -> int:
    """Draw the figures on rank 0 and name their files."""
    formats = [text.strip() for text in options.format.split(",")]
    for text in formats:
        if text not in FORMATS:
            raise InputError(
                f"--format {options.format}: unknown format {text!r}; accepted: "
                f"{', '.join(FORMATS)}, or several with commas",
                "figure-option",
            )
    width = None if options.width is None else inches(options.width)
    view = None if options.view is None else direction(options.view)
    look, folder = Look(width, view), Path(options.folder)

    def draw() -> list[Path]:
        if (folder / TABLE).is_file() and not (folder / "summary.json").exists():
            for option in ("view", "html", "step"):
                if getattr(options, option) not in (None, False):
                    raise InputError(
                        f"--{option}: the figure of a sweep shows no places; accepted: --field, "
                        "--format, --width",
                        "figure-option",
                    )
            return plot_sweep(folder, options.field, formats, look)
        if options.html:
            return export(folder, options.field)
        return plot(folder, options.field, formats, look, options.step)

    with signals_held():  # no figure is left half written
        files = on_root(comm, draw)
    if comm.rank == 0:
        print(*files, sep="\n")
    return CONVERGED


def show(folder: Path, field: str | None) -> None:
    """Show the body of a run in 3-D in a window, until that is closed."""
    opened = window(read_run(folder), field)
    display = os.environ.get("WAYLAND_DISPLAY") or has_display()
    if pyvista.OFF_SCREEN or (sys.platform == "linux" and not display):
        opened.close()
        raise InputError(
            "contact view: no display for a window; accepted: a session with a display, contact "
            "plot --view X,Y,Z, or contact plot --html",
            "figure-option",
        )
    opened.show()


def inches(text: str) -> float:
    """Return a length that is given as "85mm", "8.5cm" or "3.35in", or raise an InputError."""
    match = _LENGTH.fullmatch(text.strip())
    length = float(match[1]) * _INCHES[match[2]] if match else 0.0
    if not 1.5 <= length <= 40:
        raise InputError(
            f"--width {text}; accepted: a length such as 85mm, from 40mm to 1000mm", "figure-option"
        )
    return length


def direction(text: str) -> tuple[float, float, float]:
    """Return a direction that is given as "1,-1,0.5", or raise an InputError."""
    try:
        x, y, z = map(float, text.split(","))
    except ValueError:
        x = y = z = 0.0
    largest = max(abs(x), abs(y), abs(z))
    if not largest > 0 or not all(map(math.isfinite, (x, y, z))):
        raise InputError(
            f"--view {text}; accepted: three numbers that are not all 0, such as 1,-1,0.5",
            "figure-option",
        )
    return x / largest, y / largest, z / largest
