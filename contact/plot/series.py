"""Figures over the steps of an evolution, and over the values of a sweep."""

from __future__ import annotations

import csv
import itertools
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from itertools import cycle
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from contact.errors import InputError, nearest
from contact.io.folder import write_whole
from contact.plot.contact import along, patches, position, shown, zones
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
from contact.results.quantities import AXES, ENDS, SUMMARY, SWEEP, is_of, quantities
from contact.typing import Array

#: Parts that move, as the columns of ``steps.csv`` begin, and labels of their displacement.
DRIVEN = {"driven": "mean displacement", "rigid": "displacement"}

#: Colours of several parts that move, by turns.
COLOURS = BLUE, ORANGE, GREEN, SKY, GREY

#: Share of the largest motion from which on a part moves along an axis.
MOVES = 1e-3


def steps_figures(run: Run) -> dict[str, Figure]:
    """Return the figures of an evolution by name.

    The loop is drawn where a part is driven, and zones in 2-D.
    """
    assert run.steps is not None
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
    assert run.steps is not None
    return np.concatenate([[0.0], run.steps[name]])


def draw_loop(run: Run, moves: str) -> Figure:
    """Draw the forces on the parts that move over their displacements, along each axis of these.

    From the origin on: load lines, and loops of shear.
    """
    assert run.steps is not None
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
        for i, (body, colour) in enumerate(zip(bodies, cycle(COLOURS), strict=False)):
            if seen[i, k]:
                force = _course(run, f"{moves}_force_{names[k]}{body}")
                label = body.removeprefix("_") or "foundation"
                ax.plot(ways[i][k], force, "-o", color=colour, markersize=2.5, label=label)
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
    assert run.steps is not None
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
        ax.plot(time, plastic, color=SKY, label="dissipated by plastic flow")
    ax.set_xlabel("time")
    flat = run.axes == "xy"
    words = "energy per unit of depth" if flat else "energy"
    ax.set_ylabel(f"{words}{unit_of('work', run.units, flat)}")
    figure.legend(ncols=1 if narrow else 3, loc="outside lower center")
    ax.grid(alpha=0.25)
    return figure


def draw_zones(run: Run) -> Figure:
    """Draw the status of each node at the end of each step, over its position and the time."""
    where, _, whole = position(run.tables[0], run)
    status = np.array([table["status"] for table in run.tables])
    figure = sheet(0.7)
    ax = figure.subplots()
    zones(ax, where, whole, status, _course(run, "t"))
    ax.set_xlim(shown(run.tables[0], run, (status != "open").any(axis=0)))
    frictional = any(np.any(table["bound"] > 0) for table in run.tables)
    ax.legend(handles=patches(frictional), ncols=3, loc="lower left", bbox_to_anchor=(0, 1))
    ax.set_xlabel(along(run.tables[0], run))
    ax.set_ylabel("time")
    return figure


#: Columns that are drawn by default, as far as they vary.
DRAWN = (
    *(f"contact_force_{axis}" for axis in "xyz"),
    *("max_pressure", "contact_area", "max_displacement", "max_von_mises", "dissipation"),
)
#: Variation over the size of a vector, or number, that is rounding and the tolerance of solves.
ROUNDING = 1e-6
#: Quantities that keys of the case file give, as far as they have a unit, and symbols of others.
KEYS = {
    **dict.fromkeys(("displacement", "normal", "gap", "shortening", "layer"), "length"),
    **dict.fromkeys(("traction", "pressure", "young", "yield_stress"), "stress"),
    **{"force": "force", "potential": "potential", "phi_f": "potential", "charge": "charge"},
}
SYMBOLS = {"mu": r"$\mu$"}
#: Lines, by turns.
LINES = [*itertools.product(("-", "--", ":"), (BLUE, ORANGE, GREEN, SKY, GREY))]


def plot_sweep(
    folder: Path, columns: Sequence[str], formats: Sequence[str], look: Look
) -> list[Path]:
    """Draw ``figure-sweep``, or ``figure-sweep-COLUMN``, from the tables of a sweep; return files.

    Each column has a figure, with a panel for each component, or entry of a table; by default one
    has those of `DRAWN`, and those asked for with ``--columns``, as far as they vary. On one rank.
    """
    swept = _read(folder)
    figures = {f"-{name.replace('/', '-')}": swept.chosen(name) for name in columns}
    figures = figures or {"": swept.default}
    if not all(figures.values()):
        raise InputError(
            f"{folder}: no result of the sweep varies; accepted: --field COLUMN", "sweep-column"
        )
    files = []
    with matplotlib.rc_context(look.style):
        for ending, chosen in figures.items():
            figure = _figure(swept, chosen)
            for kind in formats:
                files.append(folder / f"figure-sweep{ending}.{kind}")
                try:
                    drawn = image(figure, kind)
                    write_whole(files[-1], partial(Path.write_bytes, data=drawn))
                except OSError as error:
                    raise refused(error) from None
    return files


@dataclass(frozen=True)
class Swept:
    """A sweep, as its figures see it.

    Attributes
    ----------
    title, units, kinematics
        Of the case.
    keys, rows
        The swept keys, and the rows of the table as texts.
    """

    title: str
    units: Units
    kinematics: str
    keys: list[str]
    rows: list[dict[str, str]]

    @property
    def columns(self) -> list[str]:
        """The columns of results."""
        return [name for name in self.rows[0] if name not in self.keys]

    @property
    def plane(self) -> bool:
        """Whether the body is plane."""
        return self.kinematics != "axisymmetric" and "contact_force_z" not in self.columns

    def varies(self, name: str) -> bool:
        """Tell whether a column is there and varies, by more than rounding of its vector."""
        base = _parts(name)[0]
        whole = [column for column in self.columns if _parts(column)[0] == base]
        if name not in self.columns:
            return False
        size = max(np.abs(self.values(column)).max() for column in whole)
        return bool(np.ptp(self.values(name)) > ROUNDING * size)

    @property
    def default(self) -> list[str]:
        """The columns that are drawn by default: results that vary, and those asked for."""
        summary = {quantity.name for quantity in quantities(SUMMARY)}
        always = {quantity.name.removesuffix("_AXIS") for quantity in quantities(SWEEP)}

        def asked(name: str) -> bool:
            base = _parts(name)[0]
            return base.partition(".")[0] in summary and ("." in base or base not in always)

        names = [*DRAWN, *filter(asked, self.columns)]
        return [name for name in names if self.varies(name)]

    def chosen(self, key: str) -> list[str]:
        """Return the columns of a key: those that vary, if any does."""
        known = [name for name in self.columns if name != "input"]
        found = [name for name in known if is_of(name, key)]
        if not found:
            raise InputError(
                f"--field {key}: no such column of sweep.csv{nearest(key, known)}; accepted: "
                f"{', '.join(known)}",
                "sweep-column",
            )
        return [name for name in found if len(found) > 1 and self.varies(name)] or found

    def values(self, name: str) -> Array:
        """Return a column of numbers."""
        try:
            return np.array([float(row[name]) for row in self.rows])
        except ValueError:
            raise InputError(
                f"--field {name}: no numbers; accepted: a column of numbers", "sweep-column"
            ) from None

    def label(self, name: str) -> str:
        """Return a column in words, with its unit: a component by its axis."""
        base, entry = _parts(name)
        top = base.partition(".")[0]
        own = {each.name.removesuffix("_AXIS"): each.unit for each in quantities(SWEEP)}
        known = {each.name: each.unit for each in quantities(SUMMARY)}
        words = base.replace(".", ": ").replace("_", " ").replace("von mises", "von Mises stress")
        words = f"largest {words.removeprefix('max ')}" if base.startswith("max_") else words
        unit = unit_of(own.get(base, known.get(top, "")), self.units, self.plane)
        entry = f", ${entry}$" if entry in AXES else f", {entry}" if entry else ""
        return f"{words}{entry}{unit}"

    def key(self, key: str, axis: str = "") -> str:
        """Return a swept key in words, with its unit: ``fixed.0.normal`` is fixed 0: normal."""
        *section, last = key.split(".")
        if last.isdigit() and int(last) < 3:
            axis, last = "xyz"[int(last)], section.pop()
        unit = unit_of(KEYS.get(last, ""), self.units, self.plane)
        of = " ".join(section).replace("_", " ")
        words = SYMBOLS.get(last, last.replace("_", " "))
        return f"{f'{of}: ' if of else ''}{words}{f', ${axis}$' if axis else ''}{unit}"


def _parts(column: str) -> tuple[str, str]:
    """Return the name of a column, and that of an entry."""
    base, _, end = column.rpartition("_")
    return (base, end) if end in AXES + ENDS else (column, "")


def _read(folder: Path) -> Swept:
    """Read the table of a sweep, and the case beside it."""
    path = folder / SWEEP
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            rows = list(csv.DictReader(file, strict=True))
        keys = [*itertools.takewhile(lambda name: name != "converged", rows[0])]
    except (OSError, ValueError, IndexError, csv.Error):
        keys = []
    if not keys or any(None in row.values() for row in rows):
        raise InputError(
            f"{path}: damaged, or no table of a sweep; accepted: a sweep's folder", "sweep-table"
        )
    try:
        case = tomllib.loads(path.with_suffix(".toml").read_text("utf-8"))
        about = case.get("case", {})
        title, units = heading(str(case.get("title", ""))), Units(**about.get("units", {}))
        return Swept(title, units, str(case["space"]["kinematics"]), keys, rows)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        accepted = "the case that a sweep has left beside its table"
        raise InputError(
            f"{path.with_suffix('.toml')}: missing or damaged; accepted: {accepted}", "sweep-toml"
        ) from None


def _places(texts: Sequence[str]) -> tuple[Array, str] | None:
    """Return the numbers of a key, or of the only component that varies, and its axis.

    None for texts, and vectors of which several vary.
    """
    try:
        found = [tomllib.loads(f"value = {text}")["value"] for text in texts]
        numbers = np.array(found, dtype=float)
    except ValueError:
        return None
    if numbers.ndim == 2:
        moving = np.flatnonzero(np.ptp(numbers, axis=0))
        return (numbers[:, moving[0]], "xyz"[moving[0]]) if moving.size == 1 else None
    return (numbers, "") if numbers.ndim == 1 and bool not in map(type, found) else None


def _figure(swept: Swept, drawn: Sequence[str]) -> Figure:
    """Return the figure: a panel for each column."""
    *others, last = swept.keys
    given = [tuple(row[key] for key in others) for row in swept.rows]
    lines = list(dict.fromkeys(given))
    across = 2 if len(drawn) > 1 else 1
    down = -(-len(drawn) // across)
    tall = 0.5 if page_width() < NARROW else 0.4
    more = 0.1 * (len(lines) > 1) + 0.06 * bool(swept.title)
    figure = sheet((tall if across > 1 else 0.66) * down + more)
    panels = np.ravel(figure.subplots(down, across, squeeze=False))
    texts = [row[last] for row in swept.rows]
    places, axis = _places(texts) or (np.array(texts), "")
    for panel, name in zip(panels, drawn, strict=False):
        values = swept.values(name)
        for line, (style, colour) in zip(lines, itertools.cycle(LINES), strict=False):
            own = np.flatnonzero([each == line for each in given])
            if places.dtype.kind == "f":  # texts stand in their own order
                own = own[np.argsort(places[own], kind="stable")]
                panel.xaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
            pairs = zip(others, line, strict=True)
            words = ", ".join(f"{swept.key(k)} = {_short(v)}" for k, v in pairs)
            look: dict[str, Any] = {"linestyle": style, "color": colour, "label": words}
            panel.plot(places[own], values[own], marker="o", markersize=3, **look)
        panel.set_xlabel(swept.key(last, axis))
        panel.set_ylabel(swept.label(name))
        panel.yaxis.set_major_locator(MaxNLocator(5))
        panel.grid(alpha=0.25)
    figure.align_ylabels()
    for panel in panels[len(drawn) :]:
        panel.axis("off")
    if len(lines) > 1:
        handles, labels = panels[0].get_legend_handles_labels()
        columns = 1 if page_width() < NARROW else 2
        figure.legend(handles, labels, loc="outside lower center", ncols=columns)
    if swept.title:
        figure.suptitle(fitted(swept.title), fontsize="large")
    return figure


def _short(text: str) -> str:
    """Return a number with six digits; anything else as it is."""
    try:
        return f"{float(text):.6g}"
    except ValueError:
        return text
