"""Random evolutions of plastic bodies: press, shear, unload, reverse, with friction from 0 to 1.

``python3 -m scripts.studies.plastic_evolutions [FIRST LAST]`` solves the evolutions of these
numbers (0 to 60 by default) and prints a row for each: hardening, bodies, friction, steps with
halved ones, Newton iterations a step, and the error of the energy balance over the work done.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from contact import Case, Solution, parse_case, solve

YOUNG, LIMIT = 200e3, 250.0
HARDENING: dict[str, dict[str, Any]] = {
    "none": {},
    "linear": {"hardening": 4e3},
    "kinematic": {"kinematic": 4e3},
    "voce": {"hardening": {"saturation": 150.0, "rate": 100.0}},
    "points": {"hardening": [[0.0, 250.0], [0.01, 320.0], [0.05, 400.0]]},
    "chaboche": {"kinematic": [{"modulus": 40e3, "recovery": 300.0}, {"modulus": 2e3}]},
}
#: Stages of each evolution, and steps in a stage.
STAGES, STEPS = 4, 4


def evolution(number: int) -> tuple[Case, dict[str, Any]]:
    """Return a random case and its main choices."""
    random = np.random.default_rng(number)
    name = list(HARDENING)[number % len(HARDENING)]
    two, degree = bool(random.integers(2)), int(random.integers(1, 3))
    mu = float(random.choice([0.0, 0.1, 0.3, 0.6, 1.0]))
    down = random.uniform(1.0, 4.0) * 1e-3 * np.array([1.0, 1.0, random.uniform(0.3, 0.9), 1.2])
    aside = np.array([0.0, *random.uniform(-3e-3, 3e-3, STAGES - 1)])
    times = [float(t) for t in range(STAGES + 1)]
    metal = {"law": "j2", "young": YOUNG, "poisson": 0.3, "yield_stress": LIMIT, **HARDENING[name]}
    n = 6 if degree == 2 else 10
    contact: dict[str, Any] = {"on": "bottom", "gap": "0.002*(x-1)**2"}
    mesh: dict[str, Any] = {"generator": "rectangle", "size": [2.0, 1.0], "cells": [2 * n, n]}
    material: Any = metal
    fixed = [{"on": "top", "displacement": ["aside", "down"]}]
    if two:
        mesh = {"generator": "two_blocks"}
        # The lower one is elastic, or of a softer metal (where a list of points does not say it).
        lower: dict[str, Any] = {"young": YOUNG, "poisson": 0.3}
        if number % 4 < 2:
            lower = {**metal, "yield_stress": LIMIT if name == "points" else 0.7 * LIMIT}
        material = [{"on": "upper", **metal}, {"on": "lower", **lower}]
        contact = {"on": "upper_bottom", "against": "lower_top"}
        fixed[0]["on"] = "upper_top"
        fixed.append({"on": "lower_bottom", "displacement": [0.0, 0.0]})
    amplitudes = {
        "aside": {"time": times, "value": [0.0, *aside.tolist()]},
        "down": {"time": times, "value": [0.0, *(-down).tolist()]},
    }
    first = fixed[0]["on"]
    fixed[:1] = [
        {"on": first, "displacement": [1.0, "free"], "amplitude": "aside"},
        {"on": first, "displacement": ["free", 1.0], "amplitude": "down"},
    ]
    case = parse_case(
        {
            "mesh": mesh,
            "space": {"degree": degree},
            "material": material,
            "fixed": fixed,
            "contact": contact,
            **({"friction": {"law": "coulomb", "mu": mu}} if mu else {}),
            "evolution": {"times": times, "steps": [STEPS] * STAGES, "amplitudes": amplitudes},
        }
    )
    return case, {"hardening": name, "bodies": 1 + two, "degree": degree, "mu": mu}


def balance(solution: Solution) -> float:
    """Return work less stored energy, friction and plastic flow, over the work done."""
    rows = [step.row for step in solution.steps]
    names = ("work", "dissipation", "plastic_dissipation")
    work, friction, plastic = (np.array([float(row[name]) for row in rows]) for name in names)
    left = work.sum() - friction.sum() - plastic.sum() - float(rows[-1]["energy"])
    return float(abs(left) / np.abs(work).sum())


def main(first: int = 0, last: int = 60) -> None:
    """Solve the evolutions, and print the table."""
    print("| number | hardening | bodies | degree | mu | steps | iterations | balance |")
    print("|---|---|---|---|---|---|---|---|")
    failed = 0
    for number in range(first, last):
        case, described = evolution(number)
        solution = solve(case)
        failed += not solution.converged
        steps, iterations = len(solution.steps), len(solution.history)
        words = " | ".join(map(str, described.values()))
        more = f" ({steps - STAGES * STEPS} more)" if steps > STAGES * STEPS else ""
        end = f"{balance(solution):.1e}" if solution.converged else solution.outcome.reason
        row = f"| {number} | {words} | {steps}{more} | {iterations / steps:.1f} | {end} |"
        print(row, flush=True)
    print(f"\n{last - first - failed} of {last - first} converge")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]))
