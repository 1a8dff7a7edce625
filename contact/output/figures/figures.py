"""Figures of a solution: contact, deformed body, potential, steps."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from contact.output.figures.body import Picture, draw_plane, draw_space, near_contact, picture
from contact.output.figures.contact import draw_line, draw_surface
from contact.output.figures.steps import Course
from contact.output.figures.style import DEFORMED, STYLE, UNNAMED, axes_of, heading, named, style
from contact.output.options import Units
from contact.output.solved import Solved
from contact.output.surface import contact_surface, opposite_surface
from contact.output.table import Table, contact_table, held_points
from contact.output.vtu import VTU
from contact.typing import Array


@dataclass(frozen=True)
class Drawing:
    """The data of all figures, from all ranks.

    Attributes
    ----------
    title
        Of all figures.
    plane
        Whether the body is plane.
    table, held
        The contact nodes, and the other nodes of Gamma_3.
    surface, opposite
        Gamma_3 with its fields, drawn in 3-D, and the other sides of contacts between bodies.
    pictures
        The figures of the deformed body by name.
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
            The folder.
        formats
            Endings of the files: png, pdf or svg.
        width
            Of the figures (inches); by default that of a page.
        contact
            Whether to draw the contact part and the steps too.

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
        """Return the figures by name, as `draw` takes their width and choice. On one rank."""
        figures: dict[str, Figure | None] = {}
        with matplotlib.rc_context(style(width)):
            if contact:
                figures["contact"] = self._contact()
            if contact and self.course is not None:
                figures |= self.course.draw(self.plane, self.title, self.axes, self.units)
            for name, made in self.pictures:
                figures[name] = self.body(near_contact(made, self.table), self.table, self.title)
        return Gallery({name: figure for name, figure in figures.items() if figure is not None})

    def _contact(self) -> Figure:
        if self.plane:
            return draw_line(
                self.table, self.title, self.held, self.axes, self.units, self.opposite
            )
        return draw_surface(self.surface, self.title, self.units, self.opposite)

    def body(self, made: Picture, table: Table, title: str) -> Figure | None:
        """Draw a deformed body with its contact nodes; None where pyvista has no display."""
        if self.plane:
            return draw_plane(made, table, title, self.axes, self.mirrored, self.units)
        return draw_space(made, title)


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


def collect(solution: Solved, fields: Sequence[str] = ()) -> Drawing | None:
    """Gather on rank 0 the data of the figures of a solution; None elsewhere. Collective.

    In 2-D the contact figure shows the stresses along Gamma_3 with the friction bound
    and the zones of stick and slip, as Figure 7.4 of the thesis does, and the deformed body is
    coloured by the von Mises stress, as in Figure 7.5. In 3-D the contact nodes are seen
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
    usual = [field for field in DEFORMED if field != "potential" or solution.problem.piezoelectric]
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


def _save(figure: Figure, path: Path) -> Path:
    """Save a figure made without pyplot."""
    try:
        figure.savefig(path)
    except BaseException:
        path.unlink(missing_ok=True)
        raise
    return path
