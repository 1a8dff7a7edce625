"""The discrete inf-sup constant of the nodal (dual) multipliers.

The multiplier of nodal values lambda_i is lambda_h = sum_i lambda_i Phi_i, with functions Phi_i
dual to those of Gamma_3. Its constant on a mesh is

    beta = min over lambda_h of sup over V_h of <lambda_h, v_nu>/|v| over the same sup over V,

|v|^2 being the elastic energy: 1 where the mesh sees all of each multiplier, and bounded away from
zero on all meshes where the pair is stable. Both suprema are energies of the body under the load
lambda_h (`DualNorm`), so that beta^2 is the smallest eigenvalue of a pair of compliance matrices.
V stands for the same elements on the mesh after some refinements, on which the integrals of Phi_i
are exact.

`python3 -m scripts.studies.inf_sup [--out DIR] [--coarse]`
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI
from scipy.linalg import eigh

from contact import Body, Contact, Domain, Fixed, Linear
from contact.interface.mortar.coupling import couple
from contact.interface.mortar.surface import surface_of
from contact.mesh.grid import box, rectangle
from contact.mesh.reader import from_generator
from contact.mesh.transfer import refined
from contact.problem.problem import ContactProblem
from contact.typing import Array
from scripts.reporting import Report, append, empty
from scripts.studies.error_norms import DualNorm

CAPTION = "Inf-sup constant of the nodal multipliers"
NOTE = (
    "The least ratio, over all multipliers, of two suprema: that over the displacements of the "
    "mesh, and that over the displacements of the mesh after `refined` bisections of all edges. "
    "Norms are elastic energies (nu = 0.3). alternating: edges of Gamma_3 alternate in the ratio "
    "8 to 1, in cells of one height. graded: unstructured, by the factor of 100 towards the end "
    "of Gamma_3. crosspoints: the ends, in 3-D the rim, of Gamma_3 are fixed, and carry no "
    "multiplier. Degree 2 in 3-D has the change of basis with alpha = 1/5. More refinements lower "
    "beta a little: uniform, degree 1, 8 cells, with 2, 3, 4 refinements 0.656, 0.626, 0.617; "
    "uniform, 3-D, degree 2, 2 cells, with 1 and 2 refinements 0.558, 0.474."
)

#: How much longer every other edge is than its neighbours.
ALTERNATING = 8.0


@dataclass(frozen=True)
class Mesh:
    """Meshes of a kind."""

    #: The mesh of a number of cells.
    make: Callable[[int], Domain]
    #: Its Gamma_3.
    part: str
    #: The parts that are constrained.
    fixed: Sequence[str]

    def problem(self, domain: Domain, degree: int) -> ContactProblem:
        """Return the problem on a mesh, or on one that has been refined."""
        zero = [0.0] * domain.dim
        body = Body(Linear(1.0, 0.3), [Fixed(part, zero) for part in self.fixed])
        return ContactProblem(domain, body, Contact(self.part, 0.0), degree=degree)


def unit(cells: int) -> Domain:
    """Return the unit square."""
    return rectangle(MPI.COMM_SELF, [0.0] * 2, [1.0] * 2, [cells] * 2)


def cube(cells: int) -> Domain:
    """Return the unit cube."""
    return box(MPI.COMM_SELF, [0.0] * 3, [1.0] * 3, [cells] * 3)


def alternating(cells: int) -> Domain:
    """Return the unit square with columns of cells that are wide and narrow by turns."""
    domain = unit(cells)
    widths = np.where(np.arange(cells) % 2 == 0, ALTERNATING, 1.0)
    ends = np.concatenate([[0.0], np.cumsum(widths)]) / widths.sum()
    x = domain.mesh.geometry.x
    x[:, 0] = np.interp(x[:, 0], np.linspace(0.0, 1.0, cells + 1), ends)
    return domain


def graded(cells: int) -> Domain:
    """Return a block whose elements at one end of Gamma_3 are a hundredth of the others."""
    sizes = {"size": 4 / cells, "contact_size": 1 / cells, "edge_size": 0.01 / cells}
    return from_generator(MPI.COMM_SELF, "half_space", radius=1.0, extent=2.0, growth=0.3, **sizes)


SIDES = ("left", "right")

#: Cells and refinements for V, by degree, in 2-D and in 3-D.
PLANE = {1: ((4, 8, 16), 3), 2: ((4, 8, 16), 2)}
SPACE = {1: ((2, 3, 4), 2), 2: ((2, 3), 1)}

#: Kinds of meshes.
SERIES: dict[str, tuple[Mesh, dict[int, tuple[tuple[int, ...], int]]]] = {
    "uniform": (Mesh(unit, "bottom", ["top"]), PLANE),
    "alternating": (Mesh(alternating, "bottom", ["top"]), PLANE),
    "graded": (Mesh(graded, "contact", ["bottom", "side"]), PLANE),
    "crosspoints": (Mesh(unit, "bottom", ["top", *SIDES]), PLANE),
    "uniform, 3-D": (Mesh(cube, "bottom", ["top"]), SPACE),
    "crosspoints, 3-D": (Mesh(cube, "bottom", ["top", *SIDES, "front", "back"]), SPACE),
}


def constant(kind: Mesh, domain: Domain, degree: int, levels: int) -> tuple[float, int]:
    """Return beta on a mesh, and the number of nodes that carry a multiplier. Serial."""
    problem = kind.problem(domain, degree)
    fine = domain
    for _ in range(levels):
        fine = refined(fine)
    reference = kind.problem(fine, degree)
    slave = surface_of(domain, problem.body.space, kind.part)
    master = surface_of(fine, reference.body.space, kind.part)
    # As if the finer mesh were the body opposite.
    opposite = replace(master, normal=-master.normal)
    without = np.setdiff1d(slave.nodes, problem.nodes.nodes)
    coupling = couple(slave, opposite, 1e-6, no_multiplier=without)
    integrals = (coupling.M.T * coupling.weight).toarray()
    nodes = problem.interface.nodes
    values = np.eye(coupling.nodes.size)[np.searchsorted(coupling.nodes, nodes.nodes)]
    normal = coupling.normal[0]

    def on_mesh(column: Array) -> Array:
        load = np.zeros(problem.body.owned)
        nodes.add_jump_transposed((nodes.weight * (values @ column))[:, None] * nodes.normal, load)
        return load

    def on_reference(column: Array) -> Array:
        load = np.zeros((reference.body.owned // domain.dim, domain.dim))
        load[coupling.masters] = (integrals @ column)[:, None] * normal
        return load.ravel()

    matrices = [
        DualNorm(of).compliance([load(column) for column in np.eye(coupling.nodes.size)])
        for of, load in ((problem, on_mesh), (reference, on_reference))
    ]
    least = eigh(*matrices, eigvals_only=True, subset_by_index=[0, 0])[0]
    return float(np.sqrt(max(least, 0.0))), coupling.nodes.size


def main(arguments: Sequence[str] | None = None) -> dict[tuple[str, int, int], float]:
    """Make the table; return the constants by mesh, degree and cells."""
    report = Report.of(__doc__, "inf_sup", arguments)
    columns = empty("mesh", "degree", "cells", "multipliers", "refined", "beta")
    found = {}
    for name, (kind, degrees) in SERIES.items():
        for degree, (cells, levels) in degrees.items():
            for n in cells[:2] if report.coarse else cells:
                beta, count = constant(kind, kind.make(n), degree, levels)
                found[name, degree, n] = beta
                append(columns, name, degree, n, count, levels, round(beta, 4))
                print(name, degree, n, count, levels, f"{beta:.4f}", flush=True)
    report.table("inf-sup-table", CAPTION, columns, NOTE)
    return found


if __name__ == "__main__":
    main()
