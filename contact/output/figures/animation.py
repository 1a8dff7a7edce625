"""Animations: the deformed body over the steps of an evolution that is over, as GIFs."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image
from scipy.spatial import KDTree

from contact.errors import InputError
from contact.output.figures.body import Picture, displacement, drawn, magnification
from contact.output.figures.figures import Drawing
from contact.output.figures.saved import added, read, read_drawing
from contact.output.figures.style import OUTLIERS, named, style
from contact.output.table import Table
from contact.output.vtu import VTU, read_vtu

#: Dots per inch, and most frames: a file that a page can show.
DPI, MOST = 90, 100

#: Milliseconds of the whole, and of a frame at least and at most.
LENGTH, SHORTEST, LONGEST = 6000, 40, 500

_SET = re.compile(r'timestep="([^"]+)" file="([\w-]+\.vtu)"')


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
    """Return the contact nodes of a step with the way that what is opposite of them has gone."""
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
    palette = _palette(images)
    first, *rest = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
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


def _palette(images: Sequence[Any]) -> Any:
    """Return one palette of all colours that are to come, so that nothing flickers."""
    some = [np.asarray(images[k]) for k in (0, len(images) // 2, -1)]
    palette = Image.fromarray(np.concatenate(some)).quantize(256)
    colours = np.array(palette.getpalette()).reshape(-1, 3)
    colours[colours.sum(axis=1).argmax()] = 255  # paper is white
    palette.putpalette([int(value) for value in colours.ravel()])
    return palette


def _image(figure: Figure) -> Any:
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    canvas.draw()  # the layout is settled by the second one
    return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
