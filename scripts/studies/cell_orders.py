"""Orders of convergence to known contacts on cells of all shapes, and their time for one per cent.

Hertz's cylinder and ball and Signorini's problem with r^(3/2), on grids of which no two cells are
alike. `curved_cells` runs it.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from contact import Domain
from contact.mesh.cells import SHAPES, Shape, rule, shape_of
from contact.mesh.domain import from_mesh
from contact.mesh.geometry import geometry_nodes, volume_factors
from contact.mesh.grid import SIDES, box, rectangle
from contact.problem.problem import ContactProblem
from contact.typing import Array
from scripts.reporting import Report, append, empty
from scripts.studies.error_norms import DualNorm, errors
from scripts.studies.exact_solutions import Singular
from scripts.studies.hertz_exact import Line, Point
from scripts.studies.lame_rings import LAME, on_a_shaft, rings
from tests.problems.mechanics import state_of
from tests.problems.meshes import assembled, midpoints

#: Geometry and displacements: their degrees.
ELEMENTS = ((1, 1), (1, 2), (2, 2))

#: How far nodes are moved, over the side of the body.
AMOUNT = 0.2

#: Relative error that is asked for.
ASKED = 0.01

ORDERS = (
    "Displacements and pressures of known contacts on distorted cells, straight and curved",
    "Unit square or cube (Hertz: a half or a quarter by symmetry), cut out of the half space with "
    "the exact displacements prescribed where it is cut. Each edge has n cells, whose nodes are "
    "moved by a smooth map that keeps the sides flat. Geometry 2 has curved cells inside. Errors "
    "are relative, on the finest mesh: of displacements in L2 (of the ball where z > 1/4), of "
    "nodal pressures, against the exact ones at the nodes, in the lumped L2 of the contact part "
    "and in the norm dual to the energy of the displacements of the same mesh. They are root mean "
    "squares over three places in a cell where contact ends. Orders are least squares over all "
    "meshes (`known-contacts-meshes.csv`). The pressure goes to zero like the root of the "
    "distance there: approximation alone gives it order 1 in L2 and 3/2 in H^-1/2. The dual norm "
    "is that of H^-1/2 for multipliers up to the inf-sup constant (`inf_sup`), and measures the "
    "distance of p_h from sum p(x_i) Phi_i, not from p itself. Hueeber and Wohlmuth (SIAM J. "
    "Numer. Anal. 43 (2005) 156) prove order 1 in the energy and H^-1/2 for degree 1; Hueeber, "
    "Mair and Wohlmuth (Appl. Numer. Math. 54 (2005) 555) treat degree 2.",
)
TIMES = (
    "Time to an error of 1 % in the energy norm",
    "Against the exact solution. Seconds of the processor for problem and solve on one rank, "
    "forms compiled, the least of three runs. n grows by a quarter from mesh to mesh; the first "
    "mesh below 1 % is shown.",
)


def moved(points: Array, amount: float = AMOUNT) -> Array:
    """Return points of the unit square or cube moved, those of its sides along these."""
    x = points.T
    waves = [np.sin(np.pi * (2 * x[k - 1] + x[k]) + k) for k in range(len(x))]
    return np.asarray((x + amount / np.pi * np.sin(np.pi * x) * waves).T)


def grid(
    comm: MPI.Intracomm,
    cell: str,
    order: int,
    n: int,
    image: Callable[[Array], Array] = moved,
) -> Domain:
    """Return an image of the unit square or cube, with the sides of a rectangle or box."""
    d = Shape(cell).dim
    make, name = (rectangle, "rectangle") if d == 2 else (box, "box")
    regular = make(MPI.COMM_SELF, (0.0,) * d, (1.0,) * d, (n,) * d, cell=cell).mesh
    space = fem.functionspace(regular, ("Lagrange", order))
    points, cells = space.tabulate_dof_coordinates()[:, :d], space.dofmap.list
    mesh = assembled(comm, points, cells, cell, order)
    facets, middle, *_ = midpoints(mesh)
    parts = {
        side: facets[np.abs(middle[:, axis] - end) < 1e-9]
        for side, (axis, end) in SIDES[name].items()
    }
    mesh.geometry.x[:, :d] = image(mesh.geometry.x[:, :d])
    return from_mesh(mesh, parts, 1.0)


def l2_error(
    problem: ContactProblem, x: Array, exact: Callable[[Array], Array], above: float = 0.0
) -> float:
    """Return the relative error of displacements in L2. Collective."""
    body = problem.body
    domain, space, degree = body.domain, body.space, body.degree
    shape, of = shape_of(domain.mesh), geometry_nodes(domain)
    points, weights = rule(shape, 8)
    volumes = volume_factors(shape, of, points) * weights
    place = np.einsum("qk,nkd->dnq", shape.lagrange(domain.order, points), of)
    volumes = volumes * (place[-1] >= above)
    nodal = x.reshape(-1, domain.dim)[space.dofmap.list[: len(of)]]
    found = np.einsum("qk,nkd->dnq", shape.lagrange(degree, points), nodal)
    known = exact(place.reshape(domain.dim, -1)).reshape(found.shape)
    squares = [np.sum(volumes * part**2) for part in (found - known, known)]
    off, whole = domain.mesh.comm.allreduce(np.array(squares))
    return float(np.sqrt(off / whole))


#: Name -> the solution, given where contact ends; the dimension; the height from which on
#: displacements are compared, as those of the ball are not known by its rim.
KNOWN: dict[str, tuple[Callable[[float], Any], int, float]] = {
    "Hertz, cylinder": (Line, 2, 0.0),
    "Hertz, ball": (Point, 3, 0.25),
    "root-like": (lambda x0: Singular(x0=x0), 2, 0.0),
}

#: Cells along an edge, by dimension and degree of the displacements.
CELLS = {(2, 1): (8, 16, 32, 64), (2, 2): (8, 16, 32, 64), (3, 1): (4, 8, 16), (3, 2): (2, 4, 8)}


#: Where the contact ends between two nodes, as a part of their distance.
PLACES = (1 / 6, 1 / 2, 5 / 6)


def places(n: int) -> list[float]:
    """Return three places where contact may end between two nodes of n."""
    return [(np.floor(0.53 * n) + part) / n for part in PLACES]


def _squares(known: Any, domain: Domain, degree: int, above: float) -> tuple[float, float, float]:
    """Return the squares of the errors: displacements, pressures in L2, and in the dual norm."""
    problem = known.on(domain, degree)
    state, nodes = state_of(problem, 1e-10), problem.nodes
    exact = known.pressure(nodes.points)
    error, dual = state.multipliers.contact - exact, DualNorm(problem)
    off = nodes.norm(error) / nodes.norm(exact), dual.pressure(error) / dual.pressure(exact)
    return l2_error(problem, state.x, known.displacement, above) ** 2, off[0] ** 2, off[1] ** 2


def orders(report: Report) -> dict[tuple[str, str, int, int], Array]:
    """Make the table of errors; return the orders by problem, cells, and both degrees."""
    keys = "problem", "cells", "geometry", "degree", "n", "unknowns"
    names = "u in L2", "p in L2", "p in H^-1/2"
    columns = empty(*keys, *names)
    last = empty(*keys, *names, "order of u", "order of p", "in H^-1/2")
    found = {}
    for name, (kind, dim, above) in KNOWN.items():
        for shape in (shape for shape in SHAPES if shape.dim == dim):
            for order, degree in ELEMENTS:
                counts, rows = CELLS[dim, degree][: 2 if report.coarse else None], []
                for n in counts:
                    domain = grid(MPI.COMM_WORLD, shape.name, order, n)
                    squares = [_squares(kind(x), domain, degree, above) for x in places(n)]
                    rows.append(np.sqrt(np.mean(squares, axis=0)))
                    of = fem.functionspace(domain.mesh, ("Lagrange", degree)).dofmap.index_map
                    shown = (name, shape.name, order, degree, n, of.size_global * dim)
                    append(columns, *shown, *rows[-1].tolist())
                    print(*shown, *rows[-1], flush=True)
                slopes = np.polyfit(-np.log(counts), np.log(rows), 1)[0]
                texts = [f"{value:.2e}" for value in rows[-1]]
                append(last, *shown, *texts, *(f"{slope:.2f}" for slope in slopes))
                found[name, shape.name, order, degree] = slopes
    report.table("known-contacts", ORDERS[0], last, ORDERS[1])
    report.numbers("known-contacts-meshes", columns)
    return found


SINGULAR = Singular()


def _ring(cell: str, order: int, degree: int, n: int) -> tuple[ContactProblem, Any]:
    return on_a_shaft(rings(MPI.COMM_WORLD, cell, order, (1.0, 2.0), (n,)), degree), LAME.ufl


def _root(cell: str, order: int, degree: int, n: int) -> tuple[ContactProblem, Any]:
    return SINGULAR.on(grid(MPI.COMM_WORLD, cell, order, n), degree), SINGULAR.ufl


def _measured(make: Callable[[int], tuple[ContactProblem, Any]], n: int) -> tuple[float, ...]:
    """Return the error in the energy norm, relative, the seconds, and the unknowns. Collective."""
    begin = time.process_time()
    problem, exact = make(n)
    state = state_of(problem, 1e-10)
    seconds = time.process_time() - begin
    norms = [errors(problem.body, state.x, other).energy for other in (exact, None)]
    return norms[0] / norms[1], seconds, problem.body.layout.unknowns


def times(report: Report) -> dict[tuple[str, str, int, int], float]:
    """Make the table of times to 1 %; return the unknowns by problem, cells and degrees."""
    columns = empty("problem", "cells", "geometry", "degree", "n", "unknowns", "error", "seconds")
    found = {}
    makes = (("ring on a shaft", _ring), ("root-like", _root))
    asked = 5 * ASKED if report.coarse else ASKED
    for name, make in makes:
        for shape in (shape for shape in SHAPES if shape.dim == 2):
            for order, degree in ELEMENTS:
                of, n = partial(make, shape.name, order, degree), 2
                while (measured := _measured(of, n))[0] > asked:
                    n = max(n + 1, n * 5 // 4)
                least = min(measured[1], *(_measured(of, n)[1] for _ in range(2)))
                shown = (name, shape.name, order, degree, n, measured[2])
                append(columns, *shown, f"{measured[0]:.2e}", f"{least:.3f}")
                print(*shown, measured[0], least, flush=True)
                found[name, shape.name, order, degree] = measured[2]
    report.table("time-to-one-per-cent", TIMES[0], columns, TIMES[1])
    return found
