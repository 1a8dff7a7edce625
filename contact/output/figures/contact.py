"""The contact figure: stresses on Gamma_3, friction bound, stick and slip."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from scipy.spatial import cKDTree

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


def fitted(title: str) -> str:
    """Return a title in lines that fit on a figure as wide as the settings say."""
    letter = 0.6 * 1.2 * float(matplotlib.rcParams["font.size"]) / 72
    width = float(matplotlib.rcParams["figure.figsize"][0])
    return "\n".join(textwrap.wrap(title, int(width / letter)))


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
    opposite: VTU | None = None,
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
    opposite
        The other sides of contacts between bodies.
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
        if opposite is not None:
            _draw_opposite(rows[0], part, opposite)
    for ax in grid[:, 1:].ravel():
        ax.set_ylabel("")
    if len(parts) == 1:
        for ax in grid[:, 0]:
            handles = _handles([ax])
            # A page has room for four beside each other.
            columns = 2 if width <= NARROW else len(handles) if len(handles) <= 4 else 3
            ax.legend(handles=handles, ncols=columns, loc="lower left", bbox_to_anchor=(0, 1))
    else:
        for ax, part in zip(grid[0], parts, strict=True):
            ax.set_title(str(part["on"][0]), fontsize="medium")
        figure.legend(handles=_handles(grid.ravel()), ncols=3, loc="outside lower center")
    if title:
        figure.suptitle(fitted(title), fontsize="large")
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


def _draw_opposite(ax: Axes, table: Table, opposite: VTU) -> None:
    """Draw the pressure on the other side where its nodes are opposite of those of a contact."""
    own = np.asarray(opposite.at_points["entry"]) == table["entry"][0]
    if not own.any():
        return
    points = np.column_stack([table["x"], table["y"]])
    where, _ = position(table)
    places = opposite.grid.points[own][:, :2]
    near = cKDTree(points).query(places)[1]
    # Along the side of the contact nodes, from the nearest of them.
    along = np.gradient(points, axis=0) / np.gradient(where)[:, None]
    there = where[near] + np.einsum("ni,ni->n", places - points[near], along[near])
    order = np.argsort(there)
    pressure = np.asarray(opposite.at_points["pressure"])[own][order]
    ax.plot(there[order], pressure, ":", color=GREY, lw=1.0, label="pressure on the other side")


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
