"""The contact figure: stresses on Gamma_3, friction bound, stick and slip, in 2-D and in 3-D."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PolyCollection
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.tri import Triangulation
from numpy.typing import NDArray
from scipy.spatial import KDTree

from contact.errors import InputError
from contact.plot.run import Run
from contact.plot.style import (
    BLUE,
    GREY,
    NARROW,
    ORANGE,
    ZONES,
    Look,
    fitted,
    page_width,
    sheet,
    smooth,
)
from contact.results.grid import Table
from contact.results.quantity import STATUS
from contact.typing import Array

#: Names of the zones without friction.
TOUCHING = {"slip": "in contact", "open": "open"}

#: Contact zones below this share of an axis are drawn with their vicinity alone.
SMALL = 1 / 3

#: Elements beside the contact zone that are shown of it at least.
BESIDE = 3


def position(table: Table, run: Run) -> tuple[Array, str, tuple[float, float]]:
    """Return the positions of nodes along Gamma_3, the coordinate's name, and where Gamma_3 ends.

    That is the coordinate over which Gamma_3 is a graph, of two that along which it is longer, and
    the arc length elsewhere.
    """
    points, outer = np.column_stack([table["x"], table["y"]]), ends(table, run.held)
    extent = np.ptp(points, axis=0)
    for axis in (0, 1) if extent[0] >= extent[1] else (1, 0):
        steps = np.diff(points[:, axis])
        straight = extent[1 - axis] <= 1e-9 * extent[axis]
        if straight or np.all(steps > 0) or np.all(steps < 0):
            where, name, borders = points[:, axis], run.axes[axis], outer[:, axis]
            break
    else:
        first, last = np.linalg.norm(outer - points[[0, -1]], axis=1)
        steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
        where, name = first + np.concatenate([[0.0], np.cumsum(steps)]), r"\ell"
        borders = np.array([0.0, where[-1] + last])
    # A single node has its share.
    room = float(table["weight"].max()) / 2 if np.ptp([*where, *borders]) == 0 else 0.0
    every = np.concatenate([where, borders])
    return where, name, (float(every.min()) - room, float(every.max()) + room)


def along(table: Table, run: Run) -> str:
    """Return the label of the axis along Gamma_3; an arc length begins at a place."""
    name = position(table, run)[1]
    start = ", ".join(f"{x:.4g}" for x in ends(table, run.held)[0] + 0.0)
    begin = "" if name in run.axes else f", from ({start})"
    return run.units.label(f"${name}$ along $\\Gamma_3${begin}", "length")


def shown(
    tables: Sequence[Table], run: Run, look: Look, touching: Sequence[NDArray[np.bool_]]
) -> list[tuple[float, float] | None]:
    """Return the ends of the axes along Gamma_3 of some contacts; None for one beside `look`.

    They are the coordinates that are asked for, of an arc length that of the nodes within; else
    they show all, or the vicinity of a small contact zone.

    Parameters
    ----------
    tables, run, look
        The contacts, their run and the choices.
    touching
        Which nodes of each are in contact.

    Raises
    ------
    InputError
        If there are coordinates beside all of them.
    """
    given = {"xlim": look.xlim, "ylim": look.ylim}
    asked = {k: ends for k, ends in enumerate(given.values()) if ends is not None}
    if 0 in asked and len(look.sides(run.axes)) > 1:
        # Its radii, of both halves.
        low, high = asked[0]
        asked[0] = max(low, -high, 0.0), min(max(high, -low), run.body.bounds[1])
    found: list[tuple[float, float] | None] = []
    for table, there in zip(tables, touching, strict=True):
        where, name, whole = position(table, run)
        spans = [np.ptp(table[key]) for key in "xy"]
        straight = [k for k in (0, 1) if run.axes[k] == name and spans[1 - k] <= 1e-9 * spans[k]]
        chosen = {k: asked[k] for k in straight or (0, 1) if k in asked}
        inside = np.ones(len(where), dtype=bool)
        for k, (low, high) in chosen.items():
            inside &= (table["xy"[k]] >= low) & (table["xy"[k]] <= high)
        if not chosen:
            (low,), (high,) = window(where[:, None], there, 0.0)
            cut = low > where.min() or high < where.max()
            found.append(tuple(np.clip([low, high], *whole)) if cut else whole)
        elif straight:
            low, high = chosen[straight[0]]
            found.append((low, high) if low < whole[1] and whole[0] < high else None)
        elif inside.any():
            room = table["weight"][inside].max() / 2
            low, high = where[inside].min() - room, where[inside].max() + room
            found.append(tuple(np.clip([low, high], *whole)))
        else:
            found.append(None)
    if all(each is None for each in found):
        words = " ".join(f"--{k} {ends[0]:g},{ends[1]:g}" for k, ends in given.items() if ends)
        lies = " and ".join(
            f"{run.axes[k]} from {min(t['xy'[k]].min() for t in tables):.4g} to "
            f"{max(t['xy'[k]].max() for t in tables):.4g}"
            for k in asked
        )
        raise InputError(
            f"{words}: beside the contact part, which has {lies}; accepted: coordinates of the "
            "mesh that show some of it, or --field for the body alone",
            "figure-option",
        )
    return found


def ends(table: Table, held: Array) -> Array:
    """Return the first and the last point of Gamma_3 in 2-D, shape (2, 2).

    They are those of the contact nodes, given in their order, or nodes beside them that are held
    and hence no contact nodes, shape (n, 2).
    """
    points = np.column_stack([table["x"], table["y"]])
    found = points[[0, -1]]
    if len(held) and len(points) > 1:
        for k, (last, before) in enumerate([(0, 1), (-1, -2)]):
            distance = np.linalg.norm(held - points[last], axis=1)
            if distance.min() < 1.5 * np.linalg.norm(points[last] - points[before]):
                found[k] = held[np.argmin(distance)]
    return found


def shares(where: Array, outer: tuple[float, float]) -> Array:
    """Return where the shares of nodes end along Gamma_3, in the order of their positions."""
    along = np.sort(where)
    return np.concatenate([outer[:1], (along[1:] + along[:-1]) / 2, outer[1:]])


def zones(ax: Axes, where: Array, outer: tuple[float, float], status: Any, rows: Array) -> None:
    """Colour the share of each node by its status.

    Parameters
    ----------
    ax
        The axes.
    where, outer
        Positions of the nodes, shape (n,), and where Gamma_3 ends.
    status
        Of the nodes in each row, shape (m, n).
    rows
        Where the rows begin and end, shape (m + 1,); those of one row in shares of the axis.
    """
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


def window(places: Array, touching: NDArray[np.bool_], margin: float) -> tuple[Array, Array]:
    """Return the corners of the part that is shown: all, or a small contact zone's vicinity.

    Parameters
    ----------
    places
        Nodes of Gamma_3, shape (n, k).
    touching
        Which of them are in contact, shape (n,).
    margin
        About all, in shares of the extent.
    """
    extent = float(np.ptp(places, axis=0).max())
    zone = float(np.ptp(places[touching], axis=0).max()) if touching.any() else extent
    room = margin * extent
    if zone < SMALL * extent:
        # A zone of a node or two is seen beside its neighbours.
        apart = KDTree(np.unique(places, axis=0)).query(places[touching], k=2)[0][:, 1].max()
        places, room = places[touching], max(0.4 * zone, 0.02 * extent, BESIDE * apart)
    return places.min(axis=0) - room, places.max(axis=0) + room


def contact_figure(run: Run, look: Look) -> Figure:
    """Draw the contact part: along Gamma_3 in 2-D, along the contact direction in 3-D."""
    figure = draw_line(run, look) if run.plane else draw_surface(run, look)
    if run.title:
        figure.suptitle(fitted(run.title), fontsize="large")
    return figure


def draw_line(run: Run, look: Look) -> Figure:
    """Draw pressure, tangential stress and friction bound along Gamma_3 in the plane."""
    touching = [part["status"] != "open" for part in run.contacts]
    ends_of = shown(run.contacts, run, look, touching)
    pairs = [(p, e) for p, e in zip(run.contacts, ends_of, strict=True) if e is not None]
    parts = [part for part, _ in pairs]
    frictional = bool(np.any(run.table["bound"] > 0))
    narrow = page_width() <= NARROW
    figure = sheet((0.8 if frictional else 0.48) * (1.5 if narrow else 1.0))
    size = (2 if frictional else 1, len(parts))
    grid = figure.subplots(*size, sharex="col", sharey="row", squeeze=False)
    for rows, (part, limits) in zip(grid.T, pairs, strict=True):
        _draw_rows(rows, part, run, limits)
    for ax in grid[:, 1:].ravel():
        ax.set_ylabel("")
    for ax, part in zip(grid[0] if len(parts) > 1 else [], parts, strict=False):
        ax.set_title(str(part["on"][0]), fontsize="medium")
    known: dict[str, Any] = {}
    for ax in grid.ravel():
        known |= {handle.get_label(): handle for handle in ax.get_legend_handles_labels()[0]}
    handles = sorted(known.values(), key=lambda handle: not isinstance(handle, Line2D))
    figure.legend(handles=handles, ncols=2 if narrow else 3, loc="outside lower center")
    return figure


def _draw_rows(rows: Any, table: Table, run: Run, limits: tuple[float, float]) -> None:
    """Draw one contact: pressure, and below it friction, if there is a second row."""
    where, _, whole = position(table, run)
    mark = "o" if len(where) == 1 else ""  # a line of one point is not seen
    bound, tau, units = table["bound"], table["tau"], run.units
    frictional = len(rows) > 1
    order, borders = np.argsort(where), shares(where, whole)
    seen = table["status"][order[(borders[1:] > limits[0]) & (borders[:-1] < limits[1])]]
    inside = where[(where >= limits[0]) & (where <= limits[1])]
    cuts = [end for end in limits if where.min() < end < where.max()]

    def within(values: Array) -> Array:
        """Return the values that are shown: of the nodes, and where the axis cuts the line."""
        return np.interp([*inside, *cuts], where[order], values[order])

    for ax in rows:
        zones(ax, where, whole, table["status"][None], np.array([0.0, 1.0]))
    for zone, (colour, label) in ZONES.items():
        if np.any(seen == zone):
            words = label if frictional else TOUCHING.get(zone, "in contact")
            rows[0].fill_between([], [], color=colour, lw=0, label=words)
    rows[0].plot(where, table["pressure"], color=BLUE, marker=mark, label=r"pressure $-\sigma_\nu$")
    rows[0].set_ylabel(units.label(r"$-\sigma_\nu$", "stress"))
    _focus(rows[0], within(table["pressure"]), 0.0)
    if np.all(seen == "open"):
        _tell_open(rows[0])
    if frictional:
        rows[1].plot(
            where, tau, color=ORANGE, marker=mark, label=r"tangential stress $-\sigma_\tau\cdot t$"
        )
        rows[1].plot(where, bound, "--", color=GREY, lw=0.8, label=r"friction bound $\pm s$")
        rows[1].plot(where, -bound, "--", color=GREY, lw=0.8)
        rows[1].axhline(0.0, color="black", lw=0.4)
        rows[1].set_ylabel(units.label(r"$-\sigma_\tau\cdot t$", "stress"))
        _focus(rows[1], within(bound), -1.0)
    if run.opposite is not None:
        _draw_opposite(rows[0], table, where, run.opposite, limits)
    rows[-1].set_xlabel(along(table, run))
    rows[0].set_xlim(limits)


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


def _tell_open(ax: Axes) -> None:
    """Say that there is no contact, where nothing else is seen."""
    there = {"transform": ax.transAxes, "bbox": {"facecolor": "white", "lw": 0}}
    ax.text(0.5, 0.5, "no contact", ha="center", va="center", **there)


def _focus(ax: Axes, values: Array, low: float) -> None:
    """Limit the axis where a singular corner would hide all else, and name the peak."""
    largest = float(values.max(initial=0.0))
    if largest <= 0:
        ax.set(ylim=(low, 1.0), yticks=[0.0])  # there is no scale
        return
    usual = float(np.quantile(values, 0.97, method="higher")) * 1.6
    top = usual if 0 < usual < 0.7 * largest else 1.05 * largest
    ax.set_ylim(low * top, top)
    if top < largest:
        text = f"peak {largest:.3g}, cut off"
        ax.annotate(text, (0.99, 0.97), xycoords="axes fraction", ha="right", va="top", fontsize=7)


def draw_surface(run: Run, look: Look) -> Figure:
    """Draw pressure, status and friction arrows on Gamma_3 in 3-D, along the contact direction."""
    surface = run.surface
    touching = surface["status"] > STATUS["open"]
    mean = np.nanmean(surface["normal"][touching if touching.any() else slice(None)], axis=0)
    view = sorted(int(k) for k in np.argsort(np.abs(mean))[:2])  # the axes most across it
    sides = [(surface, "contact pressure"), (run.opposite, "on the other side")]
    panels = [(side, name) for side, name in sides if side is not None]
    frictional = bool(np.any(run.table["bound"] > 0))
    panels.append((surface, "status, friction (arrows)" if frictional else "status"))
    places = surface.points[:, view]
    low, high = window(places, touching, 0.13)  # room for the arrows
    limits = [
        look.ends(k, np.min(v), np.max(v), "the contact part") if k < 2 else None
        for k, v in zip(view, places.T, strict=True)
    ]
    for k, ends in enumerate(limits):
        if ends is not None:
            low[k], high[k] = np.clip(ends, places[:, k].min(), places[:, k].max())
    if None in limits and limits != [None, None]:
        _balance(low, high, places, limits.index(None))
    stacked = page_width() < NARROW
    rows, columns = (len(panels), 1) if stacked else (1, len(panels))
    tall = (high - low)[1] / (high - low)[0]
    aspect = float(np.clip(tall, 0.25, 0.8 if stacked else 1.25))
    figure = sheet(rows * (aspect / columns + 0.02) + (2.0 if stacked else 1.5) / page_width())
    figure.set_layout_engine("compressed")
    *lefts, right = figure.subplots(rows, columns, sharey=not stacked, sharex=stacked)
    shown = ScalarMappable(Normalize(0.0, _highest(surface, view, low, high) or 1.0), "viridis")
    letters = 150 / float(matplotlib.rcParams["font.size"]) * page_width() / columns
    letters = int(max(8.0, 0.8 * letters * min(1.0, aspect / tall)))
    x, y = (run.units.label(f"${'xyz'[k]}$", "length") for k in view)
    for ax, (side, name) in zip((*lefts, right), panels, strict=True):
        # Of degree 2 four pieces each.
        skin = side.extract_surface(nonlinear_subdivision=1).triangulate()
        flat, facets = np.asarray(skin.points)[:, view], np.asarray(skin.regular_faces)
        if ax is right:
            _draw_status(ax, flat, facets, skin["status"])
            _draw_friction(ax, skin, view, low, high)
        else:
            known = np.isfinite(skin["pressure"][facets]).all(axis=1)
            drawn = facets[known] if known.any() else facets
            below: dict[str, Any] = {"facecolor": ZONES["open"][0], "lw": 0, "zorder": -2}
            ax.add_collection(PolyCollection(list(flat[facets]), **below))
            if touching.any():
                mesh = Triangulation(*flat.T, drawn)
                smooth(ax, mesh, np.nan_to_num(skin["pressure"]), shown.norm, shown.cmap)
        ax.set_aspect("equal")
        ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel=x, ylabel=y)
        ax.set_title(textwrap.fill(name, letters), fontsize="medium")
        ax.label_outer()
    if not touching.any():
        _tell_open(lefts[0])
    else:
        label = run.units.label(r"$-\sigma_\nu$", "stress")
        bar = {"location": "bottom", "label": label, "aspect": 40, "shrink": 0.8}
        figure.colorbar(shown, ax=[*lefts, right], **bar)
    figure.legend(handles=patches(frictional), ncols=3, loc="outside lower center")
    return figure


def _balance(low: Array, high: Array, places: Array, k: int) -> None:
    """Let an axis whose ends are not asked for show about as much as the other one does.

    About its middle, and within the part; the panels would be slivers otherwise.
    """
    asked = high[1 - k] - low[1 - k]
    middle, span = (low[k] + high[k]) / 2, float(np.clip(high[k] - low[k], asked / 3, 3 * asked))
    ends = np.array([middle - span / 2, middle + span / 2])
    low[k], high[k] = np.clip(ends, places[:, k].min(), places[:, k].max())


def _highest(surface: Any, view: list[int], low: Array, high: Array) -> float:
    """Return the largest pressure that is shown, where facets are cut too."""
    part = surface.extract_surface(nonlinear_subdivision=1)
    for k, *ends in zip(view, low, high, strict=True):
        for above, end in enumerate(ends):
            if part.n_cells:
                part = part.clip("xyz"[k], origin=np.eye(3)[k] * end, invert=above == 1)
    return float(np.nanmax(part["pressure"], initial=0.0)) if part.n_cells else 0.0


def _draw_status(ax: Axes, flat: Array, facets: NDArray[np.int64], status: Array) -> None:
    """Colour the share of each node of triangles by its status, as `zones`."""
    corners = flat[facets]
    middle = np.broadcast_to(corners.mean(axis=1, keepdims=True), corners.shape)
    after, before = (np.roll(corners, k, axis=1) for k in (-1, 1))
    quads = np.stack([corners, (corners + after) / 2, middle, (corners + before) / 2], axis=2)
    known = status[facets] >= STATUS["open"]  # nodes that are held are no contact nodes
    if not known.any():
        return
    order = np.argsort([STATUS[zone] for zone in ZONES])
    halves = 4 * np.arange(known.sum())[:, None, None] + [[0, 1, 2], [0, 2, 3]]
    ax.tripcolor(
        *quads[known].reshape(-1, 2).T,
        halves.reshape(-1, 3),
        np.repeat(order[status[facets][known]], 4),
        shading="gouraud",
        cmap=ListedColormap([colour for colour, _ in ZONES.values()]),
        vmin=-0.5,
        vmax=len(ZONES) - 0.5,
    )


def _draw_friction(ax: Axes, skin: Any, view: list[int], low: Array, high: Array) -> None:
    """Draw friction as arrows between two corners."""
    flat = np.asarray(skin.points)[:, view]
    traction, normal = np.nan_to_num(skin["traction"]), np.nan_to_num(skin["normal"])
    along = traction - np.einsum("ni,ni->n", traction, normal)[:, None] * normal
    friction = along[:, view]
    size = np.linalg.norm(friction, axis=1)
    least = 1e-6 * (high - low)  # less is rounding of the places
    size[np.any((flat < low - least) | (flat > high + least), axis=1)] = 0.0
    # Rounding of the pressures is no friction.
    rounding = 1e-9 * np.linalg.norm(traction, axis=1).max(initial=0.0)
    acting = np.flatnonzero(size > max(1e-6 * size.max(initial=0.0), rounding))
    if acting.size:
        # The first of each cell of a grid of 16 x 16 cells.
        places = flat[acting] - flat[acting].min(axis=0)
        cells = np.floor(16 * places / (places.max() or 1.0))
        chosen = acting[np.unique(cells, axis=0, return_index=True)[1]]
        longest = 0.1 * (high - low).max()
        exact = {"angles": "xy", "scale_units": "xy", "scale": size[chosen].max() / longest}
        ax.quiver(*flat[chosen].T, *friction[chosen].T, color="black", width=0.004, **exact)
