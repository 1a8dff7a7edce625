"""Table 7.1: Kacanov iterations of Algorithm 1 with Algorithm 2 inside, on Example 7.2.

`python3 -m scripts.thesis.table_7_1 [--out DIR] [--coarse] [--cells N] [--literal]`, also
under mpirun. Writes CSV and Markdown.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contact import Solution, build_problem, solve_problem
from scripts.cases import bar
from scripts.reporting import Report, parser

LOADS = (-0.005, -0.05)
RHO = (1e5, 1e6, 1e7, 6e7)
#: Counts of the thesis, by load.
THESIS = {-0.005: (3, 3, 4, 6), -0.05: (5, 5, 6, 8)}
#: r of the thesis, 2.5e4 E per metre, in millimetres; and taken at its word.
PER_MILLIMETRE, LITERAL = 25.0, 2.5e4

SECANT = 'solver.material_step="secant"'
STOPPING = ("solver.method=uzawa", 'solver.stopping="thesis"', SECANT)
PLAIN = 'solver.acceleration="none"'
HONEST = ("solver.method=uzawa", SECANT)


@dataclass(frozen=True)
class Run:
    """What one solution took.

    Attributes
    ----------
    outer
        Iterations after the frictionless start.
    inner, solves, factorizations
        Iterations of the block relaxation, linear solves and factorisations.
    residual
        The largest KKT residual at the end.
    change, square
        Iterations after which the relative change of the friction bound, or its square, was
        below 1e-5; NaN for none.
    """

    outer: int
    inner: int
    solves: int
    factorizations: int
    residual: float
    change: float
    square: float
    converged: bool
    seconds: float


def run(n: int, load: float, rho: float, *changes: str) -> Run:
    """Solve one row. Collective."""
    case = bar(n, load, rho, *changes)
    problem = build_problem(case)
    begin = time.perf_counter()
    solution: Solution = solve_problem(problem, case.solver)
    seconds = time.perf_counter() - begin
    # The frictionless start is record 0; a single loop has none.
    records = [r for r in solution.history.records if r.iteration > 0]

    def first(limit: float) -> float:
        return next((r.iteration for r in records if r.change < limit), np.nan)

    return Run(
        outer=len(records),
        inner=sum(r.inner for r in solution.history.records),
        solves=solution.counters.linear_solves,
        factorizations=solution.counters.factorizations,
        residual=solution.outcome.kkt.largest,
        change=first(1e-5),
        square=first(np.sqrt(1e-5)),
        converged=solution.converged,
        seconds=seconds,
    )


def rows() -> list[tuple[float, float, int]]:
    """Return load, rho and the thesis's count of every row."""
    return [
        (load, rho, count) for load in LOADS for rho, count in zip(RHO, THESIS[load], strict=True)
    ]


def counts(report: Report, n: int) -> list[dict[str, Run]]:
    """Make the table of outer iterations. Collective."""
    found = []
    columns: dict[str, list[object]] = {
        name: []
        for name in (
            "f2", "rho", "thesis", "(3.45), (3.46)", "solves", "residual", "seconds",
            "r = 25 E", "solves with it", "residual with it",
            "honest, (3.46)", "square", "to 1e-8", "inner", "factorizations", "honest seconds",
            "honest residual", "single loop", "its solves", "its residual",
        )
    }  # fmt: skip
    for load, rho, count in rows():
        runs = {
            "thesis": run(n, load, rho, *STOPPING),
            "printed": run(n, load, rho, *STOPPING, PLAIN, f"solver.r={PER_MILLIMETRE}"),
            "honest": run(n, load, rho, *HONEST),
            "single": run(n, load, rho, "solver.method=uzawa", "solver.single_loop=true"),
        }
        for name in ("honest", "single"):
            if not runs[name].converged:
                raise RuntimeError(f"f2 = {load}, rho = {rho:g}: {name} has not converged")
        thesis, printed, honest, single = runs.values()
        row = (
            load, rho, count, thesis.outer, thesis.solves, thesis.residual, thesis.seconds,
            printed.outer, printed.solves, printed.residual,
            honest.change, honest.square, honest.outer, honest.inner, honest.factorizations,
            honest.seconds, honest.residual, single.outer, single.solves, single.residual,
        )  # fmt: skip
        for column, value in zip(columns.values(), row, strict=True):
            column.append(value)
        found.append(runs)
    report.table(
        "table-7-1",
        f"Table 7.1: Kacanov iterations of Algorithm 1 on Example 7.2, {4 * n} x {n} cells",
        columns,
        "Counts leave out the frictionless start. First with the stopping rules of the thesis, "
        "(3.45) and (3.46) with eps = eps_fp = 1e-5, and our r and acceleration: the residual "
        "of equilibrium, contact and friction is what that leaves. Then the same rules with the "
        "plain block relaxation and the thesis's r read per metre, 25 E per mm. Then inner "
        "iterations to a residual of 1e-9: after how many outer ones (3.46) holds, also if its "
        "right-hand side is read as eps_fp without the square, which comes closest to the "
        "thesis, and after how many all residuals are below 1e-8; — where they are before (3.46) "
        "holds. Last, to the same residuals, "
        "the bound updated in the block relaxation itself, and tangent instead of secant steps "
        "near the solution.",
    )
    return found


def literal(report: Report, n: int, limit: int) -> list[Run]:
    """Show what r = 2.5e4 E does when it is taken at its word. Collective."""
    columns: dict[str, list[object]] = {
        name: [] for name in ("f2", "rho", "outer", "solves", "residual", "seconds", "stopped by")
    }
    found = []
    for load in LOADS:
        options = (PLAIN, f"solver.r={LITERAL}", f"solver.max_inner={limit}", "solver.max_outer=6")
        one = run(n, load, RHO[0], *STOPPING, *options)
        rule = "6 iterations" if np.isnan(one.change) else "(3.46)"
        row = (load, RHO[0], one.outer, one.solves, one.residual, one.seconds, rule)
        for column, value in zip(columns.values(), row, strict=True):
            column.append(value)
        found.append(one)
    report.table(
        "table-7-1-literal",
        f"r = 2.5e4 E in millimetres, plain block relaxation, {4 * n} x {n} cells",
        columns,
        f"At most {limit} inner and 6 outer iterations. With so large an r the auxiliary "
        "variables hardly move in one step, so that (3.45) is met far from the solution.",
    )
    return found


def main(arguments: Sequence[str] | None = None) -> list[dict[str, Run]]:
    """Make the tables."""
    options = parser(__doc__, "table_7_1")
    options.add_argument("--cells", type=int, help="cells per unit length (default 32)")
    options.add_argument(
        "--literal", action="store_true", help="also r = 2.5e4 E: thousands of solves"
    )
    chosen = options.parse_args(arguments)
    n = chosen.cells or (8 if chosen.coarse else 32)
    report = Report(chosen.out)
    found = counts(report, n)
    if chosen.literal:
        literal(report, n, 200 if chosen.coarse else 20000)
    return found


if __name__ == "__main__":
    main()
