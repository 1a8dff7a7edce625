"""Jumps between bodies: contact nodes that look at nodes of another body, on whatever rank."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from dolfinx.common import IndexMap
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import sparse

from contact.errors import InputError
from contact.interface.mortar.coupling import Coupling
from contact.linear.change import Change
from contact.typing import Array


@dataclass(frozen=True)
class Links:
    """The jumps at the contact nodes between bodies, as sums over nodes of both.

    Attributes
    ----------
    comm
        Communicator.
    jumps
        The jumps of all ranks by the values of the nodes that take part, shape (r, c).
    change
        The change of unknowns that makes them unknowns.
    places
        Where such nodes are among the contact nodes of this rank, shape (k,).
    own
        Their rows, shape (k,).
    here, local
        Which of the nodes that take part this rank owns, and their local numbers, shape (h,).
    """

    comm: MPI.Intracomm
    jumps: sparse.csr_array
    change: Change
    places: NDArray[np.intp]
    own: NDArray[np.intp]
    here: NDArray[np.intp]
    local: NDArray[np.int32]

    @cached_property
    def _here(self) -> sparse.csr_array:
        """The jumps of this rank's contact nodes."""
        return self.jumps[self.own]

    def apply(self, x: Array) -> Array:
        """Return the jumps at `places` of local unknowns, (nodes, block size). Collective."""
        values = np.zeros((self.change.nodes.size, x.shape[1]))
        values[self.here] = x[self.local]
        self.comm.Allreduce(MPI.IN_PLACE, values, op=MPI.SUM)
        return np.asarray(self._here @ values)

    def transpose(self, nodal: Array, into: Array) -> None:
        """Add what vectors at `places` are to owned nodes, (nodes, k). Collective."""
        forces = np.asarray(self._here.T @ nodal)
        self.comm.Allreduce(MPI.IN_PLACE, forces, op=MPI.SUM)
        into[self.local] += forces[self.here]


def make_links(
    comm: MPI.Intracomm,
    index_map: IndexMap,
    couplings: Sequence[Coupling],
    nodes: NDArray[np.int32],
    free: NDArray[np.bool_],
) -> Links | None:
    """Return the links of all pairs of bodies; None where there are none. Collective.

    Parameters
    ----------
    comm, index_map
        Communicator, and the nodes of the mesh.
    couplings
        The mortar operators of the pairs.
    nodes
        Local numbers of the contact nodes of this rank.
    free
        Which unknowns of the owned nodes are not fixed, shape (nodes, block size).

    Raises
    ------
    InputError
        If a node is a slave and a master.
    """
    if not couplings:
        return None
    slaves = np.concatenate([coupling.nodes for coupling in couplings])
    masters = np.concatenate([coupling.masters for coupling in couplings])
    if np.intersect1d(slaves, masters).size:
        raise InputError(
            "contact.against: a node is on the slave side of one contact and on the other side of "
            "one; accepted: parts `on` that share no nodes with parts `against`"
        )
    every = np.unique(np.concatenate([masters, *(coupling.slaves for coupling in couplings)]))
    jumps = sparse.vstack([_over(coupling, every) for coupling in couplings], format="csr")
    begin, end = index_map.local_range
    here = np.flatnonzero((every >= begin) & (every < end))
    local = (every[here] - begin).astype(np.int32)
    flags = np.zeros((every.size, free.shape[1]), dtype=np.intc)
    flags[here] = free[local]
    comm.Allreduce(MPI.IN_PLACE, flags, op=MPI.SUM)
    change = Change.of(every, np.searchsorted(every, slaves), jumps, flags > 0)
    order = np.argsort(slaves)
    numbers = nodes.astype(np.int64) + begin
    found = np.searchsorted(slaves, numbers, sorter=order)
    rows = order[np.minimum(found, slaves.size - 1)]
    places = np.flatnonzero(slaves[rows] == numbers)
    return Links(comm, jumps, change, places, rows[places], here, local)


def _over(coupling: Coupling, every: NDArray[np.int64]) -> sparse.csr_array:
    """Return a pair's jumps by the values of the nodes of all pairs."""
    count = coupling.nodes.size
    total = sparse.csr_array((count, every.size))
    for sign, numbers, part in (
        (1.0, coupling.slaves, coupling.own),
        (-1.0, coupling.masters, coupling.other),
    ):
        entries = part.tocoo()
        columns = np.searchsorted(every, numbers)[entries.col]
        total = total + sparse.csr_array(
            (sign * entries.data, (entries.row, columns)), shape=total.shape
        )
    return sparse.csr_array(total)
