"""Pressures next to the axis of revolution, below a rigid ball, as meshes are refined.

At degree 1 nodal pressures are of second order where all elements beside the contact are alike, and
else of first order: with diagonals that alternate, on the axis and off it. Diagonals of one way
leave a force of +-0.58 e E h^3 a radian at each node of the surface z = 0 of an exact solution
u_z = e r^2 + ... (nu = 0.3): over its area r h that is h^2/r. Nodes on the axis, whose areas are a
sixth of those beside them, would be off by 17, 11 and 6 % with diagonals to the right; they carry
no multiplier.

`python3 -m scripts.studies.pressure_on_axis [--out DIR] [--coarse]`, also under mpirun.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI

from contact import Body, Contact, Fixed, Linear, Problem, Sphere, solve
from contact.mesh.domain import revolved
from contact.mesh.grid import rectangle
from contact.methods.options import NewtonOptions
from contact.typing import Array
from scripts.reporting import Report, options

POISSON, RADIUS, DEPTH = 0.3, 4.0, 9e-4
#: Cuts with two sizes only: twice the triangles, and pressures that alternate.
FEW = "crossed", "left_right"
CAPTION = "Contact pressure over that of the nodes farther out, a rigid ball of radius 4 on a block"
NOTE = (
    "a = 0.06 = 6, 12 and 24 h. Pressures over p_0 (1 - r^2/a^2)^(1/2) as fitted to the nodes "
    "with 1.5 h < r < 0.6 a. At degree 1 no node on the axis carries a multiplier."
)


def ratios(n: int, degree: int, diagonal: str) -> tuple[Array, float]:
    """Return the pressures of the nodes over the fit, from the axis on, and p_0. Collective."""
    block = revolved(rectangle(MPI.COMM_WORLD, [0.0, 0.0], [1.0, 1.0], [n, n], diagonal=diagonal))
    body = Body(Linear(1.0, POISSON), [Fixed("left", [0.0, None]), Fixed("top", [None, -DEPTH])])
    ball = Sphere(centre=(0.0, -RADIUS), radius=RADIUS)
    solution = solve(Problem(block, body, Contact("bottom", ball), degree=degree), NewtonOptions())
    nodes = solution.problem.nodes
    r, p = nodes.gather(nodes.points[:, 0]), nodes.gather(solution.pressure)
    order = np.argsort(r)
    r, p = r[order], p[order]
    rim = r[p > 0].max()
    among = (r > 1.5 / n) & (r < 0.6 * rim)
    slope, square = np.polyfit(r[among] ** 2, p[among] ** 2, 1)
    fit = np.sqrt(np.maximum(square + slope * r**2, 1e-30))
    return p / fit, float(np.sqrt(square))


def main(arguments: Sequence[str] | None = None) -> dict[tuple[int, str, int], Array]:
    """Make the table; return the ratios of the first nodes. Collective."""
    chosen = options(__doc__, "pressure_on_axis", arguments)
    found, rows = {}, []
    kinds = [(1, way) for way in ("right", "left", *FEW)] + [(2, "right"), (2, "left")]
    for degree, diagonal in kinds:
        for n in (100, 200) if chosen.coarse or diagonal in FEW else (100, 200, 400):
            values, peak = ratios(n, degree, diagonal)
            found[degree, diagonal, n] = values[:3]
            rows.append((degree, diagonal, n, peak, *values[:3].round(4).tolist()))
    names = ("degree", "diagonal", "1/h", "p_0", "first", "second", "third")
    columns = {k: list(v) for k, v in zip(names, zip(*rows, strict=True), strict=True)}
    Report(chosen.out).table("pressure-on-axis-table", CAPTION, columns, NOTE)
    return found


if __name__ == "__main__":
    main()
