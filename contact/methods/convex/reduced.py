"""The condensed stiffness of a body, reduced to the directions in which something may act.

Nodal unknowns are turned into normal and tangential ones. Those that nothing restrains, such as
the tangential ones without friction, are eliminated; the order of one Cholesky factorisation
does it. Where the matrix is only semidefinite, since contact alone holds the body, its free
motions are found instead and all unknowns are kept.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dpotrf, dtrtri

from contact.tolerances import EPS

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

#: Eigenvalues below this, with ones on the diagonal of the matrix, are those of free motions where
#: the next one is that many times larger. A beam 1000 times as long as thick has some 1e-13, and
#: the next is 39 times that; rounding leaves up to 1e-13 of a body with many nodes behind it.
NULL, JUMP = 1e-12, 1e3

#: Free motions that can be found: 6 a body, and some to spare.
MOTIONS = 16


class NotConvexError(ValueError):
    """The matrix has negative eigenvalues."""


def cholesky(matrix: Array) -> Array | None:
    """Return the lower factor, in place of a matrix in Fortran order; None without one."""
    factor, info = dpotrf(matrix, lower=1, overwrite_a=1, clean=1)
    return factor if info == 0 else None


class Reduced:
    """A body in its restrained directions: min x'Ax/2 - b'x.

    Parameters
    ----------
    stiffness
        Symmetric matrix S (force/length), node-major, shape (n d, n d), positive definite or
        semidefinite; it is not changed.
    normal
        Unit contact directions, shape (n, d).
    tangent
        Projectors onto the free tangential directions, shape (n, d, d).
    closing
        Nodes with a gap that can close, shape (n,).
    rubbing
        Nodes where friction may act, shape (n,).
    free
        Components that are not fixed, shape (n, d).

    Attributes
    ----------
    matrix
        A, over `unit`: the largest entry of its diagonal is 1.
    unit
        Unit of stiffness (force/length).
    inverse
        The inverse of the Cholesky factor of `matrix`, made definite by `motions`.
    flexibility
        Diagonal of the inverse of `matrix`: how far each unknown gives way, times `unit`.
    motions
        Columns F with `matrix` + F F' definite, shape (unknowns, number of free motions).
    touching, rubbing
        Numbers of the nodes that may touch, shape (k,), and of those with friction, (r,).
    normals, tangents
        Numbers of their unknowns, shapes (k,) and (r, d - 1); -1 where there is none.

    Raises
    ------
    NotConvexError
        If S has negative eigenvalues.
    ValueError
        If a gap that can close lies along a fixed component.
    """

    def __init__(
        self,
        stiffness: Array,
        normal: Array,
        tangent: Array,
        closing: Mask,
        rubbing: Mask,
        free: Mask,
    ) -> None:
        n, d = normal.shape
        self._basis, role = bases(normal, tangent, closing, free)
        acting = (role == 2) & closing[:, None] | (role == 1) & rubbing[:, None]
        left = (role >= 0) & ~acting
        self._turned = _turned(stiffness, self._basis)

        order = np.concatenate([np.flatnonzero(left), np.flatnonzero(acting)])
        size = self._turned[order, order]
        if not np.all(size > 0):
            raise NotConvexError("the stiffness has no positive diagonal")
        size = np.sqrt(size)
        factor = cholesky(self._ordered(order, size))
        self._split = int(np.count_nonzero(left))
        definite = factor is not None and _count_free(_lowest(factor)[0]) == 0
        if definite:
            assert factor is not None
            k = self._split
            corner = factor[k:, k:] * size[k:, None]
            self.matrix = corner @ corner.T
            self.motions = np.zeros((order.size - k, 0))
        else:
            self._split = k = 0
            self.motions = self._free_motions(order, size) * size[:, None]
            self.matrix = self._ordered(order, np.ones_like(size))
            factor = cholesky(self._ordered(order, size, self.motions))
            if factor is None:
                raise NotConvexError("the stiffness has negative eigenvalues")
            corner = factor * size[:, None]
        del self._turned
        self._order, self._size, self._factor = order, size, factor if k else None
        self.unit = float(np.max(np.diag(self.matrix), initial=0.0)) or 1.0
        self.matrix /= self.unit
        self.motions /= np.sqrt(self.unit)
        corner /= np.sqrt(self.unit)
        self.inverse = dtrtri(np.asfortranarray(corner), lower=1, overwrite_c=1)[0]
        self.flexibility = np.einsum("ij,ij->j", self.inverse, self.inverse)

        places = np.full(n * d, -1)
        places[order[k:]] = np.arange(order.size - k)
        number = places.reshape(n, d)
        self.touching = np.flatnonzero((acting & (role == 2)).any(axis=1))
        self.rubbing = np.flatnonzero((acting & (role == 1)).any(axis=1))
        self.normals = number[self.touching, 0]
        self.tangents = np.where(acting, number, -1)[self.rubbing, 1:]

    def load(self, load: Array) -> Array:
        """Return b (force), shape (unknowns,), of a load f on all unknowns, shape (n, d)."""
        turned = np.einsum("nia,ni->na", self._basis, load).ravel()[self._order]
        self._passed = turned
        if self._factor is None:
            return turned
        passed = solve_triangular(self._factor, turned / self._size, lower=True)
        k = self._split
        self._passed = passed
        return self._size[k:] * (self._factor[k:, k:] @ passed[k:])

    def acting(self, displacement: Array) -> Array:
        """Return the kept x of all displacements, shape (n, d)."""
        turned = np.einsum("nia,ni->na", self._basis, displacement).ravel()[self._order]
        return np.asarray(turned[self._split :])

    def expand(self, x: Array) -> Array:
        """Return all displacements under the load last given, shape (n, d), from the kept x."""
        n, d = self._basis.shape[:2]
        turned, k = np.zeros(n * d), self._split
        turned[self._order[k:]] = x
        if self._factor is not None:
            rest = self._passed[:k] - self._factor[k:, :k].T @ (self._size[k:] * x)
            inner = solve_triangular(self._factor[:k, :k], rest, lower=True, trans=1)
            turned[self._order[:k]] = inner / self._size[:k]
        return np.einsum("nia,na->ni", self._basis, turned.reshape(n, d))

    def tangential(self, values: Array) -> Array:
        """Return vectors (r, d) at the nodes with friction from their components (r, d - 1)."""
        return np.einsum("nia,na->ni", self._basis[self.rubbing][:, :, 1:], values)

    def _ordered(self, order: Array, size: Array, motions: Array | None = None) -> Array:
        """Return the turned matrix in an order, over sizes of its rows, plus free motions."""
        matrix = np.asfortranarray(self._turned[np.ix_(order, order)])
        if motions is not None:
            matrix += motions @ motions.T
        matrix /= size[:, None]
        matrix /= size
        return matrix

    def _free_motions(self, order: Array, size: Array) -> Array:
        for shift in (1e-13, 1e-12, 1e-11):
            matrix = self._ordered(order, size)
            matrix[np.diag_indices_from(matrix)] += shift
            factor = cholesky(matrix)
            if factor is not None:
                values, vectors = _lowest(factor, 12)
                return vectors[:, : _count_free(values - shift)]
        raise NotConvexError("the stiffness has negative eigenvalues")


def bases(normal: Array, tangent: Array, closing: Mask, free: Mask) -> tuple[Array, NDArray]:
    """Return nodal bases: normal, tangents, and what is left or fixed (roles 2, 1, 0, -1)."""
    admissible = normal * free
    lost = np.abs(np.linalg.norm(admissible, axis=1) - 1) > 1e-6
    if np.any(lost & closing):
        raise ValueError("a gap that can close lies along a fixed component")
    admissible[lost] = 0.0
    d = normal.shape[1]
    tangent = tangent * free[:, :, None] * free[:, None, :]
    form = 2 * admissible[:, :, None] * admissible[:, None, :] + (tangent + tangent.mT) / 2
    form[:, np.arange(d), np.arange(d)] -= ~free
    values, basis = np.linalg.eigh(form)
    values, basis = values[:, ::-1], basis[:, :, ::-1].copy()
    # tangents stand behind the place of the normal
    values[lost], basis[lost] = np.roll(values[lost], 1, 1), np.roll(basis[lost], 1, 2)
    basis[~lost, :, 0] = admissible[~lost]
    return basis, np.rint(values).astype(int)


def _turned(stiffness: Array, basis: Array) -> Array:
    """Return Q'SQ with the nodal bases in Q."""
    n, d = basis.shape[:2]
    m, result = n * d, stiffness
    for _ in range(2):  # rows, transposed, and rows again
        blocks, turned = result.reshape(n, d, m), np.empty((n, d, m))
        for a in range(d):
            np.multiply(basis[:, 0, a, None], blocks[:, 0], out=turned[:, a])
            for i in range(1, d):
                turned[:, a] += basis[:, i, a, None] * blocks[:, i]
        result = turned.reshape(m, m).T
    return result


def _count_free(values: Array) -> int:
    """Return how many of the lowest eigenvalues, in rising order, are those of free motions."""
    following = np.append(values[1:], 1.0)
    free = np.flatnonzero((values < NULL) & (following > JUMP * np.maximum(values, EPS)))
    return int(free[-1]) + 1 if free.size else 0


def _lowest(factor: Array, sweeps: int = 4) -> tuple[Array, Array]:
    """Return the lowest eigenvalues of L L' and their vectors, by inverse iteration."""
    m = factor.shape[0]
    vectors = np.random.default_rng(0).standard_normal((m, min(MOTIONS, m)))
    for _ in range(sweeps):
        vectors = np.linalg.qr(vectors)[0]
        vectors = solve_triangular(factor, vectors, lower=True)
        vectors = solve_triangular(factor, vectors, lower=True, trans=1)
    vectors = np.linalg.qr(vectors)[0]
    passed = factor.T @ vectors
    values, turn = np.linalg.eigh(passed.T @ passed)
    return values, vectors @ turn


def without_potential(
    stiffness: Array, load: Array, free: Mask
) -> tuple[Array, Array, Callable[[Array], Array]]:
    """Eliminate the potentials of a piezoelectric body from its condensed matrix.

    S = [[K, G'], [G, -B]] with B definite becomes K + G' B^-1 G, which is at least as definite
    as K: a body held by its supports is stiffer with the charge that it makes.

    Parameters
    ----------
    stiffness
        Symmetric matrix, d displacements and the scaled potential a node, shape (n (d + 1),) * 2.
    load
        Forces and (scaled) charges, shape (n (d + 1),).
    free
        Unknowns that are not fixed, shape (n, d + 1): the rows of the others are identity.

    Returns
    -------
    The mechanical matrix, (n d, n d), and load, (n d,), and a function that completes nodal
    displacements, shape (n, d), by the potentials, shape (n, d + 1).

    Raises
    ------
    NotConvexError
        If nothing determines the potential, so that B is singular.
    """
    n, size = free.shape
    potential = np.zeros((n, size), dtype=bool)
    potential[:, -1] = True
    electric = np.flatnonzero(potential & free)
    mechanical = np.flatnonzero(~potential)
    factor = cholesky(np.asfortranarray(-stiffness[np.ix_(electric, electric)]))
    if factor is None or (electric.size and np.diag(factor).min() < 1e-7 * np.diag(factor).max()):
        raise NotConvexError("nothing determines the potential: no part has a given one")
    coupling = solve_triangular(factor, stiffness[np.ix_(electric, mechanical)], lower=True)
    charge = solve_triangular(factor, load[electric], lower=True)

    def complete(displacement: Array) -> Array:
        whole = np.where(free, 0.0, load.reshape(n, size))
        whole[:, :-1] = displacement
        inner = coupling @ displacement.ravel() - charge
        whole.ravel()[electric] = solve_triangular(factor, inner, lower=True, trans=1)
        return whole

    condensed = stiffness[np.ix_(mechanical, mechanical)] + coupling.T @ coupling
    return condensed, load[mechanical] + coupling.T @ charge, complete
