"""Figures beside the closed forms of `indentation.py`: pressure, and the current of a test.

`python3 -m scripts.studies.indentation_figures [--out DIR] [--coarse]`, also under mpirun.

The test: a grounded steel ball on PZT-4, driven at a constant velocity v; Sridhar, Giannakopoulos,
Suresh and Ramamurty (J. Appl. Phys. 85 (1999) 380) measured its current. No measured value is here,
only theory: I = 4 |N_21| sqrt(R) v^1.5 t^0.5.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI

from contact import build_problem, evolve
from contact.results.contact_nodes import contact_table
from contact.results.resultants import charge_balance
from contact.typing import Array
from scripts.reporting import Report, solved, subplots
from scripts.studies.indentation import (
    CURVATURE,
    HALF_ANGLE,
    MOMENTS,
    RADIUS,
    Setting,
    compared,
)

#: Radius of the ball (m), velocities (m/s) and the time that it is driven (s).
BALL, VELOCITIES, TIME = 2e-3, (0.5e-6, 1e-6, 2e-6), 10.0


def pressures(report: Report, fineness: float) -> None:
    """Draw pressure and charge beneath indenters of PZT-4 beside the closed forms. Collective."""
    drawn, axes = subplots(1, 3, size=(7.6, 2.6))
    data: dict[str, Sequence[float]] = {}
    for ax, shape in zip(axes, MOMENTS, strict=True):
        for potential, colour in ((None, "#0072B2"), (0.0, "#D55E00")):
            setting = Setting("PZT-4", shape, potential, fineness)
            solution = solved(setting.case(40.0))
            radius, made = compared(setting, solution).radius, contact_table(solution.contact)
            if made is None:
                continue
            body, kind = setting.body, "insulating" if potential is None else "grounded"
            stiff = body.insulating if potential is None else body.conducting
            x = np.linspace(0.002, 0.9995, 400)
            exact = _pressure(shape, x, stiff, setting.depth, radius)
            if shape == "punch":
                # The one of half spaces at the force that acts: at its depth the box adds 2.4 %.
                force = float(made["weight"] @ made["pressure"])
                exact *= force / (2 * stiff * RADIUS * setting.depth)
            chosen = made["x"] < (0.985 if shape == "punch" else 1.3) * RADIUS
            ax.plot(made["x"][chosen], made["pressure"][chosen], ".", ms=2, color=colour)
            ax.plot(x * radius, exact, lw=0.8, color=colour, label=kind)
            data |= {
                f"r, {shape}, {kind}": made["x"][chosen],
                f"p, {shape}, {kind}": made["pressure"][chosen],
                f"r, {shape}, {kind}, closed form": x * radius,
                f"p, {shape}, {kind}, closed form": exact,
            }
        ax.set_title(shape)
        ax.set_xlabel("$r$ (m)")
        ax.set_ylim(0, {"punch": 20.0, "cone": 80.0, "ball": 9.0}[shape])
    axes[0].set_ylabel("pressure (GPa)")
    axes[0].legend(loc="upper left")
    if MPI.COMM_WORLD.rank == 0:
        drawn.tight_layout()
        caption = (
            "Pressure beneath indenters of PZT-4: nodes, and closed forms (lines) at the computed "
            "contact radius, of the punch at the computed force"
        )
        report.figure("pressure", caption, drawn, data)


def _pressure(shape: str, x: np.ndarray, stiff: float, depth: float, radius: float) -> np.ndarray:
    """Return the pressure of isotropic elasticity with an E*, over r/a."""
    if shape == "punch":
        return np.asarray(stiff * depth / (np.pi * RADIUS) / np.sqrt(1 - x**2))
    if shape == "cone":
        return np.asarray(stiff / 2 / np.tan(np.deg2rad(HALF_ANGLE)) * np.arccosh(1 / x))
    return np.asarray(2 * stiff * radius / (np.pi * CURVATURE) * np.sqrt(1 - x**2))


def charges(velocity: float, times: Array, fineness: float, extent: float) -> Array:
    """Return the charge (C) at times (s) under the ball in a box, in contact radii. Collective.

    Solved for a ball of radius 1: lengths scale with the radius, charges with its square.
    """
    setting = Setting("PZT-4", "ball", 0.0, fineness)
    depth = velocity * TIME / BALL
    problem = build_problem(
        setting.case(extent, f"contact.rigid.displacement=[0.0, {-depth * CURVATURE}]")
    )
    # Driven from nothing at the time 0 to the depth at the time 1.
    found = [
        charge_balance(problem.at(state.time, state.history), state).foundation
        for state in evolve(problem, times / TIME)
    ]
    return -np.array(found) * (BALL / CURVATURE) ** 2


def currents(report: Report, fineness: float, steps: int) -> None:
    """Draw the current of the experiment, and fit its exponents. Collective."""
    times = np.linspace(0, TIME, steps + 1)[1:]
    middle = 0.5 * (times[1:] + times[:-1])
    coefficient = 4 * abs(Setting("PZT-4", "ball").body.inverse[1, 0]) * np.sqrt(BALL)
    drawn, (first, second) = subplots(1, 2, size=(6.0, 2.6))
    data: dict[str, Sequence[float]] = {"t": middle}
    found = []
    for velocity, colour in zip(VELOCITIES, ("#0072B2", "#D55E00", "#009E73"), strict=True):
        # The error by the box is of first order in its size.
        small, large = (charges(velocity, times, fineness, box) for box in (30.0, 60.0))
        current = np.abs(np.diff(2 * large - small)) / np.diff(times)
        theory = coefficient * velocity**1.5 * middle**0.5
        name = f"{velocity * 1e6:g} um/s"
        data |= {f"I, {name}": current, f"I, {name}, theory": theory}
        found.append(current)
        label = f"{velocity * 1e6:g} µm/s"
        first.loglog(middle, 1e9 * current, ".", ms=3, color=colour, label=label)
        first.loglog(middle, 1e9 * theory, lw=0.8, color=colour)
    speeds = np.array(VELOCITIES)
    late = middle > 0.1 * TIME
    of_speed = np.polyfit(np.log(speeds), np.log(np.array(found)[:, late]), 1)[0]
    rows = {
        "v (um/s)": 1e6 * speeds,
        "exponent of t": [np.polyfit(np.log(middle[late]), np.log(i[late]), 1)[0] for i in found],
        "I over theory": [
            np.mean(i[late] / (coefficient * v**1.5 * middle[late] ** 0.5))
            for i, v in zip(found, VELOCITIES, strict=True)
        ],
        "exponent of v": [np.mean(of_speed)] * len(found),
    }
    fine = np.geomspace(speeds[0] / 1.2, speeds[-1] * 1.2)
    for k in np.linspace(0, middle.size - 1, 3).astype(int):
        label = f"{middle[k]:.2g} s"
        second.loglog(1e6 * speeds, 1e9 * np.array(found)[:, k], "o", ms=3, label=label)
        second.loglog(1e6 * fine, 1e9 * coefficient * fine**1.5 * middle[k] ** 0.5, "k", lw=0.8)
    caption = "Current of a grounded ball on PZT-4 at constant velocity"
    report.table("current-exponents", caption, rows, "Fitted from a tenth of the time on.")
    if MPI.COMM_WORLD.rank == 0:
        first.set_xlabel("$t$ (s)")
        first.set_ylabel("current (nA)")
        first.legend(loc="upper left")
        second.set_xlabel("$v$ (µm/s)")
        second.minorticks_off()
        second.set_xticks(1e6 * speeds, [f"{1e6 * v:g}" for v in speeds])
        second.legend(loc="upper left")
        drawn.tight_layout()
        report.figure("current", f"{caption}: computed (points), theory (lines)", drawn, data)


def main(arguments: Sequence[str] | None = None) -> None:
    """Draw the figures."""
    report = Report.of(__doc__, "indentation", arguments)
    fineness = 6.0 if report.coarse else 12.0
    pressures(report, fineness)
    # A current is a difference of charges: the contact's edge wanders from node to node.
    currents(report, 3 * fineness, 10 if report.coarse else 30)


if __name__ == "__main__":
    main()
