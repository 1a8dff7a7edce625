"""Triangles clipped by a triangle, many at once: Sutherland and Hodgman's algorithm."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.typing import Array

#: Corners of what two triangles can have in common.
MOST = 6


def clipped(triangles: Array) -> tuple[Array, NDArray[np.intp]]:
    """Clip triangles by the reference triangle, on which all barycentric coordinates are >= 0.

    Parameters
    ----------
    triangles
        Barycentric coordinates of the corners of each, shape (n, 3, 3).

    Returns
    -------
    polygons
        Corners in their order, shape (n, 6, 3); those beyond the number of corners are 0.
    count
        Number of corners, 0 where nothing is common, shape (n,).
    """
    n = triangles.shape[0]
    polygon: Array = np.zeros((n, MOST, 3))
    polygon[:, :3] = triangles
    count: NDArray[np.intp] = np.full(n, 3, dtype=np.intp)
    for side in range(3):
        polygon, count = _cut(polygon, count, side)
    return polygon, count


def _cut(polygon: Array, count: NDArray[np.intp], side: int) -> tuple[Array, NDArray[np.intp]]:
    """Keep what of each polygon has a coordinate >= 0."""
    n, most, _ = polygon.shape
    present = np.arange(most)[None, :] < count[:, None]
    following = np.where(
        np.arange(1, most + 1)[None, :] < count[:, None], np.arange(1, most + 1), 0
    )
    after = np.take_along_axis(polygon, following[:, :, None], axis=1)
    here, there = polygon[:, :, side], after[:, :, side]
    inside = (here >= 0) & present
    crosses = ((here >= 0) != (there >= 0)) & present
    slope = np.where(crosses, here - there, 1.0)
    crossing = polygon + (here / slope)[:, :, None] * (after - polygon)
    # On the side itself, whatever rounding says.
    crossing[:, :, side] = 0.0
    # Of each edge its beginning where that is inside, then the crossing.
    emitted = np.stack([inside, crosses], axis=2).reshape(n, 2 * most)
    corners = np.stack([polygon, crossing], axis=2).reshape(n, 2 * most, 3)
    order = np.argsort(~emitted, axis=1, kind="stable")[:, :most]
    kept = np.take_along_axis(corners, order[:, :, None], axis=1)
    left = emitted.sum(axis=1)
    kept[np.arange(most)[None, :] >= left[:, None]] = 0.0
    return kept, left
