"""The dual mortar operator of two surfaces: jump, weights, normals and gaps at the slave nodes.

The multiplier is sum_j lambda_j Phi_j with functions Phi_j that are dual to the slave's,
int Phi_j N~_k = delta_jk int N~_k over what of the slave faces the master. The jump at the slave
node j is then

    j_j = (S u)_j - sum_l P_jl u_l,     P_jl = int Phi_j (N_l o Pi) / int N~_j,

S being the identity, but for quadratic triangles, where N~ = A N (`basis.positive_change`) and S
is made of the inverse of A^T. Constants pass: rows of S and of P have the sum 1.

References
----------
Wohlmuth, SIAM J. Numer. Anal. 38 (2000) 989 (dual basis); Popp, Gitterle, Gee and Wall, Int. J.
Numer. Methods Engrg. 83 (2010) 1428 (segments in space); Cichosz and Bischoff, Comput. Methods
Appl. Mech. Engrg. 200 (2011) 1317 (partly covered facets).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import sparse

from contact.interface.mortar.basis import basis, positive_change
from contact.interface.mortar.candidates import facing_pairs
from contact.interface.mortar.lumping import coefficients, integrals
from contact.interface.mortar.pieces import Points, common_points
from contact.interface.mortar.surface import Surface
from contact.typing import Array

#: Nodes less than this share of whose function faces the master carry no multiplier.
LEAST_COVERED = 1e-3

#: Directions that differ less than this from the normals are these.
FLAT = 1e-12

#: No nodes.
NOBODY: NDArray[np.int64] = np.zeros(0, dtype=np.int64)

#: Facets less than this share of which faces the master are left out: rounding.
LEAST_PIECE = 1e-9


@dataclass(frozen=True)
class Coupling:
    """The jump of two surfaces at the slave nodes that carry a multiplier.

    Rows are slave nodes in ascending order of their global numbers; the same on all ranks.

    Attributes
    ----------
    nodes
        Global numbers of the slave nodes, shape (n,).
    weight
        int Phi_j over what faces the master, int N~_j, shape (n,) (length^(d - 1)).
    normal
        Unit vectors from the slave to the master, between their normals, shape (n, d).
    gap
        Mean distance along them, shape (n,) (length).
    covered
        Share of int N~_j that faces the master, shape (n,).
    slaves
        Global numbers of all nodes of slave facets that face the master, shape (s,).
    own
        S, shape (n, s).
    masters
        Global numbers of the master nodes, shape (m,).
    other
        P, shape (n, m).
    """

    nodes: NDArray[np.int64]
    weight: Array
    normal: Array
    gap: Array
    covered: Array
    slaves: NDArray[np.int64]
    own: sparse.csr_array
    masters: NDArray[np.int64]
    other: sparse.csr_array


@dataclass(frozen=True)
class _Parts:
    """What the facets of one rank add, by slave facet and node: before it is summed up."""

    nodes: NDArray[np.int64]
    own: Array
    whole: Array
    normal: Array
    gap: Array
    rows: NDArray[np.int64]
    masters: NDArray[np.int64]
    values: Array

    def gathered(self, comm: MPI.Intracomm) -> _Parts:
        arrays = (np.concatenate(comm.allgather(array)) for array in vars(self).values())
        return _Parts(*arrays)


def couple(
    slave: Surface,
    master: Surface,
    reach: float,
    comm: MPI.Intracomm = MPI.COMM_SELF,
    without: NDArray[np.int64] = NOBODY,
) -> Coupling:
    """Integrate the dual mortar operator. Collective.

    Parameters
    ----------
    slave
        The slave facets that this rank owns.
    master
        All master facets.
    reach
        Largest distance at which facets face each other (length).
    comm
        Communicator.
    without
        Global numbers of slave nodes that carry no multiplier: their functions go to the other
        nodes of their facets, so that the multipliers still contain the constants.
    """
    own = _integrate(slave, master, reach, without).gathered(comm)
    return _assembled(own, slave.corners.shape[1], slave.degree, without)


def _integrate(slave: Surface, master: Surface, reach: float, without: NDArray[np.int64]) -> _Parts:
    degree = 2 if slave.degree == master.degree == 1 and not slave.revolved else 4
    pairs = list(facing_pairs(slave, master, reach))
    direction = slave.normal
    found = [common_points(slave, master, pair, direction, degree) for pair in pairs]
    middle = _middle(slave, master, found)
    if np.abs(middle - direction).max(initial=0.0) > FLAT:
        direction = middle
        found = [common_points(slave, master, pair, direction, degree) for pair in pairs]
    d = slave.corners.shape[1]
    change = positive_change(d, slave.degree)
    k = change.shape[0]
    # The dual functions of each facet, Phi = C N~: first what C is made of.
    mass, weight = np.zeros((slave.count, k, k)), np.zeros((slave.count, k))
    for points in found:
        n = basis(points.on_slave, slave.degree) @ change.T
        _add(mass, points.slave, points.weight[:, None, None] * n[:, :, None] * n[:, None, :])
        _add(weight, points.slave, points.weight[:, None] * n)
    faces = np.flatnonzero(weight.sum(axis=1) > LEAST_PIECE * integrals(slave).sum(axis=1))
    dual: Array = np.zeros_like(mass)
    dual[faces] = weight[faces, :, None] * np.linalg.inv(mass[faces])
    weight[np.setdiff1d(np.arange(slave.count), faces)] = 0.0
    handed = _handed_over(np.isin(slave.nodes, without))
    dual = handed @ dual
    own = handed * weight[:, None, :]
    total = own.sum(axis=2)
    gap = np.zeros((slave.count, k))
    entries = []
    for points in found:
        phi = np.einsum(
            "pij,pj->pi", dual[points.slave], basis(points.on_slave, slave.degree) @ change.T
        )
        phi *= points.weight[:, None]
        _add(gap, points.slave, phi * points.gap[:, None])
        entries.append(_master_entries(points, phi, slave, master))
    rows, masters, values = (
        (np.concatenate(part) for part in zip(*entries, strict=True))
        if entries
        else (np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0))
    )
    whole = np.einsum("fij,fj->fi", handed, integrals(slave))
    return _Parts(
        slave.nodes,
        own,
        whole,
        total[:, :, None] * direction[:, None, :],
        gap[:, :, None] * direction[:, None, :],
        rows,
        masters,
        values,
    )


def _middle(slave: Surface, master: Surface, found: Sequence[Points]) -> Array:
    """Return directions between the normals of slave facets and of what they face, shape (f, d).

    Along them two curved sides see each other alike, whichever of them is the slave: the normals
    of one alone would turn some of the closing of the gap into slip.
    """
    total = np.zeros_like(slave.normal)
    for points in found:
        _add(total, points.slave, points.weight[:, None] * master.normal[points.master])
    length = np.linalg.norm(total, axis=1)
    mean = total / np.where(length > 0, length, 1.0)[:, None]
    direction = slave.normal - mean
    return np.asarray(direction / np.linalg.norm(direction, axis=1)[:, None])


def _handed_over(gone: NDArray[np.bool_]) -> Array:
    """Return what the functions of facets become where some give theirs away, shape (f, k, k)."""
    kept = ~gone
    heirs = kept / np.maximum(kept.sum(axis=1, keepdims=True), 1)
    given = heirs[:, :, None] * gone[:, None, :]
    return np.asarray(given + kept[:, :, None] * np.eye(gone.shape[1]))


def _add(total: Array, index: NDArray[np.intp], values: Array) -> None:
    """Add values to rows of an array; several values may go to one row."""
    count, columns = total.shape[0], int(np.prod(total.shape[1:]))
    matrix = sparse.csr_array(
        (np.ones(index.size), (index, np.arange(index.size))), shape=(count, index.size)
    )
    total += (matrix @ values.reshape(index.size, columns)).reshape(total.shape)


def _master_entries(
    points: Points, phi: Array, slave: Surface, master: Surface
) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Return int Phi_j N_l as global row, global column, value."""
    n = basis(points.on_master, master.degree)
    new = np.ones(points.slave.size, dtype=bool)
    new[1:] = (np.diff(points.slave) != 0) | (np.diff(points.master) != 0)
    first = np.flatnonzero(new)
    if first.size == 0:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64), np.zeros(0)
    values = np.add.reduceat(phi[:, :, None] * n[:, None, :], first, axis=0)
    rows = slave.nodes[points.slave[first]][:, :, None]
    columns = master.nodes[points.master[first]][:, None, :]
    rows, columns = np.broadcast_arrays(rows, columns)
    return rows.ravel(), columns.ravel(), values.ravel()


def _assembled(parts: _Parts, d: int, degree: int, without: NDArray[np.int64]) -> Coupling:
    every, place = np.unique(parts.nodes, return_inverse=True)
    place = place.reshape(parts.nodes.shape)

    def summed(values: Array) -> Array:
        total = np.zeros((every.size, *values.shape[2:]))
        np.add.at(total, place, values)
        return total

    weight, whole = summed(parts.own.sum(axis=2)), summed(parts.whole)
    # The integral of a quadratic function on the axis of revolution is rounding.
    around = summed(np.broadcast_to(parts.whole.sum(axis=1, keepdims=True), place.shape))
    some = whole > LEAST_PIECE * around
    covered = np.where(some, weight / np.where(some, whole, 1.0), 0.0)
    kept = np.flatnonzero((covered > LEAST_COVERED) & ~np.isin(every, without))
    normal = summed(parts.normal)[kept]
    normal = normal / np.linalg.norm(normal, axis=1)[:, None]
    mean = summed(parts.gap)[kept] / weight[kept, None]
    masters, columns = np.unique(parts.masters, return_inverse=True)
    rows = np.searchsorted(every, parts.rows)
    other = sparse.csr_array((parts.values, (rows, columns)), shape=(every.size, masters.size))
    divide = sparse.diags_array(1 / weight[kept])
    rows, columns = np.broadcast_arrays(place[:, :, None], place[:, None, :])
    places = (rows.ravel(), columns.ravel())
    dual = sparse.csr_array((parts.own.ravel(), places), shape=(every.size, every.size))[kept]
    own = divide @ dual @ coefficients(place, every.size, positive_change(d, degree))
    own.eliminate_zeros()
    return Coupling(
        every[kept],
        weight[kept],
        normal,
        np.einsum("nd,nd->n", mean, normal),
        covered[kept],
        every,
        sparse.csr_array(own),
        masters,
        sparse.csr_array(divide @ other[kept]),
    )
