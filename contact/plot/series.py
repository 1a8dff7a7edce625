"""Figures over the steps of an evolution, and over the values of a sweep."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray

from contact.errors import InputError, nearest
from contact.io.folder import write_whole
from contact.io.tables import read_rows
from contact.plot.contact import patches, position, shown, zones
from contact.plot.run import Run
from contact.plot.style import (
    BLUE,
    GREEN,
    GREY,
    NARROW,
    ORANGE,
    SKY,
    Look,
    fitted,
    heading,
    image,
    page_width,
    sheet,
    unit_of,
)
from contact.ranks import refused
from contact.results.options import Units
from contact.results.quantities import quantities
from contact.results.quantity import AXES, ENDS, SUMMARY, SWEEP, is_of
from contact.typing import Array

#: Parts that move, as the columns of ``steps.csv`` begin, and labels of their displacement.
DRIVEN = {"driven": "mean displacement", "rigid": "displacement"}

#: Share of the largest motion from which on a part moves along an axis.
MOVES = 1e-3

#: Columns of a sweep that are drawn by default, as far as they vary.
DRAWN = (
    *(f"contact_force_{axis}" for axis in "xyz"),
    *("max_pressure", "contact_area", "max_displacement", "max_von_mises", "dissipation"),
)
#: Variation over the size of a vector, or number, that is rounding and the tolerance of solves.
ROUNDING = 1e-6


def steps_figures(run: Run) -> dict[str, Figure]:
    """Return the figures of an evolution by name: a loop of driven parts, zones in 2-D."""
    found = {"energy": draw_energies(run)}
    moves = next((m for m in DRIVEN if any(k.startswith(f"{m}_x") for k in run.steps)), None)
    if moves is not None:
        found["loop"] = draw_loop(run, moves)
    if run.plane and len(run.tables) > 1 and "on" not in run.tables[0]:
        found["zones"] = draw_zones(run)
    for figure in found.values():
        figure.suptitle(fitted(run.title), fontsize="large")
    return found


def _course(run: Run, name: str) -> Array:
    """Return a column of ``steps.csv`` after its value 0 in the reference configuration."""
    return np.concatenate([[0.0], run.steps[name]])


def draw_loop(run: Run, moves: str) -> Figure:
    """Draw the forces on the parts that move over their displacements, along each axis of these."""
    names = "xyz"[: len(run.axes)]
    bodies = [
        name.removeprefix(f"{moves}_x") for name in run.steps if name.startswith(f"{moves}_x")
    ]
    ways = [[_course(run, f"{moves}_{axis}{body}") for axis in names] for body in bodies]
    sizes = np.ptp(np.array(ways), axis=2)
    seen = sizes >= MOVES * sizes.max()
    chosen = np.flatnonzero(seen.any(axis=0))
    words, count = DRIVEN[moves], chosen.size
    narrow = page_width() < NARROW
    across = 1 if narrow else min(count, 2)
    down = -(-count // across)
    figure = sheet(down * (0.85 if narrow else 0.66 if across == 1 else 0.47))
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for spare in panels[count:]:
        spare.axis("off")
    unit = unit_of("force", run.units, run.axes == "xy")
    for ax, k in zip(panels, chosen, strict=False):
        for i, body in enumerate(bodies):
            if seen[i, k]:
                force = _course(run, f"{moves}_force_{names[k]}{body}")
                label = body.removeprefix("_") or "foundation"
                ax.plot(ways[i][k], force, "-o", color=f"C{i}", markersize=2.5, label=label)
        ax.xaxis.set_major_locator(MaxNLocator(6 - across, steps=[1, 2, 5, 10]))
        ax.set_xlabel(run.units.label(f"{words} $u_{run.axes[k]}$", "length"))
        ax.set_ylabel(f"force along ${run.axes[k]}${unit}")
        ax.grid(alpha=0.25)
        if len(bodies) > 1:
            ax.legend()
    return figure


def draw_energies(run: Run) -> Figure:
    """Draw the work of loads and supports, the stored energy and the dissipated one."""
    narrow = page_width() < NARROW
    time, stored = _course(run, "t"), _course(run, "energy")
    work, taken = (np.cumsum(_course(run, name)) for name in ("work", "dissipation"))
    flows = "plastic_dissipation" in run.steps
    plastic = np.cumsum(_course(run, "plastic_dissipation")) if flows else 0 * taken
    figure = sheet(0.9 if narrow else 0.6)
    ax = figure.subplots()
    ax.plot(time, work, color=BLUE, label="work done")
    loses = flows or bool(taken.any())
    if loses:
        ax.plot(time, stored + taken + plastic, "--", color=ORANGE, label="stored and dissipated")
    ax.plot(time, stored, "-" if loses else "--", color=GREEN, label="stored")
    if taken.any():
        ax.plot(time, taken, color=GREY, label="dissipated by friction")
    if flows:
        ax.plot(time, plastic, color=SKY, label="dissipated in the materials")
    ax.set_xlabel("time")
    flat = run.axes == "xy"
    words = "energy per unit of depth" if flat else "energy"
    ax.set_ylabel(f"{words}{unit_of('work', run.units, flat)}")
    figure.legend(ncols=1 if narrow else 3, loc="outside lower center")
    ax.grid(alpha=0.25)
    return figure


def draw_zones(run: Run) -> Figure:
    """Draw the status of each node at the end of each step, over its position and the time."""
    where, label, whole = position(run.tables[0], run)
    status = np.array([table["status"] for table in run.tables])
    figure = sheet(0.7)
    ax = figure.subplots()
    zones(ax, where, whole, status, _course(run, "t"))
    ax.set_xlim(shown(run.tables[0], run, (status != "open").any(axis=0)))
    frictional = any(np.any(table["bound"] > 0) for table in run.tables)
    ax.legend(handles=patches(frictional), ncols=3, loc="lower left", bbox_to_anchor=(0, 1))
    ax.set_xlabel(label)
    ax.set_ylabel("time")
    return figure


@dataclass(frozen=True)
class Swept:
    """The table of a sweep, with title and units of its case."""

    keys: list[str]  #: the swept ones
    rows: list[dict[str, str]]
    title: str = ""
    units: Units = field(default_factory=Units)
    plane: bool = False  #: whether results are those of a unit of thickness

    def chosen(self, key: str) -> list[str]:
        """Return the columns of a key: those that vary, if any does."""
        known = [name for name in self.rows[0] if name not in (*self.keys, "input")]
        found = [name for name in known if is_of(name, key)]
        if not found:
            raise InputError(
                f"--field {key}: no such column of sweep.csv{nearest(key, known)}; accepted: "
                f"{', '.join(known)}",
                "sweep-column",
            )
        return [name for name in found if len(found) > 1 and self.varies(name)] or found

    @property
    def default(self) -> list[str]:
        """The columns that are drawn by default: results that vary, and those asked for."""
        always = {quantity.name.removesuffix("_AXIS") for quantity in quantities(SWEEP)}
        summary = {quantity.name for quantity in quantities(SUMMARY)}
        names = [*DRAWN]
        for name in self.rows[0]:
            base = _parts(name)[0]
            if base.split(".")[0] in summary and ("." in base or base not in always):
                names.append(name)
        return [name for name in names if self.varies(name)]

    def varies(self, name: str) -> bool:
        """Tell whether a column varies, by more than rounding of its vector."""
        if name not in self.rows[0]:
            return False
        whole = [self.values(k) for k in self.rows[0] if _parts(k)[0] == _parts(name)[0]]
        return bool(np.ptp(self.values(name)) > ROUNDING * np.abs(whole).max())

    def values(self, name: str) -> Array:
        """Return a column of numbers."""
        try:
            return np.array([float(row[name]) for row in self.rows])
        except ValueError:
            raise InputError(
                f"--field {name}: no numbers; accepted: a column of numbers", "sweep-column"
            ) from None

    def label(self, name: str) -> str:
        """Return a column in words, with its unit."""
        base, entry = _parts(name)
        units = {q.name.removesuffix("_AXIS"): q.unit for q in quantities(SWEEP)}
        known = {q.name: q.unit for q in quantities(SUMMARY)} | units
        unit = known.get(base, known.get(base.split(".")[0], ""))
        words = f"{base} {entry}".rstrip().replace(".", " ").replace("_", " ")
        return words + unit_of(unit, self.units, self.plane)


def _parts(column: str) -> tuple[str, str]:
    """Return the name of a column, and that of an entry."""
    base, _, end = column.rpartition("_")
    return (base, end) if end in AXES + ENDS else (column, "")


def read_sweep(folder: Path) -> Swept:
    """Read the table of a sweep, and the case beside it."""
    path = folder / SWEEP
    try:
        header, rows = read_rows(path)
        keys = header[: header.index("converged")]
    except (OSError, ValueError):
        keys, rows = [], []
    if not keys or not rows:
        raise InputError(
            f"{path}: damaged, or no table of a sweep; accepted: a sweep's folder", "sweep-table"
        )
    try:
        case = tomllib.loads(path.with_suffix(".toml").read_text("utf-8"))
        units = Units(**case.get("case", {}).get("units", {}))
        plane = case["space"]["kinematics"] != "axisymmetric" and "contact_force_z" not in header
        return Swept(keys, rows, heading(str(case.get("title", ""))), units, plane)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        accepted = "the case that a sweep has left beside its table"
        raise InputError(
            f"{path.with_suffix('.toml')}: missing or damaged; accepted: {accepted}", "sweep-toml"
        ) from None


def plot_sweep(
    folder: Path, columns: Sequence[str], formats: Sequence[str], look: Look
) -> list[Path]:
    """Draw ``figure-sweep``, or ``figure-sweep-COLUMN`` each; return the files. On one rank."""
    swept, files = read_sweep(folder), []
    figures = {f"-{name.replace('/', '-')}": swept.chosen(name) for name in columns}
    figures = figures or {"": swept.default}
    if not all(figures.values()):
        raise InputError(
            f"{folder}: no result of the sweep varies; accepted: --field COLUMN", "sweep-column"
        )
    with matplotlib.rc_context(look.style):
        for ending, chosen in figures.items():
            figure = sweep_figure(swept, chosen)
            for kind in formats:
                files.append(folder / f"figure-sweep{ending}.{kind}")
                try:
                    drawn = image(figure, kind)
                    write_whole(files[-1], partial(Path.write_bytes, data=drawn))
                except OSError as error:
                    raise refused(error) from None
    return files


def sweep_figure(swept: Swept, drawn: Sequence[str]) -> Figure:
    """Draw a panel for each column over the last key, a line for each value of the others."""
    *others, last = swept.keys
    lines: dict[str, list[int]] = {}
    for i, row in enumerate(swept.rows):
        lines.setdefault(", ".join(f"{key} = {row[key]}" for key in others), []).append(i)
    places = _places([row[last] for row in swept.rows])
    across = min(len(drawn), 2)
    down = -(-len(drawn) // across)
    figure = sheet(0.45 * down * (1.5 if across == 1 else 1.0) + 0.05 * len(lines))
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for panel, name in zip(panels, drawn, strict=False):
        values = swept.values(name)
        for words, own in lines.items():
            order = np.array(own)
            if places.dtype.kind == "f":  # texts stand in their own order
                order = order[np.argsort(places[order], kind="stable")]
            panel.plot(places[order], values[order], marker="o", markersize=3, label=words)
        panel.set(xlabel=last, ylabel=swept.label(name))
        if places.dtype.kind == "f":
            panel.xaxis.set_major_locator(MaxNLocator(5))
        panel.grid(alpha=0.25)
    for panel in panels[len(drawn) :]:
        panel.axis("off")
    if others:
        figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center")
    figure.suptitle(fitted(swept.title), fontsize="large")
    return figure


def _places(texts: Sequence[str]) -> NDArray[Any]:
    """Return the values of a key: numbers, the only component of a vector that varies, or texts."""
    try:
        numbers = np.array([tomllib.loads(f"v = {text}")["v"] for text in texts], dtype=float)
    except ValueError:
        return np.array(texts)
    moving = np.flatnonzero(np.ptp(numbers, axis=0)) if numbers.ndim == 2 else np.arange(0)
    if moving.size == 1:
        return numbers[:, moving[0]]
    return numbers if numbers.ndim == 1 else np.array(texts)
