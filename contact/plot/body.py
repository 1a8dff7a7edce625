"""Pictures of deformed bodies, coloured by a field."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import matplotlib
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.tri import Triangulation

from contact import _compat
from contact.errors import InputError
from contact.mesh.cells import LINEAR
from contact.plot.foundation import HATCHED, foundation, magnification, profiles
from contact.plot.run import Run
from contact.plot.space import Scene, Zone, show_body
from contact.plot.style import (
    NARROW,
    PAGE,
    Look,
    colour_bar,
    colour_range,
    fitted,
    name_and_label,
    page_width,
    sheet,
    smooth,
)
from contact.typing import Array

#: The field whose values are regions.
REGION = "region"
#: Contact zones below this part of the body are drawn with their vicinity, of so many zones.
SMALL, VICINITY = 0.04, 3.0


def vicinity(run: Run) -> Array | None:
    """Return the corners of a small contact zone's vicinity, shape (2, d); else None."""
    zone = run.points[run.table["status"] != "open"]
    width = float(np.ptp(zone, axis=0).max()) if len(zone) else 0.0
    if not 0 < width < SMALL * run.diameter:
        return None
    return np.array([zone.min(axis=0) - VICINITY * width, zone.max(axis=0) + VICINITY * width])


def scalar(run: Run, field: str) -> tuple[Array, bool]:
    """Return a scalar field, component or norm, and whether it is cell by cell, as at degree 1."""
    at_points, in_cells = run.body.point_data, run.body.cell_data
    if field in in_cells:
        return np.asarray(in_cells[field]), True
    name, _, component = field.rpartition("_")
    linear = run.body.celltypes[0] in LINEAR
    for whole, part in ((field, ""), (name, component)):
        of_cells = linear and f"{whole}_cell" in in_cells
        fields, key = (in_cells, f"{whole}_cell") if of_cells else (at_points, whole)
        if key not in fields or not set(part) <= set("xyz"):
            continue
        values = np.asarray(fields[key])
        if not part:
            return (np.linalg.norm(values, axis=1) if values.ndim > 1 else values), of_cells
        if values.ndim > 1 and len(part) == (2 if values.shape[1] == 9 else 1):
            return values[:, int("".join(str("xyz".index(i)) for i in part), 3)], of_cells
    endings = {1: "", 3: "[_x, ...]", 9: "[_xx, ...]"}
    accepted = [f"{name}{endings[np.size(v) // len(v)]}" for name, v in at_points.items()]
    raise InputError(
        f"--field {field}: no such field; accepted: {', '.join(sorted(accepted))}", "figure-option"
    )


@dataclass(frozen=True)
class Picture:
    """The deformed body of a run, coloured by a field."""

    run: Run
    body: Any  #: the deformed body with its ``values``, a grid of pyvista
    skin: Any  #: its surface, likewise
    norm: Normalize  #: range of the colours
    label: str  #: of the colours
    scale: float  #: factor of the displacements
    box: Array  #: corners of the part that is shown, shape (2, d)
    look: Look = PAGE
    near: Array | None = None  #: corners of a small contact zone's vicinity, if that is shown
    classes: Sequence[str] = ()  #: names of the values 0, 1, ..., where these are no quantity

    @property
    def title(self) -> str:
        """The title of the run, with the factor of the displacements."""
        times = f"displacements\u00a0$\\times$\u00a0{self.scale:g}"
        times = times if self.scale != 1 else "displacements to scale".replace(" ", "\u00a0")
        return fitted(f"{self.run.title} ({times})" if self.run.title else times)

    @property
    def scene(self) -> Scene:
        """The body in 3-D."""
        ends = [self.norm.vmin, self.norm.vmax]
        colours = {"scalars": "values", "cmap": self.colours, "clim": ends}
        zone = Zone.of(self.run, self.run.table["entry"])
        return Scene(self.body, zone, foundation(self.run, self.scale), colours)

    @property
    def colours(self) -> Any:
        """The colours by name, or one for each class."""
        continuous = matplotlib.colormaps["viridis"]
        return continuous.resampled(len(self.classes)) if self.classes else continuous


def picture(run: Run, field: str, scale: float | None = None, look: Look = PAGE) -> Picture:
    """Return a picture of the body; without a scale that of a small contact zone's vicinity."""
    values, in_cells = scalar(run, field)
    near = None
    if scale is None:
        near = vicinity(run) if run.plane else None
        scale = magnification(run, box=near)
    body = run.body.warp_by_vector("displacement", factor=scale)
    (body.cell_data if in_cells else body.point_data)["values"] = values
    skin = _compat.surface(body)  # triangles; at degree 2 four of each
    box = np.array([skin.points.min(axis=0), skin.points.max(axis=0)])[:, : len(run.axes)]
    if near is not None:
        box = np.clip(near, *box)
        places = (skin.cell_centers() if in_cells else skin).points[:, :2]
        seen = np.asarray(skin["values"])[np.all((places >= box[0]) & (places <= box[1]), axis=1)]
        values = seen if seen.size else values
    label = name_and_label(field, run.units)[1]
    if field != REGION:
        return Picture(run, body, skin, *colour_range(values, label), scale, box, look, near)
    found = np.unique(values)
    for mesh in (body, skin):
        mesh["values"] = np.searchsorted(found, mesh["values"])
    names = [run.regions[k] for k in found]
    classes = Normalize(-0.5, len(names) - 0.5)
    return Picture(run, body, skin, classes, label, scale, box, look, near, names)


def body_figure(picture: Picture) -> Figure:
    """Draw a deformed body."""
    return draw_plane(picture) if picture.run.plane else draw_space(picture)


def draw_plane(picture: Picture) -> Figure:
    """Draw a plane body over its outline in the reference configuration, and the foundation."""
    run, box, head = picture.run, np.array(picture.box), picture.title
    width, height = box[1] - box[0]
    tall = float(np.clip(0.92 * height / width, 0.19, 0.87))
    more = 0.02 * float(matplotlib.rcParams["font.size"]) * head.count("\n")
    figure = sheet(tall + (1.4 + more) / page_width())
    figure.set_layout_engine("compressed")  # made for axes of equal scale
    ax = figure.subplots()
    skin = _compat.surface(run.body)
    edges = skin.extract_feature_edges(
        feature_edges=False, manifold_edges=False, non_manifold_edges=False
    )
    outline = edges.points[edges.lines.reshape(-1, 3)[:, 1:], :2]
    places = np.asarray(picture.skin.points)[:, :2]
    flat = picture.skin.triangulate()
    mesh, values = Triangulation(*flat.points[:, :2].T, flat.regular_faces), flat["values"]
    if "values" in flat.cell_data:
        shades = {"norm": picture.norm, "cmap": picture.colours}
        ax.tripcolor(mesh, facecolors=values, rasterized=True, **shades)
    else:
        smooth(ax, mesh, values, picture.norm, picture.colours)
    # Dashes would be those of an edge each: none where edges are short.
    ax.add_collection(LineCollection(list(outline), colors="black", lw=0.5))
    found = profiles(run, picture.scale, places, picture.near)
    for profile in found:
        profile.draw(ax, HATCHED * float(np.ptp(box, axis=0).max()))
    _bar(figure, picture)
    ax.set_aspect("equal")
    if picture.near is None:
        every = np.concatenate([box, outline.reshape(-1, 2)])
        box = np.array([every.min(axis=0), every.max(axis=0)])
    box = reduce(lambda part, profile: profile.reach(part), found, box)
    if picture.near is None:
        box += 0.02 * np.ptp(box, axis=0) * [[-1], [1]]
    ax.set(xlim=tuple(box[:, 0]), ylim=tuple(box[:, 1]))
    ax.set_xlabel(run.units.label(f"${run.axes[0]}$", "length"))
    ax.set_ylabel(run.units.label(f"${run.axes[1]}$", "length"))
    ax.set_title(head, fontsize="medium")
    return figure


def _bar(figure: Figure, picture: Picture) -> None:
    """Add the bar of the colours, of classes a legend."""
    if picture.classes:
        rgba = picture.colours(range(len(picture.classes)))
        handles = [Patch(color=c, label=k) for c, k in zip(rgba, picture.classes, strict=True)]
        columns = 2 if page_width() < NARROW else 4
        figure.legend(
            handles=handles, title=picture.label, ncols=columns, loc="outside lower center"
        )
        return
    colour_bar(figure, figure.axes, picture.norm, picture.colours, picture.label)


def draw_space(picture: Picture) -> Figure:
    """Draw a body in 3-D from where its contact is seen."""
    run, look = picture.run, picture.look
    figure = sheet(0.9 if page_width() < NARROW else 0.75)
    figure.set_layout_engine("compressed")
    ax = figure.subplots()
    _, words = show_body(ax, run, picture.scene, look.view)
    _bar(figure, picture)
    ax.set_title("\n".join([picture.title, words]).strip(), fontsize="medium")
    return figure
