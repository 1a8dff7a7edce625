"""How much of a growing contact sticks: a cylinder on a rigid plane, a rigid ball on a half space.

The contact grows as the load does, and friction fixes each part of it where it first touches.
Spence (J. Elasticity, 1975) showed that the stick zone then has a fixed share k = c/a of the
contact, whatever the load; boundary elements have it (`stick_limit`). Where the shear's effect on
the pressure is left out, with gamma = (1 - 2 nu)/(2 (1 - nu)), K'(k)/K(k) = gamma/mu of the
cylinder, and of the ball ln((1 + k)/(1 - k))/(2 k) = (mu/gamma) K'(k). A static law knows one step
only, and finds far less.

    python3 -m scripts.studies.stick_ratio [--out DIR] [--coarse]
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.special import ellipk

from contact import build_problem, evolve, load_case
from contact.methods.options import NewtonOptions
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from scripts.cases import CASES
from scripts.reporting import Report, append, empty
from scripts.studies import stick_limit

POISSON, HALF_WIDTH = 0.3, 0.02

#: (1 - 2 nu)/(2 (1 - nu)).
GAMMA = (1 - 2 * POISSON) / (2 * (1 - POISSON))


def cylinder(mu: float, cells: int = 160) -> ContactProblem:
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


def ball(mu: float, cells: int = 160) -> ContactProblem:
    """Return a half space under a ball whose contact has a radius of `cells` elements at time 1."""
    changes = {
        "space.degree": "1",
        "mesh.radius": "1.1",
        "mesh.contact_size": f"{1 / cells}",
        "mesh.edge_size": f"{1 / cells}",
        "mesh.growth": "0.25",
        "friction": f"{{ law = 'coulomb', mu = {mu} }}",
    }
    return build_problem(load_case(CASES / "indent-ball.toml", changes))


def cylinder_alone(k: float, mu: float) -> float:
    """Return 0 at the cylinder's ratio, without the shear's effect on the pressure."""
    return float(ellipk(1 - k * k) / ellipk(k * k) - GAMMA / mu)


def ball_alone(k: float, mu: float) -> float:
    """Return 0 at the ball's ratio."""
    return float(np.arctanh(k) / k - mu / GAMMA * ellipk(1 - k * k))


@dataclass(frozen=True)
class Pressed:
    """A pressed body."""

    #: The problem of a friction coefficient, whose load grows with the time up to 1.
    make: Callable[[float, int], ContactProblem]
    #: Boundary elements of a half plane or a half space.
    kind: Callable[[int, float], tuple[np.ndarray, ...]]
    #: Zero at the stick ratio without it, a function of k and mu.
    alone: Callable[[float, float], float]

    def coupled(self, mu: float) -> float:
        """Return the stick ratio with the shear's effect on the pressure."""
        return stick_limit.stick_ratio(self.kind, mu, POISSON)

    def uncoupled(self, mu: float) -> float:
        """Return Spence's stick ratio without the shear's effect on the pressure."""
        return float(brentq(self.alone, 1e-9, 1 - 1e-12, args=(mu,)))

    def ratios(self, mu: float, steps: Sequence[int], cells: int = 160) -> list[float]:
        """Return the stick ratio of a contact that has grown in each of some numbers of steps."""
        problem, found = self.make(mu, cells), []
        for count in steps:
            *_, last = evolve(problem, np.arange(1, count + 1) / count, NewtonOptions())
            found.append(stick_ratio(problem, last))
        return found


#: Of the cylinder the force grows, of the ball the depth: the contact with the root of either.
PRESSED = {
    "cylinder": Pressed(cylinder, stick_limit.plane, cylinder_alone),
    "ball": Pressed(ball, stick_limit.axisymmetric, ball_alone),
}

#: The problems in words.
CAPTIONS = {
    "cylinder": f"a cylinder on a rigid plane, a/R = {HALF_WIDTH / 8:g}",
    "ball": "a rigid ball on a half space, a/R = 1/4",
}

#: Friction coefficients of the tables, and numbers of load steps.
COEFFICIENTS, STEPS = (0.1, 0.2, 0.3, 0.5), (1, 2, 8, 32, 64)


def stick_ratio(problem: ContactProblem, state: State) -> float:
    """Return c/a: where nodes stick, over where they touch. On one rank."""
    step = problem.at(state.time, state.history)
    interface, nodal = step.interface, step.nodal(state)
    pressure = interface.pressure(nodal, state.multipliers)
    order = np.argsort(step.nodes.points[:, 0])
    x, p = step.nodes.points[order, 0], pressure[order]
    share = np.linalg.norm(state.multipliers.friction, axis=1)[order]
    share = share / np.maximum(interface.bound(nodal, state.multipliers)[order], 1e-300)
    touches = p > 1e-9 * p.max()
    edge = _between(x, ~touches)
    sticks = _between(x[touches], share[touches] >= 1 - 1e-9)
    return sticks / edge


def _between(x: np.ndarray, beyond: np.ndarray) -> float:
    """Return the middle between the last node before a zone and the first one in it."""
    first = int(np.argmax(beyond)) if beyond.any() else len(x) - 1
    return float(x[first] + x[max(first - 1, 0)]) / 2 if first > 0 else 0.0


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the tables."""
    report = Report.of(__doc__, "stick_ratio", arguments)
    cells, steps = (20, STEPS[:3]) if report.coarse else (160, STEPS)
    for name, pressed in PRESSED.items():
        labels = [f"{count} step{'s' * (count > 1)}" for count in steps]
        columns = empty("mu", *labels, "boundary elements", "uncoupled")
        for mu in COEFFICIENTS:
            row = [*pressed.ratios(mu, steps, cells), pressed.coupled(mu), pressed.uncoupled(mu)]
            append(columns, mu, *(f"{value:.3f}" for value in row))
        report.table(
            f"stick-ratio-{name}",
            f"Stick ratio c/a of {CAPTIONS[name]}",
            columns,
            f"nu = {POISSON}, degree 1, {cells} elements in a. Boundary elements and uncoupled are "
            "limits of infinitely many steps on a half plane or half space, with and without the "
            "effect of shear on the pressure.",
        )


if __name__ == "__main__":
    main()
