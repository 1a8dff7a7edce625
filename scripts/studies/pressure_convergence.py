"""How the contact pressure converges in L2 and in the discrete H^-1/2, against exact solutions.

A pressure like the root of the distance, in 2-D and in 3-D, Hertz's cylinder and ball, and a ring
on a shaft.

`python3 -m scripts.studies.pressure_convergence [--out DIR] [--coarse]`, also under mpirun.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from contact import NotConvergedError, Problem, solve
from contact.methods.options import NewtonOptions
from contact.problem.problem import ContactProblem
from contact.typing import Array
from scripts.reporting import Report, empty, observed_orders, options
from scripts.studies.curved_foundations import ring
from scripts.studies.error_norms import DualNorm
from scripts.studies.exact_solutions import Singular
from scripts.studies.hertz_exact import Line, Point

NOTE = (
    "Root-like: p = |A| sqrt(x - x_0), in 2-D and in a slice in 3-D. Hertz: p = p_0 sqrt(1 - "
    "r^2/a^2) of a cylinder and a ball. The body is cut out of the half space, and Hertz's "
    "displacements are prescribed where it is cut, so that none of Hertz's assumptions adds an "
    "error. These pressures are in H^s for s < 1 on Gamma_3: approximation alone gives order 1 in "
    "L2 and 3/2 in H^-1/2. Conforming: a ring with an interference on a rigid shaft (Lame), with "
    "1/h elements a unit length and constant p. Its edges are straight and the foundation is "
    "curved; on a flat side gaps would have no error. Errors are relative, of the nodal pressures "
    "against the exact ones at the nodes: in the lumped L2(Gamma_3), and in the norm dual to the "
    "energy of the displacements of the same mesh. The latter is the norm of H^-1/2 for "
    "multipliers up to the inf-sup constant (`inf_sup`). It measures the distance of p_h from sum "
    "p(x_i) Phi_i, not from p itself. Errors depend on the place between two nodes where contact "
    "ends; they are root mean squares over three places. Fitted orders are least squares over all "
    "meshes. Hueeber and Wohlmuth (SIAM J. Numer. Anal. 43 (2005) 156) prove order 1 in the "
    "energy and H^-1/2 for degree 1; Hueeber, Mair and Wohlmuth (Appl. Numer. Math. 54 (2005) "
    "555) treat degree 2. The functions on [quadratic "
    "triangles](discretisation.md#quadratic-triangles) are those of Popp, Wohlmuth, Gee and Wall "
    "(SIAM J. Sci. Comput. 34 (2012) B421) with alpha = 1/5, so that vertices carry forces."
)

#: Where the contact ends between two nodes, as a part of their distance.
PLACES = (1 / 6, 1 / 2, 5 / 6)


@dataclass(frozen=True)
class Series:
    """A problem with its exact pressure, on meshes of several sizes."""

    #: Returns the exact solution for a place where the contact ends.
    make: Callable[[float], Any]
    #: Returns its problem, given cells and degree.
    problem: Callable[[Any, int, int], ContactProblem | Problem]
    #: Returns its pressure at points.
    pressure: Callable[[Any, Array], Array]
    #: By degree.
    cells: Mapping[int, tuple[int, ...]]
    #: Where the contact ends between two nodes.
    places: tuple[float, ...] = PLACES


def _singular(problem: Callable[[Any, int, int], ContactProblem], cells: Any) -> Series:
    return Series(lambda x: Singular(x0=x), problem, lambda s, x: s.pressure(x[:, 0]), cells)


def _hertz(kind: Callable[[float], Any], cells: Mapping[int, tuple[int, ...]]) -> Series:
    return Series(kind, lambda s, n, k: s.problem(n, k), lambda s, x: s.pressure(x), cells)


#: The conforming contact, by its name in `curved_foundations`.
SHAFT = "ring on a shaft"

IN_PLANE = {1: (8, 16, 32, 64), 2: (8, 16, 32, 64)}

SERIES = {
    "root-like": _singular(lambda s, n, k: s.problem(n, k), IN_PLANE),
    "root-like, 3-D": _singular(lambda s, n, k: s.in_space(n, k), {1: (8, 16, 32), 2: (4, 8, 16)}),
    "Hertz's cylinder": _hertz(Line, IN_PLANE),
    "Hertz's ball": _hertz(Point, {1: (4, 8, 16), 2: (2, 4, 8)}),
    "conforming": Series(
        lambda _: SHAFT,
        lambda name, n, k: ring(name, 1 / n, k)[0],
        lambda name, x: np.full(len(x), ring(name, 1.0, 1)[1]),
        {1: (8, 16, 32), 2: (8, 16, 32)},
        PLACES[:1],
    ),
}


def measured(series: Series, n: int, degree: int) -> tuple[Array, float]:
    """Return the relative errors of the pressure in L2 and H^-1/2, and the residual. Collective."""
    squares, residual = np.zeros(2), 0.0
    for place in series.places:
        exact = series.make((np.floor(0.53 * n) + place) / n)
        solution = solve(series.problem(exact, n, degree), NewtonOptions(tolerance=1e-10))
        problem = solution.problem
        if not solution.converged:
            raise NotConvergedError(f"{n} cells: {solution.outcome.reason}")
        given = series.pressure(exact, problem.nodes.points)
        error, dual, norm = solution.pressure - given, DualNorm(problem), problem.nodes.norm
        ratios = norm(error) / norm(given), dual.pressure(error) / dual.pressure(given)
        squares += np.square(ratios) / len(series.places)
        residual = max(residual, solution.outcome.residuals.largest)
    return np.sqrt(squares), residual


def main(arguments: Sequence[str] | None = None) -> dict[tuple[str, int], Array]:
    """Make the table; return the errors by problem and degree, (meshes, 2). Collective."""
    chosen = options(__doc__, "pressure_convergence", arguments)
    columns = empty(
        "problem", "degree", "cells", "p in L2", "order", "fitted", "p in H^-1/2", "its order",
        "its fit", "residual",
    )  # fmt: skip
    found = {}
    for name, series in SERIES.items():
        for degree, cells in series.cells.items():
            cells = cells[:2] if chosen.coarse else cells
            rows = [measured(series, n, degree) for n in cells]
            errors = found[name, degree] = np.array([ratios for ratios, _ in rows])
            h = 1 / np.array(cells)
            columns["problem"] += [name] * len(cells)
            columns["degree"] += [degree] * len(cells)
            columns["cells"] += [int(n) for n in cells]
            columns["residual"] += [residual for _, residual in rows]
            keys = (("p in L2", "order", "fitted"), ("p in H^-1/2", "its order", "its fit"))
            for k, (value, order, fit) in enumerate(keys):
                slope = float(np.polyfit(np.log(h), np.log(errors[:, k]), 1)[0])
                columns[value] += errors[:, k].tolist()
                columns[order] += observed_orders(h, errors[:, k].tolist())
                columns[fit] += [*[np.nan] * (len(cells) - 1), slope]
            print(name, degree, errors.tolist(), flush=True)
    caption = "Convergence of the contact pressure"
    Report(chosen.out).table("pressure-convergence-table", caption, columns, NOTE)
    return found


if __name__ == "__main__":
    main()
