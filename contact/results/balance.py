"""Fluxes through the facets of a mesh: sums over both sides, and corrections that balance cells.

Ainsworth and Oden, Numer. Math. 65, 1993: mean fluxes leave a residual on the linear functions of
each cell, which the solution has not; around each corner the residuals of the cells add up to
nothing, and the smallest moments through the facets there that are opposite on both sides take them
away. Without them the error of smooth solutions of degree 2 is overestimated by two thirds on
tetrahedra, and that at corners with infinite stresses underestimated.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from dolfinx import la
from mpi4py import MPI
from numpy.typing import NDArray
from scipy.sparse import csr_array

from contact.body.equilibrium import BodyEquilibrium
from contact.mesh.cells import rule, shape_of
from contact.mesh.entities import cell_facets
from contact.mesh.geometry import geometry_nodes, measures
from contact.typing import Array

#: Added to the diagonal: constants around a corner, which are no flux, would have nothing.
SHIFT = 1e-3

#: Residual of the conjugate gradients, and the most of them: patches are small.
EXACT, MOST = 1e-10, 200


class Sides:
    """Sums over both sides of facets of values at some of their nodes. Collective to make.

    Parameters
    ----------
    body
        The body.
    closures
        Nodes of each facet as nodes of its cell, (facets, m).
    """

    def __init__(self, body: BodyEquilibrium, closures: NDArray[np.intp]) -> None:
        mesh, space, d = body.domain.mesh, body.space, body.dim
        mesh.topology.create_connectivity(d, d - 1)
        self._index_map = mesh.topology.index_map(d - 1)
        owned = mesh.topology.index_map(d).size_local
        #: Facets of the owned cells, (cells, facets), and nodes there, (cells, facets, m).
        self.facets = cell_facets(mesh)[:owned]
        self.nodes = space.dofmap.list[:owned][:, closures]
        numbers = space.dofmap.index_map.local_to_global(self.nodes.ravel().astype(np.int32))
        numbers = numbers.reshape(self.nodes.shape)
        self._count = self._index_map.size_local + self._index_map.num_ghosts
        # Both sides list the nodes by their global numbers.
        order = np.argsort(np.argsort(numbers, axis=2), axis=2)
        #: The place of each node among those of all facets, (cells, facets, m).
        self.places = self.facets[..., None] * closures.shape[1] + order
        #: Which facets have two sides.
        self.inside = self.sums(np.ones((*self.places.shape, 1)))[:, :, 0, 0] > 1.5

    def exchanged(self, rows: Array) -> Array:
        """Return the sums over all ranks of values by place, (facets m, b). Collective."""
        width = self.places.shape[2] * rows.shape[1]
        total = la.vector(self._index_map, width)
        total.array[:] = rows.ravel()
        total.scatter_reverse(la.InsertMode.add)
        total.scatter_forward()
        return np.asarray(total.array.reshape(rows.shape))

    def sums(self, values: Array) -> Array:
        """Return the sums, as the values of shape (cells, facets, m, b). Collective."""
        flat, places = values.reshape(-1, values.shape[3]), self.places.ravel()
        entries = np.ones(places.size), (places, np.arange(places.size))
        onto = csr_array(entries, shape=(self._count * self.places.shape[2], places.size))
        return self.exchanged(onto @ flat)[places].reshape(values.shape)

    def across(self, closures: NDArray[np.intp], corners: int) -> csr_array:
        """Return the matrix from values at corners of cells to places between two cells."""
        cells = np.arange(len(self.places))[:, None, None] * corners
        columns = np.broadcast_to(cells + closures, self.places.shape)[self.inside].ravel()
        rows = self.places[self.inside].ravel()
        shape = self._count * self.places.shape[2], len(self.places) * corners
        return csr_array((np.ones(rows.size), (rows, columns)), shape=shape)


def balancing(body: BodyEquilibrium, residual: Array, unknown: NDArray[np.bool_]) -> Array:
    """Return the fluxes at the nodes of degree 2 of facets that balance cells. Collective.

    Parameters
    ----------
    body
        The body.
    residual
        That of the linear functions of the owned cells, (cells, corners, b).
    unknown
        Whether the flux through facets of the boundary is unknown, and that through others is not
        the same on both sides, (cells, facets, b).

    Returns
    -------
    Fluxes into the cells, shape (cells, facets, nodes, b).
    """
    shape = shape_of(body.domain.mesh)
    corners, of = shape.facet_corners, geometry_nodes(body.domain)
    at, weights = rule(shape.facet, 4)
    hats = shape.facet.lagrange(1, at)
    areas = np.stack(
        [
            measures(body.domain.revolved, shape.facet, of[:, ends], at, weights)
            for ends in shape.facet_nodes(body.domain.order)
        ],
        axis=1,
    )
    sides, size = Sides(body, corners), areas.sum(axis=2)
    # Through the axis of a body of revolution there is no flux.
    outside = unknown & (size > 0)[..., None]
    onto = sides.across(corners, shape.corners)
    back = onto.T.tocsr()
    coupled = sides.inside[..., None] & ~unknown
    diagonal = np.full(residual.shape, SHIFT)
    for facet, ends in enumerate(corners):
        diagonal[:, ends] += (2.0 * coupled[:, facet] + outside[:, facet])[:, None]
    pairs = np.zeros((onto.shape[0], residual.shape[2]))
    pairs[sides.places] = coupled[:, :, None]
    weight = diagonal.reshape(-1, residual.shape[2])

    def image(of_cells: Array) -> Array:
        """Return the moments into each cell of the differences of both sides."""
        return np.asarray(weight * of_cells - back @ (pairs * sides.exchanged(onto @ of_cells)))

    found = _solved(body.comm, image, residual.reshape(weight.shape)).reshape(residual.shape)
    own = found[:, corners]
    between = 2 * own - sides.sums(own)
    through = np.where(coupled[:, :, None], between, outside[:, :, None] * own)
    mass = np.einsum("cfq,qi,qj->cfij", areas, hats, hats)
    mass[size == 0] = np.eye(hats.shape[1])
    to_nodes = shape.facet.lagrange(1, shape.facet.nodes(2))
    return np.asarray(-to_nodes @ np.linalg.solve(mass, through))


def _solved(comm: MPI.Intracomm, image: Callable[[Array], Array], right: Array) -> Array:
    """Solve by conjugate gradients, each component by itself: they have units. Collective."""

    def dot(one: Array, other: Array) -> Array:
        return np.asarray(comm.allreduce(np.einsum("nb,nb->b", one, other), op=MPI.SUM))

    found, left, along = np.zeros_like(right), right, right
    size = first = dot(left, left)
    for _ in range(MOST):
        if np.all(size <= EXACT**2 * first):
            break
        towards = image(along)
        step = size / np.where(size > 0, dot(along, towards), 1.0)
        found, left = found + step * along, left - step * towards
        before, size = size, dot(left, left)
        along = left + size / np.where(before > 0, before, 1.0) * along
    return found
