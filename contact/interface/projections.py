"""Projections onto the admissible contact forces: a half line and a disc, node by node."""

from __future__ import annotations

import numpy as np

from contact.typing import Array


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


def disc_derivative(z: Array, radius: Array, directions: Array) -> Array:
    """Return the derivatives of `project_disc` along directions.

    Parameters
    ----------
    z, radius
        Vectors, shape (n, d), and radii, shape (n,).
    directions
        Shape (n, d, k).

    Returns
    -------
    Shape (n, d, k); on the rim that of the inside.
    """
    length = np.linalg.norm(z, axis=1)
    beyond = length > radius
    unit = z[beyond] / length[beyond, None]
    outside = directions[beyond]
    radial = np.einsum("ni,nik->nk", unit, outside)
    outside = outside - unit[:, :, None] * radial[:, None, :]
    result = directions.copy()
    result[beyond] = (radius[beyond] / length[beyond])[:, None, None] * outside
    return result
