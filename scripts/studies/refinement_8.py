"""Refinement of chapter 8: results of Examples 8.1 to 8.4 on finer and finer meshes.

`python3 -m scripts.studies.refinement_8 [--out DIR] [--coarse]`, also under mpirun. Beside the
default ramp of psi, 0.4 wide in Examples 8.1 and 8.2 and 0.3 in 8.4, stands a steep one of 1/1000
of the body's size, which no mesh resolves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from contact import Solution, solve
from contact.results.resultants import charge_balance
from contact.typing import Array
from scripts.cases import on_grid
from scripts.reporting import Report

#: A mesh that is as symmetric as the problem.
CROSSED = ("mesh.diagonal=crossed",)

#: Example -> case file, cells along the bar over those across it, changes.
EXAMPLES: Mapping[str, tuple[str, int, tuple[str, ...]]] = {
    "8.1": ("piezo-8-1-conductive", 2, ()),
    "8.2": ("piezo-8-2", 2, ()),
    "8.3": ("compliance-8-3", 6, ()),
    "8.4": ("compliance-8-4", 6, CROSSED),
    "8.4, k_e = 0.6": ("compliance-8-4", 6, (*CROSSED, "electric.k_e=0.6")),
}

#: Largest extent of each body with a conductive foundation.
SIZES = {"piezo-8-1-conductive": 8.0, "piezo-8-2": 8.0, "compliance-8-4": 12.0}

#: Slope of the steep ramp, over the largest extent of the body.
STEEP = 1e3

#: Part of the largest extent that "force inside" leaves out at either end of Gamma_3.
AWAY = 0.1

#: Remarks on the columns, which are those of all tables, and observations.
COLUMNS = (
    "Newton's method from the zero initial guess. Moment: that of the pressure about x = 0. "
    "Patches: runs of neighbouring contact nodes. Charge: through the foundation. Several: "
    "whether the program warns of several solutions. Force inside: without a tenth of the bar's "
    "length at either end of Gamma_3, where the pressure is singular at the corners."
)
ALL_CLOSED = (
    "All of Gamma_3 is in contact, and the ramp of psi makes no difference. The largest pressure "
    "is at the free end x = 8, where the bar stands on its edge; it grows without bound. The "
    "force is as accurate as the reaction of the clamp, and a node is fixed at its corner x = 0. "
    "The error of this node falls only like h^0.5 (-10.9, -7.6, -5.3 on 48, 96, 192 cells), and "
    "has the sign opposite to the rest of the error. The force is therefore within 0.4 % on the "
    "first mesh, and its changes then turn their sign. In the moment about x = 0 that node has no "
    "weight. Changes of the moment are halved from level to level, like those of the force inside "
    "and of the charge."
)
NOTES = {
    "8.1": f"{COLUMNS} {ALL_CLOSED}",
    "8.2": "As in Example 8.1.",
    "8.3": "The foundation does not conduct.",
    "8.4": "Diagonals are crossed, so that the mesh is as symmetric as the bar. With the default "
    "ramp there is one patch, and charge and potential converge like h. The force has "
    "converged to 0.06 %; its smaller changes have no order yet. The largest pressure is "
    "in the middle, where the bar sticks between slips to either side. This zone is 0.06 "
    "wide: one node sticks on 192 cells, three on 384. On 576 cells force, charge and "
    "largest pressure are 50.55, -191.4 and 11.45. With the steep ramp no quantity "
    "converges.",
    "8.4, k_e = 0.6": "As in Example 8.4, with less charge; the changes of the force are 0.05 % "
    "of it.",
}

#: Columns of which the table shows the change from level to level.
WATCHED = ("force", "moment", "force inside", "charge")

#: Finest mesh for the steep ramp: beyond, most time would go into effects of the mesh alone.
FINEST_STEEP = 96


def measured(solution: Solution) -> dict[str, object]:
    """Return the observed quantities. Collective."""
    problem, nodes = solution.problem, solution.problem.nodes
    touching = nodes.gather((solution.status != "open").astype(float))
    where, pressure = nodes.gather(nodes.points[:, 0]), nodes.gather(solution.pressure)
    order = np.argsort(where)
    closed = touching[order] > 0
    charges = charge_balance(problem, solution.state)
    phi = problem.body.phi_scale * solution.nodal[:, -1]
    conductor = problem.interface.foundation.conductor
    return {
        "1/delta": np.nan if conductor is None else 1 / conductor.psi.delta,
        "max p": nodes.maximum(solution.pressure),
        "p in L2": nodes.norm(solution.pressure),
        "patches": int(closed[0]) + int(np.sum(closed[1:] & ~closed[:-1])),
        "force": float(-solution.contact_force[1]),
        "moment": nodes.sum(solution.pressure * nodes.points[:, 0]),
        "force inside": inside(where[order], pressure[order], AWAY * problem.domain.size),
        "max phi": nodes.maximum(phi, -np.inf),
        "charge": charges.foundation,
        "converged": solution.converged,
        "residual": solution.outcome.residuals.largest,
        "several": any("several solutions" in text for text in solution.warnings),
    }


def inside(x: Array, pressure: Array, away: float) -> float:
    """Return the integral of the pressure but for some length at either end of Gamma_3."""
    cut = np.array([x[0] + away, x[-1] - away])
    places = np.sort(np.concatenate([x[(x > cut[0]) & (x < cut[1])], cut]))
    return float(np.trapezoid(np.interp(places, x, pressure), places))


def refined(report: Report, example: str, levels: Sequence[int]) -> None:
    """Tabulate one example. Collective."""
    name, ratio, changes = EXAMPLES[example]
    rows: list[dict[str, object]] = []
    for steep in (False, True) if example != "8.3" else (False,):
        before = np.full(len(WATCHED), np.nan)
        for cells in levels:
            if steep and cells > FINEST_STEEP:
                continue
            ramp = [f"electric.delta={STEEP / SIZES[name]}"] if steep else []
            overrides = ["solver.method=newton", *changes, *ramp]
            found = measured(solve(on_grid(name, (cells, cells // ratio), *overrides)))
            now = np.array([found[key] for key in WATCHED], dtype=float)
            row: dict[str, object] = {"cells": f"{cells} x {cells // ratio}", **found}
            row |= {f"change of {key}": c for key, c in zip(WATCHED, now - before, strict=True)}
            before = now
            rows.append(row)
            print(example, *(f"{key} = {value}" for key, value in row.items()), flush=True)
    report.table(
        f"refinement-{example.split(',')[0].replace('.', '-')}{'-weak' * (',' in example)}",
        f"Example {example} on finer meshes",
        rows,
        NOTES[example],
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the tables. Collective."""
    report = Report.of(__doc__, "refinement_8", arguments)
    for example in EXAMPLES:
        refined(report, example, (12, 24) if report.coarse else (48, 96, 192, 384))


if __name__ == "__main__":
    main()
