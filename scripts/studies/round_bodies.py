"""Orders of convergence of a disc and a ball on a plane, on straight cells and on curved ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from scipy.spatial import cKDTree

from contact import Body, Contact, Domain, Fixed, Linear, Plane
from contact.mesh.cells import SHAPES
from contact.problem.problem import ContactProblem
from contact.typing import Array
from scripts.reporting import Report, append, empty
from scripts.studies.cell_orders import ELEMENTS, grid, solved

CAPTION = "A disc and a ball of soft rim on a rigid plane, on straight and on curved cells"
NOTE = (
    "A half of a disc or a quarter of a ball, between the radii 1/2 and 1 and up to 45 degrees "
    "from the contact: a core, that is pushed down, with a soft rim. E = 1, nu = 0.3, plane strain "
    "in 2-D, no friction; n cells each way, graded towards the contact. Differences at vertices "
    "from degree 2 on curved cells, N each way, relative, root mean squares over three depths, on "
    "the finest mesh; orders are least squares over all meshes (`round-bodies-meshes.csv`). The "
    "reference beside Hertz's formulas for its force: "
)
HERTZ = "{}, N = {}: a = {:.3f}, {:.3f} times his largest pressure"

LAW = Linear(1.0, 0.3)

#: Radius of the core, that of the body being 1, and the angle up to which the body goes.
CORE, ANGLE = 0.5, np.pi / 4

#: How far the core is pushed, by dimension: contact then ends 1/7, 2/7 and 4/7 of a cell behind a
#: node of the coarsest mesh, and so, in another order, on each mesh of twice as many.
DEPTHS = {2: (0.01150, 0.01338, 0.01767), 3: (0.02292, 0.03230, 0.05792)}

#: Cells along each edge by dimension and degree, and those of the reference by dimension.
CELLS = {(2, 1): (8, 16, 32, 64), (2, 2): (8, 16, 32, 64), (3, 1): (3, 6, 12), (3, 2): (3, 6)}
FINE = {2: 128, 3: 12}


def rim(points: Array) -> Array:
    """Return the body's points to angles and depths behind the rim, all from 0 to 1."""
    graded = points * (1 + 3 * points) / 4
    slopes = np.tan(ANGLE * graded[:, :-1])
    directions = np.column_stack([slopes, np.full(len(points), -1.0)])
    radius = 1 - (1 - CORE) * graded[:, -1:]
    return np.asarray(radius * directions / np.linalg.norm(directions, axis=1, keepdims=True))


def problem(domain: Domain, degree: int, depth: float) -> ContactProblem:
    """Push the body on a plane that it touches."""
    dim = domain.dim
    fixed = [Fixed("top", [*[0.0] * (dim - 1), -depth])]
    for k, side in enumerate(("left", "front")[: dim - 1]):
        fixed.append(Fixed(side, [0.0 if i == k else None for i in range(dim)]))
    low = np.eye(dim)[-1]
    contact = Contact("bottom", Plane(tuple(-low), tuple(low)))
    return ContactProblem(domain, Body(LAW, fixed), contact, degree=degree)


def lattice(dim: int, n: int) -> Array:
    """Return the vertices of n cells each way, those of the rim first, as `rim` takes them."""
    axes = np.meshgrid(*[np.linspace(0, 1, n + 1)] * dim, indexing="ij")
    points = np.column_stack([axis.ravel() for axis in axes])
    return points[np.argsort(points[:, -1], kind="stable")]


@dataclass(frozen=True)
class Solution:
    """Displacements and pressures at nodes, and the force."""

    #: Of all nodes; the pressure is 0 away from the contact.
    points: Array
    displacement: Array
    pressure: Array
    #: On the part that is modelled.
    force: float

    def off(self, other: Solution, n: int) -> Array:
        """Return the squares of the differences: force, displacements, pressures, all relative."""
        dim = self.points.shape[1]
        places = rim(lattice(dim, n))
        here, there = (cKDTree(each.points).query(places) for each in (self, other))
        assert max(here[0].max(), there[0].max()) < 1e-9
        edge = (n + 1) ** (dim - 1)
        pairs = (
            (self.force, other.force),
            (self.displacement[here[1]], other.displacement[there[1]]),
            (self.pressure[here[1][:edge]], other.pressure[there[1][:edge]]),
        )
        return np.array([np.sum((a - b) ** 2) / np.sum(np.square(b)) for a, b in pairs])

    def beside_hertz(self) -> tuple[float, float]:
        """Return a by Hertz's formulas for the force, and the largest pressure over his."""
        dim, modulus = self.points.shape[1], LAW.young / (1 - LAW.poisson**2)
        whole = 2 ** (dim - 1) * self.force
        if dim == 2:
            a = np.sqrt(4 * whole / (np.pi * modulus))
            peak = 2 * whole / (np.pi * a)
        else:
            a = (3 * whole / (4 * modulus)) ** (1 / 3)
            peak = 3 * whole / (2 * np.pi * a**2)
        return float(a), float(self.pressure.max() / peak)


def solution(dim: int, cell: str, order: int, degree: int, n: int, depth: float) -> Solution:
    """Return a solution, on one rank."""
    domain = grid(MPI.COMM_SELF, cell, order, n, rim)
    of = problem(domain, degree, depth)
    state = solved(of)
    pressure = np.zeros(len(state.x) // dim)
    pressure[of.nodes.nodes] = state.forces.pressure
    x = of.body.space.tabulate_dof_coordinates()[:, :dim]
    return Solution(x, state.x.reshape(-1, dim), pressure, of.nodes.sum(state.forces.pressure))


def orders(report: Report, coarse: bool) -> dict[tuple[str, int, int], Array]:
    """Make the table; return the orders of all three by cells and both degrees. On one rank."""
    keys = ("cells", "geometry", "degree", "n", "unknowns", "force", "u", "p")
    columns = empty(*keys)
    last = empty(*keys, "order of force", "order of u", "order of p")
    found, hertz = {}, []
    for dim, fine in FINE.items():
        fine //= 4 if coarse else 1
        best = next(shape for shape in SHAPES if shape.dim == dim and not shape.simplex)
        exact = [solution(dim, best.name, 2, 2, fine, depth) for depth in DEPTHS[dim]]
        hertz.append(HERTZ.format(best.plural, fine, *exact[0].beside_hertz()))
        for shape in (shape for shape in SHAPES if shape.dim == dim):
            for order, degree in ELEMENTS:
                counts, rows = CELLS[dim, degree][: 2 if coarse else None], []
                for n in counts:
                    squares = []
                    for depth, known in zip(DEPTHS[dim], exact, strict=True):
                        of = solution(dim, shape.name, order, degree, n, depth)
                        squares.append(of.off(known, n))
                    rows.append(np.sqrt(np.mean(squares, axis=0)))
                    shown = (shape.name, order, degree, n, of.displacement.size)
                    append(columns, *shown, *rows[-1].tolist())
                    print(*shown, *rows[-1], flush=True)
                slopes = np.polyfit(-np.log(counts), np.log(rows), 1)[0]
                texts = [f"{value:.2e}" for value in rows[-1]]
                append(last, *shown, *texts, *(f"{slope:.2f}" for slope in slopes))
                found[shape.name, order, degree] = slopes
    report.table("round-bodies", CAPTION, last, NOTE + "; ".join(hertz) + ".")
    report.numbers("round-bodies-meshes", columns)
    return found
