"""Figures and animations of a run that is over, from the files that it has left."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from mpi4py import MPI
from numpy.typing import NDArray
from PIL import Image
from scipy.spatial import KDTree

from contact.errors import InputError
from contact.output.figures.body import Picture, displacement, drawn, magnification
from contact.output.figures.figures import Drawing
from contact.output.figures.steps import Course
from contact.output.figures.style import DEFORMED, OUTLIERS, axes_of, heading, named, style
from contact.output.folder import add, begin, discard, refused, result_folder
from contact.output.options import Units
from contact.output.quantities import OPPOSITE
from contact.output.table import Table
from contact.output.vtu import VTU, read_vtu

#: Endings of files that figures may have.
FORMATS = ("png", "pdf", "svg")

#: Dots per inch, and most frames: a file that a page can show.
DPI, MOST = 90, 100

#: Milliseconds of the whole, and of a frame at least and at most.
LENGTH, SHORTEST, LONGEST = 6000, 40, 500

_SET = re.compile(r'timestep="([^"]+)" file="([\w-]+\.vtu)"')


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
    title, units, revolved, files = read(folder, "summary.json", _summary)
    surface = read(folder, "contact.vtu", read_vtu)
    body = read(folder, "fields.vtu", read_vtu)
    table = read(folder, "contact.csv", lambda path: _table(path, surface))
    d = body.grid.dimension
    held = surface.grid.points[np.asarray(surface.at_points["row"]) < 0, :d]
    usual = [field for field in DEFORMED if field in body.at_points]
    pictures = []
    for field in fields or usual:
        name, label = named(field, units)
        pictures.append((name, drawn(body, held, field, label)))
    opposite = None
    if OPPOSITE in files:
        opposite = read(folder, OPPOSITE, read_vtu)
    course = None
    if "steps.csv" in files:
        course = Course(
            read(folder, "steps.csv", _rows), read(folder, "contact-steps.csv", _tables)
        )
    return Drawing(
        title=heading(title),
        plane=d == 2,
        table=table,
        held=held,
        surface=surface,
        pictures=pictures,
        axes=axes_of(revolved),
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
    with result_folder(folder, MPI.COMM_SELF, overwrite=True):  # it only adds
        try:
            files = draw(begin(folder))
            add(folder, files)
        except OSError as error:
            raise refused(error) from None
        finally:
            discard(folder)
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
    except (ValueError, KeyError, IndexError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: not as a run has left it ({error})") from None


def _summary(path: Path) -> tuple[str, Units, bool, list[str]]:
    """Read title, units, whether the body is one of revolution, and the names of all files."""
    found = json.loads(path.read_bytes())
    revolved = found.get("kinematics") == "axisymmetric"
    return str(found["title"]), Units(**found.get("units", {})), revolved, found.get("files", [])


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


@dataclass(frozen=True)
class Frame:
    """The body at the end of a step, and its contact nodes."""

    time: float
    body: VTU
    table: Table


def animate(
    folder: Path, fields: Sequence[str] = (), width: float | None = None, mirror: bool = False
) -> list[Path]:
    """Draw ``animation-FIELD.gif`` from the files of an evolution. On one rank.

    Scale, colours and axes are the same in all frames.

    Parameters
    ----------
    folder, fields, width, mirror
        As `saved.plot` takes them.

    Raises
    ------
    InputError
        If the folder has no steps, or no such field.
    """

    def draw(new: Path) -> list[Path]:
        drawing, frames = read_drawing(folder, (), mirror), read_frames(folder)
        chosen = fields or ("von_mises",)
        return [_animation(drawing, frames, field, new, width) for field in chosen]

    return added(folder, draw)


def read_frames(folder: Path) -> list[Frame]:
    """Read the steps of an evolution, at most `MOST` of them, the last one always."""
    if not (folder / "fields.pvd").is_file():
        raise InputError(
            f"{folder}: no steps there; accepted: the results of an evolution, with "
            'output.fields = "vtu"'
        )
    sets = _SET.findall(read(folder, "fields.pvd", lambda path: path.read_text("utf-8")))
    every = int(np.ceil(len(sets) / MOST))
    chosen = sets[::-every][::-1]
    drawing = read_drawing(folder)
    assert drawing.course is not None  # where there are fields in time, there are steps
    times = [float(row["t"]) for row in drawing.course.rows]
    steps = dict(zip(times, drawing.course.tables, strict=True))
    frames = []
    for time, name in chosen:
        body = read(folder, name, read_vtu)
        frames.append(Frame(float(time), body, _moved(drawing.table, body, steps[float(time)])))
    return frames


def _moved(table: Table, body: VTU, step: Table) -> Table:
    """Return the contact nodes of a step with the displacement of the opposite side."""
    names = [name for name in "xyz" if name in table]
    normal = np.column_stack([table[f"nu_{name}"] for name in names])
    places = np.column_stack([table[name] for name in names])
    nodes = KDTree(body.grid.points[:, : len(names)]).query(places)[1]
    along = np.asarray(body.at_points["displacement"])[nodes, : len(names)]
    return {**table, "moved": np.einsum("ni,ni->n", along, normal) - step["u_n"]}


def _animation(
    drawing: Drawing, frames: Sequence[Frame], field: str, folder: Path, width: float | None
) -> Path:
    name, label = named(field, drawing.units)
    diameter = float(np.ptp(frames[-1].body.grid.points, axis=0).max())
    largest = [np.linalg.norm(displacement(frame.body), axis=1).max() for frame in frames]
    scale = magnification(diameter, float(max(largest)))
    pictures = [drawn(frame.body, drawing.held, field, label, scale) for frame in frames]
    boxes = np.array([picture.box for picture in pictures])
    box = np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
    # Colours of all frames, without values far beyond the others.
    limits = np.array([np.quantile(picture.values, OUTLIERS) for picture in pictures])
    same: dict[str, Any] = {"box": box, "limits": (limits[:, 0].min(), limits[:, 1].max())}
    with matplotlib.rc_context(style(width) | {"figure.dpi": DPI}):
        figures = [
            _figure(drawing, frame, replace(picture, **same))
            for frame, picture in zip(frames, pictures, strict=True)
        ]
        if drawing.plane:
            _same_axes(figures)
        images = [_image(figure) for figure in figures]
    palette = images[-1].quantize(256)  # one for all, so that nothing flickers; the bar has it
    first, *rest = (image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images)
    path = folder / f"animation-{name}.gif"
    each = int(np.clip(LENGTH / len(frames), SHORTEST, LONGEST))
    first.save(path, save_all=True, append_images=rest, duration=each, loop=0)
    return path


def _figure(drawing: Drawing, frame: Frame, picture: Picture) -> Figure:
    title = f"{drawing.title}, t = {frame.time:.3g}" if drawing.title else f"t = {frame.time:.3g}"
    figure = drawing.body(picture, frame.table, title)
    if figure is None:
        raise InputError("--animate: pyvista cannot draw here; accepted: a display, or Xvfb")
    return figure


def _same_axes(figures: Sequence[Figure]) -> None:
    """Show the same part of the plane in all figures."""
    axes = [figure.axes[0] for figure in figures]
    for get, put in (("get_xlim", "set_xlim"), ("get_ylim", "set_ylim")):
        limits = np.array([getattr(ax, get)() for ax in axes])
        for ax in axes:
            getattr(ax, put)(limits[:, 0].min(), limits[:, 1].max())


def _image(figure: Figure) -> Any:
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    canvas.draw()  # the second one ends the layout
    return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
