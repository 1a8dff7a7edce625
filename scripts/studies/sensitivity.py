"""How much the parameters that the thesis does not print decide: rho, delta, the layer, R.

`python3 -m scripts.studies.sensitivity [--out DIR] [--coarse]`, also under mpirun.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from contact import build_problem, solve
from scripts.cases import on_grid
from scripts.reporting import Report


@dataclass(frozen=True)
class Sweep:
    """One parameter of one case."""

    #: Of the thesis.
    example: str
    #: Case file, and the key that is changed.
    case: str
    key: str
    #: Of the parameter.
    values: Sequence[float]
    #: The mesh, along and across.
    cells: tuple[int, int]
    #: The observation.
    note: str = ""


LAYERED, LAYER = "8.4 with a layer of thickness 0.1", "compliance-8-4-layer"

SWEEPS: Mapping[str, Sweep] = {
    "rho-7": Sweep(
        "7.2, f2 = -0.005", "bar", "friction.mu.rho",
        (1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 6e7), (128, 32),
        note="The thesis prints rho for its tables and for Figures 7.7 and 7.8. The choice of rho "
             "changes the force by 0.1 % and the largest pressure by 0.2 %. With a large rho "
             "there are several solutions; this is the one that Newton's method finds from the "
             "zero initial guess ([methods "
             "compared](thesis-studies.md#agreement-of-the-methods)).",
    ),
    "rho": Sweep(
        "8.2", "piezo-8-2", "friction.mu.rho",
        (1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e4, 1e5), (64, 32),
        note="The thesis prints no rho here; the case takes 1.",
    ),
    "delta": Sweep(
        "8.4", "compliance-8-4", "electric.delta",
        (0.5, 1.0, 2.0, 10 / 3, 5.0, 8.0, 12.0), (192, 32),
        note="By default delta = 10/3. The thesis says that delta is small. Beyond 8 the ramp is "
             "narrower than two spacings of the nodes: patches appear and vanish with the mesh, "
             "and the parameter has no meaning.",
    ),
    "c_nu": Sweep(
        LAYERED, LAYER, "contact.stiffness", (0.1, 1.0, 3.0, 10.0, 30.0, 100.0, 1000.0),
        (96, 16), note="The case takes 10.",
    ),
    "alpha_nu": Sweep(
        LAYERED, LAYER, "contact.potential_factor",
        (1.0, 1.5, 2.0, 3.0, 5.0, 10.0), (96, 16), note="The case takes 2.",
    ),
    "n_nu": Sweep(
        LAYERED, LAYER, "contact.limit", (0.01, 0.02, 0.05, 0.1, 0.2, 0.5), (96, 16),
        note="The case takes 0.1, the thickness of the layer. A larger limit has no effect, for "
             "the rigid part is reached first.",
    ),
    "radius": Sweep(
        "8.4", "compliance-8-4", "friction.radius",
        (0.0, 0.1, 0.2, 0.4, 0.8, 1.6), (96, 16),
        note="The case takes 0, R = identity, as the thesis computes.",
    ),
}  # fmt: skip


def study(report: Report, name: str) -> None:
    """Tabulate contact force and pressure over one parameter. Collective."""
    sweep = SWEEPS[name]
    cells = (24, 24 // (sweep.cells[0] // sweep.cells[1])) if report.coarse else sweep.cells
    parameter = name.partition("-")[0]
    rows: list[dict[str, object]] = []
    domain = None
    for value in sweep.values:
        case = on_grid(sweep.case, cells, "solver.method=newton", f"{sweep.key}={value}")
        solution = solve(build_problem(case, domain=domain), case.solver)
        domain, nodes = solution.problem.domain, solution.problem.nodes
        closed = nodes.sum(np.where(solution.status == "open", 0.0, 1.0 / nodes.weight))
        rows.append(
            {
                parameter: value,
                "contact force": float(-solution.contact_force[1]),
                "max p": nodes.maximum(solution.pressure),
                "p in L2": nodes.norm(solution.pressure),
                "in contact": int(closed),
                "converged": solution.converged,
                "residual": solution.outcome.residuals.largest,
            }
        )
    caption = f"Sensitivity to {parameter}: Example {sweep.example}, {cells[0]} x {cells[1]} cells"
    report.table(f"sensitivity-{name}-table", caption, rows, sweep.note)


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the tables. Collective."""
    report = Report.of(__doc__, "sensitivity", arguments)
    for name in SWEEPS:
        study(report, name)


if __name__ == "__main__":
    main()
