"""Triangles too many to be drawn one by one, as an image."""

from __future__ import annotations

import numpy as np

from contact.typing import Array

#: Pixels along the body.
PIXELS = 1600


def pixels(drawn: Array, colours: Array, box: Array) -> Array:
    """Return the means over pixels, NaN outside the body."""
    extent = box[1] - box[0]
    shape = np.maximum(np.rint(PIXELS * extent / extent.max()).astype(int), 1)
    corners = (drawn - box[0]) / extent * shape
    values = np.broadcast_to(colours[:, None], (len(drawn), 3)) if colours.ndim == 1 else colours
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0)
    # Sample each triangle so densely that no pixel inside the body is missed.
    level = np.ceil(np.log2(np.maximum(2 * longest, 1))).astype(int)
    sums = np.zeros((2, shape.prod()))
    for k in np.unique(level):
        barycentric = _samples(2**k)
        for cells in np.array_split(np.flatnonzero(level == k), 1 + len(level) * 4**k // 10**7):
            points = np.floor(np.einsum("sc,ncd->nsd", barycentric, corners[cells])).astype(int)
            flat = np.ravel_multi_index(tuple(np.clip(points, 0, shape - 1).T), tuple(shape))
            weights = (barycentric @ values[cells].T).ravel()
            sums[0] += np.bincount(flat.ravel(), weights, shape.prod())
            sums[1] += np.bincount(flat.ravel(), minlength=shape.prod())
    with np.errstate(invalid="ignore"):
        return np.asarray((sums[0] / sums[1]).reshape(shape).T)


def _samples(n: int) -> Array:
    """Return the centres of the n^2 equal parts of a triangle, in barycentric coordinates."""
    i, j = (index.ravel() for index in np.indices((n, n)))
    up, down = i + j < n, i + j < n - 1
    first = np.concatenate([i[up] + 1 / 3, i[down] + 2 / 3]) / n
    second = np.concatenate([j[up] + 1 / 3, j[down] + 2 / 3]) / n
    return np.column_stack([first, second, 1 - first - second])
