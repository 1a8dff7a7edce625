"""Indentation in 3-D: a ball beside its body of revolution, and a punch that a moment tilts.

`python3 -m scripts.studies.indentation_in_space [--out DIR] [--coarse]`, also under mpirun.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from contact import Case, Solution, load_case, parse_case
from contact.results.resultants import charge_balance, movements
from contact.typing import Array
from scripts.cases import CASES
from scripts.reporting import Report, append, empty, observed_orders, solved
from scripts.studies.indentation import COUPLING, THESIS

#: How far the cut of the ball is lowered; potential of the conducting plate (GV).
DEPTH, POTENTIAL = 0.6, 0.002

#: Poisson's ratio and moment of half the punch, of radius 1 and modulus 1.
POISSON, MOMENT = 0.3, 0.0005

#: Sizes of elements along the edge of the punch, by fineness.
ARCS = {2.0: 0.24, 2.5: 0.2}


def ball(space: bool, n: float, degree: int = 1) -> Case:
    """Return half a ball of radius 10 that is pressed on a plate, with elements of size 2.4/n."""
    mesh: dict[str, Any] = {"radius": 10.0, "size": 6.0 / n}
    mesh |= {"contact_size": 2.4 / n, "contact_width": 3.0, "growth": 1.2 / n}
    mesh["generator"] = "sphere" if space else "quarter_disc"
    free = ["free", "free"] if space else ["free"]
    fixed: list[dict[str, Any]] = [{"on": "top", "displacement": [*free, -DEPTH]}]
    if space:
        fixed.append({"on": "symmetry_x", "displacement": [0.0, "free", "free"]})
        fixed.append({"on": "symmetry_y", "displacement": ["free", 0.0, "free"]})
    else:
        fixed.append({"on": "symmetry", "displacement": [0.0, "free"]})
    zero = [0.0] * len(free)
    plane = {"shape": "plane", "point": [*zero, 0.0], "normal": [*zero, 1.0]}
    elements: dict[str, Any] = {"degree": degree}
    if not space:
        elements["kinematics"] = "axisymmetric"
    return parse_case(
        {
            "mesh": mesh,
            "space": elements,
            "material": {"young": 1000.0, "poisson": 0.3},
            "fixed": fixed,
            "contact": {"on": "contact", "foundation": plane},
        }
    )


def poled(space: bool, n: float, degree: int, conducting: bool) -> Case:
    """Return the ball of the thesis's material, poled along its axis, grounded on its cut."""
    data = ball(space, n, degree).model_dump(exclude_unset=True)
    data["material"] = {**THESIS, "piezo": COUPLING}
    data["fixed"][0]["potential"] = 0.0
    if conducting:
        data["electric"] = {"law": "shifted", "k_e": 100.0, "delta": 10.0, "phi_f": POTENTIAL}
    return parse_case(data)


def measured(space: bool, n: float, conducting: bool, degree: int = 1) -> Array:
    """Return the force, and the charge drawn or the potential at the tip. Collective."""
    solution = solved(poled(space, n, degree, conducting))
    turn, problem = 4 if space else 1, solution.problem
    force = turn * float(solution.contact_force[-1])
    if conducting:
        return np.array([force, turn * charge_balance(problem, solution.state).foundation])
    # The tip is the first that touches, and the potential is largest there.
    phi = problem.body.phi_scale * solution.nodal[:, -1]
    r = np.linalg.norm(problem.nodes.points, axis=1)
    near = problem.comm.allgather((r.min(initial=np.inf), phi[r.argmin()] if r.size else 0.0))
    return np.array([force, min(near)[1]])


def beside_revolution(report: Report) -> None:
    """Tabulate the errors of half plane and space against a fine half plane. Collective."""
    exact = {kind: measured(False, 8 if report.coarse else 32, kind, 2) for kind in (False, True)}
    columns = empty("mesh", "n", "P, insulating", "phi", "P, conducting", "Q")
    for space in (False, True):
        sizes = (2, 3) if report.coarse else (4, 8, 12) if space else (4, 8, 16)
        errors = [
            np.concatenate([np.abs(measured(space, n, k) / exact[k] - 1) for k in (False, True)])
            for n in sizes
        ]
        kind = "space" if space else "half plane"
        for n, row in zip(sizes, errors, strict=True):
            append(columns, kind, n, *row)
        orders = -np.polyfit(np.log(sizes), np.log(errors), 1)[0]
        append(columns, kind, "order", *orders)
    note = (
        "Errors of P1 elements of size 2.4/n at the contact against P2 elements with n = 32 on the "
        "half plane; phi at the tip. Orders are fitted."
    )
    report.table("in-space", "A quarter of a ball beside the body of revolution", columns, note)


def punch(n: float, *more: str) -> Case:
    """Return the tilted punch, `n` times as fine as the coarsest one; `more` are overrides."""
    sizes = {"contact_size": 0.4 / n, "edge_size": 0.02 / n**2, "growth": 0.8 / n}
    changes = [f"mesh.{key}={value}" for key, value in sizes.items()]
    return load_case(CASES / "indent-punch-tilted.toml", [*changes, *more])


def rotation(solution: Solution) -> float:
    """Return the rotation of the punch over that of M = (4/3) E* a^3 theta. Collective."""
    turned = movements(solution.problem, solution.state)["rigid"]["rotation"]
    assert isinstance(turned, list)
    return float(np.deg2rad(turned[1]) * 4 / 3 / (1 - POISSON**2) / (2 * MOMENT))


def tilted_punch(report: Report) -> None:
    """Tabulate rotations, and the costs of a solve, condensed and not. Collective."""
    columns = empty(
        "n", "extent", "unknowns", "theta", "order", "solves", "seconds", "solves, lu",
        "seconds, lu",
    )  # fmt: skip
    sizes = (0.25, 0.5) if report.coarse else (0.5, 1.0, 2.0, 2.5)
    rows = []
    for n, extent in [*((n, 10.0) for n in sizes), (sizes[1], 20.0)]:
        more = [f"mesh.extent={extent}", f"mesh.size={extent / 3}"]
        more.append(f"mesh.arc_size={ARCS.get(n, 0.3)}")
        took: list[object] = []
        for linear in ("auto", "lu"):
            begin = time.process_time()
            solution = solved(punch(n, *more, f"solver.linear={linear}"))
            took += [solution.counters.linear_solves, time.process_time() - begin]
        unknowns = solution.problem.body.layout.unknowns
        rows.append((n, extent, unknowns, rotation(solution), took))
    errors = [1 - row[3] for row in rows[:-1]]
    orders = observed_orders([1 / n for n in sizes], errors)
    for (n, extent, unknowns, theta, took), order in zip(rows, [*orders, np.nan], strict=True):
        append(columns, n, extent, unknowns, theta, order, *took)
    note = (
        "Rotations over the closed form's; solves of the whole body by Newton's method, and "
        "seconds of the processor, with solver.linear = auto and lu, meshes included."
    )
    report.table("tilted-punch", "A circular punch under force and moment", columns, note)


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the tables."""
    report = Report.of(__doc__, "indentation", arguments)
    beside_revolution(report)
    tilted_punch(report)


if __name__ == "__main__":
    main()
