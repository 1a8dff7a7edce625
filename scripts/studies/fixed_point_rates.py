"""Theorems 3.2 and 4.5: how fast the fixed points converge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from contact import NotConvergedError, build_problem
from contact.history import BodyState
from contact.methods.options import FixedPointOptions, Options, PenaltyOptions
from contact.model.friction import Friction
from contact.results.fields import DerivedFields
from contact.typing import Array
from scripts.cases import bar
from scripts.reporting import TWO_COLUMNS, Report, iterates, subplots
from scripts.studies.error_norms import errors
from scripts.studies.mesh_series import RHO


def secant_rate(strain: float, yield_strain: float = 0.05) -> float:
    """Return ln(t/xi_0)/(1 + ln(t/xi_0)), the rate of Kacanov's iteration at the strain t."""
    excess = max(np.log(strain / yield_strain), 0.0)
    return float(excess / (1 + excess))


@dataclass(frozen=True)
class Iteration:
    """A fixed point whose errors are watched."""

    #: In tables and figures.
    label: str
    #: Vertical traction.
    load: float
    #: Constant coefficient of friction; 0 for none.
    mu: float = 0.0
    #: Parameter of the penalty method; None for multipliers (Algorithm 1).
    eps: float | None = None


ITERATIONS = (
    Iteration("Alg. 1, f2 = -0.1", -0.1),
    Iteration("Alg. 1, f2 = -0.15", -0.15),
    Iteration("Alg. 1, f2 = -0.3", -0.3),
    Iteration("Alg. 1, f2 = -0.005, mu = 0.5", -0.005, 0.5),
    Iteration("Alg. 1, f2 = -0.15, mu = 0.5", -0.15, 0.5),
    Iteration("Alg. 3, eps = 1e-3, f2 = -0.15", -0.15, 0.0, 1e-3),
    Iteration("Alg. 3, eps = 1e-3, f2 = -0.005, mu = 0.5", -0.005, 0.5, 1e-3),
    Iteration("Alg. 3, eps = 1e-3, f2 = -0.15, mu = 0.5", -0.15, 0.5, 1e-3),
)


def watched(iteration: Iteration, n: int) -> tuple[Array, float, float]:
    """Return |u_n - u| in energy, the largest |dev eps|, and the last residual. Collective."""
    case = bar(n, iteration.load, RHO, *([f"friction.mu={iteration.mu}"] * (iteration.mu > 0)))
    if iteration.mu == 0:
        case = case.model_copy(update={"friction": Friction()})
    problem = build_problem(case)
    found, _, outcome = iterates(problem, _settings(iteration))
    if not outcome.converged:
        raise NotConvergedError(f"{iteration.label}: {outcome.reason}")
    body, last, kkt = problem.body, found[-1].x, outcome.residuals
    distances = [errors(body, last, body.function(state.x)).energy for state in found[:-1]]
    residual = kkt.largest if iteration.eps is None else kkt.equilibrium
    return (
        np.array(distances),
        max(e.strain for e in DerivedFields(body, BodyState(last)).extremes()),
        residual,
    )


def _settings(iteration: Iteration) -> Options:
    tight = 1e-10
    if iteration.eps is not None:
        return PenaltyOptions(eps_contact=iteration.eps, tolerance=tight, material_step="secant")
    return FixedPointOptions(tolerance=tight, inner_tolerance=1e-12, material_step="secant")


def fixed_points(report: Report) -> dict[str, float]:
    """Show the errors of the fixed points per iteration; return observed rates. Collective."""
    n = 8 if report.coarse else 16
    figure, axes = subplots(1, 2, size=(TWO_COLUMNS, 3.4), sharey=True)
    rows = []
    data: dict[str, Sequence[float]] = {}
    rates = {}
    chosen = ITERATIONS[1::3] if report.coarse else ITERATIONS
    for iteration in chosen:
        distances, strain, residual = watched(iteration, n)
        # Not the first steps, nor the last, where the error is that of the final iterate.
        middle = distances[len(distances) // 3 : max(len(distances) - 3, len(distances) // 3 + 2)]
        rate = float((middle[-1] / middle[0]) ** (1 / max(len(middle) - 1, 1)))
        rates[iteration.label] = rate
        rows.append(
            {
                "iteration": iteration.label,
                "iterations": len(distances) + 1,
                "observed rate": rate,
                "max |dev eps|": strain,
                "Kacanov's bound": secant_rate(strain),
                "residual": residual,
            }
        )
        data[iteration.label] = distances
        ax = axes[0 if iteration.eps is None else 1]
        ax.semilogy(np.arange(1, distances.size + 1), distances, "o-", ms=2, label=iteration.label)
    axes[0].set_title("Theorem 3.2 (Algorithm 1)")
    axes[1].set_title("Theorem 4.5 (Algorithm 3)")
    for ax in axes:
        ax.set_xlabel(r"iteration $n$")
        ax.legend(fontsize=6)
    axes[0].set_ylabel(r"$|u_n - u|$ in energy")
    note = (
        "Kacanov's bound is ln(t/xi_0)/(1 + ln(t/xi_0)) at the largest strain t of the body, the "
        "local rate of the secant iteration there. The observed rate is smaller, since most of "
        "the body is strained less. It is larger only where friction converges last. The friction "
        "coefficient is constant; no second solution has been found for it ([methods "
        "compared](thesis-studies.md#agreement-of-the-methods))."
    )
    caption = "Theorems 3.2 and 4.5: errors of the fixed points per iteration, Example 7.2"
    report.table("fixed-point-rates", caption, rows, note)
    report.figure("fixed-point-errors", caption, figure, data)
    return rates
