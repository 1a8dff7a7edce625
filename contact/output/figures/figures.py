"""Figures of a solution: contact, deformed body, potential."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from contact.output.figures.body import draw_plane
from contact.output.figures.contact import NARROW, UNNAMED, draw_line
from contact.output.figures.facets import draw_surface
from contact.output.figures.picture import Picture, picture
from contact.output.figures.space import draw_space
from contact.output.figures.steps import Course
from contact.output.opposite import opposite_surface
from contact.output.solved import Solved
from contact.output.surface import contact_surface
from contact.output.table import Table, contact_table, held_points
from contact.output.units import Quantity, Units
from contact.output.vtu import VTU
from contact.typing import Array

#: Quantities drawn on the deformed body: name of the figure, field, label, what it is measured in.
DEFORMED: tuple[tuple[str, str, str, Quantity], ...] = (
    ("deformed", "von_mises", "von Mises stress", "stress"),
    ("potential", "potential", r"potential $\varphi$", "potential"),
)

#: Fields, with their components, whose unit has a name.
KINDS: dict[str, Quantity] = {"displacement": "length", "stress": "stress"}

#: Characters of a title that fit on a figure.
WIDTH = 70

#: Settings of all figures.
STYLE: dict[str, Any] = {
    "figure.figsize": (6.3, 4.0),
    "font.size": 9,
    "font.family": "serif",
    "mathtext.fontset": "dejavuserif",
    "axes.linewidth": 0.6,
    "lines.linewidth": 1.2,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "figure.dpi": 200,
    "savefig.dpi": 200,
    "figure.constrained_layout.use": True,
}


@dataclass(frozen=True)
class Drawing:
    """What the figures show, from all ranks.

    Attributes
    ----------
    title
        Of all figures.
    plane
        Whether the body is plane.
    table, held
        The contact nodes, and the other nodes of Gamma_3.
    surface, opposite
        Gamma_3 with its fields, drawn in space, and the other sides of contacts between bodies.
    pictures
        Names of the figures of the deformed body, and what they show.
    axes
        Names of the coordinates of a plane mesh.
    mirror
        Whether both halves of a body of revolution are drawn.
    units
        Names of the units, for labels.
    course
        The steps of an evolution.
    """

    title: str
    plane: bool
    table: Table
    held: Array
    surface: VTU
    pictures: Sequence[tuple[str, Picture]]
    axes: str = "xy"
    mirror: bool = False
    units: Units = UNNAMED
    course: Course | None = None
    opposite: VTU | None = None

    @property
    def mirrored(self) -> bool:
        """Whether there are two halves to draw."""
        return self.mirror and self.axes == "rz"

    def draw(
        self,
        folder: Path,
        formats: Sequence[str] = ("png",),
        width: float | None = None,
        contact: bool = True,
    ) -> list[Path]:
        """Draw the figures into a folder. On one rank.

        Parameters
        ----------
        folder
            Where to.
        formats
            Endings of the files: png, pdf or svg.
        width
            Of the figures (inches); by default that of a page.
        contact
            Whether to draw the contact part too.

        Returns
        -------
        The files, in the order in which they were drawn; one that fails is not left half done.
        """
        figures = self.figures(width, contact)
        with matplotlib.rc_context(style(width)):
            return [
                _save(figure, folder / f"figure-{name}.{ending}")
                for name, figure in figures.items()
                for ending in formats
            ]

    def figures(self, width: float | None = None, contact: bool = True) -> Gallery:
        """Return the figures by name. On one rank.

        Parameters
        ----------
        width, contact
            As `draw` takes them.
        """
        with matplotlib.rc_context(style(width)):
            figures: dict[str, Figure | None] = {}
            if contact:
                figures["contact"] = (
                    draw_line(
                        self.table, self.title, self.held, self.axes, self.units, self.opposite
                    )
                    if self.plane
                    else draw_surface(self.surface, self.title, self.units, self.opposite)
                )
            if contact and self.course is not None:
                figures |= self.course.draw(self.plane, self.title, self.axes, self.units)
            for name, made in self.pictures:
                figures[name] = (
                    draw_plane(made, self.table, self.title, self.axes, self.mirrored, self.units)
                    if self.plane
                    else draw_space(made, self.title)
                )
        return Gallery({name: figure for name, figure in figures.items() if figure is not None})


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


def style(width: float | None) -> dict[str, Any]:
    """Return the settings of figures of a width (inches); None for that of a page."""
    return STYLE | ({} if width is None else sized(width))


def sized(width: float) -> dict[str, Any]:
    """Return the settings of figures of another width (inches): narrow ones have small letters."""
    small = {"font.size": 7, "legend.fontsize": 6} if width < NARROW else {}
    return {"figure.figsize": (width, width)} | small


def collect(solution: Solved, fields: Sequence[str] = ()) -> Drawing | None:
    """Gather on rank 0 what the figures of a solution show; None elsewhere. Collective.

    In the plane the contact figure shows the stresses along Gamma_3 with the friction bound
    and the zones of stick and slip, as Figure 7.4 of the thesis does, and the deformed body is
    coloured by the von Mises stress, as in Figure 7.5. In space the contact nodes are seen
    along the mean contact direction, and the deformed surface from the side.

    Parameters
    ----------
    solution
        The solution.
    fields
        Fields to colour the body by; by default the von Mises stress and the potential.
    """
    table, held = contact_table(solution), held_points(solution.problem)
    surface, opposite = contact_surface(solution, table), opposite_surface(solution)
    pictures: list[tuple[str, Picture]] = []
    usual = [f for _, f, *_ in DEFORMED if f != "potential" or solution.problem.piezoelectric]
    for field in fields or usual:
        name, label = named(field, solution.units)
        made = picture(solution, field, label)
        if made is not None:
            pictures.append((name, made))
    if table is None or surface is None:
        return None
    course = None
    if solution.steps:
        tables = [record.table for record in solution.steps if record.table is not None]
        course = Course([record.row for record in solution.steps], tables)
    return Drawing(
        title=heading(solution.title),
        plane=solution.problem.dim == 2,
        table=table,
        held=held,
        surface=surface,
        pictures=pictures,
        axes=axes_of(solution.problem.domain.revolved),
        mirror=solution.output.mirror,
        units=solution.units,
        course=course,
        opposite=opposite,
    )


def named(field: str, units: Units) -> tuple[str, str]:
    """Return the name of the figure of a field, and the label of its colours."""
    for name, known, words, quantity in DEFORMED:
        if known == field:
            return name, units.label(words, quantity)
    words, base = field.replace("_", " "), field.partition("_")[0]
    if base in KINDS:
        return field, units.label(words, KINDS[base])
    return field, words if field == "dev_strain" else f"{words} (units of the case)"


def axes_of(revolved: bool) -> str:
    """Return the names of the coordinates of a plane mesh, or of the half plane of a body."""
    return "rz" if revolved else "xy"


def heading(title: str) -> str:
    """Return the title of a case as one line that fits on a figure, to be shown as it is."""
    line = " ".join(title.split())
    if len(line) > WIDTH:
        line = line[: WIDTH - 1] + "…"
    return line.replace("$", r"\$")


def _save(figure: Figure, path: Path) -> Path:
    """Save a figure made without pyplot."""
    try:
        figure.savefig(path)
    except BaseException:
        path.unlink(missing_ok=True)
        raise
    return path
