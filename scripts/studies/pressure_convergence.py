"""How the contact pressure converges: closed form 4 in L2 and in the discrete H^-1/2.

`python3 -m scripts.studies.pressure_convergence [--out DIR] [--coarse]`, also under mpirun.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.ticker import NullLocator

from contact import InputError, solve_problem
from contact.methods.options import NewtonOptions
from scripts.reporting import ONE_COLUMN, Report, observed_orders, options, subplots
from scripts.studies.dual_norm import DualNorm
from scripts.studies.exact_solutions import Singular

NOTE = (
    "Closed form 4: p = |A| sqrt(x - x_0), of H^s for s < 1 on Gamma_3: approximation alone gives "
    "order 1 in L2 and 3/2 in H^-1/2. Errors are of the nodal pressures against the exact ones at "
    "the nodes, relative, in the lumped L2(Gamma_3) and in the norm dual to the energy of the "
    "displacements of the same mesh, for which the body condensed onto Gamma_3 is inverted. Where "
    "x_0 lies between two nodes matters: they are root mean squares over three places. The nodal "
    "multiplier with lumped products is that of dual (biorthogonal) functions up to the "
    "order of the quadrature: nodal values p_i act with int phi_i, which decouples the contact "
    "conditions node by node. The pair is inf-sup stable uniformly in h, for displacements of "
    "degree 1 with dual multipliers of degree 1 on the same nodes, as Wohlmuth (SIAM J. Numer. "
    "Anal. 38 (2000) 989) and Hueeber and Wohlmuth (SIAM J. Numer. Anal. 43 (2005) 156) show, who "
    "prove the order of the best approximation for Signorini's problem, up to the regularity of "
    "the solution; for degree 2, Hueeber, Mair and Wohlmuth (Appl. Numer. Math. 54 (2005) 555)."
)


#: Where the contact ends between two nodes, as a part of their distance.
PLACES = (1 / 6, 1 / 2, 5 / 6)


def measured(exact: Singular, n: int, degree: int) -> tuple[tuple[float, float], float]:
    """Return the relative errors of the pressure in L2 and H^-1/2, and the residual. Collective."""
    problem = exact.problem(n, degree)
    solution = solve_problem(problem, NewtonOptions(tolerance=1e-10))
    if not solution.converged:
        raise InputError(f"closed form 4, {n} cells: {solution.outcome.reason}")
    given = exact.pressure(problem.nodes.points[:, 0])
    error, dual, norm = solution.pressure - given, DualNorm(problem), problem.nodes.norm
    ratios = norm(error) / norm(given), dual.pressure(error) / dual.pressure(given)
    return ratios, solution.outcome.kkt.largest


def main(arguments: Sequence[str] | None = None) -> dict[int, list[float]]:
    """Make table and figure; return the dual errors by degree. Collective."""
    chosen = options(__doc__, "pressure_convergence", arguments)
    report = Report(chosen.out)
    cells = (8, 16, 32) if chosen.coarse else (8, 16, 32, 64)
    names = (
        "degree", "cells", "p in L2", "order", "fitted", "p in H^-1/2", "its order", "its fit",
        "residual",
    )  # fmt: skip
    columns: dict[str, list[object]] = {name: [] for name in names}
    figure, axes = subplots(size=(ONE_COLUMN, 2.8))
    found = {}
    for degree in (1, 2):
        lumped, dual = [], []
        for n in cells:
            squares, residual = np.zeros(2), 0.0
            for place in PLACES:
                errors, left = measured(Singular(x0=(np.floor(0.53 * n) + place) / n), n, degree)
                squares, residual = squares + np.square(errors), max(residual, left)
            mean = np.sqrt(squares / len(PLACES))
            lumped.append(float(mean[0]))
            dual.append(float(mean[1]))
            columns["residual"].append(residual)
        h = 1 / np.array(cells)
        columns["degree"] += [degree] * len(cells)
        columns["cells"] += [f"{n} x {n}" for n in cells]
        columns["p in L2"] += lumped
        columns["order"] += observed_orders(h, lumped)
        columns["p in H^-1/2"] += dual
        for key, values in (("fitted", lumped), ("its fit", dual)):
            slope = float(np.polyfit(np.log(h), np.log(values), 1)[0])
            columns[key] += [*[np.nan] * (len(cells) - 1), slope]
        columns["its order"] += observed_orders(h, dual)
        found[degree] = dual
        marker = "os"[degree - 1]
        axes.loglog(h, lumped, f"{marker}-", ms=3, color="C0", label=f"$L^2$, P{degree}")
        axes.loglog(h, dual, f"{marker}-", ms=3, color="C1", label=f"$H^{{-1/2}}$, P{degree}")
    for power in (1.0, 1.5):
        axes.loglog(h, 0.3 * h**power, "k:", lw=0.8)
        axes.annotate(f"slope {power:g}", (h[-1], 0.3 * h[-1] ** power), fontsize=6, va="top")
    axes.set(xlabel="$h$", ylabel="relative error of $p$")
    axes.set_xticks(h, [f"1/{n}" for n in cells])
    axes.xaxis.set_minor_locator(NullLocator())
    axes.legend(fontsize=6)
    caption = "Convergence of the contact pressure, closed form 4"
    report.table("pressure-convergence-table", caption, columns, NOTE)
    report.figure("pressure-convergence", caption, figure, columns)
    return found


if __name__ == "__main__":
    main()
