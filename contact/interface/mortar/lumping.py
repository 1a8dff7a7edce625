"""Nodal areas of a surface: integrals of functions that all have some, and their coefficients.

At the vertices of quadratic triangles the basis functions have no mean: a constraint there would
weigh nothing. The functions N~ = A N of `dual_basis_transformation` take their place, and with them
the coefficients S u, S = A^-T, that of the nodal values u: in front of a rigid foundation as in
front of another body. For all other facets A is the identity.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import sparse

from contact.interface.mortar.surface import Surface, dual_basis_transformation
from contact.mesh.cells import rule
from contact.mesh.geometry import jacobians
from contact.typing import Array


def integrals(surface: Surface) -> Array:
    """Return int N~ over whole facets, shape (f, k)."""
    _, measure, functions = _integrated(surface)
    return np.asarray(measure @ functions)


def _integrated(surface: Surface) -> tuple[Array, Array, Array]:
    """Return points, their weights in integrals over facets, (f, q), and N~ there, (q, k)."""
    places, weights = rule(surface.shape, 4 * surface.order)
    change = dual_basis_transformation(surface.shape, surface.degree)
    functions = surface.shape.lagrange(surface.degree, places) @ change.T
    return places, surface.measures(places, weights), functions


def coefficients(place: NDArray[np.intp], count: int, change: Array) -> sparse.csr_array:
    """Return S: the coefficients of a function in N~ as those in N, shape (count, count).

    Parameters
    ----------
    place
        Numbers of the nodes of each facet, shape (f, k).
    count
        Number of nodes.
    change
        A of a facet, shape (k, k).
    """
    own = np.linalg.inv(change.T)
    rows = np.broadcast_to(place[:, :, None], (*place.shape, place.shape[1]))
    columns = np.broadcast_to(place[:, None, :], rows.shape)
    values = np.broadcast_to(own, rows.shape)
    # Facets that share nodes say the same of them: any of them may be heard.
    pairs, first = np.unique(rows.ravel() * count + columns.ravel(), return_index=True)
    made = sparse.csr_array(
        (values.ravel()[first], (pairs // count, pairs % count)), shape=(count, count)
    )
    made.eliminate_zeros()
    return made


@dataclass(frozen=True)
class Mixing:
    """Jumps that are no nodal values, S u less P times the values of another body.

    Rows are nodes in ascending order of their global numbers; the same on all ranks.

    Attributes
    ----------
    nodes
        Global numbers of the nodes that carry a multiplier, shape (n,).
    slaves, own
        Global numbers of the nodes of their side, shape (s,), and S, shape (n, s).
    masters, other
        Those of the other body, shape (m,), and P, shape (n, m); none before a rigid foundation.
    """

    nodes: NDArray[np.int64]
    slaves: NDArray[np.int64]
    own: sparse.csr_array
    masters: NDArray[np.int64]
    other: sparse.csr_array

    @staticmethod
    def alone(nodes: NDArray[np.int64], own: sparse.csr_array) -> Mixing:
        """Return the jumps S u of all nodes of one side, S of shape (n, n)."""
        none = sparse.csr_array((nodes.size, 0))
        return Mixing(nodes, nodes, own, np.zeros(0, dtype=np.int64), none)

    def apply(self, comm: MPI.Intracomm, numbers: NDArray[np.int64], values: Array) -> Array:
        """Return S times nodal values of owned nodes, shape (k, m). Collective.

        Jumps made of infinite values are NaN.

        Parameters
        ----------
        comm, numbers, values
            Communicator, the global numbers of the nodes that this rank owns, and their values.
        """
        place = np.searchsorted(self.nodes, numbers)
        total = np.zeros((self.nodes.size, values.shape[1]))
        total[place] = values
        comm.Allreduce(MPI.IN_PLACE, total, op=MPI.SUM)
        with np.errstate(invalid="ignore"):
            return np.asarray((self.own @ total)[place])


@dataclass(frozen=True)
class Lumping:
    """The nodes of a surface with their areas; the same on all ranks.

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
    mixing
        The jumps that belong to the weights; None where they are the nodal values.
    """

    nodes: NDArray[np.int64]
    weight: Array
    normal: Array
    deviation: Array
    mixing: Mixing | None

    @staticmethod
    def of(surface: Surface) -> Lumping:
        """Return the areas, given the facets of all ranks."""
        nodes, place = np.unique(surface.nodes, return_inverse=True)
        place = place.reshape(surface.nodes.shape)
        places, measure, functions = _integrated(surface)
        areas, shares = measure @ functions, measure[:, :, None] * functions
        if surface.order > 1:
            # Means on curved facets would be the normals at the centroids of the functions.
            places = surface.shape.nodes(surface.degree)
            shares = measure.sum(axis=1)[:, None, None] * np.eye(len(places))
        slopes = jacobians(surface.shape, surface.points, places)
        normals = surface.normals(np.arange(surface.count)[:, None], slopes)
        weight, normal = np.zeros(nodes.size), np.zeros((nodes.size, surface.normal.shape[1]))
        np.add.at(weight, place, areas)
        np.add.at(normal, place, np.einsum("fqd,fqk->fkd", normals, shares))
        deviation = np.zeros_like(normal)
        np.add.at(deviation, place, surface.node_deviations)
        deviation /= np.bincount(place.ravel(), minlength=nodes.size)[:, None]
        change, mixing = dual_basis_transformation(surface.shape, surface.degree), None
        if not np.array_equal(change, np.eye(len(change))):
            mixing = Mixing.alone(nodes, coefficients(place, nodes.size, change))
        return Lumping(nodes, weight, normal, deviation, mixing)

    def without_axis(self, surface: Surface) -> Lumping:
        """Return the areas where nodes on the axis of revolution carry no multiplier.

        Pressures at degree 1 are of second order by a cancellation between alike elements alone,
        which ends at the axis; a node there has so little area that its pressure would be off by
        several times as much as others. As at crosspoints its function goes to its neighbour.
        """
        facets = np.searchsorted(self.nodes, surface.nodes)
        weight, own = self.weight.copy(), sparse.lil_array(sparse.eye_array(self.nodes.size))
        for axis, beside in pairs_at_axis(surface, facets):
            total = self.weight[axis] + self.weight[beside]
            own[beside, axis] = self.weight[axis] / total
            own[beside, beside] = self.weight[beside] / total
            weight[axis], weight[beside] = 0.0, total
        if np.array_equal(weight, self.weight):
            return self
        return replace(self, weight=weight, mixing=Mixing.alone(self.nodes, sparse.csr_array(own)))


def pairs_at_axis(surface: Surface, numbers: NDArray[Any]) -> NDArray[Any]:
    """Return the numbers of nodes on the axis of revolution and of those beside them, (k, 2).

    None of degree 2 on straight facets, where functions of nodes on the axis have no mean.
    """
    radius = surface.corners[:, :, 0]
    on_axis = radius <= 1e-12 * radius.max(initial=0.0)
    at = on_axis.any(axis=1) & ~on_axis.all(axis=1)
    if not surface.revolved or surface.degree > 1 == surface.order:
        at[:] = False
    return np.take_along_axis(numbers[at], np.argsort(~on_axis[at], axis=1), axis=1)
