"""The non-local operator R: a mollifier along Gamma_3, section 1.4.3 of the thesis."""

from __future__ import annotations

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from contact.interface.nodes import ContactNodes
from contact.typing import Array


class Smoothing:
    """(R p)(x) = sum_j omega_r(|x - x_j|) w_j p_j / sum_j omega_r(|x - x_j|) w_j.

    omega_r(s) = exp(r^2/(s^2 - r^2)) for s < r. The division makes R reproduce a constant
    pressure exactly, at the ends of Gamma_3 too.

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


def _mollifier(nodes: ContactNodes, radius: float) -> sparse.csr_array:
    """Return the rows of R that belong to the owned nodes."""
    points, weight = nodes.gather(nodes.points), nodes.gather(nodes.weight)
    shape = (nodes.nodes.size, weight.size)
    if nodes.nodes.size == 0:
        return sparse.csr_array(shape)
    pairs = cKDTree(nodes.points).sparse_distance_matrix(
        cKDTree(points), radius * (1 - 1e-9), output_type="coo_matrix"
    )
    # exp(1 + ...) is omega up to the constant that the division below removes.
    omega = np.exp(1 + radius**2 / (pairs.data**2 - radius**2)) * weight[pairs.col]
    matrix = sparse.csr_array((omega, (pairs.row, pairs.col)), shape=shape)
    return sparse.csr_array(sparse.diags_array(1 / matrix.sum(axis=1)) @ matrix)
