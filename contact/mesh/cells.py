"""Reference cells, by basix: corners, facets, Lagrange elements, quadrature, cuts into simplices.

Points are in the reference cell, shape (q, dim); nodes are in the order of dolfinx, corners first.
Other modules do not ask for a shape by its name.

References
----------
Dompierre, Labbé, Vallet and Camarero, How to subdivide pyramids, prisms and hexahedra into
tetrahedra, 8th International Meshing Roundtable (1999).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import basix
import numpy as np
from numpy.typing import NDArray

from contact.typing import Array

#: Nodes of cells and facets.
Nodes = NDArray[np.intp]


@dataclass(frozen=True)
class Shape:
    """A reference cell, or facet."""

    name: str  #: ``interval``, ``triangle``, ``quadrilateral``, ``tetrahedron`` or ``hexahedron``

    @property
    def kind(self) -> basix.CellType:
        """The shape in basix."""
        return basix.CellType[self.name]

    @property
    def plural(self) -> str:
        """The plural of its name."""
        return {"tetrahedron": "tetrahedra", "hexahedron": "hexahedra"}.get(
            self.name, f"{self.name}s"
        )

    @cached_property
    def topology(self) -> list[list[list[int]]]:
        """Corners of the corners, edges, ... and the cell."""
        return basix.topology(self.kind)

    @property
    def dim(self) -> int:
        """Its dimension."""
        return len(self.topology) - 1

    @property
    def corners(self) -> int:
        """Number of corners."""
        return len(self.topology[0])

    @property
    def simplex(self) -> bool:
        """Whether it is a simplex: straight cells are affine images of the reference one."""
        return self.corners == self.dim + 1

    @property
    def facet(self) -> Shape:
        """The shape of its facets."""
        return facet_of(self.facet_corners.shape[1])

    @cached_property
    def facet_corners(self) -> Nodes:
        """Corners of each facet in the order of the facet's shape, (facets, corners)."""
        return np.array(self.topology[self.dim - 1], dtype=np.intp)

    @cached_property
    def edges(self) -> list[tuple[int, int]]:
        """The edges as pairs of corners."""
        return [(a, b) for a, b in self.topology[1]]

    @property
    def around(self) -> list[int]:
        """The corners in an order around a cell in 2-D."""
        return [0, 1, 3, 2] if self.corners == 4 else list(range(self.corners))

    @property
    def middle(self) -> Array:
        """The centroid, shape (1, dim)."""
        return np.asarray(basix.geometry(self.kind).mean(axis=0, keepdims=True))

    def nodes(self, degree: int) -> Array:
        """Return the nodes of the Lagrange element of a degree, shape (nodes, dim)."""
        return np.asarray(_element(self, degree).points)

    def facet_nodes(self, degree: int) -> Nodes:
        """Return the nodes of each facet in the order of the facet's nodes, (facets, nodes)."""
        closures = _element(self, degree).entity_closure_dofs[self.dim - 1]
        corners = basix.geometry(self.kind)[self.facet_corners]
        functions = self.facet.lagrange(1, self.facet.nodes(degree))
        places = np.einsum("nc,fcd->fnd", functions, corners)
        every = self.nodes(degree)[np.array(closures)]
        distance = np.linalg.norm(places[:, :, None] - every[:, None], axis=3)
        return np.take_along_axis(np.array(closures), distance.argmin(axis=2), axis=1)

    @cached_property
    def facet_normals(self) -> Array:
        """Unit normals out of the facets of the reference cell, shape (facets, dim)."""
        return np.asarray(basix.cell.facet_outward_normals(self.kind))

    def on_facet(self, facet: int, at: Array) -> Array:
        """Return points of a facet as points of the cell, shape (q, dim)."""
        corners = basix.geometry(self.kind)[self.facet_corners[facet]]
        return np.asarray(self.facet.lagrange(1, at) @ corners)

    @property
    def serendipity(self) -> list[tuple[Nodes, Nodes, Array]]:
        """Nodes of degree 2 in faces, (k,), their corners, weights of other nodes; of the cell."""
        found: list[tuple[Nodes, Nodes, Array]] = []
        dofs = _element(self, 2).entity_dofs
        for dim in range(2, self.dim + 1):
            ends = [of for of, own in zip(self.topology[dim], dofs[dim], strict=True) if own]
            weights = np.zeros((len(ends), len(self.nodes(2))))
            for i, corners in enumerate(ends):
                around = [k for k, edge in enumerate(self.edges) if {*edge} <= {*corners}]
                weights[i, corners] = -1 / 4
                # Half of the edges of a face, a quarter of those of the cell.
                weights[i, [dofs[1][k][0] for k in around]] = 1 / 2 if dim == 2 else 1 / 4
            if ends:
                nodes = np.concatenate([own for own in dofs[dim] if own])
                found.append((nodes, np.array(ends), weights))
        return found

    @property
    def children(self) -> Nodes:
        """Corners of the halves along each axis, as nodes of degree 2, (children, corners)."""
        corners = basix.geometry(self.kind)
        places = (corners[:, None] + corners[None]) / 2
        distance = np.linalg.norm(places[:, :, None] - self.nodes(2), axis=3)
        return np.asarray(distance.argmin(axis=2))

    def pieces(self, degree: int) -> Nodes:
        """Return the corners of straight pieces of a facet of a degree, (pieces, corners)."""
        if degree == 1:
            return np.arange(self.corners)[None]
        # Of a triangle the one in the middle, too.
        return np.concatenate([self.children, [[3, 4, 5]]]) if self == TRIANGLE else self.children

    def lagrange(self, degree: int, at: Array) -> Array:
        """Return the Lagrange polynomials of a degree at points, shape (q, nodes)."""
        if degree == 0:
            return np.ones((len(at), 1))
        return self._tabulated(degree, at, 0)[0]

    def gradients(self, degree: int, at: Array) -> Array:
        """Return their derivatives in the reference cell, (q, nodes, dim)."""
        return np.moveaxis(self._tabulated(degree, at, 1)[1:], 0, -1)

    def _tabulated(self, degree: int, at: Array, derivatives: int) -> Array:
        """Return the polynomials, then their first derivatives, at points, shape (k, q, nodes)."""
        if not len(at):  # by whose number basix divides
            return np.zeros((1 + derivatives * self.dim, 0, len(self.nodes(degree))))
        return np.asarray(_element(self, degree).tabulate(derivatives, at)[..., 0])

    def vtk(self, degree: int) -> tuple[int, tuple[int, ...]]:
        """Return VTK's number of cells of a degree, and the nodes in VTK's order."""
        *numbers, order = VTK[self.name]
        return numbers[degree - 1], order[: len(self.nodes(degree))]

    def degree_of(self, nodes: int) -> int:
        """Return the degree of the Lagrange element with a number of nodes: 0, 1 or 2."""
        known = {1: 0} | {len(self.nodes(degree)): degree for degree in (1, 2)}
        return known[nodes]


@cache
def _element(shape: Shape, degree: int) -> basix.finite_element.FiniteElement:
    variant = basix.LagrangeVariant.gll_warped
    return basix.create_element(basix.ElementFamily.P, shape.kind, degree, variant)


@cache
def rule(shape: Shape, degree: int) -> tuple[Array, Array]:
    """Return the points of a quadrature rule, (q, dim), and its weights, (q,)."""
    points, weights = basix.make_quadrature(shape.kind, degree)
    return np.asarray(points), np.asarray(weights)


#: Largest degree of a rule where integrands are no polynomials.
LARGEST = 40

#: VTK's number of a shape, of degree 1 and 2, and the nodes of degree 2 in VTK's order.
VTK: dict[str, tuple[int, int, tuple[int, ...]]] = {
    "interval": (3, 21, (0, 1, 2)),
    "triangle": (5, 22, (0, 1, 2, 5, 3, 4)),
    "tetrahedron": (10, 24, (0, 1, 2, 3, 9, 6, 8, 7, 5, 4)),
    "quadrilateral": (9, 28, (0, 1, 3, 2, 4, 6, 7, 5, 8)),
    "hexahedron": (
        12,
        29,
        (
            *(0, 1, 3, 2, 4, 5, 7, 6),
            *(8, 11, 13, 9, 16, 18, 19, 17, 10, 12, 15, 14),
            *(22, 23, 21, 24, 20, 25, 26),
        ),
    ),
}

#: VTK's numbers of cells of degree 1.
LINEAR = frozenset(number for number, *_ in VTK.values())

#: Facets of cells in 2-D.
INTERVAL = Shape("interval")

#: The shapes of the cells of a mesh.
TRIANGLE, QUADRILATERAL = Shape("triangle"), Shape("quadrilateral")
TETRAHEDRON, HEXAHEDRON = Shape("tetrahedron"), Shape("hexahedron")
SHAPES = (TRIANGLE, QUADRILATERAL, TETRAHEDRON, HEXAHEDRON)


def facet_of(corners: int) -> Shape:
    """Return the shape of facets with a number of corners."""
    return {2: INTERVAL, 3: TRIANGLE, 4: QUADRILATERAL}[corners]


def facet_with(dim: int, nodes: int) -> Shape:
    """Return the shape of facets of a dimension whose geometry has a number of nodes."""
    known = (s for s in (INTERVAL, TRIANGLE, QUADRILATERAL) if s.dim == dim)
    return next(s for s in known if nodes in (s.corners, len(s.nodes(2))))


def shape_of(mesh: Any) -> Shape:
    """Return the shape of the cells of a mesh of dolfinx."""
    return Shape(mesh.topology.cell_name())


def barycentric(points: Array) -> Array:
    """Return the barycentric coordinates of points of a simplex, shape (n, dim + 1)."""
    return np.column_stack([1 - points.sum(axis=1), points])


#: Corners around the facets of a cell, in VTK's order; Abaqus calls the facets S1, S2, ...
FACES: dict[str, tuple[tuple[int, ...], ...]] = {
    "triangle": ((0, 1), (1, 2), (2, 0)),
    "quadrilateral": ((0, 1), (1, 2), (2, 3), (3, 0)),
    "tetrahedron": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "pyramid": ((0, 1, 2, 3), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
    "prism": ((0, 1, 2), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    "hexahedron": (
        *((0, 1, 2, 3), (4, 5, 6, 7)),
        *((0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
    ),
}


def simplices(rows: Nodes, dim: int) -> Nodes:
    """Return cells of a dimension, by corners in VTK's order, as simplices, (cells, k, dim + 1)."""
    # A cell is the cone of its smallest corner over the faces without it, and so are these: the
    # diagonal of a face begins at its smallest corner on both sides (Dompierre et al.).
    count = rows.shape[1]
    if count == dim + 1:
        return rows[:, None]
    smallest = rows.argmin(axis=1)
    if dim == 2:
        around = np.take_along_axis(rows, (np.arange(4) + smallest[:, None]) % 4, axis=1)
        return around[:, [[0, 1, 2], [0, 2, 3]]]
    name, pieces = {5: ("pyramid", 2), 6: ("prism", 3), 8: ("hexahedron", 6)}[count]
    made = np.empty((len(rows), pieces, 4), dtype=rows.dtype)
    for tip in range(count):
        mine = smallest == tip
        faces = [rows[mine][:, list(face)] for face in FACES[name] if tip not in face]
        made[mine, :, :3] = np.concatenate([simplices(face, 2) for face in faces], axis=1)
        made[mine, :, 3] = rows[mine, tip, None]
    return made


def joined_facets(faces: Sequence[Nodes]) -> Nodes:
    """Return facets as one array, without collapsed ones, of several shapes cut into triangles."""
    unlike = len({face.shape[1] for face in faces}) > 1
    if unlike or any(face.shape[1] > 3 and not uncollapsed(face).all() for face in faces):
        faces = [simplices(face, 2).reshape(-1, 3) for face in faces]
    found = np.concatenate(faces) if faces else np.zeros((0, 1), dtype=np.int64)
    return found[uncollapsed(found)]


def uncollapsed(rows: Nodes) -> NDArray[np.bool_]:
    """Return whether cells or facets have different nodes, shape (n,)."""
    return np.asarray(np.all(np.diff(np.sort(rows, axis=1), axis=1) != 0, axis=1))


def unique_rows(rows: Nodes) -> Nodes:
    """Return the different cells or facets, as sets of nodes, in their order."""
    first = np.unique(np.sort(rows, axis=1), axis=0, return_index=True)[1]
    return rows[np.sort(first)]


def single_facets(faces: Nodes) -> Nodes:
    """Return the facets that occur once: the boundary of all facets of cells."""
    _, first, count = np.unique(
        np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True
    )
    return faces[np.sort(first[count == 1])]
