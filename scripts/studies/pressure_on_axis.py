"""Pressures next to the axis of revolution, below a rigid ball, as meshes are refined.

Triangles of degree 1 with diagonals of one way leave a force of +-0.58 e E h^3 a radian at each
node of the surface z = 0 of an exact solution u_z = e r^2 + ... (nu = 0.3): over its area r h that
is h^2/r. Squares, cut by both diagonals or left whole, leave none that grows towards the axis but a
ninth of that on the axis itself, inside the body too: a line of forces, along which nodes are off
by h. Nodes on the axis, whose areas are a sixth of those beside them, would be off by 17, 11 and
6 % with diagonals to the right; they carry no multiplier.

`python3 -m scripts.studies.pressure_on_axis [--out DIR] [--coarse]`, also under mpirun.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from contact import Body, Contact, Fixed, Linear, Problem, Sphere, solve
from contact.mesh.domain import revolved
from contact.mesh.grid import rectangle
from contact.methods.options import NewtonOptions
from contact.typing import Array
from scripts.reporting import Report, append, empty

POISSON, RADIUS, DEPTH, SIZE = 0.3, 4.0, 9e-4, 0.5
#: How a square is cut, and where it is not.
WAYS = "right", "left", "crossed", "left_right", "whole"
CAPTION = "Contact pressure next to the axis of revolution: a rigid ball of radius 4 on a block"
NOTE = (
    "Squares of 1/h a unit in a block of 0.5 x 0.5, cut by diagonals or whole (quadrilaterals); a "
    "= 0.06 = 6, 12 and 24 h. Errors, in per cent, are relative to the fit p_0 (1 - "
    "r^2/a^2)^(1/2) of degree 2 on the finest mesh. The error of p_0 is that of a fit to the "
    "nodes with 1.5 h < r < 0.6 a. The other columns are errors of the nodes at r = h, 2 h, 3 h "
    "(degree 2: h/2, h, 3 h/2) and r = a/2. At degree 1, on squares that are whole or cut by both "
    "diagonals, the errors of nodes are C h^2/r. At a given number of cells from the axis they "
    "fall like h, and at a given radius like h^2. At degree 1 no node on the axis carries a "
    "multiplier. By default a rectangle that reaches the axis is cut by both diagonals at degree "
    "1."
)


@dataclass(frozen=True)
class Profile:
    """Pressures over the radius: those of the nodes, from the axis on, and p^2 = a + b r^2."""

    radius: Array
    pressure: Array
    square: float
    slope: float

    def fitted(self, radius: Array) -> Array:
        """Return the pressures of the fit at some radii."""
        return np.asarray(np.sqrt(np.maximum(self.square + self.slope * radius**2, 1e-30)))

    @property
    def ratios(self) -> Array:
        """Nodal pressures over the fit."""
        return self.pressure / self.fitted(self.radius)


def profile(n: int, degree: int, way: str) -> Profile:
    """Return the pressures on n squares a unit. Collective."""
    cut = {"cell": "quadrilateral"} if way == "whole" else {"diagonal": way}
    cells = [round(n * SIZE)] * 2
    block = revolved(rectangle(MPI.COMM_WORLD, [0.0, 0.0], [SIZE, SIZE], cells, **cut))
    body = Body(Linear(1.0, POISSON), [Fixed("left", [0.0, None]), Fixed("top", [None, -DEPTH])])
    ball = Sphere(centre=(0.0, -RADIUS), radius=RADIUS)
    solution = solve(Problem(block, body, Contact("bottom", ball), degree=degree), NewtonOptions())
    nodes = solution.problem.nodes
    r, p = nodes.gather(nodes.points[:, 0]), nodes.gather(solution.pressure)
    order = np.argsort(r)
    r, p = r[order], p[order]
    among = (r > 1.5 / n) & (r < 0.6 * r[p > 0].max())
    slope, square = np.polyfit(r[among] ** 2, p[among] ** 2, 1)
    return Profile(r, p, float(square), float(slope))


def main(arguments: Sequence[str] | None = None) -> dict[tuple[int, str, int], Profile]:
    """Make the table; return the profiles. Collective."""
    report = Report.of(__doc__, "pressure_on_axis", arguments)
    meshes = (100, 200) if report.coarse else (100, 200, 400)
    kinds = [(1, way) for way in WAYS] + [(2, way) for way in WAYS if way != "left_right"]
    found = {(*kind, n): profile(n, *kind) for kind in kinds for n in meshes}
    best = found[2, "crossed", meshes[-1]]
    columns = empty("degree", "squares", "1/h", "p_0", "error of p_0", "r = h", "2 h", "3 h", "a/2")
    for (degree, way, n), one in found.items():
        error = 100 * (one.pressure / best.fitted(one.radius) - 1)
        middle = error[np.argmin(np.abs(one.radius - 0.03))]
        at_axis = 100 * (np.sqrt(one.square / best.square) - 1)
        values = (at_axis, *error[:3], middle)
        rounded = (round(float(e), 3) + 0.0 for e in values)
        append(columns, degree, way, n, one.square**0.5, *rounded)
    report.table("pressure-on-axis-table", CAPTION, columns, NOTE)
    return found


if __name__ == "__main__":
    main()
