"""Non-local friction at work: Example 7.2 over the radius of the smoothing operator R.

`python3 -m scripts.studies.nonlocal_friction [--out DIR] [--coarse]`, also under mpirun.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI

from contact import Solution
from contact.results.contact_nodes import Table, contact_table
from scripts.cases import bar
from scripts.reporting import TWO_COLUMNS, Report, append, empty, solved, subplots
from scripts.studies.error_norms import errors

RHO = 1e4
LOADS = (-0.005, -0.05)

#: Remark on all tables.
NOTE = (
    "R smooths the pressure in the friction bound s = mu |R sigma_nu| alone. Where the pressure "
    "varies quickly, at the end of the bar and at the ends of the contact zones, the bound is "
    "spread over the radius. It is then positive on open nodes too, as in (3.6). For this law "
    "existence is proved, and uniqueness if friction is small; the thesis computes with the "
    "radius 0. A radius of at most h does not smooth on the mesh."
)


def radii(n: int) -> dict[str, float]:
    """Return the radii of the study: 0, h, and parts of the bar's height."""
    return {"0": 0.0, "h": 1.0 / n, "0.05": 0.05, "0.1": 0.1, "0.2": 0.2}


def study(report: Report, n: int, load: float) -> dict[str, Solution]:
    """Tabulate and draw the solutions over the radius. Collective."""
    columns = empty(
        "radius", "Newton steps", "factorizations", "Algorithm 1: outer", "inner", "max pressure",
        "contact force", "friction force", "stick", "slip", "u - u(0) in energy", "residual",
        "residual (Alg. 1)",
    )  # fmt: skip
    solutions: dict[str, Solution] = {}
    tables: dict[str, Table | None] = {}
    local = None
    for label, radius in radii(n).items():
        change = f"friction.radius={radius}"
        uzawa = solved(bar(n, load, RHO, change, "solver.method=uzawa"))
        solution = solved(bar(n, load, RHO, change))
        local = local or solution
        # Each problem has a mesh of its own, with the same numbering.
        nodes, body, x = solution.problem.nodes, solution.problem.body, solution.state.x
        relative = errors(body, x, body.function(local.state.x)) / errors(body, x, None)
        status = nodes.gather(solution.status)
        records = uzawa.history
        force = solution.contact_force
        append(
            columns,
            label,
            len(solution.history),
            solution.counters.factorizations,
            len(records),
            sum(r.inner for r in records),
            nodes.maximum(solution.pressure),
            -force[1],
            force[0],
            int(np.count_nonzero(status == "stick")),
            int(np.count_nonzero(status == "slip")),
            relative.energy,
            solution.outcome.residuals.largest,
            uzawa.outcome.residuals.largest,
        )
        solutions[label], tables[label] = solution, contact_table(solution.contact)
    name = f"nonlocal-{abs(load):g}".replace(".", "_")
    where = f"Example 7.2, f2 = {load:g}, rho = {RHO:g}, {4 * n} x {n} cells"
    report.table(
        f"{name}-table",
        f"Smoothing radius of R: {where}",
        columns,
        NOTE if load == LOADS[0] else "",
    )
    if MPI.COMM_WORLD.rank == 0:
        _draw(report, name, where, tables)
    return solutions


def _draw(report: Report, name: str, where: str, tables: dict[str, Table | None]) -> None:
    figure, axes = subplots(3, 2, size=(TWO_COLUMNS, 6.6), sharex="col")
    data: dict[str, Sequence[float]] = {}
    for label, table in tables.items():
        # A radius up to h changes nothing: that curve lies on the one of radius 0.
        look = {"0": {"lw": 2.6, "color": "0.75"}, "h": {"lw": 0.9}}.get(label, {})
        data.setdefault("x", table["x"])
        for row, key in zip(axes, ("pressure", "bound", "tau"), strict=True):
            for ax, near in zip(row, (table["x"] >= 0, table["x"] >= 3.6), strict=True):
                ax.plot(table["x"][near], table[key][near], label=f"radius {label}", **look)
            data[f"{key}, radius {label}"] = table[key]
            # The peak at the end would hide all else.
            usual = 1.6 * float(np.quantile(np.abs(table[key]), 0.97))
            row[0].set_ylim(-usual if key == "tau" else 0.0, usual)
    for row, label in zip(axes, (r"-\sigma_\nu", "s", r"-\sigma_\tau\cdot t"), strict=True):
        row[0].set_ylabel(f"${label}$ (daN/mm²)")
    axes[0, 1].legend()
    axes[2, 0].set_xlabel(r"$x$ along $\Gamma_3$ (mm), peaks cut off")
    axes[2, 1].set_xlabel(r"$x$ (mm), the end that the load presses down")
    caption = f"Pressure, bound and tangential stress over the radius of R: {where}"
    report.figure(name, caption, figure, data)


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the tables and figures."""
    report = Report.of(__doc__, "nonlocal_friction", arguments)
    for load in LOADS:
        study(report, 8 if report.coarse else 64, load)


if __name__ == "__main__":
    main()
