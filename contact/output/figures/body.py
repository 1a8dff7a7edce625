"""The deformed body, coloured: what is drawn of it, and the drawing of plane bodies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from contact.errors import InputError
from contact.output.field_files import body_share
from contact.output.figures.contact import BLUE, UNNAMED, ends
from contact.output.figures.pixels import pixels
from contact.output.solved import Solved
from contact.output.table import Table, by_contact, held_points
from contact.output.units import Units
from contact.output.vtu import VTU, Grid, gathered
from contact.typing import Array

Indices: TypeAlias = NDArray[np.integer[Any]]

#: Quantiles of the values at which colours end where some values lie far beyond.
OUTLIERS = (0.005, 0.995)

#: Plane meshes with more cells are drawn as pixels.
MOST_CELLS = 150_000


@dataclass(frozen=True)
class Picture:
    """What is drawn of a deformed body.

    Attributes
    ----------
    corners
        Corners of triangles in their places at rest, shape (n, 3, d).
    displacement
        Displacement of the corners, shape (n, 3, d).
    values
        Values to colour by, one a triangle or one a corner, shape (n,) or (n, 3).
    outline
        Edges of a plane body at rest, shape (m, 2, 2).
    image
        Instead of triangles, for a large plane mesh: means in pixels, NaN outside the body.
    box
        Lower and upper corner of the deformed body as drawn, shape (2, d).
    scale
        By which the displacement is multiplied in the drawing.
    label
        Of the colours.
    held
        Nodes of Gamma_3 that are no contact nodes, shape (n, d).
    """

    corners: Array
    displacement: Array
    values: Array
    outline: Array
    image: Array | None
    box: Array
    scale: float
    label: str
    held: Array


def magnification(size: float, largest: float) -> float:
    """Return 1, 2 or 5 times a power of ten that makes displacements about 5 % of the body.

    Displacements that are visible anyway are drawn as they are.
    """
    if not 0 < largest < 0.02 * size:
        return 1.0
    wanted = 0.05 * size / largest
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * max(k for k in (1, 2, 5) if k * power <= wanted))


def picture(solution: Solved, field: str, label: str) -> Picture | None:
    """Collect what is drawn on rank 0; None elsewhere. Collective.

    Parameters
    ----------
    solution
        The solution.
    field
        Name of a field, as `scalar` takes it.
    label
        Of the colours.
    """
    problem = solution.problem
    names = ("displacement", field, field.rpartition("_")[0])
    share = body_share(problem, solution.state, names)
    body, held = gathered(problem.comm, share), held_points(problem)
    return None if body is None else drawn(body, held, field, label)


def drawn(body: VTU, held: Array, field: str, label: str) -> Picture:
    """Make a picture of a body coloured by a field. On one rank.

    Parameters
    ----------
    body
        The body with its fields.
    held
        Nodes of Gamma_3 that are no contact nodes, shape (n, d).
    field
        Name of a field, as `scalar` takes it.
    label
        Of the colours.
    """
    grid, d = body.grid, body.grid.dimension
    u = np.asarray(body.at_points["displacement"])[:, :d]
    points = grid.points[:, :d]
    cells, nodes = _triangles(grid)
    corners, moved = points[nodes], u[nodes]
    values, in_cells = scalar(body, field)
    colours = values[cells] if in_cells else values[nodes]
    used = np.unique(grid.corners)
    size = float(np.ptp(points[used], axis=0).max())
    scale = magnification(size, float(np.linalg.norm(u[used], axis=1).max()))
    places = points[used] + scale * u[used]
    box = np.array([places.min(axis=0), places.max(axis=0)])
    outline = points[_boundary(grid.corners)] if d == 2 else np.empty((0, 2, 3))
    if d == 2 and len(cells) > MOST_CELLS:
        image = pixels(corners + scale * moved, colours, box)
        empty = np.empty((0, 3, d))
        return Picture(empty, empty, np.empty(0), outline, image, box, scale, label, held)
    return Picture(corners, moved, colours, outline, None, box, scale, label, held)


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
    for whole, part in ((field, ""), (name, component)):
        linear = body.grid.cells.shape[1] == body.grid.dimension + 1
        in_cells = linear and f"{whole}_cell" in body.in_cells
        fields, key = (body.in_cells, f"{whole}_cell") if in_cells else (body.at_points, whole)
        if key not in fields or not set(part) <= set("xyz"):
            continue
        values = np.asarray(fields[key])
        if not part and values.ndim > 1:
            return np.asarray(np.linalg.norm(values, axis=1)), in_cells
        if not part:
            return values, in_cells
        if values.ndim > 1 and len(part) == (2 if values.shape[1] == 9 else 1):
            return values[:, int("".join(str("xyz".index(i)) for i in part), 3)], in_cells
    accepted = [name if np.ndim(v) == 1 else f"{name}[_x..]" for name, v in body.at_points.items()]
    raise InputError(f"--field {field}: no such field; accepted: {', '.join(sorted(accepted))}")


def _triangles(grid: Grid) -> tuple[Indices, Indices]:
    """Return cells and three nodes of each: the cells in the plane, the surface in space."""
    if grid.dimension == 2:
        return np.arange(len(grid.cells)), grid.corners
    faces = _faces(grid.corners)
    chosen = _single(faces)
    return chosen % len(grid.cells), faces[chosen]


def _faces(corners: Indices) -> Indices:
    """Return the faces of simplices by their corners, the first of all, then the second..."""
    size = corners.shape[1]
    return np.concatenate([np.delete(corners, k, axis=1) for k in range(size)])


def _single(faces: Indices) -> Indices:
    """Return the places of the faces that occur once."""
    _, first, count = np.unique(
        np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True
    )
    return np.sort(first[count == 1])


def _boundary(corners: Indices) -> Indices:
    """Return the edges on the boundary of triangles, by their ends."""
    edges = _faces(corners)
    return edges[_single(edges)]


def draw_plane(
    picture: Picture,
    table: Table,
    title: str = "",
    axes: str = "xy",
    mirrored: bool = False,
    units: Units = UNNAMED,
) -> Figure:
    """Draw a plane body over its outline at rest and the foundation.

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
    inches = float(matplotlib.rcParams["figure.figsize"][0])
    tall = float(np.clip(0.92 * height / width, 0.19, 0.87))
    figure = Figure(figsize=(inches, tall * inches + 1.4))
    ax = figure.subplots()
    rest = {"colors": "black", "lw": 0.5, "ls": (0, (6, 4))}
    for side in (-1, 1) if mirrored else (1,):
        shown = _body(ax, picture, side)
        shown.set_cmap("viridis")
        label = _ranged(shown, picture)
        ax.add_collection(LineCollection(list(picture.outline * [side, 1]), **rest))
        for part in by_contact(table):
            if np.all(part.get("rigid", True)):
                _foundation(ax, part, picture.scale, ends(part, picture.held), side)
    figure.colorbar(shown, ax=ax, location="bottom", label=label, aspect=40, shrink=0.8)
    ax.set_aspect("equal")
    ax.use_sticky_edges = False
    ax.margins(0.02)
    ax.autoscale_view()
    ax.set_xlabel(units.label(f"${axes[0]}$", "length"))
    ax.set_ylabel(units.label(f"${axes[1]}$", "length"))
    ax.set_title(with_scale(title, picture.scale), fontsize="medium")
    return figure


def _ranged(shown: Any, picture: Picture) -> str:
    """Keep singular corners from spending all the colours; return the label, which says so."""
    values = picture.values if picture.image is None else picture.image[np.isfinite(picture.image)]
    low, high = (float(end) for end in np.quantile(values, OUTLIERS))
    ends = float(values.min()), float(values.max())
    range_, peaks = list(ends), []
    if ends[1] - high > 0.2 * (high - low) > 0:
        range_[1] = high
        peaks.append(f"peak {ends[1]:.3g}")
    if low - ends[0] > 0.2 * (high - low) > 0:
        range_[0] = low
        peaks.insert(0, f"least {ends[0]:.3g}")
    shown.set_clim(*range_)
    return ", ".join([picture.label, *peaks])


def _body(ax: Axes, picture: Picture, side: int) -> Any:
    """Draw the coloured body, or its mirror image where the side is -1."""
    if picture.image is not None:
        (left, low), (right, top) = picture.box
        extent = (side * left, side * right, low, top)
        return ax.imshow(picture.image, extent=extent, origin="lower")
    drawn = (picture.corners + picture.scale * picture.displacement) * [side, 1]
    if picture.values.ndim == 1:
        shown = ax.add_collection(
            PolyCollection(list(drawn), array=picture.values, lw=0, rasterized=True)
        )
        # Smoothed edges of neighbours would let the background shine through.
        shown.set_antialiased(False)
        return shown
    points = drawn.reshape(-1, 2)
    triangles = np.arange(len(points)).reshape(-1, 3)
    return ax.tripcolor(
        *points.T, triangles, picture.values.ravel(), shading="gouraud", rasterized=True
    )


def _foundation(ax: Axes, table: Table, scale: float, edges: Array, side: int) -> None:
    """Draw the foundation as far as it faces Gamma_3, moved as the displacements are scaled."""
    points = np.column_stack([table["x"], table["y"]])
    normal, gap = np.column_stack([table["nu_x"], table["nu_y"]]), table["gap"] + table["moved"]
    points = np.concatenate([edges[:1], points, edges[1:]])
    normal = np.concatenate([normal[:1], normal, normal[-1:]])
    gap = np.concatenate([gap[:1], gap, gap[-1:]])
    points, normal = points * [side, 1], normal * [side, 1]
    surface = points + scale * gap[:, None] * normal
    ax.plot(*surface.T, color="black", lw=0.5)
    thick = 0.03 * np.ptp(points, axis=0).max()
    band = np.concatenate([surface, (surface + thick * normal)[::-1]])
    ax.fill(*band.T, facecolor="none", edgecolor=BLUE, hatch="////", lw=0)


def with_scale(title: str, scale: float) -> str:
    """Return a title that says by what displacements are multiplied."""
    times = rf"displacements $\times$ {scale:g}" if scale != 1 else "displacements to scale"
    return f"{title} ({times})" if title else times
