"""The drawing of a set-up: what is given on the parts of a body, and what it may touch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection  # type: ignore[import-untyped]
from numpy.typing import NDArray

from contact.output.units import Units
from contact.typing import Array

#: Okabe and Ito's palette, as in the other figures.
HELD, ELECTRODE, LOADED, TOUCHED, FOUNDATION = "#000000", "#009E73", "#D55E00", "#0072B2", "#56B4E9"

#: Cells up to which the mesh is drawn.
MOST_CELLS = 20_000

#: Arrows of a load on one part.
ARROWS = 12


@dataclass(frozen=True)
class Role:
    """A part of the boundary and what is given there.

    Attributes
    ----------
    facets
        Its facets by their corners, shape (n, d, d).
    colour, words
        How it is drawn, and what the legend says.
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
    cells: Array, roles: Sequence[Role], surface: Array, units: Units, axes: str
) -> Figure:
    """Draw a plane body: mesh, what is given on its parts, foundation and dimensions.

    Parameters
    ----------
    cells
        Corners of the cells, shape (n, 3, 2).
    roles
        What is given, and where.
    surface
        Points of rigid foundations, shape (m, 2).
    units, axes
        Names of the units and of the coordinates.
    """
    low, high = cells.min(axis=(0, 1)), cells.max(axis=(0, 1))
    extent = high - low
    size = float(extent.max())
    figure = Figure(figsize=(6.9, float(np.clip(6.0 * extent[1] / extent[0], 1.6, 6.0)) + 1.6))
    ax = figure.subplots()
    if len(cells) <= MOST_CELLS:
        edges = cells[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2, 2)
        mesh = LineCollection(list(edges), colors="0.75", lw=0.3, rasterized=len(edges) > 5000)
        ax.add_collection(mesh)
    middle = cells.reshape(-1, 2).mean(axis=0)
    for role in roles:
        wide = 3.0 if role.colour in (TOUCHED, ELECTRODE) else 1.5
        lines = LineCollection(list(role.facets), colors=role.colour, lw=wide, label=role.words)
        lines.set_alpha(0.6 if role.colour == ELECTRODE else 1.0)
        ax.add_collection(lines)
        if role.hatched:
            _hatch(ax, role, middle, 0.02 * size)
        if role.force is not None:
            _arrows(ax, role, middle, 0.12 * size)
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
    """Draw short strokes outwards from what is held."""
    out, centre = _outwards(role.facets, middle), role.facets.mean(axis=1)
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
    chosen = _spread(role.facets)
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


def _spread(facets: Array) -> NDArray[np.intp]:
    """Return edges about as far from each other on each of the pieces of a part, some `ARROWS`."""
    centre = facets.mean(axis=1)
    centre = centre[order := np.lexsort(centre.T)]
    apart = np.linalg.norm(facets[:, 1] - facets[:, 0], axis=1).sum() / ARROWS
    chosen: list[np.intp] = []
    left = np.ones(len(centre), dtype=bool)
    while left.any():
        chosen.append(np.argmax(left))
        left &= np.linalg.norm(centre - centre[chosen[-1]], axis=1) >= (1 - 1e-9) * apart
    return order[np.asarray(chosen, dtype=np.intp)]


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
    boundary: Array, roles: Sequence[Role], surface: Array, units: Units, axes: str
) -> Figure:
    """Draw a body in space by the facets of its boundary; see `draw_plane`."""
    figure = Figure(figsize=(6.9, 6.0))
    figure.set_layout_engine("none")
    ax: Any = figure.add_axes((0.05, 0.22, 0.9, 0.7), projection="3d")
    faint = {"facecolor": (0.9, 0.9, 0.9, 0.25), "edgecolor": "0.75", "linewidths": 0.15}
    ax.add_collection3d(Poly3DCollection(list(boundary), **faint))
    seen = [boundary.reshape(-1, 3)]
    for role in roles:
        colour = "0.6" if role.hatched else role.colour
        edge = {"edgecolor": "0.3", "linewidths": 0.2, "alpha": 0.15 if role.hatched else 0.5}
        ax.add_collection3d(Poly3DCollection(list(role.facets), facecolor=colour, **edge))
        ax.plot([], [], "s", color=colour, label=role.words)
        if role.force is not None and np.any(role.force):
            centre = role.facets.mean(axis=1)
            reach = 0.2 * float(np.ptp(boundary.reshape(-1, 3), axis=0).max())
            step = reach * role.force / np.linalg.norm(role.force, axis=1).max()
            chosen = np.linspace(0, len(centre) - 1, min(ARROWS, len(centre))).astype(int)
            start = (centre - step)[chosen]
            ax.quiver(*start.T, *step[chosen].T, color=LOADED, lw=0.8)
            seen.append(start)
    if surface.size:
        ax.plot(*surface.T, ".", ms=2, color=FOUNDATION, label="foundation")
    points = np.concatenate(seen)
    low, high = points.min(axis=0), points.max(axis=0)
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    ax.set_box_aspect(high - low)
    for name in "xyz":
        getattr(ax, f"set_{name}label")(units.label(f"${name}$", "length"))
    ax.locator_params(nbins=4)
    figure.legend(loc="lower center", ncols=2, fontsize=7)
    return figure
