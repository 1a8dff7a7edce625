"""Flow theory beside closed forms and other codes, Newton's convergence, and Hencky's law.

`python3 -m scripts.studies.plasticity [--out DIR] [--coarse]`; the page is docs/plasticity.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from contact import Case, NewtonOptions, Solution, load_case, parse_case, solve
from contact.typing import Array
from forms.hencky import UserLaw
from forms.ops import Value, maximum
from scripts.cases import CASES
from scripts.reporting import Report, append, options, solved, subplots

YOUNG, POISSON, YIELD = 200e3, 0.3, 250.0
STEEL = {"law": "j2", "young": YOUNG, "poisson": POISSON, "yield_stress": YIELD}
EFFECTIVE = YOUNG / (1 - POISSON**2)
ELEMENTS = {"P1": (1, "standard"), "P2": (2, "standard"), "P2, mean": (2, "mean_dilatation")}

#: Radius of the ball and of the cylinder in the study of first yield (mm).
RADIUS = 10.0
#: Largest pressure at first yield over Y, and its depth over the contact radius, at nu = 0.3.
FIRST_YIELD = {"ball": (1.61280, 0.4809), "cylinder": (1.79367, 0.7043)}

#: Depth over that of first yield; force over that of first yield by an independent code, and by the
#: fit of Kogut and Etsion, J. Appl. Mech. 69 (2002) 657.
BALL = {
    1.9: (2.574, 2.571),
    3.0: (4.933, 4.929),
    5.0: (9.977, 10.21),
    7.5: (17.27, 17.84),
    10.0: (25.29, 25.66),
}


def indentation(foundation: dict[str, Any], rigid: dict[str, Any], **more: Any) -> Case:
    """Return the case of a rigid foundation on the middle of a half plane that is meshed in half.

    Parameters
    ----------
    foundation, rigid
        Keys of the contact.
    more
        Other sections.
    """
    return parse_case(
        {
            "material": STEEL,
            "fixed": [
                {"on": "axis", "displacement": [0.0, "free"]},
                {"on": ["bottom", "side"], "displacement": [0.0, 0.0]},
            ],
            "contact": {
                "on": "contact",
                "direction": "axis",
                "axis": [0.0, 1.0],
                "foundation": foundation,
                "rigid": {**rigid, "amplitude": "press"},
            },
            **more,
        }
    )


def punch(size: float, element: str) -> Case:
    """Return a flat punch of half width 1 that is pressed in by far more than it takes to yield."""
    degree, kind = ELEMENTS[element]
    return indentation(
        {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, -1.0]},
        {"displacement": [0.0, -0.04]},
        mesh={
            **{"generator": "half_space", "radius": 1.0, "extent": 4.0, "growth": 0.15},
            **{"size": 0.8, "contact_size": size, "edge_size": size / 20},
        },
        space={"degree": degree, "element": kind},
        evolution={
            "times": [0.0, 0.25, 1.0],
            "steps": [8, 8],
            "amplitudes": {"press": {"time": [0.0, 1.0], "value": [0.0, 1.0]}},
        },
    )


def prandtl(report: Report, coarse: bool) -> None:
    """Make the table of limit loads of a punch. Collective."""
    limit = (2 + np.pi) / np.sqrt(3)
    columns: dict[str, list[Any]] = {
        name: [] for name in ("element", "size", "unknowns", "steps", "p/Y", "over the limit")
    }
    for element in ELEMENTS:
        for size in (0.2,) if coarse else (0.2, 0.1, 0.05):
            solution = solved(punch(size, element))
            force = abs(float(solution.steps[-1].row["contact_force_y"])) / YIELD
            unknowns = solution.problem.equilibrium.layout.unknowns
            row = element, size, unknowns, len(solution.steps), force, force / limit - 1
            append(columns, *row)
    report.table(
        "prandtl",
        "Limit pressure of a flat punch without friction beside (2 + pi) Y/sqrt(3) = 2.9685 Y",
        columns,
        "Plane strain, half width 1, no hardening, pressed in by 0.04 in 16 steps; elements of the "
        "given size beside the punch, of a twentieth at its edge. More steps: some were halved. "
        "P1 locks, and its force goes on to grow.",
    )


def first_yield(shape: str, fineness: float) -> tuple[float, float]:
    """Return the largest pressure at first yield over Y, and the depth over the contact radius.

    The force grows in steps of 0.01 Y of the largest Hertzian pressure, whose middle counts.

    Parameters
    ----------
    shape
        "ball" or "cylinder".
    fineness
        Elements on the contact radius.
    """
    known, _ = FIRST_YIELD[shape]
    pressures = known - 0.105 + 0.01 * np.arange(22)
    ball = shape == "ball"

    def force(pressure: Array) -> Array:
        """Return the force of a largest pressure over Y, of the meshed half of the cylinder."""
        if ball:
            return np.pi**3 * RADIUS**2 * (pressure * YIELD) ** 3 / (6 * EFFECTIVE**2)
        return np.pi * RADIUS * (pressure * YIELD) ** 2 / (2 * EFFECTIVE)

    # Of a ball a = pi p R/(2 E*), of a cylinder 2 p R/E*.
    a = (np.pi / 2 if ball else 2) * known * YIELD * RADIUS / EFFECTIVE
    forces = force(pressures)
    times = [float(k) for k in range(forces.size + 1)]
    case = indentation(
        {"shape": "paraboloid", "apex": [0.0, 0.0], "axis": [0.0, 1.0], "radius": RADIUS},
        {"displacement": [0.0, "free"], "force": [0.0, -1.0]},
        mesh={
            **{"generator": "half_space", "radius": 1.5 * a, "extent": 60 * a, "size": 15 * a},
            **{"contact_size": a / fineness, "edge_size": a / fineness, "growth": 0.2},
        },
        space={"degree": 2, **({"kinematics": "axisymmetric"} if ball else {})},
        evolution={
            "times": times,
            "steps": [1] * forces.size,
            "amplitudes": {"press": {"time": times, "value": [0.0, *forces.tolist()]}},
        },
    )
    solution = solved(case)
    laws = solution.problem.equilibrium.laws
    for k, step in enumerate(solution.steps):
        # The history of a state is that before its step.
        after = solution.problem.at(step.state.time, step.state.history).commit(step.state)
        strain = after.arrays()["material.equivalent_plastic_strain"]
        if strain.max() > 0:
            # The stress is flat at its maximum: the middle of the plastic zone.
            depth = -np.average(laws.places[:, 1], weights=strain * laws.volumes)
            pressure = pressures[k] - 0.005
            return float(pressure), float(depth / (a * pressure / known))
    raise ValueError(f"{shape}: nothing has yielded")


def ball_and_cylinder(report: Report, coarse: bool) -> None:
    """Make the table of first yield under Hertzian contact."""
    columns: dict[str, list[Any]] = {
        name: [] for name in ("body", "elements", "p_0/Y", "closed form", "depth/a", "closed form ")
    }
    for shape, known in FIRST_YIELD.items():
        for fineness in (6,) if coarse else (6, 12, 24):
            pressure, depth = first_yield(shape, fineness)
            append(columns, shape, fineness, pressure, known[0], depth, known[1])
    report.table(
        "first-yield",
        "First yield under a rigid ball and a rigid cylinder, nu = 0.3",
        columns,
        "The largest Hertzian pressure of the force at which the first point yields, and its "
        "depth; P2, elements on the contact radius. The force grows in steps of 0.01 Y.",
    )


def pressed_ball(report: Report, coarse: bool) -> None:
    """Make the table of forces on a ball that is pressed into steel that yields. Collective."""
    # The case's mesh, or one of twice the size.
    changes = ["mesh.contact_size=0.008", "mesh.edge_size=0.008"] if coarse else []
    solution = solved(load_case(CASES / "ball-in-steel.toml", changes))
    depth = (np.pi * FIRST_YIELD["ball"][0] * YIELD / (2 * EFFECTIVE)) ** 2 * RADIUS
    first = 4 / 3 * EFFECTIVE * np.sqrt(RADIUS) * depth**1.5
    moved = np.array([-float(step.row["rigid_y"]) for step in solution.steps]) / depth
    forces = np.array([abs(float(step.row["contact_force_y"])) for step in solution.steps]) / first
    columns: dict[str, list[Any]] = {
        name: []
        for name in ("w/w_c", "P/P_c", "another code", "over it", "Kogut and Etsion", "over that")
    }
    for w, (other, fit) in BALL.items():
        # The loading steps come first; the case's steps end within .1 % of these depths.
        k = int(np.argmin(np.abs(moved - w)))
        force = forces[k] * (w / moved[k]) ** 1.3
        append(columns, w, force, other, force / other - 1, fit, force / fit - 1)
    report.table(
        "ball",
        "Force on a rigid ball over that of first yield",
        columns,
        "`ball-in-steel.toml`, seven elements on the contact radius of first yield, no hardening. "
        "The fit of Kogut and Etsion is one for a deformable ball, +-5 %.",
    )


def block(law: str, **more: Any) -> Case:
    """Return a block that is pressed on a foundation with friction, sheared, and unloaded."""
    driven = ["4e-3*min(max(t-1,0),1)", "-3e-3*min(t,1) + 1.5e-3*max(t-2,0)"]
    laws = {"j2": {**STEEL, "hardening": 4e3}, "linear": {"young": YOUNG, "poisson": POISSON}}
    return parse_case(
        {
            "mesh": {"generator": "rectangle", "size": [2.0, 1.0], "cells": [24, 12]},
            "space": {"degree": 2},
            "material": laws[law],
            "fixed": [{"on": "top", "displacement": driven}],
            "contact": {"on": "bottom", "friction": {"law": "coulomb", "mu": 0.3}},
            "evolution": {"times": [0.0, 1.0, 2.0, 3.0], "steps": [6, 6, 6]},
            **more,
        }
    )


def hencky(hardening: float) -> UserLaw:
    """Return Hencky's law with the curve of linear hardening of the same steel."""
    shear, limit, slope = YOUNG / (2 + 2 * POISSON), np.sqrt(2 / 3) * YIELD, 2 / 3 * hardening

    def modulus(t: Value) -> Value:
        over = maximum(2 * shear * t - limit, 0.0)
        return shear * (1 - over / maximum(2 * shear * t, limit) * 2 * shear / (2 * shear + slope))

    return UserLaw(YOUNG, POISSON, modulus=modulus)


def newton(report: Report) -> None:
    """Make the table of Newton's residuals with friction, each iteration with a tangent."""
    case = block("j2", evolution={"times": [0.0, 1.0, 2.0, 2.5], "steps": [2, 2, 1]})
    solution = solve(case, NewtonOptions(tolerance=1e-12, keep="never", condense=False))
    assert solution.converged, solution.outcome.reason
    found: dict[str, list[float]] = {}
    for record in solution.history.records:
        step = f"t = {record.note.split()[2]}"
        found.setdefault(step, []).append(record.kkt.largest)
    most = max(map(len, found.values()))
    columns: dict[str, list[Any]] = {"iteration": list(range(1, most + 1))}
    for step, residuals in found.items():
        columns[step] = [*residuals, *[np.nan] * (most - len(residuals))]
    report.table(
        "newton",
        "Residuals of Newton's iterations with friction 0.3",
        columns,
        "A block of linear hardening: pressed until t = 1, sheared until 2, then lifted; whole "
        "body, no chord steps, tolerance 1e-12. Residuals below some 1e-11 are rounding.",
    )


def apart(report: Report) -> None:
    """Draw J2 and Hencky's law on the way to a load and back. Collective."""
    flow = solved(block("j2"))
    theory = solve(block("linear"), law=hencky(4e3))
    assert theory.converged, theory.outcome.reason
    figure, axes = subplots(1, 2)
    data: dict[str, Sequence[Any]] = {}
    for name, solution, line in (("J2", flow, "o-"), ("Hencky", theory, "s--")):
        time, pressed, sheared = _courses(solution)
        for ax, forces, words in zip(
            axes, (pressed, sheared), ("pressing", "shearing"), strict=True
        ):
            ax.plot(time, forces, line, ms=3, label=name)
            ax.set(xlabel="t", ylabel=f"{words} force (N/mm)")
            data[f"t, {name}"], data[f"{words}, {name}"] = time, forces
    for ax in axes:
        for turn in (1.0, 2.0):
            ax.axvline(turn, color="0.7", lw=0.8, zorder=0)
    axes[0].legend()
    report.figure(
        "apart",
        "Press, shear, unload: flow theory and Hencky's law with the same curve",
        figure,
        data,
        "A block of 2 x 1 mm, Y = 250 MPa, H = 4 GPa, pressed by 3 um until t = 1, sheared by 4 um "
        "until 2, lifted by 1.5 um until 3; friction 0.3.",
    )


def _courses(solution: Solution) -> tuple[Array, Array, Array]:
    """Return times, and the forces along y and x on the foundation, from the beginning."""
    rows = [step.row for step in solution.steps]
    names = ("t", "contact_force_y", "contact_force_x")
    time, down, aside = (np.array([0.0, *(float(row[name]) for row in rows)]) for name in names)
    return time, np.abs(down), np.abs(aside)


def main(arguments: Sequence[str] | None = None) -> None:
    """Make all of them. Collective."""
    chosen = options(__doc__ or "", "plasticity", arguments)
    report = Report(chosen.out)
    newton(report)
    apart(report)
    prandtl(report, chosen.coarse)
    ball_and_cylinder(report, chosen.coarse)
    pressed_ball(report, chosen.coarse)


if __name__ == "__main__":
    main()
