"""Nodal areas of a surface: integrals of functions that all have some, and their coefficients.

At the vertices of quadratic triangles the basis functions have no mean: a constraint there would
weigh nothing. The functions N~ = A N of `dual_basis_transformation` take their place, and with them
the coefficients D u, D = A^-T, that of the nodal values u: in front of a rigid foundation as in
front of another body. For all other facets A is the identity.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from contact.interface.mortar.surface import Surface, dual_basis_transformation
from contact.mesh.cells import rule
from contact.mesh.geometry import jacobians
from contact.mesh.owners import Owners, sparse_rows
from contact.typing import Array


def integrals(surface: Surface) -> Array:
    """Return int N~ over whole facets, shape (f, k)."""
    _, weights, functions = _integrated(surface)
    return np.asarray(weights @ functions)


def _integrated(surface: Surface) -> tuple[Array, Array, Array]:
    """Return points, their weights in integrals over facets, (f, q), and N~ there, (q, k)."""
    places, weights = rule(surface.shape, 4 * surface.order)
    change = dual_basis_transformation(surface.shape, surface.degree)
    functions = surface.shape.lagrange(surface.degree, places) @ change.T
    return places, surface.integration_weights(places, weights), functions


@dataclass(frozen=True)
class JumpRows:
    """Rows of T = [D, -M]: the jumps (T u)_j = sum_k D_jk u_k - sum_l M_jl u_l.

        D_jk = w_j^-1 int Phi_j N_k,    M_jl = w_j^-1 int Phi_j N_l o Pi,

    with the area w_j of the node and the dual functions Phi_j of the multiplier: rows of D and of M
    have the sum 1. D is A^-T on quadratic triangles, and the identity on other facets, but in the
    rows of nodes that carry functions of neighbours without multiplier: of crosspoints
    (`ModifiedDualBasis`), or of nodes on the axis of revolution (`Lumping.without_axis`).

    Rows are nodes that this rank owns in ascending order of their global numbers.

    Attributes
    ----------
    nodes
        Global numbers of the nodes that carry a multiplier, shape (n,).
    slaves, D
        Global numbers of the nodes u_k of their side, of whatever ranks, shape (s,), and D, shape
        (n, s).
    masters, M
        Those u_l of the other body, shape (m,), and M, (n, m); none before a rigid foundation.
    """

    nodes: NDArray[np.int64]
    slaves: NDArray[np.int64]
    D: sparse.csr_array
    masters: NDArray[np.int64]
    M: sparse.csr_array

    @staticmethod
    def one_sided(
        nodes: NDArray[np.int64], slaves: NDArray[np.int64], matrix: sparse.csr_array
    ) -> JumpRows:
        """Return the jumps D u of nodes in front of a rigid foundation."""
        none = sparse.csr_array((nodes.size, 0))
        return JumpRows(nodes, slaves, matrix, np.zeros(0, dtype=np.int64), none)

    def apply(self, owners: Owners, values: Array) -> Array:
        """Return D v, shape (n, m), of values v at `nodes`, which include all `slaves`. Collective.

        Jumps made of infinite values are NaN.
        """
        slave_values = owners.values(
            self.slaves, lambda numbers: values[np.searchsorted(self.nodes, numbers)]
        )
        with np.errstate(invalid="ignore"):
            return np.asarray(self.D @ slave_values)

    def on_coefficients(self, owners: Owners, forces: Array) -> Array:
        """Return the forces D^-T f on coefficients D u, given those on u, (n, m). Collective.

        D is that of one side: mid-edge nodes, which alone have other columns, have those of
        vertices, whose rows are of the identity.
        """
        at = np.searchsorted(self.slaves, self.nodes)
        diagonal = self.D.data[self.D.indices == np.repeat(at, np.diff(self.D.indptr))]
        dual_forces = forces / diagonal[:, None]
        others = -(self.D.T @ dual_forces)
        others[at] += forces
        nodes, sums = owners.sums(self.slaves, others)
        dual_forces[np.searchsorted(self.nodes, nodes)] += sums
        return np.asarray(dual_forces)


@dataclass(frozen=True)
class Lumping:
    """The nodes of a surface that this rank owns, with their areas.

    Attributes
    ----------
    nodes
        Global numbers in ascending order, shape (n,).
    weight
        int N~_j, shape (n,) (length^(d - 1)).
    normal
        Along the outward normals, int N~_j nu of straight facets, shape (n, d).
    deviation
        From the nodes to the curved surface that the facets approximate, shape (n, d) (length).
    least
        The least height of that surface above the nodes, shape (n,) (length).
    jumps
        Rows of the jumps that belong to the weights; None where these are the nodal values.
    """

    nodes: NDArray[np.int64]
    weight: Array
    normal: Array
    deviation: Array
    least: Array
    jumps: JumpRows | None

    @staticmethod
    def of(surface: Surface) -> Lumping:
        """Return the areas, given the facets that this rank owns. Collective."""
        owners, count, d = surface.owners, surface.nodes.size, surface.normal.shape[1]
        places, weights, functions = _integrated(surface)
        areas, shares = weights @ functions, weights[:, :, None] * functions
        if surface.order > 1:
            # Means on curved facets would be the normals at the centroids of the functions.
            places = surface.shape.nodes(surface.degree)
            shares = weights.sum(axis=1)[:, None, None] * np.eye(len(places))
        slopes = jacobians(surface.shape, surface.points, places)
        normals = surface.normals(np.arange(surface.count)[:, None], slopes)
        height, least = np.moveaxis(surface.node_heights, 2, 0)
        parts = [
            areas.reshape(count, 1),
            np.einsum("fqd,fqk->fkd", normals, shares).reshape(count, d),
            (height[..., None] * surface.normal[:, None, :]).reshape(count, d),
            least.reshape(count, 1),
            np.ones((count, 1)),
        ]
        nodes, total = owners.sums(surface.nodes.ravel(), np.hstack(parts))
        weight, normal, deviation, least, often = np.split(
            total, [1, 1 + d, 1 + 2 * d, 2 + 2 * d], axis=1
        )
        deviation, least = deviation / often, (least / often)[:, 0]
        change, jumps = dual_basis_transformation(surface.shape, surface.degree), None
        if not np.array_equal(change, np.eye(len(change))):
            node_pairs = np.broadcast_arrays(surface.nodes[:, :, None], surface.nodes[:, None, :])
            values = np.broadcast_to(np.linalg.inv(change.T), node_pairs[0].shape)
            entries = owners.entries(*(part.ravel() for part in (*node_pairs, values)))
            # Facets that share nodes have equal entries there: the first ones are taken.
            _, first = np.unique(np.column_stack(entries[:2]), axis=0, return_index=True)
            row, column, value = entries[0][first], entries[1][first], entries[2][first]
            jumps = JumpRows.one_sided(nodes, *sparse_rows(nodes, (row, column, value)))
        return Lumping(nodes, weight[:, 0], normal, deviation, least, jumps)

    def without_axis(self, surface: Surface) -> Lumping:
        """Return the areas without multiplier on the axis of revolution.

        The area of a node there is so small that its pressure would be off by several times as much
        as others. As at crosspoints its function goes to its neighbour.
        """
        owners, nodes = surface.owners, self.nodes
        # Few pairs: a part has two ends in the half plane.
        pairs = np.concatenate(owners.comm.allgather(pairs_at_axis(surface, surface.nodes)))
        if len(pairs) == 0:
            return self
        weights = owners.values(
            pairs.ravel(), lambda asked: self.weight[np.searchsorted(nodes, asked)]
        ).reshape(pairs.shape)
        (axis, beside), total, weight = pairs.T, weights.sum(axis=1), self.weight.copy()
        for numbers, values in ((axis, np.zeros(axis.size)), (beside, total)):
            owned = np.isin(numbers, nodes)
            weight[np.searchsorted(nodes, numbers[owned])] = values[owned]
        alone = np.setdiff1d(nodes, beside)
        entries = (
            np.concatenate([alone, beside, beside]),
            np.concatenate([alone, axis, beside]),
            np.concatenate([np.ones(alone.size), *(weights / total[:, None]).T]),
        )
        return replace(
            self, weight=weight, jumps=JumpRows.one_sided(nodes, *sparse_rows(nodes, entries))
        )


def pairs_at_axis(surface: Surface, numbers: NDArray[Any]) -> NDArray[Any]:
    """Return nodes on the axis of revolution, and those beside them, (k, 2).

    None of degree 2 on straight facets, where functions of nodes on the axis have no mean.
    """
    radius = surface.corners[:, :, 0]
    on_axis = radius <= 1e-12 * radius.max(initial=0.0)
    at = on_axis.any(axis=1) & ~on_axis.all(axis=1)
    if not surface.revolved or surface.degree > 1 == surface.order:
        at[:] = False
    return np.take_along_axis(numbers[at], np.argsort(~on_axis[at], axis=1), axis=1)
