"""The non-local operator R: a mollifier along Gamma_3, section 1.4.3 of the thesis."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from mpi4py import MPI
from scipy import sparse
from scipy.spatial import cKDTree

from contact.interface.nodes import ContactNodes
from contact.typing import Array

#: Angles at which omega is taken on a ring; it is smooth.
ANGLES = 32


class Smoother(Protocol):
    """R at all contact nodes, of one part or of several."""

    @property
    def radius(self) -> float:
        """The largest radius (length)."""

    def __call__(self, values: Array) -> Array:
        """Return R applied to nodal values, shape (n,). Collective."""

    def transposed(self, values: Array) -> Array:
        """Return R^T applied to nodal values, shape (n,). Collective."""


class Smoothing:
    """(R p)(x) = sum_j omega_r(|x - x_j|) w_j p_j / sum_j omega_r(|x - x_j|) w_j.

    omega_r(s) = exp(r^2/(s^2 - r^2)) for s < r. The division makes R reproduce a constant
    pressure exactly, at the ends of Gamma_3 too. On a body of revolution omega is averaged over
    the rings of the nodes x_j.

    Parameters
    ----------
    nodes
        The contact nodes; those of other ranks within the radius are taken into account.
    radius
        The radius r >= 0 (length); 0 gives the identity.
    """

    def __init__(self, nodes: ContactNodes, radius: float) -> None:
        self._nodes, self.radius = nodes, radius
        self._matrix: sparse.csr_array | None = None
        if radius > 0:
            self._matrix = _mollifier(nodes, radius)

    def __call__(self, values: Array) -> Array:
        """Return R applied to nodal values, shape (n,). Collective."""
        if self._matrix is None:
            return values
        return self._matrix @ self._nodes.gather(values)

    def transposed(self, values: Array) -> Array:
        """Return R^T applied to nodal values, shape (n,). Collective."""
        if self._matrix is None:
            return values
        comm, own = self._nodes.comm, values.size
        every = comm.allreduce(self._matrix.T @ values, op=MPI.SUM)
        begin = comm.exscan(own) or 0  # none is before the first rank
        return np.asarray(every[begin : begin + own])


def _mollifier(nodes: ContactNodes, radius: float) -> sparse.csr_array:
    """Return the rows of R that belong to the owned nodes."""
    points, weight = nodes.gather(nodes.points), nodes.gather(nodes.weight)
    shape = (nodes.nodes.size, weight.size)
    if nodes.nodes.size == 0:
        return sparse.csr_array(shape)
    pairs = cKDTree(nodes.points).sparse_distance_matrix(
        cKDTree(points), radius * (1 - 1e-9), output_type="coo_matrix"
    )
    if nodes.revolved:
        omega = _ring_mean(nodes.points[pairs.row], points[pairs.col], radius)
    else:
        omega = _omega(pairs.data**2, radius)
    values = omega * weight[pairs.col]
    matrix = sparse.csr_array((values, (pairs.row, pairs.col)), shape=shape)
    return sparse.csr_array(sparse.diags_array(1 / matrix.sum(axis=1)) @ matrix)


def _omega(square: Array, radius: float) -> Array:
    """Return omega at squared distances, up to a constant; 0 from the radius on."""
    inside = square < (radius * (1 - 1e-9)) ** 2
    return np.where(inside, np.exp(1 + radius**2 / np.where(inside, square - radius**2, -1)), 0.0)


def _ring_mean(points: Array, others: Array, radius: float) -> Array:
    """Return the means of omega over the rings through other points (r, z), shape (n,).

    In the angle theta between the half planes, |x - x_j|^2 is |x - x_j|^2 at theta = 0, plus
    2 r r_j (1 - cos theta). Gauss's rule takes the angles at which omega is not 0.
    """
    square = np.sum((points - others) ** 2, axis=1)
    product = 2 * points[:, 0] * others[:, 0]
    reach = (radius**2 - square) / np.where(product > 0, product, np.inf)
    widest = np.where(product > 0, np.arccos(np.clip(1 - reach, -1, 1)), np.pi)
    mean = np.zeros_like(square)
    for node, share in zip(*np.polynomial.legendre.leggauss(ANGLES), strict=True):
        theta = widest * (node + 1) / 2
        mean += share / 2 * _omega(square + product * (1 - np.cos(theta)), radius)
    return mean * widest / np.pi
