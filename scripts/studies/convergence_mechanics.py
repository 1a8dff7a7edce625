"""Convergence: Figure 7.6, known solutions, Theorems 3.2, 4.3 and 4.5.

`python3 -m scripts.studies.convergence_mechanics [--out DIR] [--coarse]`, also under mpirun.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from contact import InputError, build_problem
from contact.body.norms import errors
from contact.case.file import Case, Friction
from contact.mesh.transfer import carry
from contact.methods.newton import Newton
from contact.methods.options import FixedPointOptions, NewtonOptions, Options, PenaltyOptions
from contact.methods.report import Outcome
from contact.output.fields import DerivedFields
from contact.typing import Array
from scripts.cases import bar
from scripts.reporting import (
    TWO_COLUMNS,
    Report,
    iterates,
    observed_orders,
    options,
    solved,
    subplots,
)
from scripts.studies.exact_solutions import Singular, exact, manufactured

RHO = 1e4
NORMS = ("L2", "H1", "energy")


@dataclass(frozen=True)
class Variant:
    """A series of meshes of Example 7.2 with its reference.

    Attributes
    ----------
    label
        In tables and figures.
    load, degree
        Of the problem.
    cells
        Cells per unit length of the meshes.
    reference
        Of the reference, at least four times the last of them.
    changes
        Of the case.
    """

    label: str
    load: float
    degree: int
    cells: tuple[int, ...]
    reference: int
    changes: tuple[str, ...] = ()

    @property
    def penalised(self) -> bool:
        """Whether the penalty method is used, which knows no nested meshes."""
        return any("penalty" in change for change in self.changes)

    def case(self, n: int, nested: bool = False) -> Case:
        """Return the case on a mesh, solved on coarser ones first if wanted."""
        meshes = ["solver.nested=true"] if nested else []
        return bar(n, self.load, RHO, f"space.degree={self.degree}", *meshes, *self.changes)


def measure(variant: Variant) -> tuple[Array, list[float]]:
    """Return relative errors, shape (meshes, 3), and the residuals of the solves. Collective."""
    reference = solved(variant.case(variant.reference, nested=not variant.penalised))
    body, x = reference.problem.equilibrium, reference.state.x
    scale = errors(body, x, None)
    found, residuals = [], [_residual(reference.outcome, variant)]
    for n in variant.cells:
        solution = solved(variant.case(n))
        residuals.append(_residual(solution.outcome, variant))
        coarse = solution.problem.equilibrium.function(solution.state.x)
        e = errors(body, x, carry(coarse, body.space)) / scale
        found.append((e.l2, e.h1, e.energy))
    return np.array(found), residuals


def _residual(outcome: Outcome, variant: Variant) -> float:
    """Return the residual that decides: for a penalised problem that of its own laws."""
    return outcome.kkt.equilibrium if variant.penalised else outcome.kkt.largest


def mesh_series(
    report: Report, name: str, caption: str, note: str, variants: Sequence[Variant]
) -> dict[str, Array]:
    """Tabulate and draw errors over h; return them by label. Collective."""
    names = ["problem", "1/h", "reference 1/h"]
    columns: dict[str, list[object]] = {key: [] for key in names}
    for norm in NORMS:
        columns |= {norm: [], f"order ({norm})": []}
    columns["residual"] = []
    results = {}
    for variant in variants:
        found, residuals = measure(variant)
        results[variant.label] = found
        h = 1 / np.array(variant.cells)
        columns["problem"] += [variant.label] * h.size
        columns["1/h"] += variant.cells
        columns["reference 1/h"] += [variant.reference] * h.size
        columns["residual"] += [max(residuals[0], r) for r in residuals[1:]]
        for k, norm in enumerate(NORMS):
            columns[norm] += found[:, k].tolist()
            columns[f"order ({norm})"] += observed_orders(h, found[:, k])
    report.table(f"{name}-table", caption, columns, note)
    report.figure(name, caption, draw_series(columns), columns)
    return results


def draw_series(columns: Mapping[str, Sequence[Any]]) -> Figure:
    """Draw the errors of a table of `mesh_series` over h."""
    figure, axes = subplots(1, 3, size=(TWO_COLUMNS, 3.2))
    problems, cells = np.array(columns["problem"]), np.array(columns["1/h"], dtype=int)
    for label, marker in zip(dict.fromkeys(columns["problem"]), "os^v", strict=False):
        own = problems == label
        for ax, norm in zip(axes, NORMS, strict=True):
            values = np.array(columns[norm], dtype=float)[own]
            ax.loglog(1 / cells[own], values, f"{marker}-", ms=3, label=label)
    for ax, norm in zip(axes, NORMS, strict=True):
        power = 2 if norm == "L2" else 1
        ends, low = np.array([1 / cells.max(), 1 / cells.min()]), ax.dataLim.y0
        ax.loglog(ends, 0.7 * low * (ends / ends[0]) ** power, "k:", label=f"slope {power}")
        ax.set(title=f"relative error in {norm}", xlabel=r"$h$ (mm)")
        shown = np.unique(cells)[::-1]
        ax.set_xticks(1 / shown, [f"1/{n}" for n in shown])
        ax.xaxis.set_minor_formatter(NullFormatter())
        ax.legend(fontsize=6)
    return figure


def figure_7_6(report: Report, coarse: bool) -> dict[str, Array]:
    """Make the counterpart of Figure 7.6. Collective."""
    small, large = -0.005, -0.05
    if coarse:
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
        "The thesis's reference is its finest tested mesh, so that its last point means nothing; "
        "here it is three levels finer than the finest mesh, for with two the last order comes out "
        "about 0.05 too large. The solution is singular at the "
        "corners of the bar, above all at (4, 0), which the load presses down and where the "
        "pressure peaks, and at the clamped ones: P1 falls short of order 1 in H1, and P2 gains "
        "accuracy but no order.",
        variants,
    )


def theorem_4_3(report: Report, coarse: bool) -> dict[str, Array]:
    """Show the penalised solution converge as h -> 0 at fixed eps. Collective."""
    cells, reference = ((4, 8), 32) if coarse else ((8, 16, 32), 128)
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
        "with them the solution; what is left are the singular corners of the bar.",
        variants,
    )


def known_solutions(report: Report, coarse: bool) -> dict[str, Array]:
    """Tabulate the errors of problems with a known solution. Collective."""
    levels = 3 if coarse else 4
    singular = Singular()
    names = ("problem", "1/h", "L2", "order (L2)", "H1", "order (H1)", "energy", "order (energy)")
    names = (*names, "largest", "order", "residual")
    columns: dict[str, list[object]] = {name: [] for name in names}
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
                raise InputError(f"{label}, 1/h = {n}: {outcome.reason}")
            residuals.append(outcome.kkt.largest)
            if dim:
                e, largest = errors(problem.equilibrium, state.x, exact(dim)), np.nan
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
        "Hencky: a smooth displacement whose strain straddles the yield strain, with the body "
        "force that belongs to it. Signorini: closed form 4, whose pressure is sqrt(x - x0); "
        "its singularity limits the order in H1 to 1.5, and where x0 lies in its cell makes the "
        "orders of P2 vary. The largest error is that of the nodes.",
    )
    return results


def secant_rate(strain: float, yield_strain: float = 0.05) -> float:
    """Return ln(t/xi_0)/(1 + ln(t/xi_0)), the rate of Kacanov's iteration at the strain t."""
    excess = max(np.log(strain / yield_strain), 0.0)
    return float(excess / (1 + excess))


@dataclass(frozen=True)
class Iteration:
    """A fixed point whose errors are watched.

    Attributes
    ----------
    label
        In tables and figures.
    load
        Vertical traction.
    mu
        Constant coefficient of friction; 0 for none.
    eps
        Parameter of the penalty method; None for multipliers (Algorithm 1).
    """

    label: str
    load: float
    mu: float = 0.0
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
    found, outcome = iterates(problem, _settings(iteration))
    if not outcome.converged:
        raise InputError(f"{iteration.label}: {outcome.reason}")
    body, last, kkt = problem.equilibrium, found[-1].x, outcome.kkt
    distances = [errors(body, last, body.function(state.x)).energy for state in found[:-1]]
    residual = kkt.largest if iteration.eps is None else kkt.equilibrium
    return (
        np.array(distances),
        max(e.strain for e in DerivedFields(body, last).extremes()),
        residual,
    )


def _settings(iteration: Iteration) -> Options:
    tight = 1e-10
    if iteration.eps is not None:
        return PenaltyOptions(eps_contact=iteration.eps, tolerance=tight, material_step="secant")
    return FixedPointOptions(tolerance=tight, inner_tolerance=1e-12, material_step="secant")


def fixed_points(report: Report, coarse: bool) -> dict[str, float]:
    """Show the errors of the fixed points per iteration; return observed rates. Collective."""
    n = 8 if coarse else 16
    figure, axes = subplots(1, 2, size=(TWO_COLUMNS, 3.4), sharey=True)
    columns: dict[str, list[object]] = {
        name: []
        for name in (
            "iteration",
            "iterations",
            "observed rate",
            "max |dev eps|",
            "Kacanov's bound",
            "residual",
        )
    }
    data: dict[str, Sequence[float]] = {}
    rates = {}
    chosen = ITERATIONS[1::3] if coarse else ITERATIONS
    for iteration in chosen:
        distances, strain, residual = watched(iteration, n)
        # Not the first steps, nor the last, where the error is that of the final iterate.
        middle = distances[len(distances) // 3 : max(len(distances) - 3, len(distances) // 3 + 2)]
        rate = float((middle[-1] / middle[0]) ** (1 / max(len(middle) - 1, 1)))
        rates[iteration.label] = rate
        row = (
            iteration.label,
            len(distances) + 1,
            rate,
            strain,
            secant_rate(strain),
            residual,
        )
        for column, value in zip(columns.values(), row, strict=True):
            column.append(value)
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
        "local rate of the secant iteration there; the observed rate is smaller, as most of the "
        "body is strained less, and larger only where friction is what converges last. "
        "Friction: constant mu, for which the solution is unique."
    )
    caption = "Theorems 3.2 and 4.5: errors of the fixed points per iteration, Example 7.2"
    report.table("fixed-point-rates", caption, columns, note)
    report.figure("fixed-point-errors", caption, figure, data)
    return rates


def main(arguments: Sequence[str] | None = None) -> None:
    """Make all tables and figures."""
    chosen = options(__doc__, "convergence_mechanics", arguments)
    report = Report(chosen.out)
    known_solutions(report, chosen.coarse)
    fixed_points(report, chosen.coarse)
    theorem_4_3(report, chosen.coarse)
    figure_7_6(report, chosen.coarse)


if __name__ == "__main__":
    main()
