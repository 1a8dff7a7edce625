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
from dataclasses import astuple, dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from contact import Solution, parse_case, sensitivity
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.results.quantities import named_functionals
from scripts.reporting import Report, append, empty, options, solved
from scripts.studies import mindlin
from scripts.studies.mindlin import MODULUS, MU, POISSON, RADIUS, YOUNG

#: Q/(mu P), how near the first runs come to it, and the steps of the last run: so many, so far
#: about it that the stick zone loses one or more rings of nodes.
SHARE, NEAR, STEPS, ABOUT = 2 / 3, 1e-2, 9, 0.06

#: First step of the shear, in which all stick, over the last.
FIRST = 1e-3

MU_KEY, WAY_KEY = "friction.mu", "fixed.0.displacement.0"


@dataclass(frozen=True)
class Found:
    """Results of a run at Q = SHARE mu P, in units of the closed form."""

    #: Q/(mu P) itself.
    share: float
    #: Displacement along x and its derivative by mu, over k P/a of balls and k P of cylinders.
    way: float
    by_mu: float
    #: Radius of the stick zone, and its derivative by mu, over a.
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


def sheared(case: dict[str, Any], ways: Sequence[float]) -> Solution:
    """Press two bodies on each other, and move one along, first by a little."""
    case["fixed"][0]["displacement"][0] = ways[-1]
    shares = [0.0, 0.0, FIRST, *(way / ways[-1] for way in ways)]
    times = [float(k) for k in range(len(shares))]
    amplitudes = {
        "press": {"time": [0.0, 1.0, times[-1]], "value": [0.0, 1.0, 1.0]},
        "shear": {"time": times, "value": shares},
    }
    steps = {"times": times, "steps": [1] * (len(times) - 1), "amplitudes": amplitudes}
    return solved(parse_case({**case, "solver": {"tolerance": 1e-11}, "evolution": steps}))


def stick(problem: ContactProblem, state: State) -> float:
    """Return |q|/p at the contact node nearest the middle, mu (1 - c/a) of the closed form."""
    at = int(np.argmin(np.linalg.norm(problem.nodes.points[:, :-1], axis=1)))
    return float(np.linalg.norm(state.forces.friction[at]) / state.forces.contact[at])


def run(
    case: dict[str, Any],
    way: float,
    unit: Callable[[float], float],
    exact: Callable[[float], Found],
    line: float,
) -> tuple[Found, float]:
    """Move two bodies along until Q is near SHARE mu P, and compare with the closed form. Serial.

    Bodies yield elsewhere too, in proportion to Q: the displacement is that beyond the straight
    line on which all would stick.
    """
    share = 0.0
    while abs(share - SHARE) > NEAR:
        solution = sheared(case, [way])
        results = {"force": named_functionals(solution.problem)["contact_force_x"]}
        by_way = sensitivity(solution, results, [WAY_KEY], "tangent")["force"][WAY_KEY]
        force, normal = _forces(solution, -1)
        way, share = way + (SHARE * MU * normal - force) / by_way, force / (MU * normal)
    ways = way + np.linspace(-ABOUT, ABOUT, STEPS) * MU * normal / by_way
    solution = sheared(case, ways.tolist())
    found = sensitivity(solution, {**results, "stick": stick}, [MU_KEY, WAY_KEY], "tangent").steps
    stiffness = found["force"][WAY_KEY][1] / FIRST
    ratios = []
    for k, driven in enumerate(ways, start=2):
        force, normal = _forces(solution, k)
        scale, ratio = unit(normal), stick(solution.problem, solution.steps[k].state)
        known, by = exact(force / (MU * normal)), driven / ways[-1]
        by_mu = -found["force"][MU_KEY][k] / (found["force"][WAY_KEY][k] / by)
        slope = found["stick"][MU_KEY][k] + found["stick"][WAY_KEY][k] / by * by_mu
        beyond = (driven - force / stiffness) / scale + line * MU * known.share
        values = beyond, by_mu / scale, 1 - ratio / MU, ratio / MU**2 - slope / MU
        ratios.append(np.array(values) / astuple(known)[1:])
    mean = np.mean(ratios, axis=0) * astuple(exact(SHARE))[1:]
    return Found(SHARE, *mean.tolist()), float(np.std(ratios, axis=0)[1])


def _forces(solution: Solution, step: int) -> tuple[float, float]:
    """Return the tangential and the normal force at the end of a step."""
    row, upwards = solution.steps[step].row, "xyz"[solution.problem.dim - 1]
    return float(row["contact_force_x"]), abs(float(row[f"contact_force_{upwards}"]))


def balls(elements: float, sectors: int) -> tuple[Found, float]:
    """Return the values of two balls and their scatter; see `write_mesh` and `run`."""

    def unit(half: float) -> float:
        """Return k P/a, k = sum (2 - nu)/G, given the force of half of the balls."""
        width = (3 * 2 * half * RADIUS / 2 / (4 * YOUNG / 2)) ** (1 / 3)
        return float(8 / YOUNG * 2 * half / width)

    with TemporaryDirectory() as folder:
        case = mindlin.balls(Path(folder) / "balls.msh", elements, sectors, 1.0)
        # Of half spaces that stick: k Q/(8 a).
        return run(case, 0.022, unit, ball_values, 1 / 8)


def cylinders(elements: float, degree: int) -> tuple[Found, float]:
    """Return the values of two cylinders, so many elements on the half width, and their scatter."""

    def unit(normal: float) -> float:
        """Return k P, k = 2 (1 - nu^2)/(pi E)."""
        return float(2 * (1 - POISSON**2) / (np.pi * MODULUS) * normal)

    return run(mindlin.cylinders(elements, degree, 1.0), 0.02, unit, cylinder_values, 0.0)


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the table."""
    given = options(__doc__ or "", "derivatives", arguments)
    columns = empty(
        "bodies", "elements", "sectors", "delta_x", "d delta_x/d mu", "scatter", "c", "dc/d mu",
    )  # fmt: skip

    def add(bodies: str, elements: float, sectors: float, one: Found, scatter: float) -> None:
        values = one.way, one.by_mu, scatter, one.stick, one.stick_by_mu
        append(columns, bodies, elements, sectors, *values)

    for elements, sectors in [(4, 6)] if given.coarse else [(6, 6), (12, 8), (18, 12)]:
        add("balls", elements, sectors, *balls(elements, sectors))
    add("balls, closed form", np.nan, np.nan, ball_values(SHARE), 0.0)
    for degree in (1, 2):
        for elements in (6,) if given.coarse else (12, 24, 48, 96)[: 5 - degree]:
            add(f"cylinders, P{degree}", elements, np.nan, *cylinders(elements, degree))
    add("cylinders, closed form", np.nan, np.nan, cylinder_values(SHARE), 0.0)
    Report(given.out).table(
        "cattaneo",
        "Two bodies pressed by P and moved along by Q: displacement, stick zone, derivatives",
        columns,
        "Displacements: of balls over k P/a, k = sum (2 - nu)/G; of cylinders beyond the line of "
        "full stick over 2 (1 - nu^2) P/(pi E). The radius c of the stick zone, by the friction "
        "in the middle, is over a. Values are means over nine steps from Q/(mu P) = 0.61 to 0.73, "
        "as multiples of the closed form at Q = 2/3 mu P. scatter: standard deviation of the "
        "multiples of d delta_x/d mu. elements: on the contact radius a where it slips, linear in "
        "the balls. The closed forms are those of half spaces.",
    )


if __name__ == "__main__":
    main()
