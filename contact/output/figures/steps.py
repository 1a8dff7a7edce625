"""Figures of an evolution: force over displacement, energies, and what the contact nodes do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from contact.output.figures.contact import NARROW, UNNAMED, ZONES, fitted, position
from contact.output.table import Table
from contact.output.units import Units
from contact.typing import Array

#: Names of the figures; the first has no place where nothing is driven, the second in space.
LOOP, MAP, ENERGY = "loop", "zones", "energy"

#: What moves, as the columns of ``steps.csv`` begin, and what axes call its way and itself.
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
        found = {ENERGY: self._energies()}
        for moves, words in DRIVEN.items():
            if f"{moves}_x" in self.rows[0] and LOOP not in found:
                found[LOOP] = self._loop(moves, words, plane, units)
        if plane and len(self.rows) > 1 and "on" not in self.tables[0]:
            found[MAP] = self._zones(axes, units)
        for figure in found.values():
            figure.suptitle(fitted(title), fontsize="large")
        return found

    def _loop(self, moves: str, words: tuple[str, str], plane: bool, units: Units) -> Figure:
        """Draw the force on what moves over its way, from the rest at the origin."""
        names = "xy" if plane else "xyz"
        ways = [np.concatenate([[0.0], self.column(f"{moves}_{axis}")]) for axis in names]
        forces = [np.concatenate([[0.0], self.column(f"{moves}_force_{axis}")]) for axis in names]
        figure, turns = _figure(0.66), []
        for way in ways:
            direction = np.sign(np.diff(way))
            turns.append(np.count_nonzero(direction[1:] * direction[:-1] < 0))
        # Where the part goes to and fro; else where it goes farthest.
        k = int(np.lexsort(([np.ptp(way) for way in ways], turns))[-1])
        ax = figure.subplots()
        ax.plot(ways[k], forces[k], "-o", color="#1F4E79", markersize=2.5)
        ax.set_xlabel(units.label(f"{words[0]} $u_{names[k]}$", "length"))
        ax.set_ylabel(f"force on the {words[1]} along ${names[k]}$")
        ax.grid(alpha=0.25)
        return figure

    def _energies(self) -> Figure:
        narrow = float(matplotlib.rcParams["figure.figsize"][0]) < NARROW
        time = np.concatenate([[0.0], self.column("t")])
        figure = _figure(0.9 if narrow else 0.6)
        ax = figure.subplots()
        work, taken = (
            np.concatenate([[0.0], np.cumsum(self.column(name))])
            for name in ("work", "dissipation")
        )
        stored = np.concatenate([[0.0], self.column("energy")])
        ax.plot(time, work, color="#1F4E79", label="work done")
        ax.plot(time, stored + taken, "--", color="#C55A11", label="stored and taken by friction")
        ax.plot(time, stored, color="#548235", label="stored")
        ax.plot(time, taken, color="#7F7F7F", label="taken by friction")
        ax.set_xlabel("time")
        ax.set_ylabel("energy")
        ax.legend(ncols=1 if narrow else 2, loc="lower left", bbox_to_anchor=(0, 1))
        ax.grid(alpha=0.25)
        return figure

    def _zones(self, axes: str, units: Units) -> Figure:
        """Draw what each node does at the end of each step, over its position and the time."""
        where, name = position(self.tables[0], axes)
        order = np.argsort(where)
        kinds = list(ZONES)
        status = np.array(
            [[kinds.index(str(kind)) for kind in table["status"][order]] for table in self.tables]
        )
        figure = _figure(0.7)
        ax = figure.subplots()
        ax.pcolormesh(
            _edges(where[order]),
            np.concatenate([[0.0], self.column("t")]),
            status,
            cmap=ListedColormap([colour for colour, _ in ZONES.values()]),
            vmin=-0.5,
            vmax=len(kinds) - 0.5,
        )
        handles = [Patch(color=colour, label=words) for colour, words in ZONES.values()]
        ax.legend(handles=handles, ncols=3, loc="lower left", bbox_to_anchor=(0, 1))
        ax.set_xlabel(units.label(f"position ${name}$", "length"))
        ax.set_ylabel("time")
        return figure


def _figure(tall: float) -> Figure:
    width = float(matplotlib.rcParams["figure.figsize"][0])
    return Figure(figsize=(width, tall * width))


def _edges(where: Array) -> Array:
    """Return the borders of the nodes' shares of the contact part, one more than nodes."""
    if where.size == 1:
        return np.array([where[0] - 0.5, where[0] + 0.5])
    middle = (where[1:] + where[:-1]) / 2
    return np.concatenate([[2 * where[0] - middle[0]], middle, [2 * where[-1] - middle[-1]]])
