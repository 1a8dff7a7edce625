"""Flow theory beside closed forms and other codes, Newton's convergence, and Hencky's law.

`python3 -m scripts.studies.plasticity [--out DIR] [--coarse]`; the page is docs/plasticity.md.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar

from contact import Case, NewtonOptions, Solution, load_case, parse_case, solve, solve_steps
from contact.case.build import build_problem
from contact.typing import Array
from forms.hencky import UserLaw
from forms.ops import Value, maximum
from scripts.cases import CASES
from scripts.reporting import Report, append, empty, solved, subplots

YOUNG, POISSON, YIELD = 200e3, 0.3, 250.0
STEEL = {"law": "j2", "young": YOUNG, "poisson": POISSON, "yield_stress": YIELD}
EFFECTIVE = YOUNG / (1 - POISSON**2)
ELEMENTS = {"P1": (1, "standard"), "P2": (2, "standard"), "P2, mean": (2, "mean_dilatation")}

#: Radius of the ball and of the cylinder (mm).
RADIUS = 10.0

#: Largest pressure over Y at first yield of a ball, in the fit of Jackson and Green.
JACKSON_GREEN = 1.295 * np.exp(0.736 * POISSON)

#: Bodies and Poisson's ratios in the study of first yield.
YIELDING = [("ball", 0.25), ("ball", 0.3), ("ball", 0.35), ("ball", 0.4), ("cylinder", 0.3)]

#: Depth over that of first yield -> force over that of first yield by an independent code.
BALL = {
    **{1.9: 2.574, 3.0: 4.933, 5.0: 9.977, 7.5: 17.27, 10.0: 25.29},
    **{30.0: 103.3, 40.0: 148.1, 50.0: 193.5},
}


def indentation(foundation: dict[str, Any], rigid: dict[str, Any], **more: Any) -> Case:
    """Return the case of a rigid foundation on the middle of a half plane, meshed in half."""
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


def prandtl(report: Report) -> None:
    """Make the table of limit loads of a punch. Collective."""
    limit = (2 + np.pi) / np.sqrt(3)
    columns = empty("element", "size", "unknowns", "steps", "p/Y", "over the limit")
    for element in ELEMENTS:
        for size in (0.2,) if report.coarse else (0.2, 0.1, 0.05):
            solution = solved(punch(size, element))
            force = abs(float(solution.steps[-1].row["contact_force_y"])) / YIELD
            unknowns = solution.problem.body.layout.unknowns
            row = element, size, unknowns, len(solution.steps), force, force / limit - 1
            append(columns, *row)
    report.table(
        "prandtl",
        "Limit pressure of a flat punch without friction beside (2 + pi) Y/sqrt(3) = 2.9685 Y",
        columns,
        "Plane strain, half width 1, no hardening, pressed in by 0.04 in 16 steps, or more where "
        "some were halved. Elements have the given size beside the punch, and a twentieth of it "
        "at its edge. P1 locks, and its force continues to grow.",
    )


def hertz_first_yield(shape: str, poisson: float = POISSON) -> tuple[float, float]:
    """Return the largest Hertzian pressure at first yield over Y, and the depth over the radius.

    It yields where von Mises' stress on the axis is largest: of a ball |s_z - s_r|, of a cylinder
    that of plane strain (Johnson, Contact Mechanics, 1985, sections 3.4 and 4.2).
    """

    def mises(z: float) -> float:
        """Return the stress over the largest pressure in a depth over the contact radius."""
        if shape == "ball":
            outside = 1 - z * np.arctan2(1.0, z)
            return float(abs(1.5 / (1 + z**2) - (1 + poisson) * outside))
        root = np.sqrt(1 + z**2)
        along, down = -((1 + 2 * z**2) / root - 2 * z), -1 / root
        out = poisson * (along + down)
        of = np.array([along - down, down - out, out - along])
        return float(np.sqrt(of @ of / 2))

    found = minimize_scalar(
        lambda z: -mises(z), bounds=(0.2, 1.2), method="bounded", options={"xatol": 1e-9}
    )
    return -1 / float(found.fun), float(found.x)


def kogut_etsion(w: float) -> float:
    """Return the force over that of first yield at a depth over that of first yield, from 1 on.

    A fit for a deformable ball on a rigid plane; J. Appl. Mech. 69 (2002) 657.
    """
    return float(1.03 * w**1.425 if w <= 6 else 1.40 * w**1.263)


def jackson_green(w: float) -> float:
    """Return the force over that of first yield at a depth over that of first yield, from 1.9 on.

    A fit for a deformable ball on a rigid plane; J. Tribol. 127 (2005) 343.
    """
    strain, yielding = YIELD / EFFECTIVE, JACKSON_GREEN
    width = np.pi * yielding * strain / 2 * np.sqrt(w) * (w / 1.9) ** (0.07 * np.exp(23 * strain))
    hardness = 2.84 * (1 - np.exp(-0.82 * width**-0.7))
    elastic = np.exp(-(w ** (5 / 12)) / 4) * w**1.5
    return float(elastic + 4 * hardness / yielding * (1 - np.exp(-(w ** (5 / 9)) / 25)) * w)


def first_yield(shape: str, fineness: float, poisson: float = POISSON) -> tuple[float, float]:
    """Return the largest pressure at first yield over Y, and the depth over the contact radius.

    The force grows in steps of 0.01 Y of the largest Hertzian pressure, whose middle counts.
    """
    known, _ = hertz_first_yield(shape, poisson)
    pressures = known - 0.105 + 0.01 * np.arange(22)
    ball, modulus = shape == "ball", YOUNG / (1 - poisson**2)

    def force(pressure: Array) -> Array:
        """Return the force of a largest pressure over Y, of the meshed half of the cylinder."""
        if ball:
            return np.pi**3 * RADIUS**2 * (pressure * YIELD) ** 3 / (6 * modulus**2)
        return np.pi * RADIUS * (pressure * YIELD) ** 2 / (2 * modulus)

    # Of a ball a = pi p R/(2 E*), of a cylinder 2 p R/E*.
    a = (np.pi / 2 if ball else 2) * known * YIELD * RADIUS / modulus
    # Stresses decay with the square of the distance below a ball, with the distance in the plane.
    forces, box = force(pressures), 60 if ball else 480
    times = [float(k) for k in range(forces.size + 1)]
    case = indentation(
        {"shape": "paraboloid", "apex": [0.0, 0.0], "axis": [0.0, 1.0], "radius": RADIUS},
        {"displacement": [0.0, "free"], "force": [0.0, -1.0]},
        material={**STEEL, "poisson": poisson},
        mesh={
            **{"generator": "half_space", "radius": 1.5 * a, "growth": 0.2},
            **{"extent": box * a, "size": box * a / 4},
            **{"contact_size": a / fineness, "edge_size": a / fineness},
        },
        space={"degree": 2, **({"kinematics": "axisymmetric"} if ball else {})},
        evolution={
            "times": times,
            "steps": [1] * forces.size,
            "amplitudes": {"press": {"time": times, "value": [0.0, *forces.tolist()]}},
        },
    )
    solution = solved(case)
    laws = solution.problem.body.laws
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


def ball_and_cylinder(report: Report) -> None:
    """Make the table of first yield under Hertzian contact."""
    columns = empty("body", "nu", "elements", "p_0/Y", "closed form", "depth/a", "closed form ")
    for shape, poisson in YIELDING:
        known = hertz_first_yield(shape, poisson)
        sizes = (6,) if report.coarse else (6, 12, 24) if poisson == POISSON else (24,)
        for fineness in sizes:
            pressure, depth = first_yield(shape, fineness, poisson)
            append(columns, shape, poisson, fineness, pressure, known[0], depth, known[1])
    report.table(
        "first-yield",
        "First yield under a rigid ball and a rigid cylinder",
        columns,
        "The largest Hertzian pressure at the force at which the first point yields, and the "
        "depth of this point; P2, elements on the contact radius. The force grows in steps of "
        "0.01 Y.",
    )


def depth_of_first_yield() -> float:
    """Return how deep a ball is when the steel yields, w_c, as the fits have it."""
    return float((np.pi * JACKSON_GREEN * YIELD / (2 * EFFECTIVE)) ** 2 * RADIUS)


def ball_cases(coarse: bool) -> list[Case]:
    """Return the ball at 1.9 to 10 times the depth of first yield, and at 30 to 50 times that."""
    name, size = CASES / "ball-in-steel.toml", 2 if coarse else 1
    box, depth = ["mesh.extent=30.0", "mesh.size=8.0"], 50 * depth_of_first_yield()
    return [
        load_case(name, [*box, *(f"mesh.{of}_size={0.004 * size}" for of in ("contact", "edge"))]),
        load_case(
            name,
            [
                *box,
                *(f"mesh.{of}_size={0.01 * size}" for of in ("contact", "edge")),
                "mesh.radius=0.45",
                f"contact.rigid.displacement=[0.0,{-depth}]",
                *("evolution.times=[0.0,0.2,0.6,0.8,1.0,2.0]", "evolution.steps=[8,8,4,4,20]"),
            ],
        ),
    ]


def pressed_ball(report: Report) -> None:
    """Make the tables of a ball that is pressed into steel that yields, and lifted. Collective."""
    depth = depth_of_first_yield()
    first = 4 / 3 * EFFECTIVE * np.sqrt(RADIUS) * depth**1.5
    columns = empty(
        "w/w_c", "P/P_c", "another code", "over it", "Kogut and Etsion", "over that",
        "Jackson and Green", "over these",
    )  # fmt: skip
    lifted = empty("w/w_c", "mark over w", "Etsion et al.", "exponent", "rise 4 E* a/(3 P)")
    deepest = 0.0
    for case in ball_cases(report.coarse):
        solution = solved(case)
        rows = [step.row for step in solution.steps]
        moved = np.array([-float(row["rigid_y"]) for row in rows]) / depth
        forces = np.array([abs(float(row["contact_force_y"])) for row in rows]) / first
        turn = int(np.argmax(moved))
        for w, other in BALL.items():
            if not 1.01 * deepest < w < 1.01 * moved[turn]:
                continue
            # The steps of the loading end within .1 % of these depths.
            k = int(np.argmin(np.abs(moved[: turn + 1] - w)))
            force = forces[k] * (w / moved[k]) ** 1.3
            against = [x for fit in (kogut_etsion(w), jackson_green(w)) for x in (fit, force / fit)]
            against[1::2] = [ratio - 1 for ratio in against[1::2]]
            append(columns, w, force, other, force / other - 1, *against)
        deepest = float(moved[turn])
        mark, *elastic = unloading(solution, turn)
        append(lifted, deepest, mark, (1 - deepest**-0.28) * (1 - deepest**-0.69), *elastic)
    report.table(
        "ball",
        "Force on a rigid ball over that of first yield",
        columns,
        "`ball-in-steel.toml` in a box of 30 mm, seven elements on the contact radius of first "
        "yield, no hardening; from 30 on elements of 2.5 times the size, 29 on the last contact "
        "radius. The fits are ones for a deformable ball, +-5 %.",
    )
    report.table(
        "ball-unloading",
        "A ball that is lifted off the steel, beside Hertz's law for the radius of its mark",
        lifted,
        "Depth of the mark on the axis over that of the ball, beside the fit of Etsion, Kligerman "
        "and Kadin, Int. J. Solids Struct. 42 (2005) 3716, for a deformable ball. By Hertz's law "
        "the exponent of the force in the rise above the mark is 1.5, and the rise is 3 P/(4 E* "
        "a) with the contact radius a at the deepest indentation.",
    )


def unloading(solution: Solution, turn: int) -> tuple[float, float, float]:
    """Return how a ball is lifted off; Hertz has 1.5 and 1 for the last two. Serial."""
    nodes, body = solution.problem.nodes, solution.problem.body
    places = nodes.points[:, 0]
    mark = -float(body.nodal(solution.state.x)[nodes.nodes[np.argmin(places)], 1])
    rows = [step.row for step in solution.steps[turn:]]
    depth = np.array([-float(row["rigid_y"]) for row in rows])
    force = np.array([abs(float(row["contact_force_y"])) for row in rows])
    above, pressed = depth - mark, force > 0
    exponent = np.polyfit(np.log(above[pressed]), np.log(force[pressed]), 1)[0]
    touching = places[solution.steps[turn].state.multipliers.contact > 0].max()
    width = (touching + places[places > touching].min()) / 2
    rise = above[0] * 4 * EFFECTIVE * width / (3 * force[0])
    return mark / float(depth[0]), float(exponent), float(rise)


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
    solution = solve(case, NewtonOptions(tolerance=1e-12, reuse="never", condense=False))
    assert solution.converged, solution.outcome.reason
    found: dict[str, list[float]] = {}
    for record in solution.history:
        step = f"t = {record.note.split()[2]}"
        found.setdefault(step, []).append(record.residuals.largest)
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


#: Materials whose iterations are timed; Hencky's law first.
HARDENINGS: dict[str, dict[str, Any]] = {
    "Hencky": {},
    "J2, linear": {"hardening": 4e3},
    "J2, Voce": {"hardening": {"saturation": 100.0, "rate": 100.0}},
    "J2, points": {"hardening": [[0.0, 250.0], [0.01, 320.0], [0.05, 400.0]]},
    "J2, Chaboche": {"kinematic": [{"modulus": 40e3, "recovery": 300.0}, {"modulus": 2e3}]},
}


def cost(report: Report) -> None:
    """Tabulate the processor time of an iteration with J2 and with Hencky's law. Collective."""
    times, repeated = np.linspace(0.0, 3.0, 19)[1:].tolist(), 1 if report.coarse else 3
    columns = empty(
        "degree", "cells", "factorisations", "material", "iterations", "s an iteration",
        "ratio to Hencky's",
    )  # fmt: skip
    for degree, cells in ((2, 8),) if report.coarse else ((2, 24), (1, 64)):
        mesh = {"generator": "rectangle", "size": [2.0, 1.0], "cells": [2 * cells, cells]}
        for words, reuse in (("few (chord steps)", "within"), ("each iteration", "never")):
            settings, hencky_takes = NewtonOptions(reuse=reuse), np.nan
            for name, parameters in HARDENINGS.items():
                given, law = ("j2", None) if parameters else ("linear", hencky(4e3))
                more = {"material": {**STEEL, **parameters}} if parameters else {}
                case = block(given, mesh=mesh, space={"degree": degree}, **more)
                seconds = []
                for _ in range(repeated):
                    problem = build_problem(case, law=law)
                    begin = time.process_time()
                    solution = solve_steps(problem, times, settings)
                    seconds.append(time.process_time() - begin)
                    assert solution.converged, solution.outcome.reason
                iterations = len(solution.history)
                takes = min(seconds) / iterations
                hencky_takes = takes if not parameters else hencky_takes
                ratio = takes / hencky_takes
                append(
                    columns, degree, f"{2 * cells} x {cells}", words, name, iterations, takes, ratio
                )
    report.table(
        "cost",
        "Processor time of an iteration with flow theory beside Hencky's law",
        columns,
        "The block that is pressed, sheared and unloaded in 18 steps, on one thread; the least of "
        "three runs without set-up and output, over the number of iterations.",
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
    report = Report.of(__doc__, "plasticity", arguments)
    newton(report)
    cost(report)
    apart(report)
    prandtl(report)
    ball_and_cylinder(report)
    pressed_ball(report)


if __name__ == "__main__":
    main()
