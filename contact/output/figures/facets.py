"""The contact figure in space: pressure, stick and slip, friction on the facets of Gamma_3."""

from __future__ import annotations

from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from contact.output.figures.contact import BLUE, ORANGE, UNNAMED, ZONES
from contact.output.surface import STATUS
from contact.output.units import Units
from contact.output.vtu import VTU
from contact.typing import Array


def draw_surface(
    surface: VTU, title: str = "", units: Units = UNNAMED, opposite: VTU | None = None
) -> Figure:
    """Draw pressure, status and friction arrows on Gamma_3 in space, facet by facet.

    The arguments are those of `draw_line`.
    """
    view, names = _view(surface)
    flat = surface.grid.points @ view.T
    width = float(matplotlib.rcParams["figure.figsize"][0])
    figure = Figure(figsize=(width, 0.6 * width))
    # Placed by hand: the automatic layouts leave no room below axes of equal scale.
    figure.set_layout_engine("none")
    panels = [(surface, "contact pressure")]
    if opposite is not None:
        panels.append((opposite, "on the other side"))
    wide, step = (0.38, 0.5) if opposite is None else (0.25, 0.31)
    *lefts, right = (
        figure.add_axes((0.1 + k * step, 0.34, wide, 0.5)) for k in range(len(panels) + 1)
    )
    highest = float(np.nanmax(surface.at_points["pressure"], initial=0.0))
    for ax, (side, _) in zip(lefts, panels, strict=True):
        shown = _draw_pressure(ax, side, view, highest)
    bar = figure.add_axes((0.1, 0.15, wide + (len(panels) - 1) * step, 0.03))
    figure.colorbar(
        shown, cax=bar, orientation="horizontal", label=units.label(r"$-\sigma_\nu$", "stress")
    )
    _draw_status(right, surface, view)
    middle = 0.1 + len(panels) * step + wide / 2
    figure.legend(
        ncols=3 if opposite is None else 1, handletextpad=0.2, loc="center",
        bbox_to_anchor=(middle, 0.165),
    )  # fmt: skip
    titles = [*(name for _, name in panels), "status, friction (arrows)"]
    for ax, name in zip((*lefts, right), titles, strict=True):
        ax.set_aspect("equal")
        ax.margins(0.04)
        _zoom(ax, surface, flat)
        ax.set_title(name, fontsize="medium")
        ax.set_xlabel(units.label(f"${names[0]}$", "length"))
    lefts[0].set_ylabel(units.label(f"${names[1]}$", "length"))
    if title:
        figure.suptitle(title, fontsize="large")
    return figure


def _draw_pressure(ax: Axes, side: VTU, view: Array, highest: float) -> Any:
    """Draw the pressure on one side; return what its colours are."""
    flat, triangles = side.grid.points @ view.T, _triangles(side)
    pressure = np.asarray(side.at_points["pressure"])
    ax.add_collection(PolyCollection(list(flat[triangles]), facecolor="#F2F2F2", lw=0))
    known = np.isfinite(pressure[triangles]).all(axis=1)
    drawn = triangles[known] if known.any() else triangles
    values = np.nan_to_num(pressure)
    colours = {"shading": "gouraud", "cmap": "viridis", "vmin": 0.0, "vmax": highest or 1.0}
    return ax.tripcolor(*flat.T, drawn, values, **colours)


def _draw_status(ax: Axes, surface: VTU, view: Array) -> None:
    """Draw what sticks and slips, and friction as arrows."""
    flat = surface.grid.points @ view.T
    ax.add_collection(PolyCollection(list(flat[_triangles(surface)]), facecolor="#F2F2F2", lw=0))
    status = np.asarray(surface.at_points["status"])
    size = float(np.clip(2e3 / len(flat), 0.5, 12))
    for zone, colour in (("open", "#DDDDDD"), ("stick", BLUE), ("slip", ORANGE)):
        chosen = status == STATUS[zone]
        if np.any(chosen):
            ax.scatter(*flat[chosen].T, color=colour, s=size, lw=0, label=ZONES[zone][1])
    _arrows(ax, surface, flat, view)


def _triangles(surface: VTU) -> Any:
    """Return the facets as triangles of nodes, those of degree 2 as four each."""
    cells = surface.grid.cells
    if cells.shape[1] == 3:
        return cells
    quarters = [[0, 5, 4], [5, 1, 3], [4, 3, 2], [3, 4, 5]]
    return np.concatenate([cells[:, corners] for corners in quarters])


def _arrows(ax: Axes, surface: VTU, flat: Array, view: Array) -> None:
    """Draw the friction stress, its largest arrow a tenth of the contact part, within the axes."""
    traction, normal = (np.asarray(surface.at_points[name]) for name in ("traction", "normal"))
    along = traction - np.einsum("ni,ni->n", traction, normal)[:, None] * normal
    friction = np.nan_to_num(along @ view.T)
    size = np.linalg.norm(friction, axis=1)
    acting = np.flatnonzero(size > 1e-6 * size.max(initial=0.0))
    if not acting.size:
        return
    chosen = acting[_thinned(flat[acting], 16)]
    scale = size[chosen].max() / (0.1 * np.ptp(flat, axis=0).max())
    ends = flat[chosen] + friction[chosen] / scale
    exact = {"angles": "xy", "scale_units": "xy", "scale": scale}
    ax.quiver(*flat[chosen].T, *friction[chosen].T, color="black", width=0.004, **exact)
    ax.update_datalim(ends)


def _view(surface: VTU) -> tuple[Array, tuple[str, str]]:
    """Return two directions across the mean contact direction, shape (2, 3), and their names.

    These are axes where it lies along the third, else directions x_1, x_2.
    """
    normal = np.asarray(surface.at_points["normal"])
    touching = np.asarray(surface.at_points["status"]) > STATUS["open"]
    mean = np.nanmean(normal[touching if touching.any() else slice(None)], axis=0)
    mean = mean / np.linalg.norm(mean)
    thin = int(np.argmax(np.abs(mean)))
    kept = [k for k in range(3) if k != thin]
    if abs(mean[thin]) > 0.98:
        return np.eye(3)[kept], ("xyz"[kept[0]], "xyz"[kept[1]])
    first = np.cross(np.eye(3)[kept[0]], mean)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(mean, first)]), ("x_1", "x_2")


def _zoom(ax: Axes, surface: VTU, flat: Array) -> None:
    """Show what touches and as much around it, where that is a small piece of the whole."""
    touching = flat[np.asarray(surface.at_points["status"]) > STATUS["open"]]
    whole = np.ptp(flat, axis=0).max()
    if len(touching) and (size := np.ptp(touching, axis=0).max()) < 0.3 * whole:
        low, high = touching.min(axis=0), touching.max(axis=0)
        margin = max(0.4 * size, 0.02 * whole)
        ax.set_xlim(low[0] - margin, high[0] + margin)
        ax.set_ylim(low[1] - margin, high[1] + margin)


def _thinned(flat: Array, count: int) -> Array:
    """Return the first point of each cell of a grid of count x count cells."""
    span = np.ptp(flat, axis=0).max() or 1.0
    cells = np.floor((flat - flat.min(axis=0)) / span * count)
    return np.unique(cells, axis=0, return_index=True)[1]
