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

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import sparse

from contact.interface.mortar.basis import positive_change
from contact.interface.mortar.integration import LEAST_PIECE, NOTHING, Heirs, Parts, integrate
from contact.interface.mortar.lumping import coefficients
from contact.interface.mortar.surface import Surface
from contact.typing import Array

#: Nodes less than this share of whose function faces the master carry no multiplier.
LEAST_COVERED = 1e-3


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
    apart
        What it would be if the sides did not cut each other, shape (n,). It may be negative too:
        means are taken with functions that change their sign.
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
    apart: Array
    covered: Array
    slaves: NDArray[np.int64]
    own: sparse.csr_array
    masters: NDArray[np.int64]
    other: sparse.csr_array


def couple(
    slave: Surface,
    master: Surface,
    reach: float,
    comm: MPI.Intracomm = MPI.COMM_SELF,
    without: NDArray[np.int64] = NOTHING,
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
        nodes of their facets, or to the nearest node where these have none, so that the multipliers
        still contain the constants.
    """
    parts = integrate(slave, master, reach, Heirs.of(slave, without, comm)).gathered(comm)
    return _assembled(parts, slave.corners.shape[1], slave.degree, without)


def _assembled(parts: Parts, d: int, degree: int, without: NDArray[np.int64]) -> Coupling:
    every, place = np.unique(parts.nodes, return_inverse=True)
    place = place.reshape(parts.nodes.shape)
    heir = np.searchsorted(every, parts.heirs)

    def summed(values: Array) -> Array:
        total = np.zeros((every.size, *values.shape[2:]))
        np.add.at(total, heir, values)
        return total

    weight, whole = summed(parts.own.sum(axis=2)), summed(parts.whole)
    # The integral of a quadratic function on the axis of revolution is rounding.
    around = summed(np.broadcast_to(parts.whole.sum(axis=1, keepdims=True), place.shape))
    some = whole > LEAST_PIECE * around
    covered = np.where(some, weight / np.where(some, whole, 1.0), 0.0)
    kept = np.flatnonzero((covered > LEAST_COVERED) & ~np.isin(every, without))
    normal = summed(parts.normal)[kept]
    normal = normal / np.linalg.norm(normal, axis=1)[:, None]
    gap, apart = np.einsum("nsd,nd->sn", summed(parts.gap)[kept], normal) / weight[kept]
    masters, columns = np.unique(parts.columns, return_inverse=True)
    rows = np.searchsorted(every, parts.rows)
    other = sparse.csr_array((parts.values, (rows, columns)), shape=(every.size, masters.size))
    divide = sparse.diags_array(1 / weight[kept])
    rows, columns = np.broadcast_arrays(heir[:, :, None], place[:, None, :])
    places = (rows.ravel(), columns.ravel())
    dual = sparse.csr_array((parts.own.ravel(), places), shape=(every.size, every.size))[kept]
    own = divide @ dual @ coefficients(place, every.size, positive_change(d, degree))
    own.eliminate_zeros()
    return Coupling(
        every[kept],
        weight[kept],
        normal,
        gap,
        apart,
        covered[kept],
        every,
        sparse.csr_array(own),
        masters,
        sparse.csr_array(divide @ other[kept]),
    )
