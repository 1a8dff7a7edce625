"""All figures of a run, and animations, from the files that it has left."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from mpi4py import MPI
from PIL import Image

from contact.errors import InputError
from contact.output.figures.body import body_figure, magnification, picture, scalar
from contact.output.figures.contact import contact_figure
from contact.output.figures.run import Run, read_run, read_steps
from contact.output.figures.steps import steps_figures
from contact.output.figures.style import DEFORMED, OUTLIERS, STYLE, Look, named
from contact.output.folder import add, begin, discard, refused, result_folder

#: Endings of files that figures may have.
FORMATS = ("png", "pdf", "svg")

#: Dots per inch of an animation: a file that a page can show.
DPI = 90

#: Milliseconds of the whole animation, and of a frame at least and at most.
LENGTH, SHORTEST, LONGEST = 6000, 40, 500


class Gallery(dict[str, Figure]):
    """Figures by name; a notebook shows them."""

    def _repr_html_(self) -> str:
        images = []
        for name, figure in self.items():
            data = io.BytesIO()
            with matplotlib.rc_context(STYLE):
                figure.savefig(data, format="png", dpi=110)
            text = base64.b64encode(data.getvalue()).decode()
            images.append(f'<img alt="{name}" src="data:image/png;base64,{text}">')
        return "".join(images)


def figures_of(run: Run, fields: Sequence[str] = (), look: Look | None = None) -> Gallery:
    """Return the figures of a run by name.

    In 2-D the contact figure shows the stresses along Gamma_3 with the friction bound and the zones
    of stick and slip, as Figure 7.4 of the thesis does, and the deformed body is coloured by the
    von Mises stress, as in Figure 7.5. In 3-D the contact nodes are seen along the mean contact
    direction, and the deformed surface from the side.

    Parameters
    ----------
    run
        The run.
    fields
        Fields to colour the body by, and these figures alone; by default all figures, the body by
        von Mises stress and potential.
    look
        Choices for all figures.
    """
    look, found = look or Look(), Gallery()
    with matplotlib.rc_context(look.style):
        if not fields:
            found["contact"] = contact_figure(run, look)
            if run.steps is not None:
                found |= steps_figures(run, look)
        for field in fields or [field for field in DEFORMED if field in run.body.point_data]:
            figure = body_figure(picture(run, field), look)
            if figure is not None:
                found[named(field, run.units)[0]] = figure
    return found


def draw(
    run: Run,
    folder: Path,
    fields: Sequence[str] = (),
    formats: Sequence[str] = ("png",),
    look: Look | None = None,
) -> list[Path]:
    """Draw the figures of `figures_of` into a folder; return the files. On one rank."""
    look = look or Look()
    figures = figures_of(run, fields, look)
    files = [folder / f"figure-{name}.{ending}" for name in figures for ending in formats]
    with matplotlib.rc_context(look.style):
        for file in files:
            try:
                figures[file.stem.removeprefix("figure-")].savefig(file)
            except BaseException:  # it is not left half done
                file.unlink(missing_ok=True)
                raise
    return files


def plot(
    folder: Path,
    fields: Sequence[str] = (),
    formats: Sequence[str] = ("png",),
    look: Look | None = None,
) -> list[Path]:
    """Draw the figures of a run into its folder; return the files. On one rank.

    Parameters
    ----------
    folder
        The results of the run.
    fields, formats, look
        As `draw` takes them.

    Raises
    ------
    InputError
        If the folder has not all that is needed, or no such field, cannot be written to, or another
        run works in it.
    """
    return _added(folder, lambda new: draw(read_run(folder), new, fields, formats, look))


def animate(folder: Path, fields: Sequence[str] = (), look: Look | None = None) -> list[Path]:
    """Draw ``animation-FIELD.gif`` from the files of an evolution. On one rank.

    Scale, colours and axes are the same in all frames. The arguments are those of `plot`.

    Raises
    ------
    InputError
        As `plot`, and if the folder has no steps.
    """

    def draw(new: Path) -> list[Path]:
        frames, chosen = read_steps(folder), look or Look()
        return [_animation(frames, field, new, chosen) for field in fields or ("von_mises",)]

    return _added(folder, draw)


def _added(folder: Path, draw: Callable[[Path], list[Path]]) -> list[Path]:
    """Let files be drawn, and add them to the results in a folder."""
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


def _animation(frames: Sequence[tuple[float, Run]], field: str, folder: Path, look: Look) -> Path:
    runs = [replace(run, title=f"{run.title}, t = {time:.3g}".lstrip(", ")) for time, run in frames]
    # Colours of all frames, without values far beyond the others.
    limits = np.array([np.quantile(scalar(run, field)[0], OUTLIERS) for run in runs])
    ends = limits[:, 0].min(), limits[:, 1].max()
    scale = magnification(runs[-1].diameter, *runs)
    pictures = [picture(run, field, scale, limits=ends) for run in runs]
    boxes = np.array([made.box for made in pictures])
    box = np.array([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
    with matplotlib.rc_context(look.style | {"figure.dpi": DPI}):
        found = [body_figure(replace(made, box=box), look) for made in pictures]
        figures = [figure for figure in found if figure is not None]
        if not figures:
            raise InputError("--animate: pyvista cannot draw here; accepted: a display, or Xvfb")
        if runs[0].plane:
            axes = [figure.axes[0] for figure in figures]
            x, y = (np.array([(ax.get_xlim(), ax.get_ylim()) for ax in axes])[:, k] for k in (0, 1))
            for ax in axes:
                ax.set(xlim=(x[:, 0].min(), x[:, 1].max()), ylim=(y[:, 0].min(), y[:, 1].max()))
        images = [_image(figure) for figure in figures]
    palette = images[-1].quantize(256)  # one for all, so that nothing flickers; the bar has it
    first, *rest = (image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images)
    path = folder / f"animation-{named(field, runs[0].units)[0]}.gif"
    each = int(np.clip(LENGTH / len(frames), SHORTEST, LONGEST))
    first.save(path, save_all=True, append_images=rest, duration=each, loop=0)
    return path


def _image(figure: Figure) -> Any:
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    canvas.draw()  # the second one ends the layout
    return Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
