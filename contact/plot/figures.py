"""All figures of a run, from the files that it has left."""

from __future__ import annotations

import base64
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure
from mpi4py import MPI

from contact._compat import export_page
from contact.errors import InputError
from contact.io.folder import added, result_folder
from contact.plot.body import body_figure, picture
from contact.plot.contact import draw_line
from contact.plot.run import Run, read_run, read_step
from contact.plot.series import steps_figures
from contact.plot.space import Scene, contact_figure, drawable
from contact.plot.style import DEFORMED, PAGE, STYLE, Look, fitted, image, name_and_label
from contact.ranks import refused

#: Endings of files that figures may have.
FORMATS = ("png", "pdf", "svg")


class Gallery(dict[str, Figure]):
    """Figures by name; a notebook shows them."""

    def _repr_html_(self) -> str:
        with matplotlib.rc_context(STYLE):
            texts = {k: base64.b64encode(image(f, "png", 110)).decode() for k, f in self.items()}
        return "".join(
            f'<img alt="{name}" src="data:image/png;base64,{text}">' for name, text in texts.items()
        )


def figures_of(run: Run, fields: Sequence[str] = (), look: Look = PAGE) -> Gallery:
    """Return the figures of a run by name; with `fields` the body alone, coloured by each."""
    if run.plane and look.view is not None:
        raise flat("--view")
    found = Gallery()
    shown = run.plane or drawable()
    with matplotlib.rc_context(look.style):
        if not fields:
            if shown:
                found["contact"] = draw_line(run) if run.plane else contact_figure(run, look)
                if run.title:
                    found["contact"].suptitle(fitted(run.title), fontsize="large")
            if run.steps:
                found |= steps_figures(run)
        for field in fields or [field for field in DEFORMED if field in run.body.point_data]:
            made = picture(run, field, look=look)
            if shown:
                found[name_and_label(field, run.units)[0]] = body_figure(made)
    return found


def draw(
    run: Run,
    folder: Path,
    fields: Sequence[str] = (),
    formats: Sequence[str] = ("png",),
    look: Look = PAGE,
) -> list[Path]:
    """Draw the figures of `figures_of` into a folder; return the files. On one rank."""
    files, step = [], "" if run.step is None else f"-step-{run.step}"
    with matplotlib.rc_context(look.style):
        for name, figure in figures_of(run, fields, look).items():
            for ending in formats:
                files.append(folder / f"figure-{name}{step}.{ending}")
                files[-1].write_bytes(image(figure, ending))
    return files


def plot(
    folder: Path,
    fields: Sequence[str] = (),
    formats: Sequence[str] = ("png",),
    look: Look = PAGE,
    step: int | None = None,
) -> list[Path]:
    """Draw the figures of a run, or of its step, into its folder; return the files. On one rank."""
    read = read_run if step is None else partial(read_step, number=step)
    return _added(folder, lambda new: draw(read(folder), new, fields, formats, look))


def flat(option: str) -> InputError:
    """Return the error for a view of a body in 2-D."""
    words = "a body in 2-D is not turned; accepted: a run in 3-D, or contact plot without"
    return InputError(f"{option}: {words}", "figure-option")


def window(run: Run, field: str | None = None) -> Any:
    """Return the plotter of pyvista that shows a body in 3-D, by default with contact pressure."""
    if run.plane:
        raise flat("a window or a page")
    scene = Scene.of(run) if field is None else picture(run, field).scene
    return scene.window(field or "contact pressure")


def export(folder: Path, fields: Sequence[str] = ()) -> list[Path]:
    """Write ``figure-view.html``, or ``figure-view-FIELD.html``, to be turned in a browser."""

    def draw(new: Path) -> list[Path]:
        run, files = read_run(folder), []
        drawable()  # even a page takes a display of VTK before 9.4
        for field in fields or (None,):
            files.append(new / f"figure-view{f'-{field}' if field else ''}.html")
            try:
                export_page(window(run, field), files[-1])
            except (ImportError, AttributeError) as error:  # missing, or of another version
                raise InputError(
                    f"--html: pyvista cannot export ({error}); accepted: "
                    'pip install "pyvista[jupyter]" first, or contact view',
                    "figure-option",
                ) from error
        return files

    return _added(folder, draw)


def _added(folder: Path, draw: Callable[[Path], list[Path]]) -> list[Path]:
    """Let files be drawn, and add them to the results in a folder."""
    if not (folder / "summary.json").is_file():
        raise InputError(
            f"{folder}: no results there; accepted: a folder that a run has left", "no-results"
        )
    with result_folder(folder, MPI.COMM_SELF, overwrite=True):  # it only adds
        try:
            with added(folder) as new:
                files = draw(new)
        except OSError as error:
            raise refused(error) from None
    return [folder / path.name for path in files]
