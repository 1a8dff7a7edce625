"""The contact figure in 2-D: stresses on Gamma_3, friction bound, stick and slip."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray
from scipy.spatial import KDTree

from contact.plot.run import Run
from contact.plot.style import BLUE, GREY, NARROW, ORANGE, ZONES, page_width, sheet
from contact.results.contact_nodes import Table
from contact.typing import Array

#: Names of the zones without friction.
TOUCHING = {"slip": "in contact", "open": "open"}

#: Contact zones below this share of an axis are drawn with their vicinity alone.
SMALL = 1 / 3

#: Elements beside the contact zone that are shown of it at least.
BESIDE = 3


def position(table: Table, run: Run) -> tuple[Array, str, tuple[float, float]]:
    """Return the positions of nodes along Gamma_3, the label of the axis, and its ends."""
    # On the coordinate over which it is a graph, of two the one along which it is longer; else the
    # arc length.
    points, outer = np.column_stack([table["x"], table["y"]]), ends(table, run.constrained)
    extent = np.ptp(points, axis=0)
    for axis in (0, 1) if extent[0] >= extent[1] else (1, 0):
        steps = np.diff(points[:, axis])
        straight = extent[1 - axis] <= 1e-9 * extent[axis]
        if straight or np.all(steps > 0) or np.all(steps < 0):
            where, name, borders = points[:, axis], f"${run.axes[axis]}$", outer[:, axis]
            begin = ""
            break
    else:
        first, last = np.linalg.norm(outer - points[[0, -1]], axis=1)
        steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        where, name = first + np.concatenate([[0.0], np.cumsum(steps)]), r"$\ell$"
        begin = f", from ({', '.join(f'{x:.4g}' for x in outer[0] + 0.0)})"
        borders = np.array([0.0, where[-1] + last])
    # A single node has its share.
    room = float(table["weight"].max()) / 2 if np.ptp([*where, *borders]) == 0 else 0.0
    every = np.concatenate([where, borders])
    label = run.units.label(f"{name} along $\\Gamma_3${begin}", "length")
    return where, label, (float(every.min()) - room, float(every.max()) + room)


def shown(table: Table, run: Run, touching: NDArray[np.bool_]) -> tuple[float, float]:
    """Return the ends of the axis along Gamma_3: all, or the vicinity of a small contact zone."""
    where, _, whole = position(table, run)
    zone = float(np.ptp(where[touching])) if touching.any() else np.inf
    extent = float(np.ptp(where))
    if zone >= SMALL * extent:
        return whole
    # A zone of a node or two is seen beside its neighbours.
    apart = float(np.abs(np.gradient(where))[touching].max())
    room = max(0.4 * zone, 0.02 * extent, BESIDE * apart)
    low, high = where[touching].min() - room, where[touching].max() + room
    return max(low, whole[0]), min(high, whole[1])


def inside(table: Table, run: Run, name: str, limits: tuple[float, float]) -> Array:
    """Return a column of the nodes that an axis along Gamma_3 shows."""
    where = position(table, run)[0]
    return table[name][(where >= limits[0]) & (where <= limits[1])]


def ends(table: Table, constrained: Array) -> Array:
    """Return the ends of Gamma_3, (2, 2): contact nodes, or `constrained` ones, (n, 2), beside."""
    points = np.column_stack([table["x"], table["y"]])
    found = points[[0, -1]]
    if len(constrained) and len(points) > 1:
        for k, (last, before) in enumerate([(0, 1), (-1, -2)]):
            distance = np.linalg.norm(constrained - points[last], axis=1)
            if distance.min() < 1.5 * np.linalg.norm(points[last] - points[before]):
                found[k] = constrained[np.argmin(distance)]
    return found


def shares(where: Array, outer: tuple[float, float]) -> Array:
    """Return where the shares of nodes end along Gamma_3, in the order of their positions."""
    along = np.sort(where)
    return np.concatenate([outer[:1], (along[1:] + along[:-1]) / 2, outer[1:]])


def zones(ax: Axes, where: Array, outer: tuple[float, float], status: Any, rows: Array) -> None:
    """Colour the share of each node by its status, (m, n); `rows` has m + 1 ends, of one shares."""
    order = np.argsort(where)
    ax.pcolormesh(
        shares(where, outer),
        rows,
        np.argmax([status[:, order] == zone for zone in ZONES], axis=0),
        cmap=ListedColormap([colour for colour, _ in ZONES.values()]),
        vmin=-0.5,
        vmax=len(ZONES) - 0.5,
        rasterized=True,
        zorder=0,
        transform=ax.get_xaxis_transform() if len(status) == 1 else ax.transData,
    )


def patches(frictional: bool) -> list[Patch]:
    """Return the legend of the zones: with friction those that stick and slide, else one."""
    words = {zone: label for zone, (_, label) in ZONES.items()} if frictional else TOUCHING
    return [Patch(color=ZONES[zone][0], label=label) for zone, label in words.items()]


def draw_line(run: Run) -> Figure:
    """Draw pressure, tangential stress and friction bound along Gamma_3 in the plane."""
    parts = run.contacts
    frictional = bool(np.any(run.table["bound"] > 0))
    narrow = page_width() <= NARROW
    figure = sheet((0.8 if frictional else 0.48) * (1.5 if narrow else 1.0))
    size = (2 if frictional else 1, len(parts))
    grid = figure.subplots(*size, sharex="col", sharey="row", squeeze=False)
    limits = [shown(part, run, part["status"] != "open") for part in parts]
    for rows, part, borders in zip(grid.T, parts, limits, strict=True):
        _draw_rows(rows, part, run, borders)
    # A row has one scale, which no contact is beyond.
    for axes, name, low in zip(grid, ("pressure", "bound"), (0.0, -1.0), strict=False):
        each = zip(parts, limits, strict=True)
        _focus(axes, [inside(part, run, name, borders) for part, borders in each], low)
    for ax in grid[:, 1:].ravel():
        ax.set_ylabel("")
    for ax, part in zip(grid[0] if len(parts) > 1 else [], parts, strict=False):
        ax.set_title(run.names[part["entry"][0]], fontsize="medium")
    known: dict[str, Any] = {}
    for ax in grid.ravel():
        known |= {handle.get_label(): handle for handle in ax.get_legend_handles_labels()[0]}
    handles = sorted(known.values(), key=lambda handle: not isinstance(handle, Line2D))
    figure.legend(handles=handles, ncols=2 if narrow else 3, loc="outside lower center")
    return figure


def _draw_rows(rows: Any, table: Table, run: Run, limits: tuple[float, float]) -> None:
    """Draw one contact: pressure, and below it friction, if there is a second row."""
    where, label, whole = position(table, run)
    mark = "o" if len(where) == 1 else ""  # a line of one point is not seen
    bound, tau, units = table["bound"], table["tau"], run.units
    frictional = len(rows) > 1
    seen = inside(table, run, "status", limits)
    for ax in rows:
        zones(ax, where, whole, table["status"][None], np.array([0.0, 1.0]))
    for zone, (colour, name) in ZONES.items():
        if np.any(seen == zone):
            words = name if frictional else TOUCHING.get(zone, "in contact")
            rows[0].fill_between([], [], color=colour, lw=0, label=words)
    rows[0].plot(where, table["pressure"], color=BLUE, marker=mark, label=r"pressure $-\sigma_\nu$")
    rows[0].set_ylabel(units.label(r"$-\sigma_\nu$", "stress"))
    if np.all(seen == "open"):
        there = {"transform": rows[0].transAxes, "bbox": {"facecolor": "white", "lw": 0}}
        rows[0].text(0.5, 0.5, "no contact", ha="center", va="center", **there)
    if frictional:
        rows[1].plot(
            where, tau, color=ORANGE, marker=mark, label=r"tangential stress $-\sigma_\tau\cdot t$"
        )
        rows[1].plot(where, bound, "--", color=GREY, lw=0.8, label=r"friction bound $\pm s$")
        rows[1].plot(where, -bound, "--", color=GREY, lw=0.8)
        rows[1].axhline(0.0, color="black", lw=0.4)
        rows[1].set_ylabel(units.label(r"$-\sigma_\tau\cdot t$", "stress"))
    if run.opposite is not None:
        _draw_opposite(rows[0], table, where, run.opposite, limits)
    rows[-1].set_xlabel(label)
    rows[0].set_xlim(limits)
    rows[0].locator_params(axis="x", nbins=5 if len(run.contacts) > 1 else 10)


def _draw_opposite(
    ax: Axes, table: Table, where: Array, opposite: Any, limits: tuple[float, float]
) -> None:
    """Draw the pressure on the other side where its nodes are opposite of those of a contact."""
    own = opposite["entry"] == table["entry"][0]
    if not own.any() or len(where) == 1:
        return
    points = np.column_stack([table["x"], table["y"]])
    places = opposite.points[own][:, :2]
    near = KDTree(points).query(places)[1]
    # Along the side of the contact nodes, from the nearest of them.
    along = np.gradient(points, axis=0) / np.gradient(where)[:, None]
    there = where[near] + np.einsum("ni,ni->n", places - points[near], along[near])
    if there.max() < limits[0] or there.min() > limits[1]:
        return
    order = np.argsort(there)
    pressure = opposite["pressure"][own][order]
    ax.plot(there[order], pressure, ":", color=GREY, lw=1.0, label="pressure on the other side")


def _focus(axes: Sequence[Axes], values: Sequence[Array], low: float) -> None:
    """Limit axes where a singular corner would hide all else, and name the peaks."""
    largest = max(float(own.max(initial=0.0)) for own in values)
    if largest <= 0:
        axes[0].set(ylim=(low, 1.0), yticks=[0.0])  # there is no scale
        return
    usual = 1.6 * max(float(np.quantile(own, 0.97, method="higher")) for own in values if own.size)
    top = usual if 0 < usual < 0.7 * largest else 1.05 * largest
    axes[0].set_ylim(low * top, top)
    at = {"xycoords": "axes fraction", "ha": "right", "va": "top", "fontsize": 7}
    for ax, own in zip(axes, values, strict=True):
        if top < own.max(initial=0.0):
            ax.annotate(f"peak {own.max():.3g}, cut off", (0.99, 0.97), **at)
