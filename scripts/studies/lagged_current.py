"""Theorem 5.2 in numbers: Algorithm 4 with the charge lagged, as in the thesis, or implicit in phi.

Lagging the charge psi phi_L(phi - phi_F) makes the potential on Gamma_3 a fixed point of
phi -> A - k_e S phi, S the inverse of the body's electric Steklov operator. It contracts by
k_e |S|, whose size is k_e H/beta, and thus for small k_e only. With phi implicit there is no
such limit; the remaining rates are those of friction's and the material's fixed point.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from contact import Case, NotConvergedError, build_problem
from contact.methods.options import FixedPointOptions
from contact.thesis.fixed_point import FixedPoint
from contact.typing import Array
from scripts.cases import on_grid
from scripts.reporting import TWO_COLUMNS, Report, append, empty, iterates, subplots
from scripts.studies.error_norms import ProductNorm

#: k_e of the figure.
SHOWN = (0.1, 0.5, 1.0, 2.0)

#: Of Theorem 5.2: a bounded phi_L, and an R that smooths.
HYPOTHESES = ("electric.limit=32", "friction.radius=0.5")


def case_of(
    name: str, cells: tuple[int, int], k_e: float, lagged: bool, changes: Sequence[str] = ()
) -> Case:
    """Return a case of Example 8.1 or 8.2."""
    own = f"electric.k_e={k_e}", f"electric.lagged={str(lagged).lower()}", "solver.method=uzawa"
    return on_grid(name, cells, *own, *changes)


def errors(
    name: str,
    cells: tuple[int, int],
    k_e: float,
    lagged: bool,
    steps: int,
    exact: bool = True,
    changes: Sequence[str] = (),
) -> tuple[Array, bool]:
    """Return |x_n - x| in X over the iterations, and whether they converged. Collective."""
    problem = build_problem(case_of(name, cells, k_e, lagged, changes))
    norm = ProductNorm(problem)
    settings = FixedPointOptions(
        tolerance=1e-9, inner_tolerance=1e-10, material_step="secant", max_outer=steps
    )
    found, _, outcome = iterates(problem, settings)
    if not exact:
        moves = [np.linalg.norm(norm(b.x - a.x)) for a, b in pairwise(found)]
        return np.array(moves), outcome.converged
    implicit = build_problem(case_of(name, cells, k_e, False, changes), domain=problem.domain)
    limit, ended = FixedPoint(implicit, FixedPointOptions(tolerance=1e-11)).solve()
    if not ended.converged:
        raise NotConvergedError(f"k_e = {k_e:g}: {ended.reason}")
    distances = [np.linalg.norm(norm(state.x - limit.x)) for state in found]
    return np.array(distances), outcome.converged


def rate_of(sizes: Array) -> float:
    """Return the mean contraction over the second half of a sequence of errors."""
    tail = sizes[len(sizes) // 2 :]
    return float((tail[-1] / tail[0]) ** (1 / (len(tail) - 1))) if len(tail) > 1 else np.nan


def threshold(name: str, cells: tuple[int, int], width: float) -> tuple[float, float]:
    """Return k_e at which the lagged charge still converges, and does no longer. Collective.

    They are no more than the relative `width` apart. Beyond, the iterates do not run away: where
    the bar is lifted, the current is cut off, and they end in a cycle. A sequence whose steps do
    not shrink by a quarter in its second half counts as one.
    """
    low, high, k_e = 0.0, np.inf, 0.5
    while high - low > width * low:
        moves, converged = errors(name, cells, k_e, True, 60, exact=False)
        rate = rate_of(moves)
        if converged or moves[-1] < 0.75 * moves[len(moves) // 2]:
            # Close to proportional to k_e: aim a little beyond the limit.
            low, ahead = k_e, 1.03 * k_e / rate
        else:
            high, ahead = k_e, np.inf
        k_e = min(ahead, 2 * low) if high == np.inf else 0.5 * (low + high)
    return low, high


def theorem_5_2(report: Report) -> dict[str, float]:
    """Show the errors of Algorithm 4 per iteration, lagged and implicit. Collective."""
    cells = (16, 8) if report.coarse else (64, 32)
    name, shown = "piezo-8-1-conductive", SHOWN[1::2] if report.coarse else SHOWN
    figure, axes = subplots(1, 2, size=(TWO_COLUMNS, 3.2), sharey=True)
    data: dict[str, Sequence[float]] = {}
    columns = empty("k_e", "charge", "iterations", "converged", "observed rate")
    rates = {}
    for lagged, ax in zip((True, False), axes, strict=True):
        how = "lagged" if lagged else "implicit"
        for k_e in shown:
            found, converged = errors(name, cells, k_e, lagged, 40)
            rates[f"{how}, {k_e:g}"] = rate_of(found)
            append(columns, k_e, how, found.size, converged, rate_of(found))
            data[f"{how}, k_e = {k_e:g}"] = found
            steps = np.arange(1, found.size + 1)
            ax.semilogy(steps, found, "o-", ms=2, label=f"$k_e = {k_e:g}$")
        ax.set(title=f"charge {how}", xlabel="iteration n")
        ax.legend()
    axes[0].set_ylabel(r"$\|x_n - x\|_X$")
    grid, width = ((8, 4), 0.1) if report.coarse else ((32, 16), 0.03)
    low, high = threshold(name, grid, width)
    rates["threshold"] = low
    ends = errors(name, grid, 2.0, True, 60, changes=HYPOTHESES)[0][-2:]
    note = (
        f"With the lagged charge the iteration stops converging between k_e = {low:.3g} and "
        f"{high:.3g} ({grid[0]} x {grid[1]} cells). Its rate is about proportional to k_e, where "
        "it is above that of friction. Beyond, the iterates end in a cycle. At most 40 "
        "iterations are shown. With phi implicit the rate is that of friction and does not grow "
        "with k_e. Theorem 5.2 states convergence for all k_e. Its proof takes a subsequence of "
        "x_n that has a limit, and assumes that x_n-1 has the same limit. Bounded iterates need "
        "not have this property. An example has phi_L cut at L = 32 and R smoothing over 0.5, as "
        "the hypotheses require. At k_e = 2 its iterates end in a cycle of two, at distances of "
        f"{ends.min():.3g} and {ends.max():.3g} from x. For a small k_e, where the iteration with "
        "the lagged charge contracts, the theorem is right."
    )
    caption = "Theorem 5.2: errors of Algorithm 4 per iteration, Example 8.1, phi_F = 32"
    report.table("theorem-5-2-rates", caption, columns, note)
    report.figure("theorem-5-2", caption, figure, data)
    return rates
