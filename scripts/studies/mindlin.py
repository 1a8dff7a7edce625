"""Two balls, or cylinders, pressed on each other and moved back and forth: Mindlin and Deresiewicz.

python3 -m scripts.studies.mindlin [--out DIR] [--coarse]

One half, y >= 0, of two half balls in 3-D, or two half cylinders in the plane. Their cuts stay at
a distance while one is moved along x and back: the dissipation of a turn is the area of the
loop, and both have a closed form.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from contact import parse_case
from contact.typing import Array
from scripts.reporting import ONE_COLUMN, Report, options, solved, subplots

RADIUS, YOUNG, MU = 50.0, 20e3, 0.3

#: Results of a step.
Row = Mapping[str, Any]

#: How far the cuts approach each other, and half the way along x.
PRESS, SHEAR = 0.5, 0.1


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the table and the figure."""
    given = options(__doc__, "mindlin", arguments)
    report = Report(given.out)
    fine = [(0.0, 6, 3), (0.0, 10, 3), (0.0, 12, 3), (0.0, 16, 3), (0.0, 20, 3)]
    fine += [(0.3, 8, 6), (0.0, 8, 6)]
    runs = [(0.0, 4, 2)] if given.coarse else fine
    rows: dict[str, list[Any]] = {"nu": [], "a/h": [], "steps": [], "Q/(mu P)": []}
    rows |= {"area": [], "dissipation": []}
    for poisson, elements, steps in runs:
        loop = turn(poisson, elements, steps)
        rows["nu"].append(poisson)
        rows["a/h"].append(elements)
        rows["steps"].append(4 * steps)
        rows["Q/(mu P)"].append(loop.share)
        rows["area"].append(loop.area / loop.exact)
        rows["dissipation"].append(loop.dissipation / loop.exact)
        if poisson == 0:
            shown = loop
    report.table(
        "mindlin",
        "Two balls: area of the loop, and dissipation, over the closed form",
        rows,
        "The closed form takes all friction to act along x, which is exact for nu = 0.",
    )
    draw(report, shown)
    plane: dict[str, list[Any]] = {"degree": [], "a/h": [], "dissipation": []}
    for degree in (1, 2):
        for elements in (6,) if given.coarse else (6, 12, 24, 48, 96)[: 7 - 2 * degree]:
            plane["degree"].append(degree)
            plane["a/h"].append(elements)
            plane["dissipation"].append(turn_of_cylinders(elements, 3, degree))
    report.table(
        "mindlin-plane",
        "Two cylinders: dissipation of a turn, over the closed form",
        plane,
        "In twelve steps; with 24 of them it is the same to 1e-4.",
    )


@dataclass(frozen=True)
class Loop:
    """A turn of the upper ball, there and back, over one and the same force Q at its ends.

    Attributes
    ----------
    way, force
        Displacement of the cut along x, and its driving force, at the ends of steps.
    dissipation
        Dissipation of friction in the turn.
    normal, width, compliance
        P, Hertz's a, and k = sum (2 - nu)/G.
    """

    way: Array
    force: Array
    dissipation: float
    normal: float
    width: float
    compliance: float

    @property
    def share(self) -> float:
        """Q/(mu P) at the ends."""
        return float(np.ptp(self.force)) / (2 * MU * self.normal)

    @property
    def area(self) -> float:
        """The loop's area by the trapezoidal rule."""
        return abs(float(np.sum((self.force[1:] + self.force[:-1]) / 2 * np.diff(self.way))))

    @property
    def exact(self) -> float:
        """The area of Mindlin and Deresiewicz."""
        x, force = self.share, MU * self.normal
        bracket = 1 - (1 - x) ** (5 / 3) - 5 * x / 6 * (1 + (1 - x) ** (2 / 3))
        return 0.9 * force**2 * self.compliance / self.width * bracket

    def curve(self, force: Array, sign: float) -> Array:
        """Return the closed form's way back (sign -1) or there (1) at some forces, by Masing."""
        end, scale = self.share, MU * self.normal
        factor = 3 * scale * self.compliance / (16 * self.width)
        half = (end + sign * force / scale) / 2
        first, along = (1 - (1 - part) ** (2 / 3) for part in (end, half))
        return np.asarray(sign * factor * (2 * along - first))


def turn(
    poisson: float,
    elements: float,
    steps: int,
    degree: int = 1,
    press: float = PRESS,
    shear: float = SHEAR,
) -> Loop:
    """Press, push, and move there and back.

    Parameters
    ----------
    poisson
        Of both balls.
    elements
        In Hertz's a, or about.
    steps
        From the middle to an end of the way.
    degree
        Of the space.
    press, shear
        How far the cuts approach each other, and half the way along x.
    """
    width = np.sqrt(RADIUS / 2 * press)
    case = {
        "mesh": {
            "generator": "two_spheres",
            "quarters": 2,
            "radius": RADIUS,
            "size": 15.0,
            "contact_size": width / elements,
            "contact_width": 1.3 * width,
            "growth": 0.3,
        },
        "space": {"degree": degree},
        "material": {"young": YOUNG, "poisson": poisson},
        "fixed": [
            {"on": "symmetry_y", "displacement": ["free", 0.0, "free"]},
            {"on": "lower_cut", "displacement": [0.0, 0.0, 0.0]},
            {"on": "upper_cut", "displacement": [shear, 0.0, "free"], "amplitude": "shear"},
            {"on": "upper_cut", "displacement": ["free", "free", -press], "amplitude": "press"},
        ],
        "contact": {"on": "upper_round", "against": "lower_round"},
        "friction": {"law": "coulomb", "mu": MU},
    }
    rows, turning = moved(case, steps)
    # Both halves of the balls.
    normal = -2 * rows[-1]["contact_force_z"]
    modulus, rigidity = YOUNG / (2 * (1 - poisson**2)), YOUNG / (2 * (1 + poisson))
    return Loop(
        np.array([row["driven_x"] for row in turning]),
        np.array([2 * row["driven_force_x"] for row in turning]),
        2 * sum(row["dissipation"] for row in turning[1:]),
        normal,
        float((3 * normal * RADIUS / 2 / (4 * modulus)) ** (1 / 3)),
        2 * (2 - poisson) / rigidity,
    )


def moved(case: dict[str, Any], steps: int) -> tuple[list[Row], list[Row]]:
    """Press, push, move there and back; return the rows of all steps, and of the turn."""
    case["evolution"] = {
        "times": [0.0, 1.0, 2.0, 3.0, 4.0],
        "steps": [1, 1, 2 * steps, 2 * steps],
        "amplitudes": {
            "press": {"time": [0.0, 1.0, 4.0], "value": [0.0, 1.0, 1.0]},
            "shear": {"time": [0.0, 1.0, 2.0, 3.0, 4.0], "value": [0.0, 0.0, 1.0, -1.0, 1.0]},
        },
    }
    rows = [record.row for record in solved(parse_case(case)).steps]
    return rows, [row for row in rows if row["t"] > 2 - 1e-9]


def turn_of_cylinders(elements: float, steps: int, degree: int = 1) -> float:
    """Return the dissipation of a turn of two cylinders over the closed form.

    The tangential force is Q = mu (P - P_c), at the way mu (d(P) - d(P_c)) of the normal problem
    (Jaeger, Ciavarella), whose stiffness is constant but for -ln(P)/(pi E*): the loop is eight
    times mu^2 the area between d(P) and its chord (Masing).

    Parameters
    ----------
    elements
        In Hertz's a, or about.
    steps, degree
        As of `turn`.
    """
    width, young = 0.52, 1000.0
    sizes = {"contact_size": width / elements, "contact_width": 1.3 * width}
    case = {
        "mesh": {"generator": "two_half_cylinders", **sizes},
        "space": {"degree": degree},
        "material": {"young": young, "poisson": 0.3},
        "fixed": [
            {"on": "lower_cut", "displacement": [0.0, 0.0]},
            {"on": "upper_cut", "displacement": [0.03, "free"], "amplitude": "shear"},
            {"on": "upper_cut", "displacement": ["free", -0.1], "amplitude": "press"},
        ],
        "contact": {"on": "upper_arc", "against": "lower_arc"},
        "friction": {"law": "coulomb", "mu": MU},
    }
    rows, turning = moved(case, steps)
    normal = -rows[-1]["contact_force_y"]
    share = float(np.ptp([row["driven_force_x"] for row in turning])) / (2 * MU * normal)
    loads = np.linspace((1 - share) * normal, normal, 10_001)
    yields = -2 * 0.91 / (np.pi * young) * np.log(loads)
    chord = (loads[-1] - loads[0]) / 2 * np.trapezoid(yields, loads)
    between = chord - np.trapezoid((loads - loads[0]) * yields, loads)
    taken = sum(row["dissipation"] for row in turning[1:])
    return float(taken / (8 * MU**2 * between))


def draw(report: Report, loop: Loop) -> None:
    """Draw a loop over the closed form."""
    end = loop.share * MU * loop.normal
    # Half balls yield where they are held too, in proportion to the force.
    signs = np.sign(np.diff(loop.way, prepend=loop.way[0] + 1))
    exact = np.where(signs < 0, loop.curve(-loop.force, 1.0) * -1, loop.curve(loop.force, 1.0))
    share = float(loop.force @ (loop.way - exact) / (loop.force @ loop.force))
    figure, ax = subplots(size=(ONE_COLUMN, 2.6))
    fine = np.linspace(-end, end, 401)
    way = loop.curve(fine, 1.0)
    ax.plot(np.concatenate([way, -way]), np.concatenate([fine, -fine]) / (MU * loop.normal), "k-",
            lw=0.8, label="Mindlin, Deresiewicz")  # fmt: skip
    own = loop.way - share * loop.force
    ax.plot(own, loop.force / (MU * loop.normal), "o", ms=3, label="computed")
    ax.set_xlabel(r"$\delta_x$ near the contact")
    ax.set_ylabel(r"$Q/(\mu P)$")
    ax.locator_params(axis="x", nbins=5)
    ax.legend()
    report.figure(
        "mindlin-loop",
        "Two balls moved back and forth: force over displacement",
        figure,
        {"way": own, "force": loop.force},
        f"Of the way {share:.3g} a unit force, the half balls' deformation elsewhere, is left out: "
        "one number, fitted, that no area depends on.",
    )


if __name__ == "__main__":
    main()
