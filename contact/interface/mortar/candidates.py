"""Pairs of facets that may face each other."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from contact.interface.mortar.surface import Surface

#: Pairs that are looked at together: bounds the memory.
CHUNK = 500_000

#: Least cosine between a normal and the opposite of the other.
FACING = 0.1

#: How much farther than the nearest facet the one along the normal may be.
DETOUR = 2.0


def facing_pairs(
    slave: Surface, master: Surface, reach: float
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Yield pairs of a slave and a master facet whose shadows along the slave's normal may meet.

    Parameters
    ----------
    slave, master
        The two sides.
    reach
        Slave facets that are farther than this from all of the other side face none (length).
    """
    if slave.count == 0 or master.count == 0:
        return
    tree, radii = cKDTree(master.centres), master.radii
    widest = radii.max()
    centres, own = slave.centres, slave.radii
    distance = tree.query(centres)[0]
    near = np.flatnonzero(distance <= reach + widest + own)
    radius = (own + widest + DETOUR * distance)[near]
    counts = tree.query_ball_point(centres[near], radius, return_length=True)
    ends = np.cumsum(counts) // CHUNK
    for chosen in np.split(np.arange(near.size), np.flatnonzero(np.diff(ends)) + 1):
        found = tree.query_ball_point(centres[near[chosen]], radius[chosen], return_sorted=True)
        i = np.repeat(near[chosen], [len(f) for f in found])
        j = np.array([m for f in found for m in f], dtype=np.intp)
        offset = master.centres[j] - centres[i]
        height = np.einsum("pd,pd->p", offset, slave.normal[i])
        aside = np.sqrt(np.maximum(np.einsum("pd,pd->p", offset, offset) - height**2, 0.0))
        opposite = -np.einsum("pd,pd->p", slave.normal[i], master.normal[j])
        keep = (aside <= own[i] + radii[j]) & (opposite > FACING) & (np.abs(height) <= reach)
        yield i[keep], j[keep]
