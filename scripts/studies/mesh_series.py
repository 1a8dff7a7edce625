"""Errors of Example 7.2 against a solution on a finer mesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from mpi4py import MPI

from contact import Solution, build_problem
from contact.mesh.domain import Domain
from contact.mesh.transfer import carry
from contact.methods.report import Outcome
from contact.typing import Array
from scripts.cases import bar
from scripts.reporting import TWO_COLUMNS, Report, empty, observed_orders, solved, subplots
from scripts.studies.error_norms import errors

#: Decay of (7.16).
RHO = 1e4

NORMS = ("L2", "H1", "energy")


@dataclass(frozen=True)
class Variant:
    """A series of meshes of Example 7.2 with its reference."""

    #: In tables and figures.
    label: str
    #: Of the problem.
    load: float
    degree: int
    #: Cells per unit length of the meshes.
    cells: tuple[int, ...]
    #: Of the reference, at least four times the last of them.
    reference: int
    #: Of the case.
    changes: tuple[str, ...] = ()
    #: How far the mesh is pulled towards the corners and the end of the load, `grade`.
    power: float = 1.0

    @property
    def penalised(self) -> bool:
        """Whether the penalty method is used, which knows no nested iteration."""
        return any("penalty" in change for change in self.changes)

    def solve(self, n: int, nested: bool = False) -> Solution:
        """Solve on a mesh, and on coarser ones first if wanted. Collective."""
        meshes = ["solver.nested=true"] if nested else []
        case = bar(n, self.load, RHO, f"space.degree={self.degree}", *meshes, *self.changes)
        if self.power == 1.0:
            return solved(case)
        lines = (0.0, 2.0, 4.0), (0.0, 1.0)
        domain = grade(case.mesh.build(MPI.COMM_WORLD), self.power, lines)
        return solved(case, build_problem(case, domain=domain))


def errors_of(variant: Variant) -> tuple[Array, list[float]]:
    """Return relative errors, shape (meshes, 3), and the residuals of the solves. Collective."""
    nested = not variant.penalised and variant.power == 1.0
    reference = variant.solve(variant.reference, nested)
    body, x = reference.problem.body, reference.state.x
    scale = errors(body, x, None)
    found, residuals = [], [_residual(reference.outcome, variant)]
    for n in variant.cells:
        solution = variant.solve(n)
        residuals.append(_residual(solution.outcome, variant))
        coarse = solution.problem.body.function(solution.state.x)
        e = errors(body, x, carry(coarse, body.space)) / scale
        found.append((e.l2, e.h1, e.energy))
    return np.array(found), residuals


def _residual(outcome: Outcome, variant: Variant) -> float:
    """Return the residual that decides: for a penalised problem that of its own laws."""
    return outcome.residuals.equilibrium if variant.penalised else outcome.residuals.largest


def mesh_series(
    report: Report,
    name: str,
    caption: str,
    note: str,
    variants: Sequence[Variant],
    drawn: bool = False,
) -> dict[str, Array]:
    """Tabulate errors over h, and draw them if asked to; return them by label. Collective."""
    columns = empty("problem", "1/h", "reference 1/h")
    for norm in NORMS:
        columns |= {norm: [], f"order ({norm})": []}
    columns["residual"] = []
    results = {}
    for variant in variants:
        found, residuals = errors_of(variant)
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
    if drawn:
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


def pulled(t: Array, power: float) -> Array:
    """Return places in [0, 1], pulled towards both ends as t^power is towards 0."""
    near = 0.5 * (2 * np.minimum(t, 1 - t)) ** power
    return np.asarray(np.where(t < 0.5, near, 1 - near))


def grade(domain: Domain, power: float, places: Sequence[Sequence[float]]) -> Domain:
    """Move the nodes of a grid towards lines across it; return the domain.

    Between two lines a node at the part t of the way goes to `pulled(t, power)`: near a line
    elements are of the size r^(1 - 1/power) h at the distance r. For u ~ r^lambda they do away
    with the singularity, for elements of degree k, where power > k/lambda (Babuska, Kellogg and
    Pitkaranta, Numer. Math. 33 (1979) 447).
    """
    points = domain.mesh.geometry.x
    for axis, lines in enumerate(places):
        ends = np.asarray(lines, dtype=float)
        x = points[:, axis].copy()
        piece = np.clip(np.searchsorted(ends, x, side="right") - 1, 0, ends.size - 2)
        begin, length = ends[piece], np.diff(ends)[piece]
        points[:, axis] = begin + length * pulled(np.clip((x - begin) / length, 0, 1), power)
    return domain
