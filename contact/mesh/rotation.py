"""Rotations of a mesh."""

from collections.abc import Sequence

import numpy as np
from dolfinx import mesh as dmesh


def rotate(mesh: dmesh.Mesh, degrees: float, axis: Sequence[float] = (0.0, 1.0, 0.0)) -> None:
    """Turn a mesh in place about an axis through the origin (Rodrigues' formula)."""
    if degrees == 0.0:
        return
    a, b, c = np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    cross = np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]])
    angle = np.deg2rad(degrees)
    turn = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    mesh.geometry.x[:] = mesh.geometry.x @ turn.T
