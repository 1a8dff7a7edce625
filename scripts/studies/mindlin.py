"""Two balls, or cylinders, pressed on each other and moved back and forth: Mindlin and Deresiewicz.

python3 -m scripts.studies.mindlin [--out DIR] [--coarse]

One half, y >= 0, of two half balls in 3-D, or two half cylinders in the plane. Their cuts stay at
a distance while one is moved along x and back: the dissipation of a turn is the area of the
loop, and both have a closed form. That of balls is the one of half spaces: the finite size of the
balls changes it in proportion to a/R. The mesh of the balls is that of a half plane, fine where
the contact slips, turned about the axis.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from contact import parse_case
from contact.typing import Array
from meshes.grading import Sizes, finish
from meshes.turning import turn as turned
from scripts.reporting import ONE_COLUMN, Report, append, empty, solved, subplots

#: Radius (mm) and Young's modulus (N/mm^2) of the balls, and the friction coefficient.
RADIUS, YOUNG, MU = 50.0, 20e3, 0.3

#: Half width of the contact of the cylinders, their modulus and Poisson's ratio.
WIDTH, MODULUS, POISSON = 0.52, 1000.0, 0.3

#: Results of a step.
Row = Mapping[str, Any]

#: How far the cuts approach each other, and half the way along x over that.
PRESS, SHEAR = 0.125, 0.2

#: Middle of the ring in which elements have the smallest size, and half its width, over a; growth
#: of the elements beyond it, and their largest size.
RING, GROWTH, LARGEST = (0.8, 0.3), 0.5, 15.0


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the table and the figure."""
    report = Report.of(__doc__, "mindlin", arguments)
    fine = [(0.0, PRESS, 6, 8), (0.0, PRESS, 12, 8), (0.0, PRESS, 12, 12), (0.0, PRESS, 18, 12)]
    fine += [(0.0, 4 * PRESS, 12, 12), (0.0, PRESS / 4, 12, 12), (0.3, PRESS, 12, 12)]
    runs = [(0.0, PRESS, 4, 6)] if report.coarse else fine
    rows = empty("nu", "a/R", "a/h", "sectors", "Q/(mu P)", "area", "dissipation")
    for k, (poisson, press, elements, sectors) in enumerate(runs):
        loop = turn(poisson, elements, sectors, press)
        ratios = loop.area / loop.exact, loop.dissipation / loop.exact
        append(rows, poisson, loop.width / RADIUS, elements, sectors, loop.share, *ratios)
        if k == 0 or elements == 18:
            shown = loop
    report.table(
        "mindlin",
        "Two balls: area of the loop, and dissipation, over the closed form",
        rows,
        "a/h: elements in Hertz's a where the contact slips; sectors: of the half turn. A cycle "
        "has twelve steps, with which the trapezoidal rule underestimates the area by 3 %. The "
        "closed form is that of half spaces (a/R = 0). It takes all friction to act along x, "
        "which is exact for nu = 0.",
    )
    draw(report, shown)
    plane = empty("degree", "a/h", "dissipation")
    for degree in (1, 2):
        for elements in (6,) if report.coarse else (6, 12, 24, 48, 96)[: 7 - 2 * degree]:
            append(plane, degree, elements, turn_of_cylinders(elements, 3, degree))
    report.table(
        "mindlin-plane",
        "Two cylinders: dissipation of a cycle, over the closed form",
        plane,
        "In twelve steps; with 24 of them it is the same to 1e-4.",
    )


@dataclass(frozen=True)
class Loop:
    """A turn of the upper ball, there and back, over one and the same force Q at its ends."""

    #: Displacement of the cut along x, and its driving force, at the ends of steps.
    way: Array
    force: Array
    #: Dissipation of friction in the turn.
    dissipation: float
    #: P, Hertz's a, and k = sum (2 - nu)/G.
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


def write_mesh(path: Path, width: float, elements: float, sectors: int) -> None:
    """Write the halves y > 0 of two half balls."""
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        geo, bodies, parts = gmsh.model.geo, {}, {}
        x, middles = RING[0] * width, []
        for name, sign in (("upper", 1.0), ("lower", -1.0)):
            height = RADIUS - np.sqrt(RADIUS**2 - x**2)
            places = (0, 0), (RADIUS, sign * RADIUS), (0, sign * RADIUS), (x, sign * height)
            low, side, centre, middle = (geo.addPoint(*place, 0) for place in places)
            arcs = [geo.addCircleArc(low, centre, middle), geo.addCircleArc(middle, centre, side)]
            cut, axis = geo.addLine(side, centre), geo.addLine(centre, low)
            bodies[name] = [geo.addPlaneSurface([geo.addCurveLoop([*arcs, cut, axis])])]
            parts |= {f"{name}_round": arcs, f"{name}_cut": [cut]}
            middles.append(middle)
        sizes = Sizes(LARGEST, width / elements, RING[1] * width, GROWTH)
        finish(gmsh, 2, bodies, parts, sizes, points=middles)
        turned(gmsh, sectors)
        gmsh.write(str(path))
    finally:
        gmsh.finalize()


def balls(
    path: Path, elements: float, sectors: int, way: float, press: float = PRESS, nu: float = 0.0
) -> dict[str, Any]:
    """Return half of two half balls, moved along by a way, and write their mesh."""
    write_mesh(path, np.sqrt(RADIUS / 2 * press), elements, sectors)
    return {
        "mesh": {"file": str(path)},
        "material": {"young": YOUNG, "poisson": nu},
        "fixed": [
            {"on": "upper_cut", "displacement": [way, 0.0, "free"], "amplitude": "shear"},
            {"on": "upper_cut", "displacement": ["free", "free", -press], "amplitude": "press"},
            {"on": "symmetry", "displacement": ["free", 0.0, "free"]},
            {"on": "lower_cut", "displacement": [0.0, 0.0, 0.0]},
        ],
        "contact": {"on": "upper_round", "against": "lower_round"},
        "friction": {"law": "coulomb", "mu": MU},
    }


def cylinders(elements: float, degree: int, way: float) -> dict[str, Any]:
    """Return two half cylinders, moved along by a way."""
    sizes = {"contact_size": WIDTH / elements, "contact_width": 1.3 * WIDTH}
    return {
        "mesh": {"generator": "two_half_cylinders", **sizes},
        "space": {"degree": degree},
        "material": {"young": MODULUS, "poisson": POISSON},
        "fixed": [
            {"on": "upper_cut", "displacement": [way, "free"], "amplitude": "shear"},
            {"on": "upper_cut", "displacement": ["free", -0.1], "amplitude": "press"},
            {"on": "lower_cut", "displacement": [0.0, 0.0]},
        ],
        "contact": {"on": "upper_arc", "against": "lower_arc"},
        "friction": {"law": "coulomb", "mu": MU},
    }


def turn(
    poisson: float, elements: float, sectors: int, press: float = PRESS, steps: int = 3
) -> Loop:
    """Press, push, and move there and back. Serial."""
    with tempfile.TemporaryDirectory() as folder:
        case = balls(Path(folder) / "balls.msh", elements, sectors, SHEAR * press, press, poisson)
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
    """
    rows, turning = moved(cylinders(elements, degree, 0.03), steps)
    normal = -rows[-1]["contact_force_y"]
    share = float(np.ptp([row["driven_force_x"] for row in turning])) / (2 * MU * normal)
    loads = np.linspace((1 - share) * normal, normal, 10_001)
    yields = -2 * (1 - POISSON**2) / (np.pi * MODULUS) * np.log(loads)
    chord = (loads[-1] - loads[0]) / 2 * np.trapezoid(yields, loads)
    between = chord - np.trapezoid((loads - loads[0]) * yields, loads)
    taken = sum(row["dissipation"] for row in turning[1:])
    return float(taken / (8 * MU**2 * between))


def draw(report: Report, loop: Loop) -> None:
    """Draw a loop over the closed form."""
    end = loop.share * MU * loop.normal
    # Half balls yield where they are constrained too, in proportion to the force.
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
    ax.set_xlabel(r"$\delta_x$ near the contact (mm)")
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
