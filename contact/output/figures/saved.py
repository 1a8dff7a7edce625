"""Figures of a run that is over, from the files that it has left."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.errors import InputError
from contact.output import transaction
from contact.output.figures.body import drawn
from contact.output.figures.figures import Drawing
from contact.output.figures.steps import Course
from contact.output.figures.style import DEFORMED, axes_of, heading, named
from contact.output.folder import refused, result_folder
from contact.output.opposite import AGAINST
from contact.output.table import Table
from contact.output.units import Units
from contact.output.vtu import VTU, read_vtu

#: Endings of files that figures may have.
FORMATS = ("png", "pdf", "svg")


def read_drawing(folder: Path, fields: Sequence[str] = (), mirror: bool = False) -> Drawing:
    """Read the data of the figures of a run. On one rank.

    Parameters
    ----------
    folder
        The results of the run.
    fields
        Fields to colour the body by, as `figures.body.scalar` takes them; by default those of
        ``contact solve --plot``.
    mirror
        Whether to show both halves of a body of revolution.

    Raises
    ------
    InputError
        If the folder has not all that is needed, or no such field.
    """
    summary = read(folder, "summary.json", lambda path: json.loads(path.read_bytes()))
    surface = read(folder, "contact.vtu", read_vtu)
    body = read(folder, "fields.vtu", read_vtu)
    table = read(folder, "contact.csv", lambda path: _table(path, surface))
    d = body.grid.dimension
    held = surface.grid.points[np.asarray(surface.at_points["row"]) < 0, :d]
    units = Units(**summary.get("units", {}))
    usual = [field for field in DEFORMED if field in body.at_points]
    pictures = []
    for field in fields or usual:
        name, label = named(field, units)
        pictures.append((name, drawn(body, held, field, label)))
    opposite = None
    if f"{AGAINST}.vtu" in summary.get("files", ()):
        opposite = read(folder, f"{AGAINST}.vtu", read_vtu)
    course = None
    if "steps.csv" in summary.get("files", ()):
        course = Course(
            read(folder, "steps.csv", _rows), read(folder, "contact-steps.csv", _tables)
        )
    return Drawing(
        title=heading(summary["title"]),
        plane=d == 2,
        table=table,
        held=held,
        surface=surface,
        pictures=pictures,
        axes=axes_of(summary.get("kinematics") == "axisymmetric"),
        mirror=mirror,
        units=units,
        course=course,
        opposite=opposite,
    )


def plot(
    folder: Path,
    fields: Sequence[str] = (),
    formats: Sequence[str] = ("png",),
    width: float | None = None,
    mirror: bool = False,
) -> list[Path]:
    """Draw the figures of a run once more, into its folder. On one rank.

    Parameters
    ----------
    folder, fields, mirror
        As `read_drawing` takes them; with fields the contact part is not drawn.
    formats, width
        As `Drawing.draw` takes them.

    Returns
    -------
    The files.

    Raises
    ------
    InputError
        As `read_drawing`, and if the folder cannot be written to or another run works in it.
    """

    def draw(new: Path) -> list[Path]:
        drawing = read_drawing(folder, fields, mirror)
        return drawing.draw(new, formats, width, contact=not fields)

    return added(folder, draw)


def added(folder: Path, draw: Callable[[Path], list[Path]]) -> list[Path]:
    """Let files be drawn, and add them to the results in a folder. On one rank.

    Parameters
    ----------
    folder
        The results of a run.
    draw
        Draws files into the folder that it is given, and returns them.

    Raises
    ------
    InputError
        If there are no results, the folder cannot be written to, or another run works in it.
    """
    if not (folder / "summary.json").is_file():
        raise InputError(f"{folder}: no results there; accepted: a folder that a run has left")
    with result_folder(folder, MPI.COMM_SELF, overwrite=True):  # it adds to what is there
        try:
            files = draw(transaction.begin(folder))
            transaction.add(folder, files)
        except OSError as error:
            raise refused(error) from None
        finally:
            transaction.discard(folder)
    return [folder / path.name for path in files]


def read(folder: Path, name: str, reader: Any) -> Any:
    """Read a file of the results.

    Raises
    ------
    InputError
        If it is missing or damaged.
    """
    path = folder / name
    try:
        return reader(path)
    except FileNotFoundError:
        hint = ', written with output.fields = "vtu"' if name == "fields.vtu" else ""
        raise InputError(f"{path}: no such file; accepted: a run's results{hint}") from None
    except OSError as error:
        raise refused(error) from None
    except (ValueError, KeyError, IndexError) as error:
        raise InputError(f"{path}: not as a run has left it ({error})") from None


def _rows(path: Path) -> list[dict[str, float]]:
    """Read ``steps.csv``."""
    with path.open(newline="", encoding="utf-8") as file:
        return [{k: float(v) for k, v in row.items()} for row in csv.DictReader(file)]


def _columns(path: Path) -> dict[str, NDArray[Any]]:
    """Read a table of contact nodes."""
    with path.open(newline="", encoding="utf-8") as file:
        header, *rows = csv.reader(file)
    columns = {name: np.array(texts) for name, *texts in zip(header, *rows, strict=True)}
    return {k: v if k in ("status", "on") else v.astype(float) for k, v in columns.items()}


def _tables(path: Path) -> list[Table]:
    """Read ``contact-steps.csv``: a table a step."""
    columns = _columns(path)
    starts = np.flatnonzero(np.diff(columns["t"])) + 1
    parts = {name: np.split(values, starts) for name, values in columns.items()}
    return [{name: values[k] for name, values in parts.items()} for k in range(len(starts) + 1)]


def _table(path: Path, surface: VTU) -> Table:
    """Read ``contact.csv``, and the contact directions of its nodes from the surface."""
    columns, fields = _columns(path), surface.at_points
    row = np.asarray(fields["row"])
    nodes = np.argsort(row)[np.count_nonzero(row < 0) :]
    normal = np.asarray(fields["normal"])[nodes]
    columns["entry"] = np.asarray(fields["entry"])[nodes]
    columns["rigid"] = np.asarray(fields["rigid"])[nodes] > 0
    moved = np.asarray(fields["displacement"])[nodes, : normal.shape[1]]
    columns["moved"] = np.einsum("ni,ni->n", moved, normal) - columns["u_n"]
    return columns | {f"nu_{axis}": normal[:, i] for i, axis in enumerate("xyz")}
