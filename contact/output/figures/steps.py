"""Figures of an evolution: force over displacement, energies, and the status of each node."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from contact.output.figures.contact import position
from contact.output.figures.style import (
    BLUE,
    GREEN,
    GREY,
    NARROW,
    ORANGE,
    UNNAMED,
    ZONES,
    fitted,
    page_width,
    sheet,
)
from contact.output.options import Units
from contact.output.table import Table
from contact.typing import Array

#: Names of the figures: the first is drawn where a part is driven, the second in 2-D.
LOOP, MAP, ENERGY = "loop", "zones", "energy"

#: Parts that move, as the columns of ``steps.csv`` begin; labels of their displacement, and names.
DRIVEN = {"driven": ("mean displacement", "part"), "rigid": ("displacement", "foundation")}


@dataclass(frozen=True)
class Course:
    """The steps of an evolution.

    Attributes
    ----------
    rows
        The rows of ``steps.csv``.
    tables
        The contact nodes at the end of each step.
    """

    rows: Sequence[Mapping[str, float]]
    tables: Sequence[Table]

    def column(self, name: str) -> Array:
        """Return a column of ``steps.csv``, shape (steps,)."""
        return np.array([row[name] for row in self.rows], dtype=float)

    def draw(
        self, plane: bool, title: str, axes: str = "xy", units: Units = UNNAMED
    ) -> dict[str, Figure]:
        """Return the figures by name.

        Parameters
        ----------
        plane
            Whether the body is plane.
        title
            Of the figures.
        axes
            Names of the coordinates of a plane mesh.
        units
            Names of the units, for labels.
        """
        # Forces of plane bodies are those of a unit of thickness.
        power = 1 if plane and axes == "xy" else 2
        found = {ENERGY: self._energies(_product(units, power + 1))}
        for moves, words in DRIVEN.items():
            if f"{moves}_x" in self.rows[0] and LOOP not in found:
                found[LOOP] = self._loop(moves, words, plane, units, _product(units, power))
        if plane and len(self.rows) > 1 and "on" not in self.tables[0]:
            found[MAP] = self._zones(axes, units)
        for figure in found.values():
            figure.suptitle(fitted(title), fontsize="large")
        return found

    def _loop(
        self, moves: str, words: tuple[str, str], plane: bool, units: Units, unit: str
    ) -> Figure:
        """Draw the force on the part that moves over its displacement, from the origin on."""
        names = "xy" if plane else "xyz"
        ways = [np.concatenate([[0.0], self.column(f"{moves}_{axis}")]) for axis in names]
        forces = [np.concatenate([[0.0], self.column(f"{moves}_force_{axis}")]) for axis in names]
        turns = []
        for way in ways:
            direction = np.sign(np.diff(way))
            turns.append(np.count_nonzero(direction[1:] * direction[:-1] < 0))
        # Where the part turns back most often; else where it goes farthest.
        k = int(np.lexsort(([np.ptp(way) for way in ways], turns))[-1])
        figure = sheet(0.66)
        ax = figure.subplots()
        ax.plot(ways[k], forces[k], "-o", color=BLUE, markersize=2.5)
        ax.set_xlabel(units.label(f"{words[0]} $u_{names[k]}$", "length"))
        ax.set_ylabel(f"force on the {words[1]} along ${names[k]}${unit}")
        ax.grid(alpha=0.25)
        return figure

    def _energies(self, unit: str) -> Figure:
        """Draw the work of loads and supports, the elastic energy and the dissipation."""
        narrow = page_width() < NARROW
        time = np.concatenate([[0.0], self.column("t")])
        work, taken = (
            np.concatenate([[0.0], np.cumsum(self.column(name))])
            for name in ("work", "dissipation")
        )
        stored = np.concatenate([[0.0], self.column("energy")])
        figure = sheet(0.9 if narrow else 0.6)
        ax = figure.subplots()
        ax.plot(time, work, color=BLUE, label="work done")
        ax.plot(time, stored + taken, "--", color=ORANGE, label="stored and dissipated")
        ax.plot(time, stored, color=GREEN, label="stored")
        ax.plot(time, taken, color=GREY, label="dissipated by friction")
        ax.set_xlabel("time")
        ax.set_ylabel(f"energy{unit}")
        ax.legend(ncols=1 if narrow else 2, loc="lower left", bbox_to_anchor=(0, 1))
        ax.grid(alpha=0.25)
        return figure

    def _zones(self, axes: str, units: Units) -> Figure:
        """Draw the status of each node at the end of each step, over its position and the time."""
        where, name = position(self.tables[0], axes)
        order = np.argsort(where)
        kinds = list(ZONES)
        status = np.array(
            [[kinds.index(str(kind)) for kind in table["status"][order]] for table in self.tables]
        )
        figure = sheet(0.7)
        ax = figure.subplots()
        ax.pcolormesh(
            _edges(where[order]),
            np.concatenate([[0.0], self.column("t")]),
            status,
            cmap=ListedColormap([colour for colour, _ in ZONES.values()]),
            vmin=-0.5,
            vmax=len(kinds) - 0.5,
            rasterized=True,
        )
        handles = [Patch(color=colour, label=words) for colour, words in ZONES.values()]
        ax.legend(handles=handles, ncols=3, loc="lower left", bbox_to_anchor=(0, 1))
        ax.set_xlabel(units.label(f"position ${name}$", "length"))
        ax.set_ylabel("time")
        return figure


def _product(units: Units, power: int) -> str:
    """Return the unit of stress times a power of length in parentheses, if both are named."""
    if not units.stress or not units.length:
        return ""
    return f" ({units.stress} {units.length}{f'$^{power}$' if power > 1 else ''})"


def _edges(where: Array) -> Array:
    """Return the borders of the nodes' shares of the contact part, one more than nodes."""
    if where.size == 1:
        return np.array([where[0] - 0.5, where[0] + 0.5])
    middle = (where[1:] + where[:-1]) / 2
    return np.concatenate([[2 * where[0] - middle[0]], middle, [2 * where[-1] - middle[-1]]])
