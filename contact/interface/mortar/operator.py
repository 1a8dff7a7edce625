"""The mortar coupling operator T: jumps that are sums over nodes, of any rank.

Between bodies (master nodes, and slave nodes without multiplier beside crosspoints); in front of a
rigid foundation on quadratic triangles, and beside the axis of revolution. Each rank has the rows
of its own contact nodes.
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
from contact.interface.mortar.lumping import JumpRows
from contact.linear.transformation import BasisChange
from contact.mesh.owners import Halo, Owners
from contact.typing import Array


@dataclass(frozen=True)
class CouplingOperator:
    """The operator from nodal values to the jumps at contact nodes that are no nodal values."""

    halo: Halo  #: the nodes of this rank and the ghosts in its rows
    jumps: sparse.csr_array  #: rows of this rank, shape (r, nodes)
    change: BasisChange  #: change of basis from nodal values to jumps
    numbers: NDArray[np.int64]  #: global numbers of the nodes of these rows, shape (r,)
    between: bool  #: whether there are masters
    local: NDArray[np.intp]  #: local numbers of the nodes in jumps of any rank, shape (h,)
    places: NDArray[np.intp]  #: positions of nodes of `jumps` among given nodes, (k,)
    rows: NDArray[np.intp]  #: rows of `jumps` at `places`, shape (k,)

    def at(self, numbers: NDArray[np.int64]) -> CouplingOperator:
        """Return the operator at other nodes of this rank, given their global numbers."""
        order = np.argsort(self.numbers)
        positions = np.searchsorted(self.numbers, numbers, sorter=order)
        places = np.flatnonzero(np.isin(numbers, self.numbers))
        return replace(self, places=places, rows=order[positions[places]])

    @cached_property
    def _rows_at_places(self) -> sparse.csr_array:
        """Rows at `places`."""
        return self.jumps[self.rows]

    def apply(self, x: Array) -> Array:
        """Return the jumps at `places` of local unknowns, (nodes, block size). Collective."""
        return np.asarray(self._rows_at_places @ self.halo.forward(x[: self.halo.count]))

    def transpose(self, vectors: Array, into: Array) -> None:
        """Add the transpose of vectors at `places` to owned nodes, (nodes, k). Collective."""
        into[: self.halo.count] += self.halo.reverse(np.asarray(self._rows_at_places.T @ vectors))


def coupling_operator(
    comm: MPI.Intracomm,
    index_map: IndexMap,
    jump_rows: Sequence[JumpRows],
    nodes: tuple[NDArray[np.int32], Array],
    free: NDArray[np.bool_],
) -> CouplingOperator | None:
    """Return the operator of jumps that are no nodal values; None without any. Collective.

    `nodes` are the local numbers of the contact nodes of this rank, shape (n,), and their unknowns
    by jumps, shape (n, block size, block size): the free components of those of all others. `free`
    is the mask of the unfixed unknowns of owned nodes, shape (nodes, block size). Refuses nodes of
    several contacts that follow each other in a circle.
    """
    if not jump_rows:
        return None
    owners = Owners.of(index_map, comm)
    columns = [np.concatenate([rows.slaves, rows.masters]) for rows in jump_rows]
    halo = Halo(owners, index_map.size_local, np.concatenate(columns))
    numbers = np.concatenate([rows.nodes for rows in jump_rows])
    blocks = []  # each contact's jumps by the values of the nodes of all contacts
    for rows, names in zip(jump_rows, columns, strict=True):
        block = sparse.hstack([rows.D, -rows.M], format="coo")
        at, shape = (block.row, halo.places(names)[block.col]), (rows.nodes.size, halo.numbers.size)
        blocks.append(sparse.csr_array((block.data, at), shape=shape))
    jumps = sparse.vstack(blocks, format="csr")
    replaced = halo.places(numbers)
    circle = _cyclic(comm, halo, replaced, jumps)
    if circle:
        raise InputError(
            f"contact.against: {circle} contact nodes follow, by way of the nodes opposite, "
            "themselves; accepted: contacts that form no circle, such as one of two that are each "
            "other's opposite",
            "contact-cycle",
        )
    taking = np.zeros((halo.numbers.size, 1))
    taking[jumps.indices] = 1.0
    local, unknowns = nodes
    named = index_map.local_to_global(local)
    order, by_jumps = np.argsort(named), np.eye(free.shape[1]) * free[replaced][:, None, :]
    of_contact = np.isin(numbers, named)
    place = np.searchsorted(named, numbers[of_contact], sorter=order)
    by_jumps[of_contact] = unknowns[order[place]]
    change = BasisChange.of(comm, halo, replaced, jumps, (by_jumps, free))
    none = np.zeros(0, dtype=np.intp)
    between = comm.allreduce(any(rows.masters.size for rows in jump_rows), op=MPI.LOR)
    taken = np.flatnonzero(halo.reverse(taking)[:, 0])
    operator = CouplingOperator(
        halo=halo,
        jumps=jumps,
        change=change,
        numbers=numbers,
        between=between,
        local=taken,
        places=none,
        rows=none,
    )
    return operator.at(named)


def _cyclic(
    comm: MPI.Intracomm, halo: Halo, replaced: NDArray[np.intp], jumps: sparse.csr_array
) -> int:
    """Return the number of replaced nodes in circles of nodes following each other. Collective."""
    # Remove nodes that follow no remaining node, then those that no remaining node follows.
    follows = sparse.coo_array(jumps)
    others = (replaced[follows.row] != follows.col) & (follows.data != 0)
    follows = sparse.csr_array(
        (np.ones(np.count_nonzero(others)), (follows.row[others], follows.col[others])),
        shape=jumps.shape,
    )
    remaining: Array = np.ones((replaced.size, 1))
    total = comm.allreduce(replaced.size, op=MPI.SUM)
    for leading in (False, True):
        while total:
            if leading:
                met = halo.reverse(follows.T @ remaining)[replaced]
            else:
                in_halo = np.zeros((halo.count, 1))
                in_halo[replaced] = remaining
                met = follows @ halo.forward(in_halo)
            remaining = remaining * (met > 0)
            before, total = total, comm.allreduce(int(remaining.sum()), op=MPI.SUM)
            if total == before:
                break
    return int(total)
