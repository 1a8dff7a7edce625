"""The contact figure: stresses on Gamma_3, friction bound, stick and slip."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from contact.output.table import Table
from contact.typing import Array

#: Okabe and Ito's palette: told apart by colour-blind readers, and in grey.
BLUE, ORANGE, GREY, LIGHT = "#0072B2", "#D55E00", "#555555", "#BBBBBB"
ZONES = {
    "stick": ("#CDE7F0", "sticking"),
    "slip": ("#FBE3C8", "sliding"),
    "open": ("#F2F2F2", "open"),
}


def position(table: Table) -> tuple[Array, str]:
    """Return where the nodes lie along Gamma_3 and what to call it.

    That is a coordinate where Gamma_3 lies along an axis, and the arc length elsewhere.
    """
    points = np.column_stack([table["x"], table["y"]])
    extent = np.ptp(points, axis=0)
    for axis, name in enumerate("xy"):
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


def draw_line(table: Table, title: str = "", held: Array | None = None) -> Figure:
    """Draw pressure, tangential stress and friction bound along Gamma_3 in the plane.

    Parameters
    ----------
    table
        The contact nodes in their order.
    title
        Of the figure.
    held
        Nodes of Gamma_3 that are no contact nodes, shape (n, 2), to begin and end at.
    """
    where, name = position(table)
    bound, tau = table["bound"], table["tau"]
    frictional = bool(np.any(bound > 0))
    figure = Figure(figsize=(6.3, 5.0 if frictional else 3.0))
    axes = figure.subplots(2 if frictional else 1, sharex=True, squeeze=False)[:, 0]
    for ax in axes:
        for zone, start, stop in zones(table["status"], where):
            ax.axvspan(start, stop, color=ZONES[zone][0], lw=0, zorder=0)
    shown = [
        Patch(color=colour, label=label if frictional or zone == "open" else "in contact")
        for zone, (colour, label) in ZONES.items()
        if np.any(table["status"] == zone)
    ]
    axes[0].plot(where, table["pressure"], color=BLUE, label=r"pressure $-\sigma_\nu$")
    axes[0].set_ylabel(r"$-\sigma_\nu$ (units of the case)")
    if frictional:
        axes[1].plot(where, tau, color=ORANGE, label=r"tangential stress $-\sigma_\tau\cdot t$")
        axes[1].plot(where, bound, "--", color=GREY, lw=0.8, label=r"friction bound $\pm s$")
        axes[1].plot(where, -bound, "--", color=GREY, lw=0.8)
        axes[1].axhline(0.0, color="black", lw=0.4)
        axes[1].set_ylabel(r"$-\sigma_\tau\cdot t$ (units of the case)")
    axes[-1].set_xlabel(f"${name}$ along $\\Gamma_3$ (mesh units)")
    before, after = _margins(table, held)
    axes[0].set_xlim(where.min() - before, where.max() + after)
    _focus(axes[0], table["pressure"], 0.0)
    if frictional:
        _focus(axes[1], bound, -1.0)
    for k, ax in enumerate(axes):
        handles = ax.get_legend_handles_labels()[0] + (shown if k == 0 else [])
        ax.legend(handles=handles, ncols=len(handles), loc="lower left", bbox_to_anchor=(0, 1))
    if title:
        figure.suptitle(title, fontsize=10)
    return figure


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


def draw_surface(table: Table, title: str = "") -> Figure:
    """Draw pressure, status and friction arrows on Gamma_3 in space."""
    points = np.column_stack([table[axis] for axis in "xyz"])
    flat, names = _flatten(points)
    figure = Figure(figsize=(6.3, 3.8))
    # Placed by hand: the automatic layouts leave no room below axes of equal scale.
    figure.set_layout_engine("none")
    left, right = (figure.add_axes((x, 0.34, 0.38, 0.5)) for x in (0.1, 0.6))
    if np.linalg.matrix_rank(flat - flat[0]) == 2:
        shown = left.tripcolor(*flat.T, table["pressure"], shading="gouraud", cmap="viridis")
    else:  # too few nodes for triangles
        shown = left.scatter(*flat.T, c=table["pressure"], cmap="viridis")
    bar = figure.add_axes((0.1, 0.15, 0.38, 0.03))
    figure.colorbar(
        shown, cax=bar, orientation="horizontal", label=r"$-\sigma_\nu$ (units of the case)"
    )
    size = float(np.clip(2e3 / len(points), 0.5, 12))
    for zone, colour in (("open", LIGHT), ("stick", BLUE), ("slip", ORANGE)):
        chosen = table["status"] == zone
        if np.any(chosen):
            right.scatter(*flat[chosen].T, color=colour, s=size, lw=0, label=ZONES[zone][1])
    friction = _flatten(points, np.column_stack([table[f"tau_{axis}"] for axis in "xyz"]))[0]
    if np.any(friction):
        chosen = _thinned(flat, 16)
        arrows = {"color": "black", "width": 0.004, "clip_on": False}
        right.quiver(*flat[chosen].T, *friction[chosen].T, **arrows)
    figure.legend(ncols=3, handletextpad=0.2, loc="center", bbox_to_anchor=(0.79, 0.165))
    for ax, name in ((left, "contact pressure"), (right, "status, friction (arrows)")):
        ax.set_aspect("equal")
        ax.margins(0.08)
        ax.set_title(name, fontsize=9)
        ax.set_xlabel(f"${names[0]}$ (mesh units)")
    left.set_ylabel(f"${names[1]}$ (mesh units)")
    if title:
        figure.suptitle(title, fontsize=10)
    return figure


def _flatten(points: Array, vectors: Array | None = None) -> tuple[Array, tuple[str, str]]:
    """Return points, or vectors there, in the two coordinates along which Gamma_3 extends.

    These are two axes if Gamma_3 is flat along them, else its principal directions x_1, x_2.
    """
    extent = np.ptp(points, axis=0)
    given = points if vectors is None else vectors
    thin = int(np.argmin(extent))
    if extent[thin] <= 0.2 * np.sort(extent)[1]:
        kept = [k for k in range(3) if k != thin]
        return given[:, kept], ("xyz"[kept[0]], "xyz"[kept[1]])
    centred = points - points.mean(axis=0)
    directions = np.linalg.eigh(centred.T @ centred)[1][:, :0:-1]
    return given @ directions, ("x_1", "x_2")


def _thinned(flat: Array, count: int) -> Array:
    """Return the first point of each cell of a grid of count x count cells."""
    span = np.ptp(flat, axis=0).max() or 1.0
    cells = np.floor((flat - flat.min(axis=0)) / span * count)
    return np.unique(cells, axis=0, return_index=True)[1]
