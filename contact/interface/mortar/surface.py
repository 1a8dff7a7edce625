"""The facets of a part of the boundary as plain arrays, on this rank or on all, and their basis.

Points on facets are given by the functions of degree 1 of their c corners, shape (p, c): by
barycentric coordinates on edges and triangles, bilinear functions on quadrilaterals. Nodes are
those of `contact.mesh.cells`: the corners, then for degree 2 the middle of the edge, or of the
facet's edges (of a triangle the first of them opposite to the first corner), and the middle of a
quadrilateral.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from contact import _compat
from contact.interface.mortar.deviation import deviations, pairs_of
from contact.mesh.cells import QUADRILATERAL, facet_of, shape_of
from contact.mesh.cells import rule as cell_rule
from contact.mesh.domain import Domain
from contact.mesh.entities import cells_at
from contact.mesh.geometry import jacobians, sizes
from contact.typing import Array

#: Share of each mid-edge function that goes to the two vertices of a quadratic triangle.
ALPHA = 1 / 5

#: Symmetric rules on a triangle, by degree: barycentric orbits (a, a, 1 - 2 a) and weights of a
#: point (Dunavant, Int. J. Numer. Methods Engrg. 21 (1985)).
ORBITS = {
    2: [(1 / 6, 1 / 3)],
    4: [
        (0.445948490915964886, 0.223381589678011466),
        (0.091576213509770743, 0.109951743655321868),
    ],
}


def basis(barycentric: Array, degree: int) -> Array:
    """Return the basis functions at points, shape (p, nodes)."""
    if degree == 1:
        return barycentric
    if barycentric.shape[1] == 4:
        return QUADRILATERAL.lagrange(degree, _reference(barycentric))
    corners = barycentric * (2 * barycentric - 1)
    if barycentric.shape[1] == 2:
        return np.column_stack([corners, 4 * barycentric.prod(axis=1)])
    others = [[1, 2], [2, 0], [0, 1]]
    return np.column_stack([corners, *(4 * barycentric[:, pair].prod(axis=1) for pair in others)])


def _reference(functions: Array) -> Array:
    """Return points of a quadrilateral, (p, 2), given by the functions of its corners."""
    return np.column_stack([functions[:, [1, 3]].sum(axis=1), functions[:, [2, 3]].sum(axis=1)])


def dual_basis_transformation(corners: int, degree: int) -> Array:
    """Return A with the functions N~ = A N, all of whose integrals are positive.

    The vertex functions of a quadratic triangle have none. There each takes the share alpha of
    its two mid-edge neighbours (Popp, Wohlmuth, Gee and Wall, SIAM J. Sci. Comput. 34 (2012)
    B421); else A is the identity.
    """
    if (corners, degree) != (3, 2):
        return np.eye(len(facet_of(corners).nodes(degree)))
    change = np.diag([1.0] * 3 + [1 - 2 * ALPHA] * 3)
    change[:3, 3:] = ALPHA * (1 - np.eye(3))
    return change


def rule(corners: int, degree: int) -> tuple[Array, Array]:
    """Return points (q, corners) and weights (q,) of sum 1, exact for polynomials of a degree.

    Parameters
    ----------
    corners
        2 for an edge, 3 for a triangle, 4 for a quadrilateral.
    degree
        2 or 4.
    """
    if corners == 4:
        at, weights = cell_rule(QUADRILATERAL, degree)
        return QUADRILATERAL.lagrange(1, at), weights
    if corners == 2:
        points, weights = np.polynomial.legendre.leggauss(degree // 2 + 1)
        return np.column_stack([1 - points, 1 + points]) / 2, weights / 2
    # A point and those that a turn of the triangle makes of it.
    places = [a + (1 - 3 * a) * np.eye(3) for a, _ in ORBITS[degree]]
    return np.concatenate(places), np.repeat([weight for _, weight in ORBITS[degree]], 3)


def densities(corners: Array, places: Array) -> Array:
    """Return the size of facets for that of the whole reference facet at points, (f, q) or (f, 1).

    Parameters
    ----------
    corners
        Coordinates of the corners, shape (f, c, d).
    places
        Points, shape (q, c).
    """
    if corners.shape[1] < 4:
        return size_of(corners)[:, None]
    return sizes(QUADRILATERAL, corners, _reference(places))


def size_of(corners: Array) -> Array:
    """Return the lengths or areas of edges or triangles by their corners, (f, d, d) -> (f,)."""
    edges = corners[:, 1:] - corners[:, :1]
    gram = np.einsum("fid,fjd->fij", edges, edges)
    return np.asarray(np.sqrt(np.linalg.det(gram)) / math.factorial(edges.shape[1]))


@dataclass(frozen=True)
class Surface:
    """Straight facets with the nodes of a Lagrange space.

    Attributes
    ----------
    nodes
        Global numbers of the nodes, shape (f, k).
    corners
        Coordinates of the corners, shape (f, c, d) (length).
    normal
        Unit normals out of the body, shape (f, d); in the middle, where a facet is not plane.
    deviation
        Of the curved surface from them (`contact.interface.mortar.deviation`), shape (f, edges).
    degree
        Of the space.
    revolved
        Whether the facets stand for the rings through them, about the axis x = 0.
    refined
        Whether straight edges have been cut in two since the mesh met a curved boundary.
    """

    nodes: NDArray[np.int64]
    corners: Array
    normal: Array
    deviation: Array
    degree: int
    revolved: bool = False
    refined: bool = False

    @property
    def count(self) -> int:
        """Number of facets."""
        return self.nodes.shape[0]

    @property
    def centres(self) -> Array:
        """Their centres, shape (f, d)."""
        return np.asarray(self.corners.mean(axis=1))

    @property
    def radii(self) -> Array:
        """The farthest distance of a corner from the centre, shape (f,)."""
        spread = np.linalg.norm(self.corners - self.centres[:, None], axis=2)
        return np.asarray(spread.max(axis=1, initial=0.0))

    def gathered(self, comm: MPI.Intracomm) -> Surface:
        """Return the facets of all ranks. Collective."""
        arrays: dict[str, Any] = {
            f.name: np.concatenate(comm.allgather(getattr(self, f.name)))
            for f in fields(self)
            if f.name not in ("degree", "revolved", "refined")
        }
        return replace(self, **arrays)

    @property
    def largest_deviation(self) -> float:
        """The largest deviation (length), on this rank."""
        return float(np.abs(self.deviation).max(initial=0.0)) / 4

    @property
    def follows(self) -> bool:
        """Whether gaps are those of the curved surface.

        At degree 1 displacements cannot follow a curve, and parts of an edge that has been refined
        lie on one chord.
        """
        return self.degree == 2 and not self.refined

    def height(self, facets: NDArray[np.intp], barycentric: Array) -> Array:
        """Return how far the surface is above facets at points, (p, q), along their normals.

        Nothing where gaps are those of the facets.

        Parameters
        ----------
        facets, barycentric
            The facets, and points on each, shapes (p,) and (p, q, d).
        """
        if not self.follows:
            return np.zeros(barycentric.shape[:2])
        corners = self.corners.shape[1]
        pairs = [(barycentric[..., i], barycentric[..., j]) for i, j in pairs_of(corners)]
        products = np.stack([one * other for one, other in pairs], axis=2)
        if corners == 4:
            # Between opposite edges the curves of both, in proportion.
            along = np.stack([one + other for one, other in pairs], axis=2)
            products /= np.where(along > 0, along, 1.0)
        return np.asarray(np.einsum("pqe,pe->pq", products, self.deviation[facets]))

    @property
    def node_deviations(self) -> Array:
        """From the nodes of each facet to the curved surface, shape (f, k, d) (length)."""
        shape = facet_of(self.corners.shape[1])
        places = shape.lagrange(1, shape.nodes(self.degree))
        heights = self.height(
            np.arange(self.count), np.broadcast_to(places, (self.count, *places.shape))
        )
        return np.asarray(heights[:, :, None] * self.normal[:, None, :])

    def turn(self, facets: NDArray[np.intp], barycentric: Array) -> Array:
        """Return the circumferences through points of facets; 1 unless revolved, shape (p,).

        Parameters
        ----------
        facets, barycentric
            The points, shapes (p,) and (p, d).
        """
        if not self.revolved:
            return np.ones(facets.size)
        radius = np.einsum("pc,pc->p", barycentric, self.corners[facets][:, :, 0])
        return np.asarray(2 * np.pi * radius)


def surface_of(domain: Domain, space: fem.FunctionSpace, part: str) -> Surface:
    """Return the facets of a part that this rank owns. Collective.

    Raises
    ------
    InputError
        If there is no such part.
    """
    mesh, d = domain.mesh, domain.dim
    facets = domain.facets(part)
    cells, place = cells_at(mesh, facets)
    degree, shape = space.ufl_element().embedded_superdegree, shape_of(mesh)
    local = shape.facet_nodes(degree)[place]
    nodes = np.take_along_axis(space.dofmap.list[cells], local, axis=1)
    x = mesh.geometry.x[_compat.geometry_dofmap(mesh)[cells]][:, :, :d]
    corners = np.take_along_axis(x, shape.facet_corners[place][:, :, None], axis=1)
    numbers = space.dofmap.index_map.local_to_global(nodes.ravel().astype(np.int32))
    names = np.asarray(numbers, dtype=np.int64).reshape(nodes.shape)
    normal = _outward(corners, x.mean(axis=1))
    deviation = deviations(
        names[:, : corners.shape[1]], corners, normal, domain.comm, domain.levels
    )
    return Surface(
        names,
        corners,
        normal,
        deviation,
        degree,
        domain.revolved,
        domain.levels > 0,
    )


def _outward(corners: Array, inside: Array) -> Array:
    """Return unit normals that point away from a point of the body, shape (f, d)."""
    shape = facet_of(corners.shape[1])
    edges = np.moveaxis(jacobians(shape, corners, shape.middle)[:, 0], 2, 0)
    flat = corners.shape[2] == 2
    turned = edges[0][:, ::-1] * [-1.0, 1.0] if flat else np.cross(*edges)
    across: Array = np.asarray(turned, dtype=float)
    normal = across / np.linalg.norm(across, axis=1)[:, None]
    away = np.einsum("fd,fd->f", normal, corners[:, 0] - inside)
    return np.asarray(normal * np.sign(away)[:, None])
