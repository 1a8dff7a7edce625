"""Two elastic bodies against closed forms: Hertz's contacts, and rings that overlap.

python3 -m scripts.studies.two_bodies [--out DIR] [--coarse]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contact import load_case, parse_case
from contact.results.contact_nodes import Table, contact_table
from contact.solution import Solution
from scripts.cases import CASES
from scripts.reporting import Report, append, empty, solved
from scripts.studies.curved_foundations import ratios, two_rings
from scripts.studies.hertz_exact import line_contact

#: E/(1 - nu^2) of steel and aluminium of the cylinder on a block, radius there.
STEEL, ALUMINIUM, RADIUS = 210e3 / 0.91, 70e3 / 0.91, 50.0

#: Load steps of the cylinder on a block with friction.
STEPS = 32

#: Round bodies (SSNV104 of code_aster): radius and Young's modulus of both.
BALL, YOUNG = 50.0, 20e3


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the tables."""
    report = Report.of(__doc__, "two_bodies", arguments)
    coarse = (1.2, 0.6) if report.coarse else (1.2, 0.6, 0.3, 0.15)
    hertz(report, coarse)
    round_bodies(report, (5, 10) if report.coarse else (5, 10, 20))
    rings(report, (0.1, 0.05) if report.coarse else (0.1, 0.05, 0.025))


def hertz(report: Report, sizes: Sequence[float]) -> None:
    """Write half width, largest pressure and stick ratio of the cylinder on a block.

    With friction in one step and in `STEPS`, and at smaller loads, where the contact is small
    beside the cylinder.
    """
    rows = empty("mu", "steps", "load", "h/a", "a", "p_0", "stick", "u_y")
    modulus = 1 / (1 / STEEL + 1 / ALUMINIUM)
    runs = [(0.0, 1, 1.0, size) for size in sizes] + [(0.1, 1, 1.0, sizes[-1])]
    runs += [(0.1, STEPS, 1.0, size) for size in sizes]
    runs += [(0.1, STEPS, share, sizes[-1]) for share in (1 / 4, 1 / 16, 1 / 64)]
    for mu, steps, share, size in runs:
        # Lengths and pressures grow like the root of the load.
        root = np.sqrt(share)
        a, p_0 = line_contact(35e3 * share, modulus, RADIUS)
        changes = [
            f"mesh.contact_size={size * root}",
            f"mesh.contact_width={8.0 * root}",
            f"friction.mu={mu}",
            "evolution.times=[0.0, 1.0]",
            f"evolution.steps=[{steps}]",
            f"load.0.traction=[0.0, '-{350.0 * share}*t']",
        ]
        solution = solved(load_case(CASES / "cylinder-on-block.toml", changes))
        table = contact_table(solution.contact)
        force = table["weight"] * table["pressure"]
        found = 2 * np.sqrt(np.sum(force * table["x"] ** 2) / np.sum(force))
        touches = table["pressure"] > 0
        sticks = table["weight"][touches & (table["status"] == "stick")].sum()
        ratio = sticks / table["weight"][touches].sum() if mu > 0 else np.nan
        peak = float(table["pressure"].max())
        append(
            rows, mu, steps, share, size * root / a, found / a, peak / p_0, ratio, middle(solution)
        )
    report.table(
        "two-bodies-hertz",
        "Cylinder on a block (NAFEMS R0094-1): a and p_0 over Hertz's, stick ratio, depth",
        rows,
        "At the load 1, 35 kN/mm, Hertz has a = 6.215 mm. a: by the second moment of the "
        "pressure. stick: the share of the contact that sticks. u_y (mm): displacement of the "
        "middle of the block's top.",
    )


def middle(solution: Solution) -> float:
    """Return how far the middle of the block's top moves."""
    u = solution.displacement
    points = u.function_space.tabulate_dof_coordinates()
    at = np.linalg.norm(points, axis=1) < 1e-9 * BALL
    return float(u.x.array.reshape(-1, 2)[at, 1].mean())


@dataclass(frozen=True)
class Pressed:
    """Two equal round bodies, cut in half and moved by their cuts, and Hertz's values for them."""

    #: How far each cut is moved.
    push: float
    #: Of all of the contact; a unit length of cylinders.
    force: float
    #: Half width and largest pressure, found over those of Hertz at this force.
    a: float
    p_0: float
    #: Hertz's a.
    width: float


def pressed(kinematics: str, degree: int, push: float, elements: float) -> Pressed:
    """Press two balls ("axisymmetric") or cylinders ("plane_strain") on each other."""
    balls = kinematics == "axisymmetric"
    width = np.sqrt(BALL * push) if balls else 0.8 * np.sqrt(BALL * push)
    up, down = ({"on": f"{name}_cut", "displacement": ["free", sign * push]}
                for name, sign in (("lower", 1.0), ("upper", -1.0)))  # fmt: skip
    sizes = {"size": 6.0 if balls else 1.5 * degree, "contact_size": width / elements}
    case = {
        "mesh": {"generator": "two_balls", **sizes, "contact_width": 1.25 * width},
        "space": {"kinematics": kinematics, "degree": degree},
        "material": {"young": YOUNG, "poisson": 0.3},
        "fixed": [up, down],
        "contact": {"on": "upper_arc", "against": "lower_arc"},
    }
    if not balls:
        case["fixed"].append({"on": "symmetry", "displacement": [0.0, "free"]})
    table = contact_table(solved(parse_case(case)).contact)
    x, share = table["x"], table["weight"] * table["pressure"]
    force = float(share.sum()) * (1 if balls else 2)
    modulus, radius = YOUNG / (2 * 0.91), BALL / 2
    if balls:
        a = (3 * force * radius / (4 * modulus)) ** (1 / 3)
        p_0, moment = 1.5 * force / (np.pi * a**2), 5 / 2
    else:
        (a, p_0), moment = line_contact(force, modulus, radius), 4.0
    found = np.sqrt(moment * np.sum(share * x**2) / np.sum(share))
    return Pressed(push, force, float(found) / a, summit(table, a) / p_0, a)


def summit(table: Table, a: float) -> float:
    """Return the largest pressure: that of the ellipse p^2 = p_0^2 (1 - x^2/b^2) fitted within a.

    Pressures of single nodes, of which there are few near an axis, scatter about it.
    """
    x, p, weight = table["x"], table["pressure"], table["weight"]
    near = (np.abs(x) < 0.9 * a) & (p > 0)
    root = np.sqrt(weight[near])
    columns = np.column_stack([root, -root * x[near] ** 2])
    return float(np.sqrt(np.linalg.lstsq(columns, root * p[near] ** 2)[0][0]))


def approach(small: Pressed, large: Pressed, kinematics: str) -> float:
    """Return the approach of two bodies over Hertz's, without the deformation far from the contact.

    Hertz's is that of half spaces; bodies of finite size move too where they are constrained. For
    balls that share is proportional to the force, against force^(2/3): two forces tell both apart.
    Two half planes have no approach but by its change with the half width, -2/(pi E*) log a a unit
    force.
    """
    if kinematics == "axisymmetric":
        first, second = (2 * p.push * BALL / 2 / p.width**2 for p in (small, large))
        return first - (second - first) * small.width / (large.width - small.width)
    modulus = YOUNG / (2 * 0.91)
    first, second = (np.pi * modulus * p.push / p.force for p in (small, large))
    return float((first - second) / np.log(large.width / small.width))


def round_bodies(report: Report, counts: Sequence[float]) -> None:
    """Write a, p_0 and approach of two balls and of two cylinders over Hertz's, for some meshes."""
    rows = empty("bodies", "P", "a/h", "a", "p_0", "approach")
    for name, kinematics, degree, push in (
        ("balls", "axisymmetric", 1, 2.0),
        ("balls", "axisymmetric", 2, 2.0),
        ("cylinders", "plane_strain", 1, 1.0),
        ("cylinders", "plane_strain", 2, 1.0),
    ):
        for count in counts:
            small, large = (pressed(kinematics, degree, u, count) for u in (push / 4, push))
            way = approach(small, large, kinematics)
            append(rows, name, degree, count, small.a, small.p_0, way)
    report.table(
        "two-bodies-round",
        "Two equal balls (SSNV104) and cylinders over Hertz",
        rows,
        "a: by the second moment of the pressure; p_0: by an ellipse fitted to it, at the "
        "computed force. The approach follows from two forces, without the effect of the cuts far "
        "from the contact.",
    )


def rings(report: Report, sizes: Sequence[float]) -> None:
    """Write the pressures of two rings with a small interference over the exact one."""
    rows = empty("degree", "h", "mean", "least", "largest")
    for degree in (1, 2):
        for h in sizes:
            pressure, weight = ratios(*two_rings(h, degree))
            mean = float(pressure @ weight / weight.sum())
            append(rows, degree, h, mean, float(pressure.min()), float(pressure.max()))
    report.table(
        "two-rings",
        "Two rings with an overlap of 0.001: contact pressure over the exact one",
        rows,
        "Radii 1, 1.5 and 2, a quarter by symmetry, plane strain; straight triangles of size h. "
        "Mean, and least and largest at a node.",
    )


if __name__ == "__main__":
    main()
