"""Crystals: Voigt's notation, and tensors turned from the axes of the crystal to those of a body.

A plane body lies in (x, y) = (X2, X3) of the crystal, whose axis X3 is that of poling; X1 points
out of the plane. The half plane of a body of revolution lies alike, with X1 along theta.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: Pairs of tensor indices in the order of Voigt's notation.
VOIGT = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))

#: The rotation of the crystal's axes X2, X3, X1 into x, y, z of a plane body.
PLANE = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])


def turned(tensor: ArrayLike, rotation: ArrayLike) -> NDArray[np.float64]:
    """Return a tensor of any rank, each index of size 3, turned by a rotation matrix.

    Raises
    ------
    ValueError
        If the matrix is no rotation.
    """
    q, result = np.asarray(rotation, dtype=float), np.asarray(tensor, dtype=float)
    if q.shape != (3, 3) or not np.allclose(q @ q.T, np.eye(3), atol=1e-12):
        raise ValueError("a rotation must be an orthogonal 3 x 3 matrix")
    if np.linalg.det(q) < 0:
        raise ValueError("a rotation must have the determinant +1, not -1")
    for axis in range(result.ndim):
        result = np.moveaxis(np.tensordot(q, result, (1, axis)), 0, axis)
    return np.ascontiguousarray(result)


def about_z(degrees: float) -> NDArray[np.float64]:
    """Return the rotation by an angle about z."""
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def in_plane(degrees: float = 90.0) -> NDArray[np.float64]:
    """Return the rotation of a crystal into a plane body, X3 at an angle from x."""
    return about_z(degrees - 90.0) @ PLANE


def to_axis(axis: ArrayLike) -> NDArray[np.float64]:
    """Return the rotation that turns z the shortest way to another axis.

    Raises
    ------
    ValueError
        If the axis is no vector of three finite numbers, or zero.
    """
    given = np.asarray(axis, dtype=float)
    length = np.linalg.norm(given)
    if given.shape != (3,) or not 0 < length < np.inf:
        raise ValueError(f"a poling axis must be a vector (3 numbers, not all 0); got {given}")
    x, y, z = given / length
    if z < -1 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    cross = np.array([[0.0, 0.0, x], [0.0, 0.0, y], [-x, -y, 0.0]])
    return np.asarray(np.eye(3) + cross + cross @ cross / (1 + z))


def stiffness_tensor(voigt: ArrayLike) -> NDArray[np.float64]:
    """Return c_ijkl of a 6 x 6 matrix in Voigt's notation."""
    matrix, tensor = np.asarray(voigt, dtype=float), np.zeros((3, 3, 3, 3))
    for a, (i, j) in enumerate(VOIGT):
        for b, (k, m) in enumerate(VOIGT):
            tensor[i, j, k, m] = tensor[j, i, k, m] = matrix[a, b]
            tensor[i, j, m, k] = tensor[j, i, m, k] = matrix[a, b]
    return tensor


def stiffness_voigt(tensor: ArrayLike) -> NDArray[np.float64]:
    """Return the 6 x 6 matrix of c_ijkl in Voigt's notation."""
    c = np.asarray(tensor)
    return np.array([[c[i, j, k, m] for k, m in VOIGT] for i, j in VOIGT])


def coupling_tensor(voigt: ArrayLike) -> NDArray[np.float64]:
    """Return e_ijk of a 3 x 6 matrix in Voigt's notation."""
    matrix, tensor = np.asarray(voigt, dtype=float), np.zeros((3, 3, 3))
    for column, (j, k) in enumerate(VOIGT):
        tensor[:, j, k] = tensor[:, k, j] = matrix[:, column]
    return tensor


def isotropic_about_x3(*tensors: ArrayLike) -> bool:
    """Return true if tensors are invariant under rotations about X3."""
    # A tensor of rank 4 that is invariant under one rotation by an odd angle is so under all.
    turn = about_z(40.0)
    return all(
        np.allclose(turned(t, turn), t, rtol=0, atol=1e-9 * max(np.abs(t).max(), 1e-300))
        for t in map(np.asarray, tensors)
    )
