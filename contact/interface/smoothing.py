"""The non-local operator R: a mollifier along Gamma_3, section 1.4.3 of the thesis."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from petsc4py import PETSc
from scipy import sparse
from scipy.spatial import cKDTree

from contact.interface.nodes import ContactNodes
from contact.linear.layout import times
from contact.ranks import neighbours
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
        The contact nodes, those of other ranks within the radius included.
    radius
        The radius r >= 0 (length); 0 gives the identity.
    """

    def __init__(self, nodes: ContactNodes, radius: float) -> None:
        self.radius = radius
        self._matrix = _mollifier(nodes, radius) if radius > 0 else None

    def __call__(self, values: Array) -> Array:
        """Return R applied to nodal values, shape (n,). Collective."""
        return times(self._matrix, values)

    def transposed(self, values: Array) -> Array:
        """Return R^T applied to nodal values, shape (n,). Collective."""
        return times(self._matrix, values, transposed=True)


def _mollifier(nodes: ContactNodes, radius: float) -> PETSc.Mat:
    """Return R, its rows and columns divided among the ranks as the nodes are. Collective."""
    own, reach = nodes.nodes.size, radius * (1 - 1e-9)
    first = nodes.comm.scan(own) - own
    numbers = np.arange(first, first + own, dtype=float)
    values = np.column_stack([nodes.points, nodes.weight, numbers])
    near = neighbours(nodes.comm, nodes.points, values, radius)
    points, weight, column = near[:, : nodes.dim], near[:, -2], near[:, -1].astype(PETSc.IntType)
    if own == 0:
        pairs = sparse.coo_array((own, len(near)))
    else:
        pairs = cKDTree(nodes.points).sparse_distance_matrix(
            cKDTree(points), reach, output_type="coo_matrix"
        )
    row, col = pairs.row, pairs.col
    if nodes.revolved:
        omega = _ring_mean(nodes.points[row], points[col], radius)
    else:
        omega = _omega(pairs.data**2, radius)
    every = nodes.comm.allreduce(own)
    part = sparse.csr_array((omega * weight[col], (row, column[col])), (own, every))
    part = sparse.csr_array(sparse.diags_array(1 / part.sum(axis=1)) @ part)
    part.sort_indices()
    csr = (part.indptr.astype(PETSc.IntType), part.indices.astype(PETSc.IntType), part.data)
    made = PETSc.Mat().createAIJ(((own, every), (own, every)), csr=csr, comm=nodes.comm)
    made.assemble()
    return made


def _omega(square: Array, radius: float) -> Array:
    """Return omega at squared distances, up to a constant; 0 from the radius on."""
    inside = square < (radius * (1 - 1e-9)) ** 2
    return np.where(inside, np.exp(1 + radius**2 / np.where(inside, square - radius**2, -1)), 0.0)


def _ring_mean(points: Array, others: Array, radius: float) -> Array:
    """Return the means of omega over the rings through other points (r, z), shape (n,)."""
    # At the angle theta |x - x_j|^2 grows by 2 r r_j (1 - cos theta); Gauss's rule where omega > 0.
    square = np.sum((points - others) ** 2, axis=1)
    product = 2 * points[:, 0] * others[:, 0]
    reach = (radius**2 - square) / np.where(product > 0, product, np.inf)
    widest = np.where(product > 0, np.arccos(np.clip(1 - reach, -1, 1)), np.pi)
    mean = np.zeros_like(square)
    for node, share in zip(*np.polynomial.legendre.leggauss(ANGLES), strict=True):
        theta = widest * (node + 1) / 2
        mean += share / 2 * _omega(square + product * (1 - np.cos(theta)), radius)
    return mean * widest / np.pi
