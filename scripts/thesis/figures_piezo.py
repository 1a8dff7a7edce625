"""Figures 8.2 to 8.7: Examples 8.1 and 8.2.

`python3 -m scripts.thesis.figures_piezo [--out DIR] [--coarse]`, also under mpirun.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from matplotlib import colormaps
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter, NullLocator
from mpi4py import MPI

from contact.body.equilibrium import BodyEquilibrium
from contact.mesh.transfer import carry
from contact.plot.body import picture
from contact.results.contact_nodes import contact_table
from contact.typing import Array
from forms.kinematics import strain
from scripts.reporting import TWO_COLUMNS, Report, empty, observed_orders, run_of, subplots
from scripts.studies.lagged_current import theorem_5_2
from scripts.thesis.figures_compliance import (
    ALONG,
    POTENTIAL,
    example,
    remark,
    solution_of,
    with_forces,
)

MU = (0.0, 0.2, 1.0)
PHI_F = (0, 1, 2, 4, 8, 16, 32)
K_E = (0.0, 1e-3, 1e-2, 1e-1, 1.0)

#: Norms of Figure 8.7.
NORMS = ("u in H1", "phi in H1", "u in L2", "phi in L2")


@dataclass(frozen=True)
class Curve:
    """One curve of a figure: how a case file is changed for it, and its label."""

    label: str
    changes: tuple[str, ...]


def figure_8_2a(report: Report, cells: tuple[int, int]) -> None:
    """Draw the deformed bar on an insulating foundation. Collective."""
    solution = solution_of("piezo-8-1", cells)
    run, (along, across) = run_of(solution), solution.contact_force
    if run is None:
        return
    table, deformed = run.table, picture(run, "potential")
    values = deformed.skin["values"]
    report.figure(
        "figure-8-2a",
        "Figure 8.2 (a): deformed bar, potential, contact forces on it (arrows), k_e = 0, mu = 0.2",
        with_forces(deformed),
        {"smallest potential": [float(values.min())], "largest potential": [float(values.max())]},
        f"{remark(solution, table)} The body presses on the foundation with ({along:.4g}, "
        f"{across:.4g}): to the right, as the thesis says of the contact force. The arrows are "
        "the reaction on the body.",
    )


def potentials(
    report: Report, number: str, topic: str, name: str, curves: Sequence[Curve],
    cells: tuple[int, int], rises: bool = True,
) -> None:  # fmt: skip
    """Draw the potential on Gamma_3 for several data, with which it rises or not. Collective."""
    domain = None
    data: dict[str, Array] = {}
    figure, axes = subplots(size=(TWO_COLUMNS, 3.2))
    residual = 0.0
    for k, curve in enumerate(curves):
        solution = solution_of(name, cells, *curve.changes, domain=domain)
        domain = solution.problem.domain
        residual = max(residual, solution.outcome.residuals.largest)
        table = contact_table(solution.contact)
        if table is not None:
            data.setdefault("x", table["x"])
            data[curve.label] = table["phi"]
            # Broken in turn: of those that coincide two at least are seen.
            colour = colormaps["viridis"](0.9 * k / max(len(curves) - 1, 1))
            dashes = ("-", "--", "-.", ":")[k % 4]
            axes.plot(table["x"], table["phi"], dashes, color=colour, label=curve.label)
    if MPI.COMM_WORLD.rank > 0:
        return
    axes.set(xlabel=ALONG, ylabel=POTENTIAL)
    axes.legend(ncols=2)
    _, *found = data.values()
    rising = int(np.count_nonzero(np.all(np.diff(found, axis=0) > 0, axis=0)))
    claim = (
        f"Where the thesis sees it rise from curve to curve, it rises here at {rising} of "
        f"{data['x'].size} nodes."
    )
    report.figure(
        f"figure-{number}",
        f"Figure {number.replace('-', '.', 1)[:3]} ({number[-1]}): potential on Gamma_3, {topic}",
        figure,
        data,
        f"Largest residual {residual:.1e}. {claim if rises else ''}".rstrip(),
    )


def all_potentials(report: Report, cells: tuple[int, int]) -> None:
    """Draw Figures 8.2 (b), 8.4 and 8.6. Collective."""
    # Without friction the case has none, so that mu = 0 is allowed by the law itself.
    friction = [Curve(rf"$\mu = {mu:g}$", (f"friction.mu={mu}",)) for mu in MU]
    potentials(report, "8-2b", "k_e = 0, for mu = 0, 0.2, 1", "piezo-8-1", friction, cells, False)
    phi_f = [Curve(rf"$\varphi_F = {v}$", (f"electric.phi_f={v}",)) for v in PHI_F]
    k_e = [Curve(rf"$k_e = {v:g}$", (f"electric.k_e={v}",)) for v in K_E]
    for number, name in (("8-4", "piezo-8-1-conductive"), ("8-6", "piezo-8-2")):
        potentials(report, f"{number}a", "k_e = 1, for phi_F = 0 to 32", name, phi_f, cells)
        potentials(report, f"{number}b", "phi_F = 32, for k_e = 0 to 1", name, k_e, cells)


def norms(body: BodyEquilibrium) -> Callable[[Array], Array]:
    """Return the norms of u and phi in H1 (seminorms |eps|, |grad|) and in L2. Collective."""
    difference = fem.Function(body.space)
    u, phi = body.split(difference)
    parts = (strain(u), ufl.grad(phi), u, phi)
    forms = [fem.form(ufl.inner(part, part) * body.domain.dx) for part in parts]

    def norms_of(x: Array) -> Array:
        difference.x.array[:] = x
        squares = [body.comm.allreduce(fem.assemble_scalar(form)) for form in forms]
        return np.sqrt(squares)

    return norms_of


def figure_8_7(report: Report) -> dict[str, Array]:
    """Draw the error against a reference three levels finer than the last mesh. Collective."""
    cells, last = ((4, 8), 64) if report.coarse else ((8, 16, 32, 64), 512)
    columns = empty("problem", "cells", "reference")
    for name in NORMS:
        columns |= {name: [], f"order ({name})": []}
    found = {}
    for label, name in (("Example 8.1", "piezo-8-1-conductive"), ("Example 8.2", "piezo-8-2")):
        reference = solution_of(name, (last, last // 2))
        x, body = reference.state.x, reference.problem.body
        norms_of, rows = norms(body), []
        for n in cells:
            solution = solution_of(name, (n, n // 2))
            other = carry(solution.problem.body.function(solution.state.x), body.space)
            rows.append(norms_of(other.x.array - x) / norms_of(x))
        errors, h = np.array(rows), 4.0 / (np.array(cells) / 2)
        found[label] = errors
        columns["problem"] += [label] * h.size
        columns["cells"] += [f"{n} x {n // 2}" for n in cells]
        columns["reference"] += [f"{last} x {last // 2}"] * h.size
        for k, norm in enumerate(NORMS):
            columns[norm] += errors[:, k].tolist()
            columns[f"order ({norm})"] += observed_orders(h, errors[:, k])
    note = (
        "Errors are relative; |eps(u)| and |grad(phi)| stand for the norms of H1. The thesis's "
        "reference has 65536 triangles and 33153 nodes, 256 x 128 cells. It is the finest mesh "
        "that the thesis tests, and its last point has no meaning; here the reference is three "
        "levels finer than the finest mesh. The thesis's h = 1/256 is relative to the length of "
        "the bar. The clamped and grounded corners are singular. P1 therefore does not reach "
        "order 1 in H1 and order 2 in L2."
    )
    caption = "Figure 8.7: errors of u and phi against a reference solution"
    report.table("figure-8-7-table", caption, columns, note)
    report.figure("figure-8-7", caption, error_figure(h, found), columns)
    return found


def error_figure(h: Array, found: Mapping[str, Array]) -> Figure:
    """Return errors over the mesh size, one curve a problem and norm."""
    figure, axes = subplots(1, 2, size=(TWO_COLUMNS, 3.4))
    for line, (label, errors) in zip(("o-", "x-"), found.items(), strict=True):
        for k, symbol in enumerate(("$u$", r"$\varphi$") * 2):
            colour, name = f"C{k % 2}", f"{symbol}, {label}"
            axes[k // 2].loglog(h, errors[:, k], line, ms=4, lw=0.8, color=colour, label=name)
    for ax, power, title in zip(axes, (1, 2), ("$H^1$", "$L^2$"), strict=True):
        low = 0.7 * ax.dataLim.y0
        ends = np.array([h.min(), h.max()])
        ax.loglog(ends, low * (ends / ends[0]) ** power, "k:", label=f"slope {power}")
        ax.set(title=f"relative error in {title}", xlabel="$h$ (m)")
        ax.set_xticks(h, [f"1/{1 / size:g}" if size < 1 else f"{size:g}" for size in h])
        ax.xaxis.set_minor_locator(NullLocator())
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.yaxis.set_major_formatter(FormatStrFormatter("%g"))
        ax.yaxis.set_minor_formatter(NullFormatter())
        ax.legend(fontsize=6)
    return figure


def main(arguments: Sequence[str] | None = None) -> None:
    """Make the figures. Collective."""
    report = Report.of(__doc__, "figures_piezo", arguments)
    cells = (16, 8) if report.coarse else (128, 64)
    figure_8_2a(report, cells)
    topic = "k_e = 1, phi_F = 32"
    example(report, "8-3", "piezo-8-1-conductive", f"Example 8.1, {topic}", cells)
    example(report, "8-5", "piezo-8-2", f"Example 8.2, {topic}", cells)
    all_potentials(report, cells)
    theorem_5_2(report)
    figure_8_7(report)


if __name__ == "__main__":
    main()
