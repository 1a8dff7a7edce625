"""Superconvergent patch recovery: smooth fields from values at a few points of each cell.

At each vertex a polynomial is fitted to the values in the cells around it (Zienkiewicz and Zhu,
IJNME 33, 1992); in a cell those of its vertices are blended by its barycentric coordinates
(Blacker and Belytschko, IJNME 37, 1994), those of vertices with more cells around them counting
more: at the boundary few cells determine them. Constant polynomials are nodal means.
"""

from __future__ import annotations

from itertools import combinations_with_replacement

import numpy as np
from dolfinx import fem
from dolfinx.la import InsertMode
from scipy import sparse

from contact.mesh.domain import Domain, Indices
from contact.typing import Array

#: Regularisation of the coefficients, by degree, over the moments of the points: polynomials of
#: patches with few cells are unique by it.
SMALL = (0.0, 1e-6, 1e-3)


def powers(x: Array, degree: int) -> Array:
    """Return all monomials up to a degree at points, shape (..., d) -> (..., monomials)."""
    d = x.shape[-1]
    columns = [np.ones(x.shape[:-1])]
    for k in range(1, degree + 1):
        chosen = combinations_with_replacement(range(d), k)
        columns += [np.prod(x[..., list(c)], axis=-1) for c in chosen]
    return np.stack(columns, axis=-1)


def barycentric(points: Array) -> Array:
    """Return the barycentric coordinates of points of the reference cell, shape (n, d + 1)."""
    return np.column_stack([1 - points.sum(axis=1), points])


class Recovery:
    """Recovered fields in some cells of a mesh. Its functions are collective.

    Parameters
    ----------
    domain
        The mesh.
    cells
        Owned cells; cells around them that are not among them do not count.
    degree
        Degree of the polynomials.
    """

    def __init__(self, domain: Domain, cells: Indices, degree: int) -> None:
        self._domain, self._degree = domain, degree
        self._scalar = fem.functionspace(domain.mesh, ("Lagrange", 1))
        self._vertices = self._scalar.dofmap.list[cells]
        self._corners = self._scalar.tabulate_dof_coordinates()[:, : domain.dim]

    def volumes(self, at: Array, weights: Array) -> Array:
        """Return the volumes of points, (q, d + 1), with weights of a rule, shape (cells, q)."""
        corners = self._corners[self._vertices]
        volumes = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))[:, None] * weights
        if self._domain.revolved:
            volumes = volumes * 2 * np.pi * (corners[..., 0] @ at.T)
        return np.asarray(volumes)

    def recovered(self, points: Array, values: Array, at: Array) -> Array:
        """Return the recovered field at points of the cells.

        Parameters
        ----------
        points
            Barycentric coordinates of the points with values, shape (s, d + 1).
        values
            Shape (cells, s, components).
        at
            Barycentric coordinates of other points, shape (q, d + 1).

        Returns
        -------
        Shape (cells, q, components).
        """
        corners = self._corners[self._vertices]
        # Relative to each vertex: (cells, vertex, point, d).
        here = points @ corners
        basis = powers(here[:, None] - corners[:, :, None], self._degree)
        coefficients = self._fitted(basis, values)[self._vertices]
        there = powers((at @ corners)[:, None] - corners[:, :, None], self._degree)
        # A mean is determined by any number of cells.
        trust = self._around[self._vertices][:, None] ** (3 if self._degree > 0 else 0)
        blend = at * trust / (at @ trust.swapaxes(1, 2))
        return np.asarray(
            np.einsum("cqv,cvqm,cvmk->cqk", blend, there, coefficients, optimize=True)
        )

    def _fitted(self, basis: Array, values: Array) -> Array:
        """Return the coefficients at local vertices, shape (vertices, monomials, components)."""
        count, components = basis.shape[-1], values.shape[-1]
        matrix = np.einsum("cvsm,cvsn->cvmn", basis, basis, optimize=True)
        right = np.einsum("cvsm,csk->cvmk", basis, values, optimize=True)
        both = np.concatenate([matrix, right], axis=3)
        flat = both.reshape(*both.shape[:2], count * (count + components))
        sums = self._summed(flat).reshape(-1, *both.shape[2:])
        matrix, right = sums[..., :count], sums[..., count:]
        #: Numbers of points around each vertex.
        self._around = matrix[:, 0, 0]
        size = np.sqrt(np.einsum("vmm->vm", matrix))
        size[size == 0] = 1.0  # around the vertex none of the cells
        degrees = [0] * 1 + [1] * self._domain.dim + [2] * count
        small = np.diag(np.take(SMALL, degrees[:count])) + 1e-300 * np.eye(count)
        scaled = matrix / (size[:, :, None] * size[:, None, :]) + small
        scaled[matrix[:, 0, 0] == 0] = np.eye(count)
        found = np.linalg.solve(scaled, right / size[:, :, None]) / size[:, :, None]
        return np.asarray(found.reshape(-1, count, components))

    def _summed(self, values: Array) -> Array:
        """Return the sums over the cells around each local vertex, of (cells, d + 1, n)."""
        pairs, n = self._vertices.size, values.shape[-1]
        local = self._corners.shape[0]
        where = np.arange(pairs), self._vertices.ravel()
        around = sparse.csr_array((np.ones(pairs), where[::-1]), shape=(local, pairs))
        sums = around @ values.reshape(pairs, n)
        if self._domain.comm.size == 1:
            return np.asarray(sums)
        total = fem.Function(fem.functionspace(self._domain.mesh, ("Lagrange", 1, (n,))))
        blocks, dofs = total.x.array.reshape(-1, n), total.function_space.dofmap.list
        blocks[dofs] = sums[self._scalar.dofmap.list]
        total.x.scatter_reverse(InsertMode.add)
        total.x.scatter_forward()
        made = np.zeros_like(sums)
        made[self._scalar.dofmap.list] = blocks[dofs]
        return made
