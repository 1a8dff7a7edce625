"""Tables 8.2 and 8.3, the series of conductivities, and the counts of the iterative solver.

`python3 -m scripts.thesis.tables_piezo [--out DIR] [--coarse]`, also under mpirun.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from contact import Solution, build_problem
from contact.results.resultants import charge_balance
from scripts.cases import on_grid
from scripts.force_balance import force_balance
from scripts.reporting import Report, append, empty
from scripts.thesis.tables_compliance import PLAIN, difference, ended, iterations, solution_of
from tests.problems.piezo import first_solve

PHI_F = (0, 1, 2, 4, 8, 16, 32)
K_E = (0.0, 1e-3, 1e-2, 1e-1, 1.0)

#: Table -> case file and iterations of the thesis.
THESIS: Mapping[str, tuple[str, Sequence[int]]] = {
    "8.2": ("piezo-8-1-conductive", (4, 5, 5, 5, 5, 5, 5)),
    "8.3": ("piezo-8-2", (8, 9, 9, 9, 9, 9, 9)),
}

#: Explained and unexplained differences.
NOTES = {
    "8.2": "The thesis's 4 or 5 iterations are near those of an implicit charge. This agreement "
    "is no evidence: the thesis does not print rho of (7.16) for this chapter, and the "
    "value here was chosen for it. A table below has other values.",
    "8.3": "The thesis's counts are 4 above those of its Table 8.2, although the material alone "
    "differs. None of the tried values of rho (table below) shows this difference: hardly "
    "any of the body is strained beyond xi_0, and the counts of both examples are equal up "
    "to 1. The difference is not explained.",
}

#: Values of rho that are tried for Tables 8.2 and 8.3.
OTHER_RHO = (1.0, 1e2, 1e4, 1e5)

#: Algorithm 4 as in the thesis: l lagged, Kacanov's steps. The same with phi implicit in l.
UZAWA, NEWTON = "solver.method=uzawa", "solver.method=newton"
SECANT = (UZAWA, "solver.material_step=secant")
LAGGED = ("electric.lagged=true", *SECANT)

#: Counted by (3.46) alone: a change of the friction bound below 1e-5, after converged inner solves.
BY_CHANGE = ("solver.stopping=thesis", "solver.eps=1e-9", "solver.max_outer=100")

#: The thesis's r = 0.25 E and its rules (3.46) and (5.38), which end both loops at 1e-5.
LITERAL = (*LAGGED, "solver.stopping=thesis", *PLAIN, "solver.max_outer=60")


def table_8(report: Report, number: str, cells: tuple[int, int]) -> None:
    """Make the counterpart of Table 8.2 or 8.3. Collective."""
    rows: list[dict[str, object]] = []
    name, counts = THESIS[number]
    domain = build_problem(on_grid(name, cells)).domain
    for phi_f, thesis in zip(PHI_F, counts, strict=True):

        def solution(*changes: str, phi_f: float = phi_f) -> Solution:
            return solution_of(on_grid(name, cells, f"electric.phi_f={phi_f}", *changes), domain)

        lagged = iterations(solution(*LAGGED, "solver.tolerance=1e-9"))
        changes = [counted(solution(*s, *BY_CHANGE)) for s in (LAGGED, SECANT)]
        implicit, newton = solution(UZAWA), solution(NEWTON)
        rows.append(
            {
                "phi_F": phi_f,
                "thesis": thesis,
                "Alg. 4, (3.46)": changes[0],
                "Alg. 4, literal": counted(solution(*LITERAL)),
                "Alg. 4, 1e-8": lagged[1],
                "implicit, (3.46)": changes[1],
                "implicit, 1e-8": iterations(implicit)[1],
                "solves": implicit.counters.linear_solves,
                "residual": implicit.outcome.residuals.largest,
                "Newton": newton.counters.linear_solves if newton.converged else np.nan,
                "at contact": newton.counters.contact_solves,
                "difference": difference(implicit, newton),
            }
        )
    report.table(
        f"table-{number.replace('.', '-')}",
        f"Table {number}: iterations for k_e = 1, {cells[0]} x {cells[1]} cells",
        rows,
        "Alg. 4: charge lagged, Kacanov's steps, inner solves to 1e-9; iterations to a relative "
        "change (3.46) of the friction bound of 1e-5, and to residuals of 1e-8. Literal: r = "
        "0.25 E and the thesis's rules in both loops; — where these are not met in 60 "
        "iterations. Implicit: phi of the charge is in the operator. Its steps are Kacanov's to "
        "(3.46); to 1e-8 they are tangent steps near the solution. With the lagged charge the "
        f"iteration contracts slowly at k_e = 1 (see Theorem 5.2). {NOTES[number]} Newton: linear "
        "solves of the whole body; at contact: Newton iterations on the condensed problem. "
        "Difference: of the implicit and Newton's solutions, relative in all unknowns.",
    )


def other_rho(report: Report, cells: tuple[int, int]) -> None:
    """Tabulate the counts of both tables for other rho at phi_F = 32. Collective."""
    columns: dict[str, list[object]] = {"rho": list(OTHER_RHO)}
    for number, (name, thesis) in THESIS.items():
        columns[f"{number}: thesis"] = [thesis[-1]] * len(OTHER_RHO)
        lagged, implicit, shares = [], [], []
        for rho in OTHER_RHO:
            friction = f"friction.mu.rho={rho}"
            first = solution_of(on_grid(name, cells, friction, *LAGGED, *BY_CHANGE))
            second = solution_of(on_grid(name, cells, friction, *SECANT, *BY_CHANGE))
            lagged.append(counted(first))
            implicit.append(counted(second))
            shares.append(second.plastic_share)
        columns |= {f"{number}: Alg. 4": lagged, f"{number}: implicit": implicit}
    columns["yielded share in 8.3"] = shares
    report.table(
        "tables-8-2-8-3-rho",
        f"Tables 8.2 and 8.3 with other rho of (7.16): iterations to (3.46), phi_F = 32, "
        f"{cells[0]} x {cells[1]} cells",
        columns,
        "Charge lagged as in Algorithm 4, and implicit; Kacanov's steps, inner solves to 1e-9; — "
        "where (3.46) is not met in 100 iterations. From Table 8.2 to 8.3 the thesis's counts "
        "grow by 4; with no rho do the counts here.",
    )


def counted(solution: Solution) -> float:
    """Return the iterations until the thesis's criterion is met, NaN if it is not."""
    met = "criterion is met" in solution.outcome.reason
    return solution.history[-1].iteration if met else np.nan


def series(report: Report, number: str, cells: tuple[int, int]) -> None:
    """Make a table of the rows of Figures 8.4 (b) or 8.6 (b). Collective."""
    name, _ = THESIS[number]
    rows: list[dict[str, object]] = []
    domain = build_problem(on_grid(name, cells)).domain
    for k_e in K_E:
        solution = solution_of(on_grid(name, cells, f"electric.k_e={k_e}", NEWTON), domain)
        rows.append({"k_e": k_e, **values(solution)})
    example = {"8.2": "8.1", "8.3": "8.2"}[number]
    report.table(
        f"series-k-e-{example.replace('.', '-')}",
        f"Example {example}, load -15x, phi_F = 32: series of k_e, {cells[0]} x {cells[1]} cells",
        rows,
        "Newton's method. The potentials are those on Gamma_3. Charges are integrals of D.nu; "
        "imbalances are relative to the absolute nodal charges and to the resultant forces. Only "
        "some cells at corners of the bar are strained beyond xi_0 = 1.8. The strain is singular "
        "there and grows as the mesh is refined. Example 8.2 therefore hardly differs from 8.1.",
    )


def values(solution: Solution) -> dict[str, object]:
    """Return the row of a conductivity in `series`. Collective."""
    problem, nodes, state = solution.problem, solution.problem.nodes, solution.state
    body = problem.body
    phi = body.phi_scale * solution.nodal[:, -1]
    u = state.x.reshape(-1, body.block_size)[:, : body.dim]
    charges = charge_balance(problem, state)
    return {
        **ended(solution),
        "phi min": -nodes.maximum(-phi, -np.inf),
        "phi max": nodes.maximum(phi, -np.inf),
        "max u_i": max(problem.comm.allgather(float(np.abs(u).max()))),
        "max p": nodes.maximum(solution.pressure),
        "max |dev eps|": solution.max_dev_strain,
        "yielded share": solution.plastic_share,
        "charge at the left": charges.electrodes["left"],
        "through foundation": charges.foundation,
        "charge imbalance": charges.imbalance,
        "force imbalance": force_balance(problem, state).imbalance,
    }


def iterative(report: Report) -> None:
    """Tabulate the iterations of the linear solver over the mesh. Collective."""
    plane = [(16, 8), (32, 16)] if report.coarse else [(n, n // 2) for n in (32, 64, 128, 256)]
    space = [(4, 4, 8), (6, 6, 12)] if report.coarse else [(n, n, 2 * n) for n in (10, 14, 20, 24)]
    columns = empty("body", "cells", "unknowns", "iterations")
    for name, meshes in (("piezo-8-1-conductive", plane), ("piezo-column", space)):
        for cells in meshes:
            problem, shown = build_problem(on_grid(name, cells)), " x ".join(map(str, cells))
            iterations, _ = first_solve(problem, compare=False)
            append(columns, name, shown, problem.body.layout.unknowns, iterations)
    report.table(
        "piezo-linear-iterations",
        "MINRES iterations to 1e-10: diag(GAMG, hypre) on displacement and potential",
        columns,
        "With exact solves of both blocks the coupling takes 23 iterations; multigrid causes the "
        "others.",
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Make all tables. Collective."""
    report = Report.of(__doc__, "tables_piezo", arguments)
    cells = (16, 8) if report.coarse else (64, 32)
    for number in THESIS:
        table_8(report, number, cells)
        series(report, number, cells)
    other_rho(report, cells)
    iterative(report)


if __name__ == "__main__":
    main()
