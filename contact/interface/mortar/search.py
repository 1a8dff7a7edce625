"""Contact search: the master facets of all ranks opposite to slave facets.

Ranks with boxes near the slave facets send the facets within balls around these: messages and
memory do not grow with the number of ranks.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from contact.body.elements import CHUNK
from contact.interface.mortar.surface import Surface
from contact.ranks import bounding_boxes, exchanged
from contact.tolerances import ROUNDING
from contact.typing import Array

#: Least cosine between a normal and the opposite of the other.
FACING = 0.1

#: How much farther than the nearest facet the one along the normal may be.
DETOUR = 2.0


@dataclass(frozen=True)
class Opposite:
    """The master facets opposite to slave facets of this rank."""

    master: Surface  #: master facets of all ranks
    near: NDArray[np.intp]  #: slave facets within the reach, shape (n,)
    radius: Array  #: search radius around the centres of these, shape (n,) (length)
    reach: float  #: largest distance at which facets face each other (length)

    @staticmethod
    def of(slave: Surface, master: Surface, reach: float) -> Opposite:
        """Find the master facets in reach of the slave facets of this rank. Collective."""
        comm = slave.owners.comm
        widest = comm.allreduce(float(master.radii.max(initial=0.0)), op=MPI.MAX)
        distance = nearest(comm, slave.centres, master.centres)
        near = np.flatnonzero(distance <= reach + widest + slave.radii)
        radius = (slave.radii + widest + DETOUR * distance)[near]
        centres = slave.centres[near]
        ball, rank = meeting(bounding_boxes(comm, master.centres), centres, radius)
        asked = exchanged(comm, rank, centres[ball], radius[ball])
        facets, ranks = within(master.centres, *asked)
        return Opposite(master.sent(facets, ranks), near, radius, reach)

    def pairs(
        self, slave: Surface, direction: Array
    ) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
        """Yield candidate pairs of facets, whose projections along the directions may meet.

        The directions are those of the slave's facets, unit vectors, shape (f, d).
        """
        master, near, radius = self.master, self.near, self.radius
        if near.size == 0 or master.count == 0:
            return
        master_radii, centres, slave_radii = master.radii, slave.centres, slave.radii
        # The dual functions take k x k numbers at each point of a pair.
        most = CHUNK // slave.nodes.shape[1] ** 2
        for row, j in in_balls(master.centres, centres[near], radius, most):
            i = near[row]
            offset = master.centres[j] - centres[i]
            height = np.einsum("pd,pd->p", offset, direction[i])
            aside = np.sqrt(np.maximum(np.einsum("pd,pd->p", offset, offset) - height**2, 0.0))
            opposite = -np.einsum("pd,pd->p", slave.normal[i], master.normal[j])
            keep = (aside <= slave_radii[i] + master_radii[j]) & (opposite > FACING)
            keep &= np.abs(height) <= self.reach
            yield i[keep], j[keep]


def in_balls(
    places: Array, centres: Array, radius: Array, most: int
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Yield pairs of a ball and a place in it, about `most` at a time."""
    tree = cKDTree(places)
    counts = tree.query_ball_point(centres, radius, return_length=True)
    ends = np.cumsum(counts) // max(most, 1)
    for chosen in np.split(np.arange(len(centres)), np.flatnonzero(np.diff(ends)) + 1):
        members = tree.query_ball_point(centres[chosen], radius[chosen], return_sorted=True)
        row = np.repeat(chosen, [len(near) for near in members])
        yield row, np.array([k for near in members for k in near], dtype=np.intp)


def nearest(comm: MPI.Intracomm, points: Array, places: Array) -> Array:
    """Return the distance of points to the nearest place of any rank, inf without. Collective."""
    point, rank = _holders(bounding_boxes(comm, places), points)
    asked_by, asked = exchanged(comm, rank, points[point])
    distances = cKDTree(places).query(asked)[0] if len(places) else np.full(len(asked), np.inf)
    _, distance = exchanged(comm, asked_by, distances)
    least = np.full(len(points), np.inf)
    np.minimum.at(least, point[np.argsort(rank, kind="stable")], distance)
    return least


def nearest_named(
    comm: MPI.Intracomm, points: Array, places: Array, names: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the name of the nearest place of any rank to each point. Collective.

    -1 without places; of equally near ones that of the least coordinates.
    """
    least = nearest(comm, points, places)
    among = np.flatnonzero(np.isfinite(least))
    radius = least[among] * (1 + 100 * ROUNDING)
    ball, rank = meeting(bounding_boxes(comm, places), points[among], radius)
    source, number, centre, size = exchanged(
        comm, rank, among[ball], points[among][ball], radius[ball]
    )
    members = cKDTree(places).query_ball_point(centre, size) if len(places) else []
    counts = np.array([len(near) for near in members], dtype=np.intp)
    near = np.array([k for some in members for k in some], dtype=np.intp)
    row = np.repeat(np.arange(counts.size), counts)
    _, number, place, name = exchanged(comm, source[row], number[row], places[near], names[near])
    order = np.lexsort((*place.T[::-1], number))
    chosen = np.full(len(points), -1, dtype=np.int64)
    chosen[number[order][::-1]] = name[order][::-1]
    return chosen


def _distances(box: Array, points: Array) -> tuple[Array, Array]:
    """Return the least and the largest distance of points to places in a box."""
    lower, upper = box
    least = np.linalg.norm(np.maximum(np.maximum(lower - points, points - upper), 0.0), axis=1)
    most = np.linalg.norm(np.maximum(np.abs(lower - points), np.abs(upper - points)), axis=1)
    return least, most


def meeting(
    every: Array, centres: Array, radius: Array
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return pairs of a ball and a rank whose box it meets."""
    lower, upper = every[:, 0], every[:, 1]
    low = (centres - radius[:, None]).min(axis=0, initial=np.inf)
    high = (centres + radius[:, None]).max(axis=0, initial=-np.inf)
    balls: list[NDArray[np.intp]] = [np.zeros(0, dtype=np.intp)]
    ranks: list[NDArray[np.intp]] = [np.zeros(0, dtype=np.intp)]
    for rank in np.flatnonzero(np.all((lower <= high) & (upper >= low), axis=1)):
        ball = np.flatnonzero(_distances(every[rank], centres)[0] <= radius)
        balls.append(ball)
        ranks.append(np.full(ball.size, rank))
    return np.concatenate(balls), np.concatenate(ranks)


def _holders(every: Array, points: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return pairs of a point and a rank that may have the nearest place, given the boxes."""
    filled = np.flatnonzero(np.isfinite(every[:, 0, 0]))
    none = np.zeros(0, dtype=np.intp)
    if filled.size == 0 or len(points) == 0:
        return none, none
    # First by a ball around all points: most ranks are far from it.
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    extent = np.linalg.norm(points.max(axis=0) - middle)
    bounds = [_distances(every[rank], middle[None]) for rank in filled]
    least, most = np.array(bounds)[:, :, 0].T
    filled = filled[least - extent <= most.min() + extent]
    bounds = [_distances(every[rank], points) for rank in filled]
    allowed = np.min([most for _, most in bounds], axis=0)
    chosen = [np.flatnonzero(least <= allowed) for least, _ in bounds]
    ranks = np.repeat(filled, [part.size for part in chosen])
    return np.concatenate(chosen), ranks


def within(
    places: Array, source: NDArray[np.intp], centres: Array, radius: Array
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the places in balls or beside them, and the ranks of these balls."""
    # Balls of one rank and the same power of two take the largest radius among them.
    if len(places) == 0 or len(centres) == 0:
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    size = np.ceil(np.log2(radius)).astype(np.intp)
    pairs = np.zeros((0, 2), dtype=np.intp)
    for rank, exponent in np.unique(np.column_stack([source, size]), axis=0):
        group = (source == rank) & (size == exponent)
        far = radius[group].max() * (1 + 100 * ROUNDING)
        distance = cKDTree(centres[group]).query(places, distance_upper_bound=far)[0]
        inside = np.flatnonzero(np.isfinite(distance))
        pairs = np.concatenate([pairs, np.column_stack([np.full(inside.size, rank), inside])])
    ranks, facets = np.unique(pairs, axis=0).T
    return facets, ranks
