"""Figures 7.4, 7.5, 7.7 and 7.8: Example 7.2 by multipliers and by the penalty method.

`python3 -m scripts.thesis.figures_mechanics [--out DIR] [--coarse]`, also under mpirun.
Figure 7.2 is made by hertz, Figure 7.6 by convergence_mechanics.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from mpi4py import MPI

from contact import Case, Solution
from contact.plot.body import draw_plane, picture
from contact.plot.contact import draw_line
from contact.results.contact_nodes import Table, contact_table
from scripts.cases import bar
from scripts.reporting import TWO_COLUMNS, Report, run_of, solved, subplots

RHO = 1e4
EPS = 1.05e-5
PENALTY = ("solver.method=penalty", f"solver.eps_contact={EPS}")

#: The unprinted values, and the appearance of the free end of the bar.
OF_7_4 = (
    "For Figures 7.4 to 7.6 the thesis prints no rho; that of Figures 7.7 and 7.8 is taken. At "
    "the corner x = 4 the bar stands on its edge, and the stresses are singular. The value at the "
    "last node grows as the mesh is refined: 0.017, 0.021, 0.025 with 128, 256, 512 cells at f2 = "
    "-0.005. At the node before it the tangential stress steps down. This step comes from "
    "triangles that lean to the right: it is one node wide on each mesh, and is absent if they "
    "lean to the left or are crossed."
)

#: Figure -> load, changes of the case, title.
FIGURES: Mapping[str, tuple[float, tuple[str, ...], str]] = {
    "7-4": (-0.005, (), "multipliers"),
    "7-5": (-0.05, (), "multipliers"),
    "7-7": (-0.005, PENALTY, f"penalty, eps = {EPS:g}"),
    "7-8": (-0.05, PENALTY, f"penalty, eps = {EPS:g}"),
}


def draw(report: Report, number: str, case: Case, text: str, load: float) -> Table | None:
    """Draw both parts of a figure; return the contact table on rank 0. Collective."""
    solution = solved(case)
    run, table = run_of(solution), contact_table(solution.contact)
    if run is None:
        return None
    deformed = picture(run, "von_mises")
    dotted = number.replace("-", ".")
    where = f"Example 7.2, f2 = {load:g}, rho = {RHO:g}, {text}"
    report.figure(
        f"figure-{number}a",
        f"Figure {dotted} (a): stresses on Gamma_3, {where}",
        draw_line(run),
        table,
        f"{_remark(solution, table)} {OF_7_4 if number == '7-4' else ''}".rstrip(),
    )
    values = deformed.skin["values"]
    report.figure(
        f"figure-{number}b",
        f"Figure {dotted} (b): deformed configuration and von Mises stress, {where}",
        draw_plane(deformed),
        {"smallest von Mises": [float(values.min())], "largest von Mises": [float(values.max())]},
    )
    return table


def _remark(solution: Solution, table: Table) -> str:
    """Return the solver's residuals and the visible quantities."""
    kkt = solution.outcome.residuals
    counts = {kind: np.count_nonzero(table["status"] == kind) for kind in ("stick", "slip", "open")}
    return (
        f"{counts['stick']} nodes stick, {counts['slip']} slide, {counts['open']} are open; "
        f"residuals: equilibrium {kkt.equilibrium:.1e}, contact {kkt.contact:.1e}, friction "
        f"{kkt.friction:.1e}. Solver: {solution.outcome.reason}."
    )


def compare(report: Report, tables: Mapping[str, Table | None]) -> None:
    """Draw the solutions with multipliers and by penalty on one set of axes."""
    if MPI.COMM_WORLD.rank > 0:
        return
    figure, axes = subplots(2, 2, size=(TWO_COLUMNS, 5.0), sharex=True)
    data: dict[str, Sequence[float]] = {}
    for column, (exact, penalised) in enumerate((("7-4", "7-7"), ("7-5", "7-8"))):
        # The first is wider: both are seen where they coincide.
        for number, width, label in ((exact, 2.4, "multipliers"), (penalised, 0.8, "penalty")):
            table = tables[number]
            data.setdefault("x", table["x"])
            for row, key in enumerate(("pressure", "tau")):
                axes[row, column].plot(table["x"], table[key], lw=width, label=label)
                data[f"{key}, {label}, f2 = {FIGURES[number][0]:g}"] = table[key]
                usual = 1.6 * float(np.quantile(np.abs(table[key]), 0.97))
                axes[row, column].set_ylim(-usual if key == "tau" else 0.0, usual)
        axes[0, column].set_title(f"f2 = {FIGURES[exact][0]:g}")
        axes[1, column].set_xlabel(r"$x$ along $\Gamma_3$ (mm)")
    axes[0, 0].set_ylabel(r"$-\sigma_\nu$ (daN/mm²)")
    axes[1, 0].set_ylabel(r"$-\sigma_\tau\cdot t$ (daN/mm²)")
    axes[0, 0].legend()
    report.figure(
        "multipliers-and-penalty",
        f"Augmented Lagrangian and penalty (eps = {EPS:g}) on one set of axes, Example 7.2",
        figure,
        data,
        "The thesis finds both methods to give the same solution. Here the tangential stresses "
        "differ visibly where sticking meets sliding, most under the smaller load. The penalised "
        "friction law is rounded over the slip length eps, so that nodes creep that ought to "
        "stick. Table 7.2 has the distances of the solutions. The peaks at the end of the bar are "
        "cut off.",
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the figures."""
    report = Report.of(__doc__, "figures_mechanics", arguments)
    n = 8 if report.coarse else 64
    tables = {
        number: draw(report, number, bar(n, load, RHO, *changes), text, load)
        for number, (load, changes, text) in FIGURES.items()
    }
    compare(report, tables)


if __name__ == "__main__":
    main()
