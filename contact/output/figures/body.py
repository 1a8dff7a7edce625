"""Pictures of deformed bodies, coloured by a field: in 2-D by matplotlib, in 3-D by pyvista."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from contact.errors import InputError
from contact.output.field_files import body_share
from contact.output.figures.contact import ends, triangles
from contact.output.figures.style import (
    BLUE,
    NARROW,
    UNNAMED,
    colour_range,
    fitted,
    page_width,
    sheet,
)
from contact.output.options import Units
from contact.output.solved import Solved
from contact.output.table import Table, by_contact, held_points
from contact.output.vtu import KINDS, ORDER, VTU, gathered
from contact.typing import Array

logger = logging.getLogger("contact.plots")

#: Contact zones below this part of the body are drawn with their vicinity, of so many zones.
SMALL, VICINITY = 0.04, 3.0
#: Scaled gaps up to this part of Gamma_3 are drawn.
FAR = 0.2


@dataclass(frozen=True)
class Picture:
    """A deformed body, coloured by a field.

    Attributes
    ----------
    body
        The body in the reference configuration with its fields, shape (n, d) of the nodes.
    values
        Values to colour by, one a node or one a cell.
    in_cells
        Whether they are those of the cells.
    label
        Of the colours.
    held
        Nodes of Gamma_3 that are no contact nodes, shape (n, d).
    scale
        Factor of the displacements in the drawing.
    box
        Lower and upper corner of the part that is shown, shape (2, d).
    limits
        Values at which the colours end; None for those that suit this picture alone.
    """

    body: VTU
    values: Array
    in_cells: bool
    label: str
    held: Array
    scale: float
    box: Array
    limits: tuple[float, float] | None = None

    @property
    def points(self) -> Array:
        """Nodes in the reference configuration, shape (n, d)."""
        return self.body.grid.points[:, : self.body.grid.dimension]

    @property
    def places(self) -> Array:
        """Nodes as they are drawn, shape (n, d)."""
        return self.points + self.scale * displacement(self.body)

    def colours(self) -> tuple[Normalize, str]:
        """Return the range of the colours, and their label."""
        if self.limits is not None:
            return Normalize(*self.limits), self.label
        return colour_range(self.values, self.label)

    def titled(self, title: str) -> str:
        """Return a title with the factor of the displacements."""
        times = f"displacements $\\times$ {self.scale:g}"
        times = times if self.scale != 1 else "displacements to scale"
        return fitted(f"{title} ({times})" if title else times)


def displacement(body: VTU) -> Array:
    """Return the displacement of the nodes of a body, shape (n, d)."""
    return np.asarray(body.at_points["displacement"])[:, : body.grid.dimension]


def magnification(diameter: float, largest: float) -> float:
    """Return 1, 2 or 5 times a power of ten that makes displacements about 5 % of the body.

    Displacements that are visible anyway are drawn as they are.
    """
    if not 0 < largest < 0.02 * diameter:
        return 1.0
    wanted = 0.05 * diameter / largest
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * max(k for k in (1, 2, 5) if k * power <= wanted))


def picture(solution: Solved, field: str, label: str) -> Picture | None:
    """Make a picture of a solution on rank 0; None elsewhere. Collective.

    The field is one that `scalar` takes, and the label that of the colours.
    """
    problem = solution.problem
    names = ("displacement", field, field.rpartition("_")[0])
    share = body_share(problem, solution.state, names)
    if not share.at_points.keys() & names[1:] and field != "displacement":
        share = body_share(problem, solution.state)  # for the message, which lists all fields
    body, held = gathered(problem.comm, share), held_points(problem)
    return None if body is None else drawn(body, held, field, label)


def drawn(body: VTU, held: Array, field: str, label: str, scale: float | None = None) -> Picture:
    """Make a picture of a body coloured by a field that `scalar` takes. On one rank.

    The scale is by default that of `magnification`; the other arguments are those of `Picture`.
    """
    values, in_cells = scalar(body, field)
    u, points = displacement(body), body.grid.points[:, : body.grid.dimension]
    if scale is None:
        largest = float(np.linalg.norm(u, axis=1).max())
        scale = magnification(float(np.ptp(points, axis=0).max()), largest)
    places = points + scale * u
    box = np.array([places.min(axis=0), places.max(axis=0)])
    return Picture(body, values, in_cells, label, held, scale, box)


def near_contact(picture: Picture, table: Table) -> Picture:
    """Return a picture of the vicinity of a contact zone that is small, of the body otherwise."""
    points = np.column_stack([table[axis] for axis in "xyz" if axis in table])
    zone = points[table["status"] != "open"]
    width = float(np.ptp(zone, axis=0).max()) if len(zone) else 0.0
    if not 0 < width < SMALL * np.ptp(picture.box, axis=0).max():
        return picture
    largest = float(np.linalg.norm(displacement(picture.body), axis=1).max())
    near = replace(picture, scale=magnification(2 * VICINITY * width, largest))
    low, high = zone.min(axis=0) - VICINITY * width, zone.max(axis=0) + VICINITY * width
    whole = near.places.min(axis=0), near.places.max(axis=0)
    return replace(near, box=np.clip([low, high], *whole))


def scalar(body: VTU, field: str) -> tuple[Array, bool]:
    """Return a scalar field of a body, and whether its values are those of the cells.

    Derived fields are taken as they are in cells of degree 1, and averaged at the nodes of
    others. ``displacement``, ``stress``... are the lengths of these vectors and tensors, and
    ``displacement_y``, ``stress_xy``... their components.

    Raises
    ------
    InputError
        If the body has no such field.
    """
    name, _, component = field.rpartition("_")
    linear = body.grid.cells.shape[1] == body.grid.dimension + 1
    for whole, part in ((field, ""), (name, component)):
        in_cells = linear and f"{whole}_cell" in body.in_cells
        fields, key = (body.in_cells, f"{whole}_cell") if in_cells else (body.at_points, whole)
        if key not in fields or not set(part) <= set("xyz"):
            continue
        values = np.asarray(fields[key])
        if not part:
            return (np.linalg.norm(values, axis=1) if values.ndim > 1 else values), in_cells
        if values.ndim > 1 and len(part) == (2 if values.shape[1] == 9 else 1):
            return values[:, int("".join(str("xyz".index(i)) for i in part), 3)], in_cells
    endings = {1: "", 2: "[_x, ...]", 3: "[_x, ...]", 9: "[_xx, ...]"}
    accepted = [
        f"{name}{endings.get(np.size(v) // len(v), '')}" for name, v in body.at_points.items()
    ]
    raise InputError(f"--field {field}: no such field; accepted: {', '.join(sorted(accepted))}")


def boundary(points: Array, cells: Any) -> Array:
    """Return the edges of a plane mesh that belong to one triangle, shape (m, 2, 2)."""
    mesh = Triangulation(*points.T, cells)
    at, edge = np.nonzero(mesh.neighbors < 0)
    return np.asarray(points[np.stack([mesh.triangles[at, (edge + k) % 3] for k in (0, 1)], 1)])


def draw_plane(
    picture: Picture,
    table: Table,
    title: str = "",
    axes: str = "xy",
    mirrored: bool = False,
    units: Units = UNNAMED,
) -> Figure:
    """Draw a plane body over its outline in the reference configuration, and the foundation.

    Parameters
    ----------
    picture, table
        The body, and its contact nodes.
    title
        Of the figure.
    axes
        Names of the coordinates.
    mirrored
        Whether the other half of a body of revolution is drawn too.
    units
        Names of the units.
    """
    width, height = picture.box[1] - picture.box[0]
    if mirrored:
        width = 2 * picture.box[1, 0]
    tall = float(np.clip(0.92 * height / width, 0.19, 0.87))
    head = picture.titled(title)
    more = 0.02 * float(matplotlib.rcParams["font.size"]) * head.count("\n")
    figure = sheet(tall + (1.4 + more) / page_width())
    figure.set_layout_engine("compressed")  # made for axes of equal scale
    ax = figure.subplots()
    outline = boundary(picture.points, triangles(picture.body.grid.cells))
    norm, label = picture.colours()
    for side in (-1, 1) if mirrored else (1,):
        _body(ax, picture, side, norm)
        # Dashes would be those of an edge each: none where edges are short.
        ax.add_collection(LineCollection(list(outline * [side, 1]), colors="black", lw=0.5))
        for part in by_contact(table):
            if np.all(part.get("rigid", True)):
                _foundation(ax, part, picture.scale, ends(part, picture.held), side)
    colours = ScalarMappable(norm, "viridis")
    figure.colorbar(colours, ax=ax, location="bottom", label=label, aspect=40, shrink=0.8)
    ax.set_aspect("equal")
    ax.use_sticky_edges = False
    ax.margins(0.02)
    ax.autoscale_view()
    (left, low), (right, top) = picture.box
    if np.any(picture.box[1] - picture.box[0] < 0.99 * np.ptp(picture.places, axis=0)):
        ax.set(xlim=(-right if mirrored else left, right), ylim=(low, top))
    ax.set_xlabel(units.label(f"${axes[0]}$", "length"))
    ax.set_ylabel(units.label(f"${axes[1]}$", "length"))
    ax.set_title(head, fontsize="medium")
    return figure


def _body(ax: Axes, picture: Picture, side: int, norm: Normalize) -> None:
    """Draw the coloured body, or its mirror image where the side is -1."""
    mesh = Triangulation(*(picture.places * [side, 1]).T, triangles(picture.body.grid.cells))
    shown: dict[str, Any] = {"norm": norm, "cmap": "viridis", "rasterized": True}
    if picture.in_cells:
        ax.tripcolor(mesh, facecolors=picture.values, **shown)
    else:
        ax.tripcolor(mesh, picture.values, shading="gouraud", **shown)


def _foundation(ax: Axes, table: Table, scale: float, edges: Array, side: int) -> None:
    """Draw the foundation as far as it faces Gamma_3, moved as the displacements are scaled.

    Not where it is far: gaps to a curved shape, scaled like the displacements, are no shape.
    """
    points = np.column_stack([table["x"], table["y"]])
    normal, gap = np.column_stack([table["nu_x"], table["nu_y"]]), table["gap"] + table["moved"]
    points = np.concatenate([edges[:1], points, edges[1:]]) * [side, 1]
    normal = np.concatenate([normal[:1], normal, normal[-1:]]) * [side, 1]
    gap = np.concatenate([gap[:1], gap, gap[-1:]])
    surface = points + scale * gap[:, None] * normal
    extent = np.ptp(points, axis=0).max()
    near = np.flatnonzero((scale == 1) | (scale * gap <= max(FAR * extent, 2 * scale * gap.min())))
    for run in np.split(near, np.flatnonzero(np.diff(near) > 1) + 1):
        ax.plot(*surface[run].T, color="black", lw=0.5)
        band = np.concatenate([surface[run], (surface + 0.03 * extent * normal)[run[::-1]]])
        ax.fill(*band.T, facecolor="none", edgecolor=BLUE, hatch="////", lw=0)


def draw_space(picture: Picture, title: str = "") -> Figure | None:
    """Draw the surface of a body in 3-D, from above and from below; None without a display."""
    norm, label = picture.colours()
    grid, kind = picture.body.grid, (3, picture.body.grid.cells.shape[1])
    nodes = grid.cells[:, ORDER.get(kind, range(kind[1]))]

    def add(plotter: Any) -> None:
        import pyvista

        body = pyvista.UnstructuredGrid({KINDS[kind]: nodes}, picture.places)
        (body.cell_data if picture.in_cells else body.point_data)["values"] = picture.values
        surface = body.extract_surface(nonlinear_subdivision=1)
        edges = surface.n_cells < 5000
        plotter.add_mesh(
            surface, scalars="values", cmap="viridis", clim=[norm.vmin, norm.vmax],
            show_edges=edges, line_width=0.5, edge_opacity=0.3, ambient=0.6, diffuse=0.4,
            show_scalar_bar=False,
        )  # fmt: skip

    images = [rendered(add, (1.0, -1.6, height), picture.box) for height in (0.8, -0.8)]
    narrow = page_width() < NARROW
    figure = sheet(1.9 if narrow else 0.6)
    figure.set_layout_engine("compressed")
    axes = figure.subplots(*((2, 1) if narrow else (1, 2)))
    for ax, name, image in zip(axes, ("from above", "from below"), images, strict=True):
        if image is None:
            return None
        ax.imshow(image)
        ax.set_title(name, fontsize="medium")
        ax.axis("off")
    colours = ScalarMappable(norm, "viridis")
    figure.colorbar(colours, ax=axes, location="bottom", label=label, aspect=40, shrink=0.8)
    figure.suptitle(picture.titled(title), fontsize="large")
    return figure


def rendered(
    add: Callable[[Any], None], view: tuple[float, float, float], box: Array
) -> Array | None:
    """Return an image of a 3-D scene by pyvista, without a window; None without a display.

    Parameters
    ----------
    add
        Adds the meshes of the scene to a ``pyvista.Plotter``.
    view
        Direction from the scene to the eye.
    box
        Lower and upper corner of the scene, shape (2, 3).
    """
    import pyvista

    if not os.environ.get("DISPLAY") and pyvista.vtk_version_info < (9, 4):
        try:
            pyvista.start_xvfb()
        except OSError:
            logger.warning("the body is not drawn: VTK before 9.4 needs a display or Xvfb")
            return None
    plotter = pyvista.Plotter(off_screen=True, window_size=(1000, 1000))
    plotter.set_background("white")
    plotter.enable_parallel_projection()
    add(plotter)
    plotter.add_axes(viewport=(0.0, 0.0, 0.2, 0.2))
    plotter.view_vector(view)
    plotter.reset_camera(bounds=box.T.ravel())
    image = plotter.screenshot(return_img=True)
    plotter.close()
    return np.asarray(image)
