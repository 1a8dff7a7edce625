"""The contact figure in space: pressure, stick and slip, friction on the facets of Gamma_3."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray

from contact.output.figures.contact import BLUE, NARROW, ORANGE, UNNAMED, ZONES, fitted
from contact.output.surface import STATUS
from contact.output.units import Units
from contact.output.vtu import VTU
from contact.typing import Array

#: Room for the numbers and the name of an axis, in widths of a letter.
MARGIN = 5.8


def draw_surface(
    surface: VTU, title: str = "", units: Units = UNNAMED, opposite: VTU | None = None
) -> Figure:
    """Draw pressure, status and friction arrows on Gamma_3 in space, facet by facet.

    The arguments are those of `draw_line`.
    """
    view, names = _view(surface)
    panels = [(surface, "contact pressure")]
    if opposite is not None:
        panels.append((opposite, "on the other side"))
    low, high = _shown(surface, surface.grid.points @ view.T)
    title = fitted(title)
    sheet = _Sheet.of(len(panels) + 1, float((high - low)[1] / (high - low)[0]), title)
    figure = Figure(figsize=sheet.size)
    # Placed by hand: the automatic layouts leave no room below axes of equal scale.
    figure.set_layout_engine("none")
    *lefts, right = (figure.add_axes(sheet.panel(k)) for k in range(len(panels) + 1))
    highest = float(np.nanmax(surface.at_points["pressure"], initial=0.0))
    for ax, (side, _) in zip(lefts, panels, strict=True):
        shown = _draw_pressure(ax, side, view, highest)
    figure.colorbar(
        shown, cax=figure.add_axes(sheet.bar), orientation="horizontal",
        label=units.label(r"$-\sigma_\nu$", "stress"),
    )  # fmt: skip
    _draw_status(right, surface, view, 0.1 * float((high - low).max()))
    columns = 1 if len(panels) > 1 and not sheet.stacked else 3
    place = {"loc": "upper center", "bbox_to_anchor": sheet.legend}
    figure.legend(ncols=columns, handletextpad=0.2, **place)
    titles = [*(name for _, name in panels), "status, friction (arrows)"]
    for ax, name in zip((*lefts, right), titles, strict=True):
        ax.set_aspect("equal")
        ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        ax.set_title(name, fontsize="medium")
        ax.set_xlabel(units.label(f"${names[0]}$", "length"))
        if sheet.stacked or ax is lefts[0]:
            ax.set_ylabel(units.label(f"${names[1]}$", "length"))
    if title:
        figure.suptitle(title, fontsize="large", y=sheet.heading)
    return figure


@dataclass(frozen=True)
class _Sheet:
    """Where the panels go: beside each other, on a narrow figure one below the other.

    Attributes
    ----------
    count, stacked
        Number of panels, and whether they are one below the other.
    width, em
        Of the figure and of its letters (inches).
    wide, tall
        Of a panel.
    head
        Of the title.
    """

    count: int
    stacked: bool
    width: float
    em: float
    wide: float
    tall: float
    head: float

    @classmethod
    def of(cls, count: int, aspect: float, title: str) -> _Sheet:
        """Return the sheet for panels of an aspect, as wide as figures are by their settings."""
        head = 1.5 + 1.5 * len(title.splitlines()) if title else 0.5
        width = float(matplotlib.rcParams["figure.figsize"][0])
        em = float(matplotlib.rcParams["font.size"]) / 72
        stacked = width < NARROW
        wide = (width - em) / (1 if stacked else count) - MARGIN * em
        tall = wide * float(np.clip(aspect, 0.25, 0.8 if stacked else 1.25))
        return cls(count, stacked, width, em, wide, tall, head * em)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height of the figure (inches)."""
        rows = self.count if self.stacked else 1
        foot = (7.5 if self.stacked else 5.5) * self.em
        return self.width, self.head + rows * (self.tall + 6 * self.em) + foot

    @property
    def heading(self) -> float:
        """Where the title begins."""
        return 1 - 0.8 * self.em / self.size[1]

    @property
    def bar(self) -> tuple[float, float, float, float]:
        """Place of the colours, below the panels that they are of."""
        last = self.panel(0 if self.stacked else self.count - 2)
        left = MARGIN * self.em / self.width
        below = (5.5 if self.stacked else 4.0) * self.em / self.size[1]
        return left, below, last[0] + last[2] - left, 0.7 * self.em / self.size[1]

    @property
    def legend(self) -> tuple[float, float]:
        """Place of the middle of the legend's upper edge."""
        left, _, wide, _ = self.panel(self.count - 1)
        return left + wide / 2, (2.2 if self.stacked else 5.0) * self.em / self.size[1]

    def panel(self, k: int) -> tuple[float, float, float, float]:
        """Return the place of a panel, in shares of the figure."""
        row, column = (k, 0) if self.stacked else (0, k)
        width, height = self.size
        left = MARGIN * self.em + column * (self.wide + MARGIN * self.em)
        top = self.head + 2 * self.em + row * (self.tall + 6 * self.em)
        bottom = height - top - self.tall
        return left / width, bottom / height, self.wide / width, self.tall / height


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


def _draw_status(ax: Axes, surface: VTU, view: Array, reach: float) -> None:
    """Draw what sticks and slips, and friction as arrows of some length at most."""
    flat = surface.grid.points @ view.T
    ax.add_collection(PolyCollection(list(flat[_triangles(surface)]), facecolor="#F2F2F2", lw=0))
    status = np.asarray(surface.at_points["status"])
    size = float(np.clip(2e3 / len(flat), 0.5, 12))
    for zone, colour in (("open", "#DDDDDD"), ("stick", BLUE), ("slip", ORANGE)):
        chosen = status == STATUS[zone]
        if np.any(chosen):
            ax.scatter(*flat[chosen].T, color=colour, s=size, lw=0, label=ZONES[zone][1])
    _arrows(ax, surface, flat, view, reach)


def _triangles(surface: VTU) -> Any:
    """Return the facets as triangles of nodes, those of degree 2 as four each."""
    cells = surface.grid.cells
    if cells.shape[1] == 3:
        return cells
    quarters = [[0, 5, 4], [5, 1, 3], [4, 3, 2], [3, 4, 5]]
    return np.concatenate([cells[:, corners] for corners in quarters])


def _arrows(ax: Axes, surface: VTU, flat: Array, view: Array, reach: float) -> None:
    """Draw the friction stress, its largest arrow of a given length."""
    traction, normal = (np.asarray(surface.at_points[name]) for name in ("traction", "normal"))
    along = traction - np.einsum("ni,ni->n", traction, normal)[:, None] * normal
    friction = np.nan_to_num(along @ view.T)
    size = np.linalg.norm(friction, axis=1)
    # Rounding of the pressures is no friction.
    rounding = 1e-9 * np.nan_to_num(np.linalg.norm(traction, axis=1)).max(initial=0.0)
    acting = np.flatnonzero(size > max(1e-6 * size.max(initial=0.0), rounding))
    if not acting.size:
        return
    chosen = acting[_thinned(flat[acting], 16)]
    exact = {"angles": "xy", "scale_units": "xy", "scale": size[chosen].max() / reach}
    ax.quiver(*flat[chosen].T, *friction[chosen].T, color="black", width=0.004, **exact)


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


def _shown(surface: VTU, flat: Array) -> tuple[Array, Array]:
    """Return the corners of what is shown: all, or a small piece that touches and its vicinity."""
    touching = flat[np.asarray(surface.at_points["status"]) > STATUS["open"]]
    whole = float(np.ptp(flat, axis=0).max())
    margin = 0.13 * whole  # room for the arrows
    if len(touching) and (size := float(np.ptp(touching, axis=0).max())) < 0.3 * whole:
        flat, margin = touching, max(0.4 * size, 0.02 * whole)
    return flat.min(axis=0) - margin, flat.max(axis=0) + margin


def _thinned(flat: Array, count: int) -> NDArray[np.intp]:
    """Return the first point of each cell of a grid of count x count cells."""
    span = np.ptp(flat, axis=0).max() or 1.0
    cells = np.floor((flat - flat.min(axis=0)) / span * count)
    return np.unique(cells, axis=0, return_index=True)[1]
