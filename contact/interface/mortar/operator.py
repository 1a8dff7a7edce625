"""The mortar coupling operator: jumps that are sums over nodes of both bodies, on whatever rank.

So are the jumps on quadratic triangles in front of a rigid foundation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from dolfinx.common import IndexMap
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import sparse

from contact.errors import InputError
from contact.interface.mortar.lumping import Mixing
from contact.linear.constraint import Change, cyclic_dependencies
from contact.mesh.entities import owned_among
from contact.typing import Array


@dataclass(frozen=True)
class CouplingOperator:
    """The operator from nodal values to the jumps at contact nodes that are no nodal values.

    Attributes
    ----------
    comm
        Communicator.
    jumps
        The jumps of all ranks by the values of the nodes that take part, shape (r, c).
    change
        The change of unknowns that makes them unknowns.
    numbers
        The global numbers of their nodes, shape (r,).
    between
        Whether other bodies take part.
    places
        Where such nodes are among some nodes of this rank, shape (k,).
    own
        Their rows, shape (k,).
    here, local
        Which of the nodes that take part this rank owns, and their local numbers, shape (h,).
    """

    comm: MPI.Intracomm
    jumps: sparse.csr_array
    change: Change
    numbers: NDArray[np.int64]
    between: bool
    places: NDArray[np.intp]
    own: NDArray[np.intp]
    here: NDArray[np.intp]
    local: NDArray[np.int32]

    def at(self, numbers: NDArray[np.int64]) -> CouplingOperator:
        """Return the operator at other nodes of this rank, given their global numbers."""
        order = np.argsort(self.numbers)
        found = np.searchsorted(self.numbers, numbers, sorter=order)
        rows = order[np.minimum(found, self.numbers.size - 1)]
        places = np.flatnonzero(self.numbers[rows] == numbers)
        return replace(self, places=places, own=rows[places])

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
        """Add the transpose of vectors at `places` to owned nodes, (nodes, k). Collective."""
        forces = np.asarray(self._here.T @ nodal)
        self.comm.Allreduce(MPI.IN_PLACE, forces, op=MPI.SUM)
        into[self.local] += forces[self.here]


def coupling_operator(
    comm: MPI.Intracomm,
    index_map: IndexMap,
    given: Sequence[Mixing],
    nodes: NDArray[np.int32],
    free: NDArray[np.bool_],
) -> CouplingOperator | None:
    """Return the operator of all contacts; None where there are none. Collective.

    Parameters
    ----------
    comm, index_map
        Communicator, and the nodes of the mesh.
    given
        The jumps that are no nodal values.
    nodes
        Local numbers of the contact nodes of this rank.
    free
        Which unknowns of the owned nodes are not fixed, shape (nodes, block size).

    Raises
    ------
    InputError
        If nodes of several contacts follow each other in a circle.
    """
    if not given:
        return None
    slaves = np.concatenate([rows.nodes for rows in given])
    masters = np.concatenate([rows.masters for rows in given])
    every = np.unique(np.concatenate([masters, *(rows.slaves for rows in given)]))
    jumps = sparse.vstack([_over(rows, every) for rows in given], format="csr")
    replaced = np.searchsorted(every, slaves)
    circle = cyclic_dependencies(replaced, jumps)
    if circle.size:
        raise InputError(
            f"contact.against: {circle.size} contact nodes follow, by way of the nodes opposite, "
            "themselves; accepted: contacts that form no circle, such as one of two that are each "
            "other's opposite"
        )
    here, local = owned_among(index_map, every)
    flags = np.zeros((every.size, free.shape[1]), dtype=np.intc)
    flags[here] = free[local]
    comm.Allreduce(MPI.IN_PLACE, flags, op=MPI.SUM)
    change = Change.of(every, replaced, jumps, flags > 0)
    none = np.zeros(0, dtype=np.intp)
    operator = CouplingOperator(
        comm, jumps, change, slaves, masters.size > 0, none, none, here, local
    )
    return operator.at(index_map.local_to_global(nodes))


def _over(rows: Mixing, every: NDArray[np.int64]) -> sparse.csr_array:
    """Return a contact's jumps by the values of the nodes of all contacts."""
    entries = sparse.hstack([rows.own, -rows.other], format="coo")
    columns = np.searchsorted(every, np.concatenate([rows.slaves, rows.masters]))
    return sparse.csr_array(
        (entries.data, (entries.row, columns[entries.col])), shape=(rows.nodes.size, every.size)
    )
