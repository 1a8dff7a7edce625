"""Tables 8.2 and 8.3, the series of conductivities, and the counts of the iterative solver.

`python3 -m scripts.thesis.tables_piezo [--out DIR] [--coarse]`, also under mpirun.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from contact import Solution, build_problem, load_case
from contact.linear.operator import SparseOperator
from contact.problem.problem import ContactProblem
from contact.problem.residuals import residual_forces
from contact.results.resultants import charge_balance
from contact.thesis.uzawa import augmentation
from scripts.cases import CASES
from scripts.force_balance import force_balance
from scripts.reporting import Report, append, empty, options
from scripts.thesis.tables_compliance import case_of, difference, iterations, run

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
LITERAL = (
    *LAGGED,
    "solver.stopping=thesis",
    f"solver.r={0.25 * 58.7102}",
    "solver.acceleration=none",
    "solver.max_outer=60",
)


def table_8(report: Report, number: str, cells: tuple[int, int]) -> None:
    """Make the counterpart of Table 8.2 or 8.3. Collective."""
    columns = empty(
        "phi_F", "thesis", "Alg. 4, (3.46)", "Alg. 4, literal", "Alg. 4, 1e-8", "implicit, (3.46)",
        "implicit, 1e-8", "solves", "residual", "Newton", "at contact", "difference",
    )  # fmt: skip
    name, counts = THESIS[number]
    domain = build_problem(case_of(name, cells)).domain
    for phi_f, thesis in zip(PHI_F, counts, strict=True):

        def solution(*changes: str, phi_f: float = phi_f) -> Solution:
            return run(case_of(name, cells, f"electric.phi_f={phi_f}", *changes), domain)

        lagged = iterations(solution(*LAGGED, "solver.tolerance=1e-9"))
        changes = [counted(solution(*s, *BY_CHANGE)) for s in (LAGGED, SECANT)]
        implicit, newton = solution(UZAWA), solution(NEWTON)
        append(
            columns,
            phi_f,
            thesis,
            changes[0],
            counted(solution(*LITERAL)),
            lagged[1],
            changes[1],
            iterations(implicit)[1],
            implicit.counters.linear_solves,
            implicit.outcome.residuals.largest,
            newton.counters.linear_solves if newton.converged else np.nan,
            newton.counters.contact_solves,
            difference(implicit, newton),
        )
    report.table(
        f"table-{number.replace('.', '-')}",
        f"Table {number}: iterations for k_e = 1, {cells[0]} x {cells[1]} cells",
        columns,
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
            first = run(case_of(name, cells, friction, *LAGGED, *BY_CHANGE))
            second = run(case_of(name, cells, friction, *SECANT, *BY_CHANGE))
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
    columns = empty(
        "k_e", "converged", "iterations", "solves", "residual", "phi min", "phi max", "max u_i",
        "max p", "max |dev eps|", "yielded share", "charge at the left", "through foundation",
        "charge imbalance", "force imbalance",
    )  # fmt: skip
    domain = build_problem(case_of(name, cells)).domain
    for k_e in K_E:
        solution = run(case_of(name, cells, f"electric.k_e={k_e}", NEWTON), domain)
        append(columns, k_e, *values(solution))
    example = {"8.2": "8.1", "8.3": "8.2"}[number]
    report.table(
        f"series-k-e-{example.replace('.', '-')}",
        f"Example {example}, load -15x, phi_F = 32: series of k_e, {cells[0]} x {cells[1]} cells",
        columns,
        "Newton's method. The potentials are those on Gamma_3. Charges are integrals of D.nu; "
        "imbalances are relative to the absolute nodal charges and to the resultant forces. Only "
        "some cells at corners of the bar are strained beyond xi_0 = 1.8. The strain is singular "
        "there and grows as the mesh is refined. Example 8.2 therefore hardly differs from 8.1.",
    )


def values(solution: Solution) -> tuple[object, ...]:
    """Return the columns of `series`. Collective."""
    problem, nodes, state = solution.problem, solution.problem.nodes, solution.state
    body = problem.body
    phi = body.phi_scale * solution.nodal[:, -1]
    u = state.x.reshape(-1, body.block_size)[:, : body.dim]
    charges = charge_balance(problem, state)
    return (
        solution.converged,
        solution.history[-1].iteration,
        solution.counters.linear_solves,
        solution.outcome.residuals.largest,
        -nodes.maximum(-phi, -np.inf),
        nodes.maximum(phi, -np.inf),
        max(problem.comm.allgather(float(np.abs(u).max()))),
        nodes.maximum(solution.pressure),
        solution.max_dev_strain,
        solution.plastic_share,
        charges.electrodes["left"],
        charges.foundation,
        charges.imbalance,
        force_balance(problem, state).imbalance,
    )


def linear_iterations(problem: ContactProblem) -> int:
    """Return the MINRES iterations of the first solve, all of Gamma_3 in contact. Collective."""
    interface, state = problem.interface, problem.start()
    nodal = problem.nodal(state)
    blocks = augmentation(problem.nodes, problem.scales.c, problem.frictional)
    blocks = blocks + interface.foundation.charge_block(nodal, np.ones(len(nodal)))
    operator = SparseOperator(problem.body, interface.operator_nodes, solver="iterative")
    operator.update("secant", state, interface.weighted(blocks, state.x))
    operator.solve(-residual_forces(problem, state))
    return operator.counters.linear_iterations


def iterative(report: Report, coarse: bool) -> None:
    """Tabulate the iterations of the linear solver over the mesh. Collective."""
    plane = [(16, 8), (32, 16)] if coarse else [(n, n // 2) for n in (32, 64, 128, 256)]
    space = [(4, 4, 8), (6, 6, 12)] if coarse else [(n, n, 2 * n) for n in (10, 14, 20, 24)]
    columns = empty("body", "cells", "unknowns", "iterations")
    for name, meshes in (("piezo-8-1-conductive", plane), ("piezo-column", space)):
        for cells in meshes:
            grid = f"mesh.cells=[{', '.join(map(str, cells))}]"
            problem = build_problem(load_case(CASES / f"{name}.toml", [grid]))
            unknowns, shown = problem.body.layout.unknowns, " x ".join(map(str, cells))
            append(columns, name, shown, unknowns, linear_iterations(problem))
    report.table(
        "piezo-linear-iterations",
        "MINRES iterations to 1e-10: diag(GAMG, hypre) on displacement and potential",
        columns,
        "With exact solves of both blocks the coupling takes 23 iterations; multigrid causes the "
        "others.",
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Make all tables. Collective."""
    chosen = options(__doc__, "tables_piezo", arguments)
    report, cells = Report(chosen.out), (16, 8) if chosen.coarse else (64, 32)
    for number in THESIS:
        table_8(report, number, cells)
        series(report, number, cells)
    other_rho(report, cells)
    iterative(report, chosen.coarse)


if __name__ == "__main__":
    main()
