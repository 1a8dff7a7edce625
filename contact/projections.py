"""Projections onto the admissible contact forces: a half line and a disc, node by node."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def project_half_line(z: Array) -> Array:
    """Return max(0, z): the projection onto admissible pressures, equation (3.43)."""
    return np.maximum(z, 0.0)


def project_disc(z: Array, radius: Array) -> Array:
    """Return the projection of tangential vectors onto discs |.| <= radius.

    Parameters
    ----------
    z
        Vectors, shape (n, d).
    radius
        Friction bounds s >= 0, shape (n,).
    """
    length = np.linalg.norm(z, axis=1)
    beyond = length > radius
    scale = np.ones_like(length)
    scale[beyond] = radius[beyond] / length[beyond]
    return z * scale[:, None]
