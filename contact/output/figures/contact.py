"""The contact figure: stresses on Gamma_3, friction bound, stick and slip."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from contact.output.surface import STATUS
from contact.output.table import Table, by_contact
from contact.output.units import Units
from contact.output.vtu import VTU
from contact.typing import Array

#: Okabe and Ito's palette: told apart by colour-blind readers, and in grey.
BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#555555"
#: Figures narrower than this (inches) have small letters and legends of two columns.
NARROW = 4.5
#: Where no units are named.
UNNAMED = Units()
ZONES = {
    "stick": ("#CDE7F0", "sticking"),
    "slip": ("#FBE3C8", "sliding"),
    "open": ("#F2F2F2", "open"),
}


def position(table: Table, axes: str = "xy") -> tuple[Array, str]:
    """Return where the nodes lie along Gamma_3 and what to call it.

    That is a coordinate where Gamma_3 lies along an axis, and the arc length elsewhere.
    """
    points = np.column_stack([table["x"], table["y"]])
    extent = np.ptp(points, axis=0)
    for axis, name in enumerate(axes):
        if extent[1 - axis] <= 1e-9 * extent[axis]:
            return points[:, axis], name
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)]), r"\ell"


def ends(table: Table, held: Array) -> Array:
    """Return where Gamma_3 begins and ends in the plane, shape (2, 2).

    Parameters
    ----------
    table
        The contact nodes in their order.
    held
        Nodes of Gamma_3 that are held, and hence no contact nodes, shape (n, 2).
    """
    points = np.column_stack([table["x"], table["y"]])
    found = points[[0, -1]]
    if len(held) and len(points) > 1:
        for k, (last, before) in enumerate([(0, 1), (-1, -2)]):
            distance = np.linalg.norm(held - points[last], axis=1)
            spacing = np.linalg.norm(points[last] - points[before])
            if distance.min() < 1.5 * spacing:
                found[k] = held[np.argmin(distance)]
    return found


def zones(status: Any, where: Array) -> Iterator[tuple[str, float, float]]:
    """Yield the runs of nodes of one status, and between which positions they lie."""
    order = np.argsort(where)
    status, where = status[order], where[order]
    edges = np.concatenate([where[:1], (where[1:] + where[:-1]) / 2, where[-1:]])
    starts = np.flatnonzero(np.concatenate([[True], status[1:] != status[:-1]]))
    for start, stop in zip(starts, [*starts[1:], status.size], strict=True):
        yield str(status[start]), float(edges[start]), float(edges[stop])


def draw_line(
    table: Table,
    title: str = "",
    held: Array | None = None,
    axes: str = "xy",
    units: Units = UNNAMED,
) -> Figure:
    """Draw pressure, tangential stress and friction bound along Gamma_3 in the plane.

    Parameters
    ----------
    table
        The contact nodes in their order.
    title
        Of the figure.
    held
        Nodes of Gamma_3 that are no contact nodes, shape (n, 2), to begin and end at.
    axes
        Names of the coordinates.
    units
        Names of the units.
    """
    parts = by_contact(table)
    frictional = bool(np.any(table["bound"] > 0))
    width = float(matplotlib.rcParams["figure.figsize"][0])
    tall = 0.8 if frictional else 0.48
    figure = Figure(figsize=(width, (tall if width > NARROW else 1.5 * tall) * width))
    size = (2 if frictional else 1, len(parts))
    grid = figure.subplots(*size, sharex="col", sharey="row", squeeze=False)
    for rows, part in zip(grid.T, parts, strict=True):
        _draw_rows(rows, part, held, axes, units)
    for ax in grid[:, 1:].ravel():
        ax.set_ylabel("")
    if len(parts) == 1:
        for ax in grid[:, 0]:
            handles = _handles([ax])
            columns = len(handles) if width > NARROW else 2
            ax.legend(handles=handles, ncols=columns, loc="lower left", bbox_to_anchor=(0, 1))
    else:
        for ax, part in zip(grid[0], parts, strict=True):
            ax.set_title(str(part["on"][0]), fontsize="medium")
        figure.legend(handles=_handles(grid.ravel()), ncols=3, loc="outside lower center")
    if title:
        figure.suptitle(title, fontsize="large")
    return figure


def _handles(axes: Iterable[Axes]) -> list[Any]:
    """Return what a legend shows: each label once, lines first."""
    found: dict[str, Any] = {}
    for ax in axes:
        handles, labels = ax.get_legend_handles_labels()
        for label, handle in zip(labels, handles, strict=True):
            found.setdefault(label, handle)
    return sorted(found.values(), key=lambda handle: not isinstance(handle, Line2D))


def _draw_rows(rows: Any, table: Table, held: Array | None, axes: str, units: Units) -> None:
    """Draw one contact: pressure, and below it friction, if there is a second row."""
    where, name = position(table, axes)
    bound, tau = table["bound"], table["tau"]
    frictional = len(rows) > 1
    for ax in rows:
        for zone, start, stop in zones(table["status"], where):
            ax.axvspan(start, stop, color=ZONES[zone][0], lw=0, zorder=0)
    for zone, (colour, label) in ZONES.items():
        if np.any(table["status"] == zone):
            words = label if frictional or zone == "open" else "in contact"
            rows[0].fill_between([], [], color=colour, lw=0, label=words)
    rows[0].plot(where, table["pressure"], color=BLUE, label=r"pressure $-\sigma_\nu$")
    rows[0].set_ylabel(units.label(r"$-\sigma_\nu$", "stress"))
    if frictional:
        rows[1].plot(where, tau, color=ORANGE, label=r"tangential stress $-\sigma_\tau\cdot t$")
        rows[1].plot(where, bound, "--", color=GREY, lw=0.8, label=r"friction bound $\pm s$")
        rows[1].plot(where, -bound, "--", color=GREY, lw=0.8)
        rows[1].axhline(0.0, color="black", lw=0.4)
        rows[1].set_ylabel(units.label(r"$-\sigma_\tau\cdot t$", "stress"))
    rows[-1].set_xlabel(units.label(f"${name}$ along $\\Gamma_3$", "length"))
    before, after = _margins(table, held)
    rows[0].set_xlim(where.min() - before, where.max() + after)
    _focus(rows[0], table["pressure"], 0.0)
    if frictional:
        _focus(rows[1], bound, -1.0)


def _margins(table: Table, held: Array | None) -> tuple[float, float]:
    """Return how far Gamma_3 goes on beyond its contact nodes, at either end of the axis."""
    if held is None:
        return 0.0, 0.0
    outer = np.column_stack([table["x"], table["y"]])[[0, -1]]
    # The rows begin where x, then y is smaller, and so does the axis.
    first, last = np.linalg.norm(ends(table, held) - outer, axis=1)
    return float(first), float(last)


def _focus(ax: Axes, values: Array, low: float) -> None:
    """Limit the axis where a singular corner would hide all else, and say what is cut off."""
    largest = float(values.max(initial=0.0))
    usual = float(np.quantile(values, 0.97)) * 1.6
    if largest <= 0:
        return
    top = usual if 0 < usual < 0.7 * largest else 1.05 * largest
    ax.set_ylim(low * top, top)
    if top < largest:
        text = f"peak {largest:.3g}, cut off"
        ax.annotate(text, (0.99, 0.97), xycoords="axes fraction", ha="right", va="top", fontsize=7)


def draw_surface(surface: VTU, title: str = "", units: Units = UNNAMED) -> Figure:
    """Draw pressure, status and friction arrows on Gamma_3 in space, facet by facet."""
    view, names = _view(surface)
    flat = surface.grid.points @ view.T
    triangles = _triangles(surface)
    pressure = np.asarray(surface.at_points["pressure"])
    width = float(matplotlib.rcParams["figure.figsize"][0])
    figure = Figure(figsize=(width, 0.6 * width))
    # Placed by hand: the automatic layouts leave no room below axes of equal scale.
    figure.set_layout_engine("none")
    left, right = (figure.add_axes((x, 0.34, 0.38, 0.5)) for x in (0.1, 0.6))
    for ax in (left, right):
        ax.add_collection(PolyCollection(list(flat[triangles]), facecolor="#F2F2F2", lw=0))
    known = np.isfinite(pressure[triangles]).all(axis=1)
    drawn = triangles[known] if known.any() else triangles
    shown = left.tripcolor(
        *flat.T, drawn, np.nan_to_num(pressure), shading="gouraud", cmap="viridis"
    )
    bar = figure.add_axes((0.1, 0.15, 0.38, 0.03))
    figure.colorbar(
        shown, cax=bar, orientation="horizontal", label=units.label(r"$-\sigma_\nu$", "stress")
    )
    status = np.asarray(surface.at_points["status"])
    size = float(np.clip(2e3 / len(flat), 0.5, 12))
    for zone, colour in (("open", "#DDDDDD"), ("stick", BLUE), ("slip", ORANGE)):
        chosen = status == STATUS[zone]
        if np.any(chosen):
            right.scatter(*flat[chosen].T, color=colour, s=size, lw=0, label=ZONES[zone][1])
    _arrows(right, surface, flat, view)
    figure.legend(ncols=3, handletextpad=0.2, loc="center", bbox_to_anchor=(0.79, 0.165))
    for ax, name in ((left, "contact pressure"), (right, "status, friction (arrows)")):
        ax.set_aspect("equal")
        ax.margins(0.04)
        _zoom(ax, surface, flat)
        ax.set_title(name, fontsize="medium")
        ax.set_xlabel(units.label(f"${names[0]}$", "length"))
    left.set_ylabel(units.label(f"${names[1]}$", "length"))
    if title:
        figure.suptitle(title, fontsize="large")
    return figure


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
