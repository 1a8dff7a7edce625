"""Figures of a solution, as PNG files: contact, deformed body, potential."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.figure import Figure

from contact.output.figures.body import Picture, draw_plane, picture
from contact.output.figures.contact import draw_line, draw_surface
from contact.output.figures.space import draw_space
from contact.output.solution import Solution
from contact.output.table import contact_table, held_points

#: Quantities drawn on the deformed body: name of the figure, field, label.
DEFORMED = (
    ("deformed", "von_mises", "von Mises stress (units of the case)"),
    ("potential", "potential", r"potential $\varphi$ (units of the case)"),
)

#: Settings of all figures.
STYLE: dict[str, Any] = {
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


def write_figures(solution: Solution, folder: str | Path) -> list[Path]:
    """Draw the figures of a solution into a folder. Collective; rank 0 draws.

    In the plane the contact figure shows the stresses along Gamma_3 with the friction bound
    and the zones of stick and slip, as Figure 7.4 of the thesis does, and the deformed body is
    coloured by the von Mises stress, as in Figure 7.5. In space the contact nodes are seen
    along the mean contact direction, and the deformed surface from the side.

    Parameters
    ----------
    solution
        The solution.
    folder
        Where to; it is made if need be.

    Returns
    -------
    The files, in the order in which they were drawn; none on ranks other than 0.
    """
    folder, comm = Path(folder), solution.problem.comm
    table, held = contact_table(solution), held_points(solution.problem)
    pictures: list[tuple[str, Picture]] = []
    for name, field, label in DEFORMED:
        if field != "potential" or solution.problem.piezoelectric:
            made = picture(solution, field, label)
            if made is not None:
                pictures.append((name, made))
    if comm.rank > 0 or table is None:
        return []
    folder.mkdir(parents=True, exist_ok=True)
    plane, title = solution.problem.dim == 2, solution.title
    with matplotlib.rc_context(STYLE):
        figures: dict[str, Figure | None] = {
            "contact": draw_line(table, title, held) if plane else draw_surface(table, title)
        }
        for name, made in pictures:
            drawn = draw_plane(made, table, title) if plane else draw_space(made, title)
            figures[name] = drawn
        return [
            _save(figure, folder / f"figure-{name}.png")
            for name, figure in figures.items()
            if figure is not None
        ]


def _save(figure: Figure, path: Path) -> Path:
    """Save a figure made without pyplot, under another name first."""
    partial = path.with_name(f".part-{path.name}")
    figure.savefig(partial)
    os.replace(partial, path)
    return path
