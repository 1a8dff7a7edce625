"""A cylinder pressed on a rigid plane: how much of the contact sticks, in one step and in many.

The contact grows as the load does, and friction fixes each part of it where it first touches.
Spence showed that the stick zone then has a fixed share k = c/a of the contact, whatever the load:
K'(k)/K(k) = (1 - 2 nu)/(2 mu (1 - nu)) where the shear's effect on the pressure is left out. A
static law knows one step only, and finds far less.

    python3 -m scripts.studies.stick_ratio [STEPS...]
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipk

from contact import build_problem, evolve, load_case
from contact.methods.options import NewtonOptions
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from scripts.cases import CASES

POISSON, HALF_WIDTH = 0.3, 0.02

#: Friction coefficient -> stick ratio with the shear's effect on the pressure, +-0.005.
COUPLED = {0.1: 0.035, 0.2: 0.362, 0.3: 0.689, 0.5: 0.941}


def uncoupled(mu: float, poisson: float = POISSON) -> float:
    """Return Spence's stick ratio without the shear's effect on the pressure."""
    ratio = (1 - 2 * poisson) / (2 * (1 - poisson)) / mu
    return float(brentq(lambda k: ellipk(1 - k * k) / ellipk(k * k) - ratio, 1e-12, 1 - 1e-12))


def cylinder(mu: float, cells: int) -> ContactProblem:
    """Return half a cylinder whose contact has a half width of `cells` elements at time 1."""
    size = HALF_WIDTH / cells
    modulus = 2000.0 / (1 - POISSON**2)
    force = HALF_WIDTH**2 * np.pi * modulus / (4 * 8.0)  # Hertz, of the whole cylinder
    changes = {
        "mesh.contact_size": f"{size}",
        "mesh.contact_width": f"{1.3 * HALF_WIDTH}",
        "mesh.growth": "0.25",
        "mesh.size": "1.0",
        "load.0.traction": f"[0.0, {-force / 16.0}]",
        "friction.mu": f"{mu}",
    }
    return build_problem(load_case(CASES / "hertz.toml", changes))


def stick_ratio(problem: ContactProblem, state: State) -> float:
    """Return c/a: where nodes stick, over where they touch. On one rank."""
    step = problem.at(state.time, state.history)
    interface, nodal = step.interface, step.nodal(state)
    pressure = interface.pressure(nodal, state.forces)
    order = np.argsort(step.nodes.points[:, 0])
    x, p = step.nodes.points[order, 0], pressure[order]
    share = np.linalg.norm(state.forces.friction, axis=1)[order]
    share = share / np.maximum(interface.bound(nodal, state.forces)[order], 1e-300)
    touches = p > 1e-9 * p.max()
    edge = _between(x, ~touches)
    sticks = _between(x[touches], share[touches] >= 1 - 1e-9)
    return sticks / edge


def _between(x: np.ndarray, beyond: np.ndarray) -> float:
    """Return the middle between the last node before a zone and the first one in it."""
    first = int(np.argmax(beyond)) if beyond.any() else len(x) - 1
    return float(x[first] + x[max(first - 1, 0)]) / 2 if first > 0 else 0.0


def stick_ratios(mu: float, steps: Sequence[int], cells: int = 160) -> list[float]:
    """Return the stick ratio of a contact that has grown in each of some numbers of steps."""
    problem, found = cylinder(mu, cells), []
    for count in steps:
        # The load grows with the time, and the half width with its root.
        times = np.arange(1, count + 1) / count
        *_, last = evolve(problem, times, NewtonOptions())
        found.append(stick_ratio(problem, last))
    return found


def main(steps: Sequence[int]) -> None:
    """Print the table."""
    print("| mu | " + " | ".join(f"{n} step{'s' * (n > 1)}" for n in steps), end=" | ")
    print("coupled, limit | Spence, uncoupled |")
    print("|---" * (len(steps) + 3) + "|")
    for mu, limit in COUPLED.items():
        row = [f"{value:.3f}" for value in stick_ratios(mu, steps)]
        print("| " + " | ".join([f"{mu}", *row, f"{limit:.3f}", f"{uncoupled(mu):.3f}"]) + " |")


if __name__ == "__main__":
    main([int(argument) for argument in sys.argv[1:]] or [1, 2, 8, 32, 64])
