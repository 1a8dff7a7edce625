"""Convergence: Figure 7.6, known solutions, Theorems 3.2, 4.3 and 4.5.

`python3 -m scripts.studies.convergence_mechanics [--out DIR] [--coarse]`, also under mpirun.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from contact import NotConvergedError
from contact.methods.newton import Newton
from contact.methods.options import NewtonOptions
from contact.typing import Array
from scripts.reporting import Report, empty, observed_orders
from scripts.studies.corner import POISSON, exponent
from scripts.studies.error_norms import errors
from scripts.studies.exact_solutions import Singular, exact, manufactured
from scripts.studies.fixed_point_rates import fixed_points
from scripts.studies.mesh_series import NORMS, Variant, mesh_series


def figure_7_6(report: Report) -> dict[str, Array]:
    """Make the counterpart of Figure 7.6. Collective."""
    small, large = -0.005, -0.05
    if report.coarse:
        variants = [
            Variant("P1, f2 = -0.005", small, 1, (4, 8, 16), 64),
            Variant("P2, f2 = -0.005", small, 2, (4, 8), 32),
        ]
    else:
        variants = [
            Variant("P1, f2 = -0.005", small, 1, (8, 16, 32, 64), 512),
            Variant("P1, f2 = -0.05", large, 1, (8, 16, 32, 64), 512),
            Variant("P2, f2 = -0.005", small, 2, (8, 16, 32), 256),
            Variant("P2, f2 = -0.05", large, 2, (8, 16, 32), 256),
        ]
    return mesh_series(
        report,
        "figure-7-6",
        "Figure 7.6: error against a reference solution, Example 7.2, rho = 1e4",
        "The thesis's reference has 65536 triangles and 33153 nodes. It is the finest mesh that "
        "the thesis tests, so that its last point has no meaning. These are 256 x 128 cells that "
        "are not square; their length is 1/256 of that of the bar, 1/64 mm. Here the reference is "
        "three levels finer than the finest mesh; with two levels the last order would be about "
        "0.05 too large. The solution is singular at the corners of the bar: most at (4, 0), "
        "which the load presses down and where the pressure peaks, and at the clamped corners. P1 "
        "therefore does not reach order 1 in H1, and P2 gains accuracy but no order.",
        variants,
        drawn=True,
    )


def graded_meshes(report: Report) -> dict[str, Array]:
    """Show the orders on meshes graded towards the corners. Collective."""
    load, power = -0.005, exponent(POISSON)
    series: tuple[tuple[int, tuple[float, ...], tuple[int, ...], int], ...]
    series = ((1, (1.0, 1.5), (4, 8, 16), 128), (2, (1.0, 3.0), (2, 4, 8), 64))
    if report.coarse:
        series = ((1, (1.0, 1.5), (4, 8), 32),)
    variants = [
        Variant(f"P{degree}, power {q:g}", load, degree, cells, reference, power=q)
        for degree, powers, cells, reference in series
        for q in powers
    ]
    return mesh_series(
        report,
        "graded",
        "Example 7.2 on graded meshes, f2 = -0.005, rho = 1e4, against a reference three levels "
        "finer",
        f"At the corners u ~ r^{power:.3f} by theory (next section). Grids are graded towards the "
        "sides and the end of the load with a power q: elements have the size r^(1 - 1/q) h. "
        f"With q > 1/lambda = {1 / power:.2f} P1 has order 1 in H1, which uniform meshes do not "
        f"reach. P2 needs q > 2/lambda = {2 / power:.2f}. Its order is then limited to 3/2 by the "
        "points where contact begins and where friction changes over, u ~ r^(3/2). References "
        "are graded alike. Interpolation between meshes whose diagonals differ adds a little to "
        "the errors.",
        variants,
    )


def theorem_4_3(report: Report) -> dict[str, Array]:
    """Show the penalised solution converge as h -> 0 at fixed eps. Collective."""
    cells, reference = ((4, 8), 32) if report.coarse else ((8, 16, 32), 128)
    variants = [
        Variant(
            f"eps = {eps:g}",
            -0.005,
            1,
            cells,
            reference,
            ("solver.method=penalty", f"solver.eps_contact={eps}"),
        )
        for eps in (1e-2, 1e-4)
    ]
    return mesh_series(
        report,
        "theorem-4-3",
        "Theorem 4.3: the penalised solution as h -> 0, Example 7.2, rho = 1e4",
        "Both solutions belong to the same eps. A large eps smooths contact and friction, and "
        "with them the solution. The corners of the bar remain singular.",
        variants,
    )


def known_solutions(report: Report) -> dict[str, Array]:
    """Tabulate the errors of problems with a known solution. Collective."""
    levels = 3 if report.coarse else 4
    singular = Singular()
    names = ("problem", "1/h", "L2", "order (L2)", "H1", "order (H1)", "energy", "order (energy)")
    names = (*names, "largest", "order", "residual")
    columns = empty(*names)
    results = {}
    series = [
        (f"Hencky, {dim}-D, P{degree}", dim, degree, first * 2 ** np.arange(levels - (dim == 3)))
        for dim, degree, first in ((2, 1, 8), (2, 2, 4), (3, 1, 4), (3, 2, 2))
    ]
    series += [
        (f"Signorini r^(3/2), P{degree}", 0, degree, first * 2 ** np.arange(levels + 1))
        for degree, first in ((1, 8), (2, 4))
    ]
    for label, dim, degree, cells in series:
        found, residuals = [], []
        for n in cells.tolist():
            problem = manufactured(dim, degree, n) if dim else singular.problem(n, degree)
            state, outcome = Newton(problem, NewtonOptions(tolerance=1e-9)).solve()
            if not outcome.converged:
                raise NotConvergedError(f"{label}, 1/h = {n}: {outcome.reason}")
            residuals.append(outcome.residuals.largest)
            if dim:
                e, largest = errors(problem.body, state.x, exact(dim)), np.nan
            else:
                e, largest = singular.errors(problem, state)
            found.append((e.l2, e.h1, e.energy, largest))
        table = np.array(found)
        results[label] = table
        columns["problem"] += [label] * cells.size
        columns["1/h"] += cells.tolist()
        columns["residual"] += residuals
        for k, (norm, order) in enumerate(
            (*((norm, f"order ({norm})") for norm in NORMS), ("largest", "order"))
        ):
            columns[norm] += table[:, k].tolist()
            columns[order] += observed_orders(1 / cells, table[:, k])
    report.table(
        "known-solutions",
        "Errors against known solutions, with observed orders",
        columns,
        "Hencky: a smooth displacement whose strain straddles the yield strain, with the "
        "corresponding body force. Signorini: a half plane whose exact pressure is sqrt(x - x0). "
        "Its singularity limits the order in H1 to 1.5, and the orders of P2 vary with the place "
        "of x0 in its cell. The column *largest* is the largest error at a node.",
    )
    return results


def main(arguments: Sequence[str] | None = None) -> None:
    """Make all tables and figures."""
    report = Report.of(__doc__, "convergence_mechanics", arguments)
    for make in (known_solutions, fixed_points, theorem_4_3, figure_7_6, graded_meshes):
        make(report)


if __name__ == "__main__":
    main()
