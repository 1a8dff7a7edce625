"""Rigid motions at points of a body, as columns."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.typing import Array


def rigid_motions(points: NDArray[np.floating], revolved: bool = False) -> Array:
    """Return the rigid motions at points of shape (n, d): shape (n, d, 3 or 6).

    Translations come first, then rotations: about z in the plane, about x, y and z in space.
    A body of revolution has one, along its axis: shape (n, 2, 1).
    """
    n, d = points.shape
    motions = np.zeros((n, d, 3 if d == 2 else 6))
    motions[:, np.arange(d), np.arange(d)] = 1.0
    for k, (i, j) in enumerate([(0, 1)] if d == 2 else [(1, 2), (2, 0), (0, 1)]):
        motions[:, i, d + k], motions[:, j, d + k] = -points[:, j], points[:, i]
    return motions[:, :, 1:2] if revolved else motions
