"""The drawing of plane bodies, deformed and coloured."""

from __future__ import annotations

from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from mpl_toolkits.axes_grid1 import make_axes_locatable

from contact.output.figures.contact import BLUE, UNNAMED, ends, fitted
from contact.output.figures.picture import Picture, widened
from contact.output.table import Table, by_contact
from contact.output.units import Units
from contact.typing import Array

#: Quantiles of the values at which colours end where some values lie far beyond.
OUTLIERS = (0.005, 0.995)

#: Openings of less than this part of the drawing are not seen in it.
SEEN = 0.005

#: Part of the drawing's width from which on a boundary has a strip of its own.
WIDE = 0.25

#: Scaled gaps up to this part of Gamma_3 are drawn.
FAR = 0.2

#: Height of the strip beneath that shows them (inches).
STRIP = 0.75


def draw_plane(
    picture: Picture,
    table: Table,
    title: str = "",
    axes: str = "xy",
    mirrored: bool = False,
    units: Units = UNNAMED,
) -> Figure:
    """Draw a plane body over its outline at rest and the foundation.

    Where it lifts off by less than can be seen at the scale of the displacements, the opening is
    drawn beneath at its own.

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
    lifted = None if mirrored else _lift_off(picture, table)
    strip = 0.0 if lifted is None else STRIP
    head = with_scale(title, picture.scale)
    more = 0.02 * float(matplotlib.rcParams["font.size"]) * head.count("\n")
    size = inches, tall * inches + 1.4 + strip + more
    # Made for axes of equal scale, whose title it leaves room for; it knows of no strip beneath.
    figure = Figure(figsize=size, layout="compressed" if lifted is None else "constrained")
    ax = figure.subplots()
    # Dashes would be those of an edge each: none where edges are short.
    rest = {"colors": "black", "lw": 0.5}
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
    ax.set_title(head, fontsize="medium")
    if lifted is not None:
        _strip(ax, *lifted, units)
    return figure


def _strip(ax: Axes, where: Array, opening: Array, units: Units) -> None:
    """Draw an opening beneath the body, at a scale of its own."""
    below = make_axes_locatable(ax).append_axes("bottom", STRIP - 0.1, pad=0.1, sharex=ax)
    below.fill_between(where, opening, color=BLUE, lw=0.8)
    most = opening.max()
    below.set_yticks([])  # their labels have no room: the axes stands outside of the layout
    below.set_ylim(0.0, 2.0 * most)
    said = f"{units.label('opening', 'length')}, at most {most:.2g}"
    below.text(0.01, 0.93, said, transform=below.transAxes, va="top", fontsize="small")
    below.set_xlabel(ax.get_xlabel())
    ax.set_xlabel("")
    ax.tick_params(labelbottom=False)


def _lift_off(picture: Picture, table: Table) -> tuple[Array, Array] | None:
    """Return x and how far a straight Gamma_3 is open there, if that is too little to be seen."""
    x, opening = np.asarray(table["x"]), np.asarray(table["gap"] - table["u_n"])
    opening = np.where(table["status"] == "open", np.maximum(opening, 0.0), 0.0)
    seen = picture.scale * opening.max(initial=0.0) / np.ptp(picture.box, axis=0).max()
    width = np.ptp(picture.box[:, 0])
    level = np.ptp(x) > WIDE * width and np.ptp(table["y"]) <= 1e-9 * np.ptp(x) and "entry" in table
    alone = level and np.ptp(table["entry"]) == 0 and np.all(table["rigid"])
    return (x, opening) if alone and 0 < seen < SEEN else None


def _ranged(shown: Any, picture: Picture) -> str:
    """Keep singular corners from spending all the colours; return the label, which says so."""
    if picture.limits is not None:
        shown.set_clim(*picture.limits)
        return picture.label
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
    shown.set_clim(*widened(*range_))
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
    """Draw the foundation as far as it faces Gamma_3, moved as the displacements are scaled.

    Not where it is far: gaps to a curved shape, scaled like the displacements, are no shape.
    """
    points = np.column_stack([table["x"], table["y"]])
    normal, gap = np.column_stack([table["nu_x"], table["nu_y"]]), table["gap"] + table["moved"]
    points = np.concatenate([edges[:1], points, edges[1:]])
    normal = np.concatenate([normal[:1], normal, normal[-1:]])
    gap = np.concatenate([gap[:1], gap, gap[-1:]])
    points, normal = points * [side, 1], normal * [side, 1]
    surface = points + scale * gap[:, None] * normal
    extent = np.ptp(points, axis=0).max()
    near = np.flatnonzero((scale == 1) | (scale * gap <= max(FAR * extent, 2 * scale * gap.min())))
    for run in np.split(near, np.flatnonzero(np.diff(near) > 1) + 1):
        ax.plot(*surface[run].T, color="black", lw=0.5)
        band = np.concatenate([surface[run], (surface + 0.03 * extent * normal)[run[::-1]]])
        ax.fill(*band.T, facecolor="none", edgecolor=BLUE, hatch="////", lw=0)


def with_scale(title: str, scale: float) -> str:
    """Return a title that says by what displacements are multiplied."""
    times = rf"displacements $\times$ {scale:g}" if scale != 1 else "displacements to scale"
    return fitted(f"{title} ({times})" if title else times)
