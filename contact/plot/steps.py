"""Figures of an evolution: force over displacement, energies, and the status of each node."""

from __future__ import annotations

from itertools import cycle

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

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
    page_width,
    sheet,
    unit_of,
)
from contact.typing import Array

#: Parts that move, as the columns of ``steps.csv`` begin, and labels of their displacement.
DRIVEN = {"driven": "mean displacement", "rigid": "displacement"}

#: Colours of several parts that move, by turns.
COLOURS = BLUE, ORANGE, GREEN, SKY, GREY

#: Share of the largest motion from which on a part moves along an axis.
MOVES = 1e-3


def steps_figures(run: Run, look: Look) -> dict[str, Figure]:
    """Return the figures of an evolution by name.

    The loop is drawn where a part is driven, and zones in 2-D.
    """
    assert run.steps is not None
    found = {"energy": draw_energies(run)}
    moves = next((m for m in DRIVEN if any(k.startswith(f"{m}_x") for k in run.steps)), None)
    if moves is not None:
        found["loop"] = draw_loop(run, moves)
    if run.plane and len(run.tables) > 1 and "on" not in run.tables[0]:
        found["zones"] = draw_zones(run, look)
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


def draw_zones(run: Run, look: Look) -> Figure:
    """Draw the status of each node at the end of each step, over its position and the time."""
    where, _, whole = position(run.tables[0], run)
    status = np.array([table["status"] for table in run.tables])
    figure = sheet(0.7)
    ax = figure.subplots()
    zones(ax, where, whole, status, _course(run, "t"))
    (ends,) = shown([run.tables[0]], run, look, [(status != "open").any(axis=0)])
    ax.set_xlim(ends)
    frictional = any(np.any(table["bound"] > 0) for table in run.tables)
    ax.legend(handles=patches(frictional), ncols=3, loc="lower left", bbox_to_anchor=(0, 1))
    ax.set_xlabel(along(run.tables[0], run))
    ax.set_ylabel("time")
    return figure
