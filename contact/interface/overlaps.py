"""Overlaps of undeformed bodies, whichever way their sides look: boundaries in cells of others.

A point of the boundary of a body in a cell of another one is as deep in that as it is far from its
boundary, less the heights of both curved surfaces above their facets: chords of curves that touch
cut each other. Corners and middles of facets show ribs, needles and sides that no facet faces;
`contact.interface.mortar` has the depth between facets that face each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeAlias

import numpy as np
from dolfinx import geometry
from mpi4py import MPI
from numpy.typing import NDArray

from contact.body.elements import CHUNK
from contact.body.equilibrium import BodyEquilibrium
from contact.interface.mortar.search import in_balls, meeting, nearest, within
from contact.interface.mortar.surface import Surface, straight_surface, surface_of
from contact.mesh.cells import shape_of
from contact.mesh.entities import cells_at, exterior_facets
from contact.mesh.geometry import geometry_nodes, nearest_on_simplices, pulled_back
from contact.ranks import bounding_boxes, exchanged
from contact.tolerances import NEGLIGIBLE
from contact.typing import Array

#: Distance along a further axis, over the size of the mesh, by which searches keep bodies apart.
ASIDE = 10.0

#: Indices of points, bodies or facets.
Numbers = NDArray[np.intp]

#: Depths at the sides of a pair, and beside those of all pairs (length).
Depths: TypeAlias = tuple[float, float]

#: Depths of bodies in each other that are not of both sides of any pair, by their numbers (length).
Unpaired: TypeAlias = dict[tuple[int, int], float]


def overlap_depths(
    body: BodyEquilibrium, pairs: Sequence[tuple[str, str, bool]]
) -> tuple[list[Depths], Unpaired]:
    """Return how deep bodies lie in each other. Collective.

    `pairs` are both parts of each, and whether it presses overlaps apart. The first result has the
    largest depths that curvature does not explain (length), 0 for rounding, of the bodies of each
    pair: at its sides, but where another pair presses, and where there is no side of any pair. The
    second has the depths above rounding of bodies that no pair keeps apart.
    """
    if body.connected_components[1] == 1:
        return [(0.0, 0.0)] * len(pairs), {}
    bodies = _Boundaries.of(body, [pair[:2] for pair in pairs])
    number, other = bodies.inside(*bodies.points)
    facet, place = np.divmod(number, len(bodies.places))
    depth, on_sides = bodies.depths(facet, place, other)
    own = bodies.connected_component[facet]
    twins = bodies.twins()
    own, other, depth = (np.append(a, b) for a, b in zip((own, other, depth), twins, strict=True))
    on_sides = np.pad(on_sides, ((0, len(own) - len(on_sides)), (0, 0)))
    depth[depth <= body.accepted_overlaps(own, other)] = 0.0
    between = bodies.between(own, other)
    press = np.array([press for *_, press in pairs], dtype=bool)
    elsewhere = (on_sides & press).any(axis=1, keepdims=True) & ~press
    of_sides = between & on_sides & ~elsewhere
    beside = between & ~on_sides.any(axis=1, keepdims=True)
    both = np.stack([of_sides, beside], axis=2)
    deepest = np.where(both, depth[:, None, None], 0.0).max(axis=0, initial=0.0)
    body.comm.Allreduce(MPI.IN_PLACE, deepest, op=MPI.MAX)
    alone = np.flatnonzero(~between.any(axis=1) & (depth > 0))
    alone = alone[np.argsort(depth[alone])]  # the deepest of two bodies comes last
    two = np.sort(np.column_stack([own, other])[alone], axis=1)
    deep = zip(*two.T, depth[alone], strict=True)
    here: Unpaired = {(int(i), int(j)): float(d) for i, j, d in deep}
    unpaired: Unpaired = {}
    for there in body.comm.allgather(here):
        unpaired |= {k: max(d, unpaired.get(k, 0.0)) for k, d in there.items()}
    return [(at_sides, elsewhere) for at_sides, elsewhere in deepest.tolist()], unpaired


@dataclass(frozen=True)
class _Boundaries:
    """The boundaries of all bodies, which are the connected components of the mesh."""

    body: BodyEquilibrium
    facets: NDArray[np.int32]  #: owned, of the boundary without the axis of revolution, (f,)
    surface: Surface  #: of these facets
    connected_component: Numbers  #: of each facet, shape (f,)
    parts: Sequence[tuple[str, str]]  #: both parts of each pair
    sides: NDArray[np.bool_]  #: which facets are on either part, shape (f, pairs, 2)
    bodies: NDArray[np.bool_]  #: which components each side is of, shape (pairs, 2, components)

    @staticmethod
    def of(body: BodyEquilibrium, parts: Sequence[tuple[str, str]]) -> _Boundaries:
        """Find them. Collective."""
        domain, (_, count) = body.domain, body.connected_components
        facets = exterior_facets(domain.mesh)
        surface = straight_surface(domain, body.space, facets)
        if domain.revolved:
            radius = surface.corners[:, :, 0].max(axis=1, initial=0.0)
            facets = facets[radius > NEGLIGIBLE * domain.size]
            surface = straight_surface(domain, body.space, facets)
        component = body.connected_component_of_cells[cells_at(domain.mesh, facets)[0]]
        sides = np.zeros((facets.size, len(parts), 2), dtype=bool)
        bodies = np.zeros((len(parts), 2, count), dtype=bool)
        for pair, both in enumerate(parts):
            for side, part in enumerate(both):
                sides[:, pair, side] = np.isin(facets, domain.facets(part))
                bodies[pair, side, component[sides[:, pair, side]]] = True
        body.comm.Allreduce(MPI.IN_PLACE, bodies, op=MPI.LOR)
        return _Boundaries(body, facets, surface, component, parts, sides, bodies)

    def between(self, one: Numbers, other: Numbers) -> NDArray[np.bool_]:
        """Return whether components are of both sides of each pair, shape (n, pairs)."""
        first, second = np.moveaxis(self.bodies, 1, 0)
        both = (first[:, one] & second[:, other]) | (first[:, other] & second[:, one])
        return np.asarray(both.T)

    @property
    def places(self) -> Array:
        """Reference points of the nodes and the middle of a facet."""
        shape = self.surface.shape
        return np.concatenate([shape.nodes(self.surface.order), shape.middle])

    def on_sides(self) -> NDArray[np.bool_]:
        """Return which `places` of facets are on sides of each pair, (f, k, pairs). Collective."""
        nodes, owners = self.surface.nodes, self.surface.owners
        facets = np.asarray(self.sides.any(axis=2))
        found = np.repeat(facets[:, None], len(self.places), axis=1)
        corners = self.surface.shape.corners
        for pair, named in enumerate(facets.T):
            own = owners.among(owners.requested(nodes[named].ravel()), nodes.ravel())
            found[:, :corners, pair] |= np.isin(nodes[:, :corners], own)
        return found

    @cached_property
    def points(self) -> tuple[Array, Numbers]:
        """The `places` of all facets, shape (f k, d), and their components."""
        surface, places, d = self.surface, self.places, self.body.dim
        x = surface.shape.lagrange(surface.order, places) @ surface.points
        return x.reshape(-1, d), np.repeat(self.connected_component, len(places))

    def twins(self) -> tuple[Numbers, Numbers, Array]:
        """Return bodies that coincide, the other ones, and the depths of both. Collective."""
        # No point of the boundary of either is within the other, but any other point is.
        low, high = self.body.boxes
        off = np.maximum(*(np.abs(x[:, None] - x).max(axis=2) for x in (low, high)))
        accepted = self.body.accepted_overlaps(*np.indices(off.shape))
        alike = np.count_nonzero(off <= accepted, axis=1) > 1
        if not alike.any():
            none = np.zeros(0, dtype=np.intp)
            return none, none, np.zeros(0)
        x = geometry_nodes(self.body.domain).mean(axis=1)
        of_cells = self.body.connected_component_of_cells[: len(x)]
        cells = np.flatnonzero(alike[of_cells])
        comm, far = self.body.comm, ASIDE * self.body.domain.size
        x, of = x[cells], of_cells[cells]
        boundary, own = self.points
        depth = nearest(
            comm, np.column_stack([x, far * of]), np.column_stack([boundary, far * own])
        )
        deepest = np.zeros(len(alike))
        np.maximum.at(deepest, of, depth)
        comm.Allreduce(MPI.IN_PLACE, deepest, op=MPI.MAX)
        middle = np.flatnonzero(depth >= deepest[of])
        number, other = self.inside(x[middle], of[middle])
        return of[middle][number], other, depth[middle][number]

    def inside(self, x: Array, of: Numbers) -> tuple[Numbers, Numbers]:
        """Return the numbers of points of bodies that are in another, and that. Collective."""
        domain, comm, d = self.body.domain, self.body.comm, self.body.dim
        mesh = domain.mesh
        cells = geometry_nodes(domain)
        # Points beyond the boxes of all other bodies are in none of these.
        near = np.flatnonzero(self._near(x, of))
        within_box, rank = meeting(
            bounding_boxes(comm, cells.reshape(-1, d)), x[near], np.zeros(near.size)
        )
        asked = near[within_box]
        source, number, there, of = exchanged(comm, rank, asked, x[asked], of[asked])
        point = cell = np.zeros(0, dtype=np.intp)
        if len(there) and len(cells):
            owned = np.arange(len(cells), dtype=np.int32)
            padded = np.pad(there, ((0, 0), (0, 3 - d)))
            tree = geometry.bb_tree(mesh, d, entities=owned, padding=NEGLIGIBLE * domain.size)
            found = geometry.compute_collisions_points(tree, padded)
            point = np.repeat(np.arange(len(there)), np.diff(found.offsets))
            cell = found.array.astype(np.intp)
        component = self.body.connected_component_of_cells
        apart = component[cell] != of[point]
        point, cell = point[apart], cell[apart]
        of_cells = shape_of(mesh)
        with np.errstate(divide="ignore", invalid="ignore"):  # far from a curved cell
            at = pulled_back(of_cells, cells[cell], there[point])
        inward = -of_cells.facet_normals
        begin = of_cells.nodes(1)[of_cells.facet_corners[:, 0]]
        height = np.einsum("pfd,fd->pf", at[:, None] - begin, inward)
        inside = height.min(axis=1, initial=np.inf) >= -NEGLIGIBLE
        functions = of_cells.lagrange(of_cells.degree_of(cells.shape[1]), at)
        missed = np.einsum("pk,pkd->pd", functions, cells[cell]) - there[point]
        inside &= np.linalg.norm(missed, axis=1) <= NEGLIGIBLE * domain.size
        point, other = point[inside], component[cell[inside]]
        _, number, other = exchanged(comm, source[point], number[point], other)
        number, other = np.unique(np.column_stack([number, other]), axis=0).T
        return number, other

    def _near(self, x: Array, of: Numbers) -> NDArray[np.bool_]:
        """Return which points of bodies are in boxes of other ones. Collective."""
        near = np.zeros(len(x), dtype=bool)
        for body, (low, high) in enumerate(zip(*self.body.boxes, strict=True)):
            accepted = self.body.accepted_overlaps(of, np.full_like(of, body))[:, None]
            inside = np.all((x > low + accepted) & (x < high - accepted), axis=1)
            near |= inside & (of != body)
        return near

    def depths(
        self, facet: Numbers, place: Numbers, other: Numbers
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Return the depths of points in other bodies, (n,), and their `on_sides`. Collective."""
        surface, comm, far = self.surface, self.body.comm, ASIDE * self.body.domain.size
        at, on_sides = self.places[place], self.on_sides()[facet, place]
        functions = surface.shape.lagrange(surface.order, at)
        x = np.einsum("nk,nkd->nd", functions, surface.points[facet])
        points = np.column_stack([x, far * other])
        beside = np.repeat(far * self.connected_component, surface.points.shape[1])
        nodes = np.column_stack([surface.points.reshape(-1, x.shape[1]), beside])
        centres = np.column_stack([surface.centres, far * self.connected_component])
        least = nearest(comm, points, nodes)
        if comm.allreduce(len(x)) == 0:
            return least, np.zeros((0, len(self.parts)), dtype=bool)
        widest = comm.allreduce(float(surface.radii.max(initial=0.0)), op=MPI.MAX)
        radius = (least + widest) * (1 + NEGLIGIBLE)
        ball, rank = meeting(bounding_boxes(comm, centres), points, radius)
        near, ranks = within(centres, *exchanged(comm, rank, points[ball], radius[ball]))
        surface = self._curved(np.union1d(near, facet))
        opposite = surface.sent(near, ranks)
        # A foot aside, where facets turn, has a height in another direction: none adds to depths.
        own = np.minimum(surface.distance_bounds(facet, at, surface.normal[facet])[0], 0.0)
        sides = np.asarray(self.sides.any(axis=2))
        _, theirs, centres = exchanged(comm, ranks, sides[near], centres[near])
        depth = np.full(len(x), np.inf)
        rounding_length = NEGLIGIBLE * self.body.domain.size
        for i, j in in_balls(centres, points, radius, CHUNK):
            distance, there = _from_facets(opposite, j, x[i])
            behind = np.minimum(opposite.distance_bounds(j, there, opposite.normal[j])[0], 0.0)
            np.minimum.at(depth, i, distance + own[i] + behind - _bow(opposite)[j])
            np.minimum.at(least, i, distance)
            nearest_ones = distance <= least[i] + rounding_length
            np.logical_or.at(on_sides, i[nearest_ones], theirs[j[nearest_ones]])
        return depth, on_sides

    def _curved(self, near: Numbers) -> Surface:
        """Return the boundary with deviations, largest on parts of near facets. Collective."""
        # Parts alone have no edges of the body, at whose vertices curvature is not known.
        domain, curved = self.body.domain, self.surface.with_deviations()
        names = [*dict.fromkeys([*domain.parts, *(part for both in self.parts for part in both)])]
        met = np.array([np.isin(self.facets[near], domain.facets(name)).any() for name in names])
        self.body.comm.Allreduce(MPI.IN_PLACE, met, op=MPI.LOR)
        for name in np.array(names, dtype=object)[met]:
            alone = surface_of(domain, self.body.space, name)
            _, there, row = np.intersect1d(self.facets, domain.facets(name), return_indices=True)
            before, after = (
                np.abs(side.deviation).max(axis=1, initial=0.0) for side in (curved, alone)
            )
            larger = after[row] >= before[there]
            there, row = there[larger], row[larger]
            curved.deviation[there] = alone.deviation[row]
            curved.unknown[there] = alone.unknown[row]
            curved.change[there] = alone.change[row]
        return curved


def _from_facets(facets: Surface, of: Numbers, x: Array) -> tuple[Array, Array]:
    """Return distances of points from facets, (n,), and reference points of the nearest points."""
    shape, order = facets.shape, facets.order
    pieces = shape.pieces(order)
    if not shape.simplex:
        pieces = np.concatenate([pieces[:, [0, 1, 2]], pieces[:, [1, 3, 2]]])
    count, corners = pieces.shape
    ends = facets.points[of][:, pieces].reshape(-1, corners, x.shape[1])
    share = nearest_on_simplices(ends, np.repeat(x, count, axis=0))
    foot = np.einsum("nk,nkd->nd", share, ends).reshape(-1, count, x.shape[1])
    distance = np.linalg.norm(foot - x[:, None], axis=2)
    best = np.arange(of.size), distance.argmin(axis=1)
    share = share.reshape(-1, count, corners)[best]
    return distance[best], np.einsum("nk,nkr->nr", share, shape.nodes(order)[pieces[best[1]]])


def _bow(facets: Surface) -> Array:
    """Return the largest distance of curved or warped facets from their pieces, shape (f,)."""
    shape = facets.shape
    if facets.order == 1:
        if shape.simplex:
            return np.zeros(facets.count)
        twist = np.einsum("k,fkd,fd->f", [1, -1, -1, 1], facets.corners, facets.normal)
        return np.asarray(np.abs(twist) / 4)
    first, second = np.array(shape.edges).T
    middle = facets.points[:, shape.corners : shape.corners + first.size]
    bow = middle - (facets.points[:, first] + facets.points[:, second]) / 2
    return np.asarray(shape.dim * np.linalg.norm(bow, axis=2).max(axis=1, initial=0.0) / 4)
