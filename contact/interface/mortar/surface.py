"""The facets of a part of the boundary that a rank owns as plain arrays, and their basis.

Points on facets are those of the reference facet, and nodes are numbered, as in
`contact.mesh.cells`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray

from contact import _compat
from contact.mesh.cells import Shape, facet_with, rule, shape_of
from contact.mesh.deviation import SMOOTH, deviations
from contact.mesh.domain import Domain
from contact.mesh.entities import Indices, cells_at
from contact.mesh.geometry import (
    area_vectors,
    integration_weights,
    inverse,
    jacobians,
    unit_normals,
)
from contact.mesh.owners import ALONE, Owners
from contact.ranks import exchanged
from contact.tolerances import NEGLIGIBLE, ROUNDING
from contact.typing import Array

#: Share of each mid-edge function that goes to the two vertices of a quadratic triangle.
ALPHA = 1 / 5


def dual_basis_transformation(shape: Shape, degree: int) -> Array:
    """Return A with the functions N~ = A N, all of whose integrals are positive.

    The vertex functions of a quadratic triangle have none. There each takes the share alpha of
    its two mid-edge neighbours (Popp, Wohlmuth, Gee and Wall, SIAM J. Sci. Comput. 34 (2012)
    B421); else A is the identity.
    """
    points, weights = rule(shape, degree)
    integrals = weights @ shape.lagrange(degree, points)
    if integrals.min() > NEGLIGIBLE * integrals.max():
        return np.eye(len(integrals))
    change = np.diag([1.0] * 3 + [1 - 2 * ALPHA] * 3)
    change[:3, 3:] = ALPHA * (1 - np.eye(3))
    return change


#: Exponent of the unknown parts in the weights of two ways to know the same.
SHARP = 4


@dataclass(frozen=True)
class Surface:
    """Facets with the nodes of a Lagrange space.

    Attributes
    ----------
    nodes
        Global numbers of the nodes, shape (f, k).
    points
        Coordinates of the nodes of the facets' geometry, corners first, shape (f, g, d) (length).
    normal
        Unit normals out of the body in the middle of the facets, shape (f, d).
    deviation
        Of the curved surface from straight facets (`contact.mesh.deviation`), shape
        (f, edges).
    unknown
        Its uncertainty, shape (f, edges); of curved facets that of the surface between the nodes.
    change
        The largest part by which it is taken to be off: its change to the next vertices, shape
        (f, edges).
    degree
        Of the space.
    revolved
        Whether the facets stand for the rings through them, about the axis x = 0.
    levels
        How often straight edges have been cut in two since the mesh met a curved boundary.
    owners
        The ranks that own the nodes.
    """

    nodes: NDArray[np.int64]
    points: Array
    normal: Array
    deviation: Array
    unknown: Array
    change: Array
    degree: int
    revolved: bool = False
    levels: int = 0
    owners: Owners = ALONE

    def moved(self, displacement: Array) -> Surface:
        """Return the surface at a displacement of the owned nodes, shape (nodes, d). Collective."""
        shape, begin, d = self.shape, self.owners.begin, displacement.shape[1]
        u = self.owners.values(self.nodes.ravel(), lambda numbers: displacement[numbers - begin])
        functions = shape.lagrange(self.degree, shape.nodes(self.order))
        points = self.points + functions @ u.reshape(*self.nodes.shape, d)
        before, after = (
            area_vectors(jacobians(shape, x, shape.middle)[:, 0]) for x in (self.points, points)
        )
        outward = np.sign(np.einsum("fd,fd->f", before, self.normal))[:, None] * after
        normal = outward / np.linalg.norm(outward, axis=1)[:, None]
        return replace(self, points=points, normal=normal).with_deviations()

    def with_deviations(self) -> Surface:
        """Return the surface with its deviations from straight facets. Collective."""
        corners = self.nodes[:, : self.shape.corners]
        deviation, unknown, change = deviations(
            corners, self.corners, self.normal, self.owners, self.levels
        )
        if self.order > 1:
            arcs = _of_arcs(self.shape, self.points, self.normal)
            deviation = np.zeros_like(deviation)
            unknown, change = 0.5 * unknown + 2 * arcs, np.maximum(self._slope_errors(), 4 * arcs)
        return replace(self, deviation=deviation, unknown=unknown, change=change)

    def _slope_errors(self) -> Array:
        """Return c of a parabola with the errors of slopes of curved edges, (f, edges). Collective.

        A smooth curve is off from the parabola through three of its points by less than another
        one over the edge, of the length L, that has the error s of the slope at an end: c = s L.
        With the jumps of normals n and curvatures K to the facets beside it s is

            s = |n - n'| + |t.(K - K') t| L/12    (t along the edge).
        """
        shape, d, corners = self.shape, self.points.shape[2], self.shape.corners
        ends = np.array(shape.edges)
        gradients = shape.gradients(self.order, shape.nodes(self.order))
        slopes = np.einsum("abr,fbd->fadr", gradients, self.points)
        second = np.einsum("abs,fbdr->fadrs", gradients, slopes)[:, :corners]
        slopes, names = slopes[:, :corners], self.nodes[:, :corners]
        normal = self.normals(np.arange(self.count)[:, None], slopes)
        dual = inverse(slopes.swapaxes(2, 3) @ slopes) @ slopes.swapaxes(2, 3)
        curvature = np.einsum(
            "fcd,fcdrs,fcra,fcsb->fcab", normal, second, dual, dual, optimize=True
        )
        one = np.ones((*names.shape, 1))
        own = np.concatenate([normal, curvature.reshape(*names.shape, d * d), one], axis=2)
        at, sums = self.owners.sums(names.ravel(), own.reshape(-1, own.shape[2]))
        mean = self.owners.values(names.ravel(), lambda given: sums[np.searchsorted(at, given)])
        mean = (mean / mean[:, -1:]).reshape(own.shape)
        # Edges of the body are none of its surface: the cosine of half of the turn, squared.
        smooth = np.einsum("fcd,fcd->fc", normal, mean[:, :, :d]) > SMOOTH**2
        jump = 2 * np.where(smooth[:, :, None], own - mean, 0.0)[:, ends]
        along = np.einsum(
            "feidr,er->feid", slopes[:, ends], np.diff(shape.nodes(1)[ends], axis=1)[:, 0]
        )
        along /= np.linalg.norm(along, axis=3)[..., None]
        bend = jump[..., d:-1].reshape(*along.shape, d)
        bend = np.abs(np.einsum("feia,feiab,feib->fei", along, bend, along))
        middle = self.points[:, corners : corners + len(ends), None]
        length = np.linalg.norm(self.points[:, ends] - middle, axis=3).sum(axis=2)
        error = np.linalg.norm(jump[..., :d], axis=3) + bend * length[:, :, None] / 12
        return np.asarray(length * error.max(axis=2))

    @property
    def refined(self) -> bool:
        """Whether straight edges have been cut in two."""
        return self.levels > 0

    @property
    def count(self) -> int:
        """Number of facets."""
        return self.nodes.shape[0]

    @property
    def shape(self) -> Shape:
        """The shape of the facets."""
        return facet_with(self.points.shape[2] - 1, self.points.shape[1])

    @property
    def order(self) -> int:
        """Degree of their geometry: 1 for straight edges."""
        return self.shape.degree_of(self.points.shape[1])

    @property
    def corners(self) -> Array:
        """Coordinates of the corners, shape (f, c, d) (length)."""
        return self.points[:, : self.shape.corners]

    @property
    def centres(self) -> Array:
        """Their centres, shape (f, d)."""
        return np.asarray(self.points.mean(axis=1))

    @property
    def radii(self) -> Array:
        """The farthest distance of a node of the geometry from the centre, shape (f,)."""
        spread = np.linalg.norm(self.points - self.centres[:, None], axis=2)
        return np.asarray(spread.max(axis=1, initial=0.0))

    @cached_property
    def edges(self) -> Array:
        """The lengths of the edges, shape (f, edges)."""
        first, second = np.array(self.shape.edges).T
        return np.linalg.norm(self.corners[:, second] - self.corners[:, first], axis=2)

    @cached_property
    def bend(self) -> Array:
        """Largest deviation of nodes from the affine map of the middle, shape (f,).

        In the coordinates of the reference facet.
        """
        shape = self.shape
        middle = shape.lagrange(self.order, shape.middle) @ self.points
        slope = jacobians(shape, self.points, shape.middle)[:, 0]
        offset = shape.nodes(self.order) - shape.middle
        aside = self.points - middle - np.einsum("fdr,kr->fkd", slope, offset)
        aside = aside @ slope @ inverse(slope.swapaxes(1, 2) @ slope)
        deviation = np.abs(aside).sum(axis=2).max(axis=1, initial=0.0)
        return np.asarray(np.where(deviation > NEGLIGIBLE, deviation, 0.0))

    def sent(self, facets: NDArray[np.intp], ranks: NDArray[np.intp]) -> Surface:
        """Send facets of this rank to ranks, and return those that it is sent. Collective."""
        every = self.nodes, self.points, self.normal, self.deviation, self.unknown, self.change
        _, *arrays = exchanged(self.owners.comm, ranks, *(array[facets] for array in every))
        nodes, points, normal, deviation, unknown, change = arrays
        return replace(
            self,
            nodes=nodes,
            points=points,
            normal=normal,
            deviation=deviation,
            unknown=unknown,
            change=change,
        )

    @property
    def largest_deviation(self) -> float:
        """The largest deviation (length), on this rank."""
        return float(np.abs(self.deviation).max(initial=0.0)) / 4

    @property
    def turns(self) -> Array:
        """h/R, the turn of the curve over a straight edge, the largest of a facet, shape (f,)."""
        return np.asarray(np.abs(2 * self.deviation / self.edges).max(axis=1, initial=0.0))

    @property
    def unknown_deviation(self) -> float:
        """Largest part of the deviations that gaps do not contain (length), on this rank."""
        return float(self.unknown.max(initial=0.0)) / 4 if self.follows else self.largest_deviation

    @property
    def follows(self) -> bool:
        """Whether gaps are those of the curved surface that straight facets approximate.

        Not at degree 1, where displacements do not follow a curve, nor on refined chords.
        """
        return self.degree == 2 and not self.refined and self.order == 1

    def height(self, facets: NDArray[np.intp], at: Array) -> Array:
        """Return the height of the surface above points of straight facets, (p,).

        The points are those of the reference facet, shape (p, dim). Over an edge of the length L
        that is an arc of the sagitta f = c/4, whose height h over a point is, with w = l_i l_j L^2
        the product of the distances to the ends,

            h (h + 2 b) = w,     b = (L^2/4 - f^2)/(2 f),

        and on a facet the sum over its edges.
        """
        along, products = self._bubbles(at)
        sagitta, square = self.deviation[facets] / 4, self.edges[facets] ** 2
        base = square / 4 - sagitta**2
        root = np.sqrt(np.maximum(base**2 + 4 * sagitta**2 * products * square, 0.0))
        heights = 2 * sagitta * products * square / (base + root)
        return np.asarray(np.sum(along * heights, axis=1))

    def height_bounds(self, facets: NDArray[np.intp], at: Array) -> tuple[Array, Array]:
        """Return bounds of the height of a smooth surface above points of facets, (p,).

        Parts of an edge that has been refined are anywhere on its chord.
        """
        if self.refined and self.order == 1:
            along, products = self._bubbles(self.shape.middle)
            both = np.stack([np.minimum(self.deviation, 0.0), np.maximum(self.deviation, 0.0)])
            inside, edge = np.abs(both @ (along * products)[0]), np.abs(both).max(axis=2) / 4
            # Half turns are known less well.
            least, most = 1.1 * np.maximum(inside, edge)[:, facets]
            return -least, most
        along, products = self._bubbles(at)
        height, off = self.height(facets, at), along * products * self.change[facets]
        # The sum of the arcs over the edges of a facet in a sphere is off by less than that.
        slack = off.sum(axis=1) + self.turns[facets] ** 2 / 8 * np.abs(height)
        return height - slack, height + slack

    def _bubbles(self, at: Array) -> tuple[Array, Array]:
        """Return the shares of the edges at points, and l_i l_j on them, shape (p, edges)."""
        first, second = np.array(self.shape.edges).T
        functions = self.shape.lagrange(1, at)
        products = functions[:, first] * functions[:, second]
        along = np.ones_like(products)
        if not self.shape.simplex:
            # Between opposite edges the arcs of both, in proportion.
            along = functions[:, first] + functions[:, second]
            products /= np.where(np.abs(along) > ROUNDING, along, 1.0) ** 2
        return along, products

    def reconstructed(self, values: Array) -> tuple[NDArray[np.int64], Array]:
        """Return the third-order reconstruction of a function from its corner values. Collective.

        The values have the shape (f, c), infinite where the function has none. The smoother of
        both, function and surface, has the larger weight (Jiang and Shu, as in `deviations`). The
        result has the nodes of this rank, ascending, and at each the value, its weight against that
        on the surface, from 0 to 1, and the unknown part; shape (n, 3).
        """
        corners, places = self.nodes[:, : self.shape.corners], self.shape.nodes(self.degree)
        rise, other, _ = deviations(corners, self.points, self.normal, self.owners, values=values)
        along, products = self._bubbles(places)
        bubbles, finite = (along * products).T, np.all(np.isfinite(values), axis=1)
        linear = np.where(finite[:, None], values, 0.0) @ self.shape.lagrange(1, places).T
        parts = linear + rise @ bubbles, self.unknown @ bubbles, other @ bubbles, finite[:, None]
        together = np.stack([*np.broadcast_arrays(*parts), np.ones_like(linear)], axis=2)
        nodes, sums = self.owners.sums(self.nodes.ravel(), together.reshape(-1, 5))
        nodal_values, mine, other, finite = (sums[:, :4] / sums[:, 4:]).T
        share = np.where(finite == 1, mine / np.where(mine + other > 0, mine + other, 1.0), 0.0)
        weight = share**SHARP / (share**SHARP + (1 - share) ** SHARP)
        return nodes, np.column_stack([nodal_values, weight, (1 - weight) * mine + weight * other])

    def distance(self, facets: NDArray[np.intp], at: Array, direction: Array) -> Array:
        """Return the distance of the surface from points of straight facets along rays, (p,).

        With the foot of each point of an arc beside the origin of its ray, to the fourth order. The
        directions of the rays are unit vectors, shape (p, d), the points those of `height`.
        """
        distance = np.zeros(len(at))
        if not self.deviation.any():
            return distance
        slope = self.slopes(facets, at)
        aside = np.einsum("pdr,pd->pr", slope @ inverse(slope.swapaxes(1, 2) @ slope), direction)
        rise = np.einsum("pd,pd->p", self.normal[facets], direction)
        for _ in range(6):  # each takes the error by the product of two small slopes
            distance = self.height(facets, at + distance[:, None] * aside) / rise
        return distance

    def distance_bounds(
        self, facets: NDArray[np.intp], at: Array, direction: Array
    ) -> tuple[Array, Array]:
        """Return the least and the largest distance (`distance`) of the surface, shapes (p,)."""
        rise = np.einsum("pd,pd->p", self.normal[facets], direction)
        least, most = (height / rise for height in self.height_bounds(facets, at))
        if self.refined:
            return np.minimum(least, most), np.maximum(least, most)
        distance, slack = self.distance(facets, at, direction), np.abs(most - least) / 2
        if self.order == 1:
            # An error of third order is largest beside the middle, up to four times the bubble;
            # spheres have one.
            most = self.change[facets].sum(axis=1) / np.abs(rise)
            slack = np.maximum(self.shape.dim * slack, np.minimum(4 * slack, most))
        return distance - slack, distance + slack

    @property
    def node_heights(self) -> Array:
        """Height of the surface at nodes in gaps, and its lower bound, shape (f, k, 2) (length)."""
        places = self.shape.nodes(self.degree)
        facets, at = np.repeat(np.arange(self.count), len(places)), np.tile(places, (self.count, 1))
        height = self.height(facets, at) if self.follows else np.zeros(len(at))
        both = np.column_stack([height, self.height_bounds(facets, at)[0]])
        return both.reshape(self.count, len(places), 2)

    def integration_weights(self, at: Array, weights: Array) -> Array:
        """Return the weights of a rule's points in integrals over facets or rings, (f, q)."""
        return integration_weights(self.revolved, self.shape, self.points, at, weights)

    def slopes(self, facets: NDArray[np.intp], at: Array) -> Array:
        """Return dx/dxi at a point of each of some facets, shape (p, d, dim)."""
        gradients = self.shape.gradients(self.order, at)
        return np.asarray(np.einsum("pkr,pkd->pdr", gradients, self.points[facets]))

    def normals(self, facets: NDArray[np.intp], slopes: Array) -> Array:
        """Return unit normals out of the body, (..., d), of facets with dx/dxi, (..., d, dim)."""
        normals = area_vectors(slopes)
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
        sign = np.sign(np.einsum("...d,...d->...", normals, self.normal[facets]))
        return np.asarray(normals * sign[..., None])


def surface_of(domain: Domain, space: fem.FunctionSpace, part: str) -> Surface:
    """Return the facets of a part that this rank owns; refuse a missing part. Collective."""
    return straight_surface(domain, space, domain.facets(part)).with_deviations()


def straight_surface(domain: Domain, space: fem.FunctionSpace, facets: Indices) -> Surface:
    """Return owned facets of the boundary, without deviations. Collective."""
    mesh, d = domain.mesh, domain.dim
    cells, place = cells_at(mesh, facets)
    degree, shape = space.ufl_element().embedded_superdegree, shape_of(mesh)
    local = shape.facet_nodes(degree)[place]
    nodes = np.take_along_axis(space.dofmap.list[cells], local, axis=1)
    x = mesh.geometry.x[_compat.geometry_dofmap(mesh)[cells]][:, :, :d]
    order = _compat.geometry_degree(mesh)
    points = np.take_along_axis(x, shape.facet_nodes(order)[place][:, :, None], axis=1)
    numbers = space.dofmap.index_map.local_to_global(nodes.ravel().astype(np.int32))
    names = np.asarray(numbers, dtype=np.int64).reshape(nodes.shape)
    normal = unit_normals(shape.facet, points, x.mean(axis=1))
    owners, none = Owners.of(space.dofmap.index_map, domain.comm), np.zeros((len(facets), 0))
    return Surface(
        nodes=names,
        points=points,
        normal=normal,
        deviation=none,
        unknown=none,
        change=none,
        degree=degree,
        revolved=domain.revolved,
        levels=domain.levels,
        owners=owners,
    )


def _of_arcs(shape: Shape, points: Array, normal: Array) -> Array:
    """Return 4 f^3/L^2 of curved edges, shape (f, edges)."""
    # A parabola through the ends and the middle of an arc of the sagitta f over the chord L is off
    # by 4 f^3/L^2 s^2 (1 - s^2) for s from -1 to 1.
    first, second = np.array(shape.edges).T
    begin, end, middle = (
        points[:, nodes] for nodes in (first, second, shape.corners + np.arange(len(first)))
    )
    sagitta = np.abs(np.einsum("fed,fd->fe", middle - (begin + end) / 2, normal))
    return np.asarray(4 * sagitta**3 / np.sum((end - begin) ** 2, axis=2))
