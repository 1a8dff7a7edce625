"""Quarters of thick rings of any cells, straight or of second order, and Lame's solution there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from contact import Body, Contact, Cylinder, Domain, Fixed, Linear, Sphere
from contact.mesh.cells import Shape
from contact.mesh.domain import from_mesh
from contact.mesh.grid import box, rectangle
from contact.problem.problem import ContactProblem
from contact.typing import Array
from tests.problems.meshes import assembled, midpoints

#: Cells around a ring and across it for each on the other way.
AROUND = 2


@dataclass(frozen=True)
class Lame:
    """A ring between two radii under a pressure inside, in plane strain."""

    #: Radii.
    inner: float = 1.0
    outer: float = 2.0
    #: Inside.
    pressure: float = 0.01
    #: Of the material.
    young: float = 1.0
    poisson: float = 0.3

    def _constants(self) -> tuple[float, float]:
        squares = self.inner**2, self.outer**2
        stress = self.pressure * squares[0] / (squares[1] - squares[0])
        return stress, stress * squares[1]

    def displacement(self, radius: Array) -> Array:
        """Return the radial displacement."""
        mean, rest = self._constants()
        factor = (1 + self.poisson) / self.young
        return factor * ((1 - 2 * self.poisson) * mean * radius + rest / radius)

    def ufl(self, place: ufl.core.expr.Expr) -> ufl.core.expr.Expr:
        """Return the displacement as a UFL vector of the coordinates."""
        radius = ufl.sqrt(place[0] ** 2 + place[1] ** 2)
        mean, rest = self._constants()
        factor = (1 + self.poisson) / self.young
        size = factor * ((1 - 2 * self.poisson) * mean + rest / radius**2)
        return ufl.as_vector([size * place[0], size * place[1], 0][: len(place)])

    def radial(self, radius: Array) -> Array:
        """Return the radial stress."""
        mean, rest = self._constants()
        return mean - rest / radius**2


LAME = Lame()
LAW = Linear(LAME.young, LAME.poisson)


def rings(
    comm: MPI.Intracomm, cell: str, order: int, radii: Sequence[float], cells: Sequence[int]
) -> Domain:
    """Return quarters of rings about each other, with parts `inner0`, `outer0`, `inner1`, ...

    In 3-D they are one deep. The others are `left` on x = 0, `bottom` on y = 0, `front` on z = 0
    and `back`; regions are `ring0`, ...
    """
    shape = Shape(cell)
    d, places, rows, count = shape.dim, [], [], 0
    for low, high, n in zip(radii[:-1], radii[1:], cells, strict=True):
        counts = [n, AROUND * n, max(n // 2, 1)][:d]
        make = rectangle if d == 2 else box
        grid = make(MPI.COMM_SELF, (0.0,) * d, (1.0,) * d, counts, cell=cell).mesh
        space = fem.functionspace(grid, ("Lagrange", order))
        x = space.tabulate_dof_coordinates()[:, :d].copy()
        radius, angle = low + (high - low) * x[:, 0], np.pi / 2 * x[:, 1]
        x[:, 0], x[:, 1] = radius * np.cos(angle), radius * np.sin(angle)
        # Nodes of the next ring at the same radius are others.
        places.append(x)
        rows.append(space.dofmap.list + count)
        count += len(x)
    mesh = assembled(comm, np.concatenate(places), np.concatenate(rows), cell, order)
    facets, middle, behind, every = midpoints(mesh)
    centre, inside, at = (np.linalg.norm(x[:, :2], axis=1) for x in (every, behind, middle))
    flat = {"left": 0, "bottom": 1, "front": 2}
    sides = {name: np.abs(middle[:, k]) < 1e-9 for name, k in flat.items() if k < d}
    if d == 3:
        sides["back"] = np.abs(middle[:, 2] - 1) < 1e-9
    round_ = ~np.any([*sides.values()], axis=0)
    regions = {}
    for k, (low, high) in enumerate(pairwise(radii)):
        # Chords lie within the circles.
        own = round_ & (inside > low * 0.95) & (inside < high)
        sides[f"inner{k}"] = own & (at < inside)
        sides[f"outer{k}"] = own & (at > inside)
        regions[f"ring{k}"] = np.flatnonzero((centre > low * 0.95) & (centre < high))
    parts = {name: facets[chosen] for name, chosen in sides.items()}
    return from_mesh(mesh, parts, radii[-1], regions)


def error(space: fem.FunctionSpace, x: Array, exact: Lame) -> float:
    """Return the relative error of displacements in L2. Collective."""
    mesh, u = space.mesh, fem.Function(space)
    u.x.array[:] = x[: u.x.array.size]
    known = exact.ufl(ufl.SpatialCoordinate(mesh))
    dx = ufl.dx(metadata={"quadrature_degree": 10})
    squares = [fem.assemble_scalar(fem.form(ufl.inner(v, v) * dx)) for v in (u - known, known)]
    off, whole = mesh.comm.allreduce(np.array(squares))
    return float(np.sqrt(off / whole))


def supports(dim: int) -> list[Fixed]:
    """Return the supports of a quarter of a ring, by symmetry."""
    sides = [("left", 0), ("bottom", 1), ("front", 2), ("back", 2)][: 2 * dim - 2]
    return [Fixed(part, [0.0 if i == k else None for i in range(dim)]) for part, k in sides]


def on_a_shaft(domain: Domain, degree: int) -> ContactProblem:
    """Press a ring on a shaft, whose radius is that at which the pressure is LAME's."""
    dim = domain.dim
    radius = 1.0 + float(LAME.displacement(np.array(1.0)))
    shaft = (
        Sphere((0.0, 0.0), radius)
        if dim == 2
        else Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), radius)
    )
    contact = Contact("inner0", shaft, press=True)
    return ContactProblem(domain, Body(LAW, supports(dim)), contact, degree=degree)
