"""Cattaneo's and Mindlin's problem with its derivatives by the coefficient of friction.

`python3 -m scripts.studies.cattaneo [--out DIR] [--coarse]`: two balls, or two cylinders, are
pressed on each other by P and moved along by Q = 2/3 mu P. Displacement, radius of the stick zone
and the derivatives of both by mu at this Q have closed forms; the page is docs/derivatives.md.

References
----------
Johnson, Contact Mechanics, Cambridge University Press (1985), section 7.2.
Ciavarella, The generalized Cattaneo partial slip plane contact problem, Int. J. Solids Struct. 35
(1998) 2349.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from contact import Solution, parse_case, sensitivity
from contact.output.differentiable import named_quantities
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from scripts.reporting import Report, append, options, solved
from scripts.studies.mindlin import MU, PRESS, RADIUS, YOUNG, write_mesh

#: Q/(mu P), of the specification, and how near the runs come to it.
SHARE, NEAR = 2 / 3, 1e-3

#: First step of the shear, in which all stick, over the last.
FIRST = 1e-3

#: Half width of the contact of the cylinders, their modulus, Poisson's ratio, and their approach.
WIDTH, MODULUS, POISSON, APPROACH = 0.52, 1000.0, 0.3, 0.1

MU_KEY, WAY_KEY = "friction.mu", "fixed.0.displacement.0"


@dataclass(frozen=True)
class Found:
    """Results of a run at Q = SHARE mu P, in units of the closed form.

    Attributes
    ----------
    share
        Q/(mu P) itself.
    way, by_mu
        Displacement along x and its derivative by mu, over k P/a of balls and k P of cylinders.
    stick, stick_by_mu
        Radius of the stick zone, and its derivative by mu, over a.
    """

    share: float
    way: float
    by_mu: float
    stick: float
    stick_by_mu: float


def ball_values(x: float, mu: float = MU) -> Found:
    """Return the closed form of balls at Q = x mu P."""
    y = (1 - x) ** (1 / 3)
    way = 3 * mu / 16 * (1 - y**2)
    by_mu = 3 / 16 * (1 - y**2 - 2 / 3 * x / y)
    return Found(x, way, by_mu, y, x / (3 * mu * y**2))


def cylinder_values(x: float, mu: float = MU) -> Found:
    """Return the closed form of cylinders at Q = x mu P.

    By Ciavarella and Jaeger the way is mu (d(P) - d(P - Q/mu)), d being the approach under a force,
    of stiffness -k ln(P) but for a constant: the way has no origin, and is that beyond the straight
    line of Q that all would stick on.
    """
    y = np.sqrt(1 - x)
    way = mu * (x + (1 - x) * np.log(1 - x))
    return Found(x, way, x + np.log(1 - x), y, x / (2 * mu * y))


def case_of_balls(path: Path, elements: float, sectors: int) -> dict[str, Any]:
    """Return half of two half balls, and write their mesh."""
    write_mesh(path, np.sqrt(RADIUS / 2 * PRESS), elements, sectors)
    return {
        "mesh": {"file": str(path)},
        "material": {"young": YOUNG, "poisson": 0.0},
        "fixed": [
            {"on": "upper_cut", "displacement": [1.0, 0.0, "free"], "amplitude": "shear"},
            {"on": "upper_cut", "displacement": ["free", "free", -PRESS], "amplitude": "press"},
            {"on": "symmetry", "displacement": ["free", 0.0, "free"]},
            {"on": "lower_cut", "displacement": [0.0, 0.0, 0.0]},
        ],
        "contact": {"on": "upper_round", "against": "lower_round"},
    }


def case_of_cylinders(elements: float, degree: int) -> dict[str, Any]:
    """Return two half cylinders."""
    sizes = {"contact_size": WIDTH / elements, "contact_width": 1.3 * WIDTH}
    return {
        "mesh": {"generator": "two_half_cylinders", **sizes},
        "space": {"degree": degree},
        "material": {"young": MODULUS, "poisson": POISSON},
        "fixed": [
            {"on": "upper_cut", "displacement": [1.0, "free"], "amplitude": "shear"},
            {"on": "upper_cut", "displacement": ["free", -APPROACH], "amplitude": "press"},
            {"on": "lower_cut", "displacement": [0.0, 0.0]},
        ],
        "contact": {"on": "upper_arc", "against": "lower_arc"},
    }


def sheared(case: dict[str, Any], way: float) -> Solution:
    """Press two bodies on each other, move one along by a little, and to the end."""
    times = [0.0, 1.0, 2.0, 3.0]
    case["fixed"][0]["displacement"][0] = way
    return solved(
        parse_case(
            case
            | {
                "friction": {"law": "coulomb", "mu": MU},
                "solver": {"tolerance": 1e-11},
                "evolution": {
                    "times": times,
                    "steps": [1, 1, 1],
                    "amplitudes": {
                        "press": {"time": times, "value": [0.0, 1.0, 1.0, 1.0]},
                        "shear": {"time": times, "value": [0.0, 0.0, FIRST, 1.0]},
                    },
                },
            }
        )
    )


def stick(problem: ContactProblem, state: State) -> float:
    """Return |q|/p at the contact node nearest the middle, mu (1 - c/a) of the closed form."""
    at = int(np.argmin(np.linalg.norm(problem.nodes.points[:, :-1], axis=1)))
    return float(np.linalg.norm(state.forces.friction[at]) / state.forces.pressure[at])


def run(case: dict[str, Any], way: float, unit: Callable[[float], float]) -> Found:
    """Move two bodies along until Q is SHARE mu P; return values of the closed form. Serial.

    Bodies yield elsewhere too, in proportion to Q: the displacement is that beyond the straight
    line on which all would stick.

    Parameters
    ----------
    case, way
        The case, and a first guess of the way.
    unit
        Returns that of the displacement, given the normal force of the mesh.
    """
    while True:
        solution = sheared(case, way)
        last, upwards = solution.steps[-1].row, "xyz"[solution.problem.dim - 1]
        force, normal = float(last["contact_force_x"]), abs(float(last[f"contact_force_{upwards}"]))
        results = {"force": named_quantities(solution.problem)["contact_force_x"], "stick": stick}
        found = sensitivity(solution, results, [MU_KEY, WAY_KEY], "tangent")
        by_way, share = found["force"][WAY_KEY], abs(force) / (MU * normal)
        if abs(share - SHARE) < NEAR:
            break
        way += (SHARE - share) * MU * normal / abs(by_way)
    stiffness = found.steps["force"][WAY_KEY][1] / FIRST
    by_mu = -found["force"][MU_KEY] / by_way
    ratio, scale = stick(solution.problem, solution.state), unit(normal)
    slope = found["stick"][MU_KEY] + found["stick"][WAY_KEY] * by_mu
    return Found(
        share,
        (way - force / stiffness) / scale,
        by_mu / scale,
        1 - ratio / MU,
        ratio / MU**2 - slope / MU,
    )


def balls(elements: float, sectors: int) -> Found:
    """Return the values of two balls; see `write_mesh`."""

    def unit(half: float) -> float:
        """Return k P/a, k = sum (2 - nu)/G, given the force of half of the balls."""
        width = (3 * 2 * half * RADIUS / 2 / (4 * YOUNG / 2)) ** (1 / 3)
        return float(8 / YOUNG * 2 * half / width)

    with TemporaryDirectory() as folder:
        case = case_of_balls(Path(folder) / "balls.msh", elements, sectors)
        found = run(case, 0.022, unit)
    # Of half spaces that stick: k Q/(8 a).
    return replace(found, way=found.way + MU * found.share / 8)


def cylinders(elements: float, degree: int) -> Found:
    """Return the values of two cylinders with so many elements on the half width of contact."""

    def unit(normal: float) -> float:
        """Return k P, k = 2 (1 - nu^2)/(pi E)."""
        return float(2 * (1 - POISSON**2) / (np.pi * MODULUS) * normal)

    return run(case_of_cylinders(elements, degree), 0.02, unit)


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the table."""
    given = options(__doc__ or "", "derivatives", arguments)
    names = ("delta_x", "d delta_x/d mu", "c", "dc/d mu")
    columns: dict[str, list[Any]] = {"bodies": [], "elements": [], "sectors": []}
    columns |= {name: [] for name in ("Q/(mu P)", *names)}

    def add(bodies: str, elements: float, sectors: int | None, one: Found) -> None:
        values = one.way, one.by_mu, one.stick, one.stick_by_mu
        append(columns, bodies, elements, sectors, one.share, *values)

    for elements, sectors in [(4, 6)] if given.coarse else [(6, 6), (12, 8), (18, 12)]:
        add("balls", elements, sectors, balls(elements, sectors))
    add("balls, closed form", np.nan, None, ball_values(SHARE))
    for degree in (1, 2):
        for elements in (6,) if given.coarse else (12, 24, 48, 96)[: 5 - degree]:
            add(f"cylinders, P{degree}", elements, None, cylinders(elements, degree))
    add("cylinders, closed form", np.nan, None, cylinder_values(SHARE))
    Report(given.out).table(
        "cattaneo",
        "Two bodies pressed by P and moved along by Q: displacement, stick zone, derivatives",
        columns,
        "Displacements of balls over k P/a, k = sum (2 - nu)/G, of cylinders beyond the line of "
        "full stick over 2 (1 - nu^2) P/(pi E); the radius c of the stick zone, by the friction in "
        "the middle, over a. Elements on the contact radius a where it slips, linear in the balls; "
        "the closed forms are those of half spaces.",
    )


if __name__ == "__main__":
    main()
