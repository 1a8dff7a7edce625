"""The set-up of a case: parts of the boundary with their data, foundations, dimensions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from contact.output.figures.body import rendered
from contact.output.figures.style import BLUE, GREEN, ORANGE, SKY
from contact.output.options import Units
from contact.typing import Array

#: Colours of supports, electrodes, loads, contact parts and foundations.
HELD, ELECTRODE, LOADED, TOUCHED, FOUNDATION = "#000000", GREEN, ORANGE, BLUE, SKY

#: Cells up to which the mesh is drawn.
MOST_CELLS = 20_000

#: Arrows of a load on one part, and strokes along a support.
ARROWS, STROKES = 12, 30


@dataclass(frozen=True)
class Role:
    """A part of the boundary and its data.

    Attributes
    ----------
    facets
        Its facets by their corners, shape (n, d, d).
    colour, words
        How it is drawn, and its entry in the legend.
    hatched
        Whether it is held.
    force
        Given force on each facet, shape (n, d); None for none.
    """

    facets: Array
    colour: str
    words: str
    hatched: bool = False
    force: Array | None = None


def draw_plane(
    boundary: Array, cells: Array, roles: Sequence[Role], surface: Array, units: Units, axes: str
) -> Figure:
    """Draw a plane body: mesh, data of its parts, foundation and dimensions.

    Parameters
    ----------
    boundary, cells
        Corners of the edges on the boundary and of the cells, shapes (m, 2, 2) and (n, 3, 2).
    roles
        The parts with their data.
    surface
        Points of rigid foundations, shape (m, 2).
    units, axes
        Names of the units and of the coordinates.
    """
    low, high = boundary.min(axis=(0, 1)), boundary.max(axis=(0, 1))
    extent = high - low
    diameter = float(extent.max())
    figure = Figure(figsize=(6.9, float(np.clip(6.0 * extent[1] / extent[0], 1.6, 6.0)) + 1.6))
    ax = figure.subplots()
    ax.add_collection(LineCollection(list(boundary), colors="0.4", lw=0.6))
    if len(cells) <= MOST_CELLS:
        corners = np.arange(3 * len(cells)).reshape(-1, 3)
        thin = {"color": "0.75", "lw": 0.3, "rasterized": len(cells) > 2000}
        ax.triplot(*cells.reshape(-1, 2).T, corners, **thin)
    middle = cells.reshape(-1, 2).mean(axis=0)
    for role in roles:
        wide = 3.0 if role.colour in (TOUCHED, ELECTRODE) else 1.5
        lines = LineCollection(list(role.facets), colors=role.colour, lw=wide, label=role.words)
        lines.set_alpha(0.6 if role.colour == ELECTRODE else 1.0)
        ax.add_collection(lines)
        if role.hatched:
            _hatch(ax, role, middle, 0.02 * diameter)
        if role.force is not None:
            _arrows(ax, role, middle, 0.12 * diameter)
    if surface.size:
        order = np.lexsort(surface.T[::-1])
        ax.plot(*surface[order].T, ".", ms=2, color=FOUNDATION, label="foundation")
    _dimensions(ax, low, high, units)
    ax.set_aspect("equal")
    ax.margins(0.03)
    ax.autoscale_view()
    ax.set_xlabel(units.label(f"${axes[0]}$", "length"))
    ax.set_ylabel(units.label(f"${axes[1]}$", "length"))
    figure.legend(loc="outside lower center", ncols=2, fontsize=7)
    return figure


def _outwards(facets: Array, middle: Array) -> Array:
    """Return unit normals of edges that point away from the middle of the body, shape (n, 2)."""
    along = facets[:, 1] - facets[:, 0]
    out = np.column_stack([along[:, 1], -along[:, 0]])
    out /= np.linalg.norm(out, axis=1)[:, None]
    side = np.einsum("ni,ni->n", out, facets.mean(axis=1) - middle)
    return np.asarray(out * np.sign(side)[:, None])


def _hatch(ax: Axes, role: Role, middle: Array, length: float) -> None:
    """Draw short strokes outwards from a support."""
    facets = role.facets[_spread(role.facets, STROKES)]
    out, centre = _outwards(facets, middle), facets.mean(axis=1)
    skew = out + 0.6 * np.column_stack([-out[:, 1], out[:, 0]])
    ax.add_collection(
        LineCollection(
            list(np.stack([centre, centre + length * skew], axis=1)), colors=HELD, lw=0.6
        )
    )


def _arrows(ax: Axes, role: Role, middle: Array, reach: float) -> None:
    """Draw a load's arrows outside the body, the longest of a given length."""
    assert role.force is not None
    centre = role.facets.mean(axis=1)
    chosen = _spread(role.facets, ARROWS)
    force = role.force[chosen]
    largest = float(np.linalg.norm(role.force, axis=1).max(initial=0.0))
    if largest == 0:
        return
    step = reach * force / largest
    seen = np.linalg.norm(step, axis=1) > 0.02 * reach
    pulls = np.einsum("ni,ni->n", step, _outwards(role.facets[chosen], middle)) > 0
    start = centre[chosen] - np.where(pulls[:, None], 0.0, step)
    arrows = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.0025}
    ax.quiver(*start[seen].T, *step[seen].T, color=LOADED, **arrows)
    for ends in (start, start + step):  # for the limits of the axes
        ax.plot(*ends[seen].T, ls="", marker="")


def _spread(facets: Array, count: int) -> NDArray[np.intp]:
    """Return about so many edges of a part, each in turn the farthest from those before."""
    centre = facets.mean(axis=1)
    apart = np.linalg.norm(facets[:, 1] - facets[:, 0], axis=1).sum() / count
    chosen, distance = [np.lexsort(centre.T)[0]], np.full(len(centre), np.inf)
    while True:
        last = np.linalg.norm(centre - centre[chosen[-1]], axis=1)
        distance = np.minimum(distance, last)
        if distance.max() < (1 - 1e-9) * apart:
            return np.asarray(chosen, dtype=np.intp)
        chosen.append(np.argmax(distance))


def _dimensions(ax: Axes, low: Array, high: Array, units: Units) -> None:
    """Write width and height along the box of the body."""
    unit = f" {units.length}" if units.length else ""
    size = float((high - low).max())
    for axis in range(2):
        other = 1 - axis
        ends = np.array([low, low])
        ends[1, axis] = high[axis]
        ends[:, other] = low[other] - 0.09 * size if axis == 0 else high[other] + 0.05 * size
        ax.annotate("", ends[1], ends[0], arrowprops={"arrowstyle": "<->", "lw": 0.6})
        ax.plot(*ends.T, ls="", marker="")
        text = f"{high[axis] - low[axis]:g}{unit}"
        place = {"ha": "center", "va": "center", "rotation": 90.0 * axis, "fontsize": 8}
        box = {"facecolor": "white", "edgecolor": "none", "pad": 1.0}
        ax.text(*ends.mean(axis=0), text, bbox=box, **place)  # type: ignore[arg-type]


def draw_space(
    boundary: Array, cells: Array, roles: Sequence[Role], surface: Array, units: Units, axes: str
) -> Figure:
    """Draw a body in 3-D by the facets of its boundary, shape (m, 3, 3); see `draw_plane`."""
    corners = [boundary.reshape(-1, 3), surface.reshape(-1, 3)]
    reach = 0.2 * float(np.ptp(corners[0], axis=0).max())
    arrows = []
    for role in roles:
        if role.force is not None and np.any(role.force):
            step = reach * role.force / np.linalg.norm(role.force, axis=1).max()
            chosen = np.linspace(0, len(step) - 1, min(ARROWS, len(step))).astype(int)
            arrows.append(((role.facets.mean(axis=1) - step)[chosen], step[chosen]))
            corners.append(arrows[-1][0])

    def add(plotter: Any) -> None:
        import pyvista

        def facets(given: Array) -> Any:
            corners = np.arange(3 * len(given)).reshape(-1, 3)
            return pyvista.PolyData.from_regular_faces(given.reshape(-1, 3), corners)

        edges = {"show_edges": len(boundary) <= MOST_CELLS, "edge_opacity": 0.4, "line_width": 0.5}
        plotter.add_mesh(facets(boundary), color="#EEEEEE", opacity=0.3, **edges)
        for role in roles:
            if not role.hatched:
                lit = {"opacity": 0.7, "ambient": 0.6, "diffuse": 0.4}
                plotter.add_mesh(facets(role.facets), color=role.colour, **lit)
        for start, step in arrows:
            plotter.add_arrows(start, step, color=LOADED)
        if surface.size:
            plotter.add_points(surface, color=FOUNDATION, point_size=5.0)

    seen = np.concatenate(corners)
    image = rendered(add, (1.0, -1.6, 0.5), np.array([seen.min(axis=0), seen.max(axis=0)]))
    figure = Figure(figsize=(6.9, 6.0))
    ax = figure.subplots()
    ax.axis("off")
    if image is not None:
        ax.imshow(image)
    sides = r" $\times$ ".join(f"{side:.4g}" for side in np.ptp(corners[0], axis=0))
    ax.set_title(f"{sides}{f' {units.length}' if units.length else ''}", y=-0.02, fontsize=8)
    for role in roles:
        face = "none" if role.hatched else role.colour
        ax.plot([], [], "s", color="0.6", markerfacecolor=face, label=role.words)
    if surface.size:
        ax.plot([], [], "o", ms=3, color=FOUNDATION, label="foundation")
    figure.legend(loc="outside lower center", ncols=2, fontsize=7)
    return figure
