"""``contact plot DIR``: the figures of a run once more, from the files that it has left."""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import Any

from mpi4py import MPI

from contact.cli.ending import CONVERGED
from contact.cli.options import add_command
from contact.errors import InputError
from contact.output.folder import on_root

_LENGTH = re.compile(r"(\d+(?:\.\d*)?)\s*(mm|cm|in)")
_INCHES = {"mm": 1 / 25.4, "cm": 1 / 2.54, "in": 1.0}


def add_parser(commands: Any) -> None:
    """Add the command to the parser's commands."""
    text = "draw the figures of a run again, from its files"
    command = add_command(commands, "plot DIR [options]", text)
    command.add_argument("folder", metavar="DIR", help="folder with the results of a run")
    command.add_argument(
        "--field",
        action="append",
        default=[],
        metavar="NAME",
        help="colour the body by this field of fields.vtu, and draw this figure alone; may be "
        "repeated: von_mises, displacement, displacement_y, stress_xy, potential, ...",
    )
    command.add_argument(
        "--format", default="png", metavar="pdf,png", help="formats of the files: png, pdf, svg"
    )
    command.add_argument("--width", metavar="85mm", help="width of the figures, in mm, cm or in")
    command.add_argument(
        "--mirror", action="store_true", help="show both halves of a body of revolution"
    )
    command.add_argument(
        "--animate",
        action="store_true",
        help="draw animation-FIELD.gif instead, the deformed body over the steps of an evolution",
    )


def run(options: argparse.Namespace, comm: MPI.Intracomm) -> int:
    """Draw the figures on rank 0 and name their files."""
    from contact.output.figures.animation import animate  # they take a while to load
    from contact.output.figures.saved import FORMATS, plot

    formats = [text.strip() for text in options.format.split(",")]
    for text in formats:
        if text not in FORMATS:
            raise InputError(
                f"--format {options.format}: unknown format {text!r}; accepted: "
                f"{', '.join(FORMATS)}, or several with commas"
            )
    width = None if options.width is None else inches(options.width)
    folder, fields, mirror = Path(options.folder), options.field, options.mirror

    def draw() -> list[Path]:
        if options.animate:
            return animate(folder, fields, width, mirror)
        return plot(folder, fields, formats, width, mirror)

    files = on_root(comm, draw)
    if comm.rank == 0:
        print(*files, sep="\n")
    return CONVERGED


def inches(text: str) -> float:
    """Return a length that is given as "85mm", "8.5cm" or "3.35in".

    Raises
    ------
    InputError
        If it is not understood, or no width for a figure.
    """
    match = _LENGTH.fullmatch(text.strip())
    length = float(match[1]) * _INCHES[match[2]] if match else 0.0
    if not 1.5 <= length <= 40:
        raise InputError(f"--width {text}; accepted: a length such as 85mm, from 40mm to 1000mm")
    return length
