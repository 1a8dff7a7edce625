"""Layers beside or around each other whose meshes overlap, and what presses them apart."""

import re
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import pytest
from dolfinx import fem
from dolfinx.mesh import Mesh
from mpi4py import MPI
from numpy.typing import ArrayLike

from contact import Body, Contact, Fixed, InputError, Linear, Load, Problem, Solution
from contact._compat import geometry_dofmap
from contact.mesh.cells import Shape
from contact.mesh.domain import Domain, from_mesh, revolved
from contact.mesh.grid import box, rectangle
from tests.problems.meshes import assembled, midpoints

#: Young's modulus and Poisson's ratio.
YOUNG, POISSON = 10.0, 0.3

#: Modulus of a layer that cannot widen.
UNIAXIAL = YOUNG * (1 - POISSON) / ((1 + POISSON) * (1 - 2 * POISSON))

#: Place of a corner along the side that it is in, of the length 1.
OFFSET = 0.45

#: Ends of the layers, along x or the radius.
RADII = (1.0, 1.5, 2.0)

#: Degrees of geometry and displacements.
ELEMENTS = ((1, 1), (1, 2), (2, 2))

PLANE, SPACE = ("triangle", "quadrilateral"), ("tetrahedron", "hexahedron")


def told(domain: Domain, given: Body, contact: Contact, degree: int = 1, words: str = "") -> float:
    """Return the depth of the overlap for which a problem is refused."""
    with pytest.raises(InputError, match=r"\[overlap\]") as raised:
        Problem(domain, given, contact, degree=degree)
    assert words in str(raised.value)
    return float(re.search(r"by up to (\S+) more", str(raised.value))[1])


def boxes(comm: MPI.Intracomm, cell: str, order: int, numbers: Sequence[Sequence[int]]) -> Mesh:
    """Return unit cubes of these numbers of cells, which begin at x = 0, 2, 4, ..."""
    d, places, rows, count = Shape(cell).dim, [], [], 0
    for k, given in enumerate(numbers):
        make = rectangle if d == 2 else box
        grid = make(MPI.COMM_SELF, (0.0,) * d, (1.0,) * d, given, cell=cell).mesh
        space = fem.functionspace(grid, ("Lagrange", order))
        x = space.tabulate_dof_coordinates()[:, :d].copy()
        x[:, 0] += 2 * k
        places.append(x)
        rows.append(space.dofmap.list + count)
        count += len(x)
    return assembled(comm, np.concatenate(places), np.concatenate(rows), cell, order)


def layers(
    comm: MPI.Intracomm,
    cell: str,
    order: int,
    form: str,
    depth: float | Sequence[float],
    radii: Sequence[float] = RADII,
    counts: Sequence[int] = (4, 5),
    rib: float = 0.0,
) -> Domain:
    """Return blocks ("flat"), revolved tubes ("tube") or rings ("ring"), `depth` in each other.

    The last one has a rib of this height in the middle of its inner side, two facets wide.
    """
    d = Shape(cell).dim
    numbers = [[max(n // 2, 1), n, max(n // 2, 1)][:d] for n in counts]
    mesh = boxes(comm, cell, order, numbers)
    facets, middle, *_ = midpoints(mesh)
    sides = {
        f"{name}{k}": np.abs(middle[:, 0] - 2 * k - end) < 1e-9
        for k in range(len(counts))
        for name, end in (("inner", 0), ("outer", 1))
    }
    ends = {"below": (1, 0), "above": (1, 1), "front": (2, 0), "back": (2, 1)}
    for name, (i, end) in list(ends.items())[: 2 * d - 2]:
        sides[name] = np.abs(middle[:, i] - end) < 1e-9
    x = mesh.geometry.x
    k = np.floor(x[:, 0] / 2 + 1e-9).astype(int)
    low, high = np.array(list(pairwise(radii))).T
    shift = np.concatenate([[0.0], np.cumsum(np.broadcast_to(depth, len(counts) - 1))])
    radius = low[k] + (high - low)[k] * (x[:, 0] - 2 * k) - shift[k]
    tent = np.maximum(1 - counts[-1] * np.abs(x[:, 1] - 0.5), 0.0) * (1 - (x[:, 0] - 2 * k))
    radius -= np.where(k == len(counts) - 1, rib * tent, 0.0)
    angle = np.pi / 2 * x[:, 1] if form == "ring" else np.zeros(len(x))
    x[:, 0] = radius * np.cos(angle)
    if form == "ring":
        x[:, 1] = radius * np.sin(angle)
    domain = from_mesh(mesh, {name: facets[there] for name, there in sides.items()}, radii[-1])
    return revolved(domain) if form == "tube" else domain


def corner(
    comm: MPI.Intracomm,
    cell: str,
    order: int,
    edges: ArrayLike,
    depth: float,
    numbers: Sequence[Sequence[int]],
    axis: bool = False,
) -> Domain:
    """Return a block with the side "top" at y = 0, and a parallelepiped whose corner is in it.

    Its "sides" meet at the corner, from where its edges (rows) go; "base" and "end" are the sides
    of both bodies far from each other. With `axis` the corner is on the axis of revolution, and the
    first edge along it.
    """
    mesh, edges = boxes(comm, cell, order, numbers), np.asarray(edges)
    facets, middle, *_ = midpoints(mesh)
    d, second = edges.shape[0], middle[:, 0] > 1.5
    middle[:, 0] -= 2 * second
    low, high = (np.abs(middle[:, :d] - end) < 1e-9 for end in (0, 1))
    sides = {
        "base": ~second & low[:, 1],
        "top": ~second & high[:, 1],
        "sides": second & low[:, : d - axis].any(axis=1),
        "end": second & high.any(axis=1),
    }
    x = mesh.geometry.x
    above = x[:, 0] > 1.5
    x[above, 0] -= 2
    x[above, :d] = x[above, :d] @ edges
    x[above, 1] -= depth
    x[~above, :d] = 4 * (x[~above, :d] - [0.0 if axis else OFFSET, 1.0, OFFSET][:d])
    domain = from_mesh(mesh, {name: facets[there] for name, there in sides.items()}, 4.0)
    return revolved(domain) if axis else domain


def of_layer(domain: Domain, number: int) -> np.ndarray:
    """Return which nodes of the geometry belong to a layer, of blocks that touch."""
    nodes = np.zeros(len(domain.mesh.geometry.x), dtype=bool)
    cells = geometry_dofmap(domain.mesh)
    nodes[cells[domain.mesh.geometry.x[cells][:, :, 0].mean(axis=1) > RADII[number]]] = True
    return nodes


def body(form: str, dim: int, layers: int, traction: float = 0.0) -> Body:
    """Return the body between rollers; its end is constrained where no traction pulls at it."""
    across = {"below": 1, "above": 0 if form == "ring" else 1, "front": 2, "back": 2}
    supports = list(across.items())[: 2 * dim - 2]
    last, loads = f"outer{layers - 1}", []
    if form == "flat":
        supports += [("inner0", 0)] + ([(last, 0)] if traction == 0 else [])
        if traction != 0:
            loads = [Load(last, [traction] + [0.0] * (dim - 1))]
    fixed = [Fixed(part, [0.0 if i == k else None for i in range(dim)]) for part, k in supports]
    return Body(Linear(YOUNG, POISSON), fixed, loads)


def pressure(form: str, depth: float, radii: Sequence[float] = RADII) -> float:
    """Return the pressure on the first of two layers; of rings Lame's, for the drawn radii."""
    a, c, b = radii
    if form == "flat":
        return UNIAXIAL * depth / (b - a)
    inside, outside = (c, a), (b - depth, c - depth)
    stretch = sum((x**2 + y**2) / (x**2 - y**2) for x, y in (inside, outside))
    return depth * YOUNG / ((1 - POISSON**2) * c * stretch)


def mean(solution: Solution) -> float:
    """Return the mean pressure of a solution."""
    nodes = solution.problem.nodes
    return nodes.sum(solution.pressure) / nodes.sum(np.ones_like(nodes.weight))
