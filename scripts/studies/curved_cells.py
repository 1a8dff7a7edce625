"""Orders of convergence on straight cells and on those of second order, and times to 1 %.

Rings here, known contacts and times in `cell_orders`.

`python3 -m scripts.studies.curved_cells [--out DIR] [--coarse]`
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI

from contact import Body, Contact, Domain, Load
from contact.mesh.cells import SHAPES
from contact.problem.problem import ContactProblem
from contact.typing import Array
from scripts.reporting import Report, append, empty, observed_orders
from scripts.studies import cell_orders
from scripts.studies.lame_rings import LAME, LAW, error, on_a_shaft, rings, supports
from tests.problems.mechanics import state_of

CAPTION = "Displacements of round bodies on straight and on curved cells"
NOTE = (
    "Lame's ring between the radii 1 and 2, plane strain (in 3-D of depth 1), nu = 0.3. shaft: "
    "pressed on a rigid shaft. two rings: cut at the radius 1.5 into two bodies whose meshes do "
    "not match, under an inner pressure. Errors are relative, in L2; the order is that from the "
    "next coarser mesh; pressure: the largest relative error of a nodal pressure."
)

RIM = (
    "Tetrahedra of second order on a shaft, and under the same pressure as a load",
    "Lame's ring of the first table, degree 2 on curved tetrahedra. shaft: pressed on a rigid "
    "shaft. load: the pressure is given, and the error is that of the discretisation of the body "
    "alone. Errors are relative, in L2; orders are those from the next coarser mesh.",
)

#: Cells across the ring, by dimension.
CELLS = {2: (4, 8, 16), 3: (4, 8)}


def under_pressure(domain: Domain, degree: int) -> ContactProblem:
    """Give a ring the pressure of the shaft as a load; nothing is in its reach."""
    body = Body(LAW, supports(domain.dim), [Load("inner0", pressure=LAME.pressure)])
    return ContactProblem(domain, body, Contact("outer0", 1.0), degree=degree)


def two_rings(domain: Domain, degree: int, on: str = "outer0") -> ContactProblem:
    """Put two rings about each other, as one, under a pressure inside."""
    against = {"outer0": "inner1", "inner1": "outer0"}[on]
    body = Body(LAW, supports(domain.dim), [Load("inner0", pressure=LAME.pressure)])
    return ContactProblem(domain, body, Contact(on, 0.0, against=against), degree=degree)


def solved(problem: ContactProblem) -> tuple[float, Array]:
    """Return the error of the displacements in L2, and the pressures of all ranks."""
    state = state_of(problem, 1e-10)
    size = error(problem.body.space, state.x, LAME)
    return size, problem.nodes.gather(state.multipliers.contact)


def problem_of(kind: str, cell: str, order: int, degree: int, n: int) -> ContactProblem:
    """Return a problem on a mesh of n cells across."""
    if kind == "shaft":
        return on_a_shaft(rings(MPI.COMM_WORLD, cell, order, (1.0, 2.0), (n,)), degree)
    domain = rings(MPI.COMM_WORLD, cell, order, (1.0, 1.5, 2.0), (n // 2, n // 2 + 1))
    return two_rings(domain, degree)


def rim(report: Report) -> dict[str, float]:
    """Make the table of tetrahedra on a shaft; return the last orders."""
    columns = empty("across", "unknowns")
    last = {}
    for n in (2, 4) if report.coarse else (4, 8, 12):
        domain = rings(MPI.COMM_WORLD, "tetrahedron", 2, (1.0, 2.0), (n,))
        columns["across"].append(n)
        for kind, make in (("shaft", on_a_shaft), ("load", under_pressure)):
            problem = make(domain, 2)
            columns.setdefault(kind, []).append(solved(problem)[0])
        columns["unknowns"].append(3 * problem.body.layout.index_map.size_global)
    for kind in ("shaft", "load"):
        sizes = 1 / np.array(columns["across"])
        columns[f"order, {kind}"] = observed_orders(sizes, columns[kind])
        last[kind] = columns[f"order, {kind}"][-1]
    report.table("rim-of-tetrahedra", RIM[0], columns, RIM[1])
    return last


def main(arguments: Sequence[str] | None = None) -> dict[tuple[str, str, int, int], float]:
    """Make the table; return the last orders by problem, cell, and the degrees of both."""
    report = Report.of(__doc__, "curved_cells", arguments)
    columns = empty(
        "problem", "cells", "geometry", "degree", "across", "unknowns", "error", "order",
        "pressure",
    )  # fmt: skip
    orders = {}
    for kind, exact in (
        ("shaft", LAME.pressure),
        ("two rings", -float(LAME.radial(np.array(1.5)))),
    ):
        for shape in SHAPES:
            counts = CELLS[shape.dim][: 2 if report.coarse else None]
            for order, degree in cell_orders.ELEMENTS:
                last = None
                for n in counts:
                    problem = problem_of(kind, shape.name, order, degree, n)
                    size, pressure = solved(problem)
                    rate = None if last is None else float(np.log2(last / size))
                    last, off = size, float(np.abs(pressure / exact - 1).max())
                    unknowns = problem.body.layout.index_map.size_global * shape.dim
                    shown = "" if rate is None else f"{rate:.2f}"
                    row = (kind, shape.name, order, degree, n, unknowns, f"{size:.2e}", shown)
                    append(columns, *row, f"{off:.1e}")
                    print(*row, f"{off:.1e}", flush=True)
                    if rate is not None:
                        orders[kind, shape.name, order, degree] = rate
    report.table("curved-cells", CAPTION, columns, NOTE)
    rim(report)
    cell_orders.orders(report)
    cell_orders.times(report)
    return orders


if __name__ == "__main__":
    main()
