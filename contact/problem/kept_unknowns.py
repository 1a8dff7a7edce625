"""The unknowns that are kept of a condensed body, in jumps and others.

Kept are contact nodes and the nodes that their jumps are made of: those opposite, or of the same
quadratic facets. In jumps and other unknowns, x = Q y, the Schur complement S becomes Q^T S Q; the
others are eliminated (`contact.problem.condensed_masters`), and what is left is of the size of one
body's contact nodes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from contact.body.equilibrium import BodyEquilibrium
from contact.interface.interface import Interface
from contact.linear.change import Change
from contact.mesh.entities import owned_among
from contact.typing import Array


class KeptUnknowns:
    """The kept unknowns of a body; collective.

    Parameters
    ----------
    body, interface
        The body and its interface.

    Attributes
    ----------
    unknowns
        Kept unknowns that this rank owns, local numbers: those of coupled nodes first.
    offset
        Where the coupled unknowns of this rank begin among those of all ranks.
    jumps, others
        Which of the changed unknowns of all ranks are coupled, and which are free besides.
    """

    def __init__(self, body: BodyEquilibrium, interface: Interface) -> None:
        layout, comm, change = body.layout, body.comm, interface.change
        nodes = coupled = interface.coupled
        if change is not None:
            _, here = owned_among(layout.index_map, change.nodes)
            nodes = np.concatenate([coupled, np.setdiff1d(here, coupled)])
        size = layout.block_size
        own = np.arange(size, dtype=np.int32)
        self.unknowns: NDArray[np.int32] = (nodes[:, None] * np.int32(size) + own).ravel()
        self.offset = size * sum(comm.allgather(coupled.size)[: comm.rank])
        is_jump = np.arange(nodes.size) < coupled.size
        jumps = np.repeat(np.concatenate(comm.allgather(is_jump)), size)
        free = np.concatenate(comm.allgather(layout.free[nodes])).ravel()
        self.jumps, self.others = np.flatnonzero(jumps), np.flatnonzero(~jumps & free)
        numbers = np.concatenate(comm.allgather(layout.index_map.local_to_global(nodes)))
        self._change = None if change is None else _among(change, numbers, size)

    def stiffness(self, against_kept: Array) -> Array:
        """Return Q^T S Q of a symmetric stiffness S."""
        if self._change is None:
            return against_kept
        return np.asarray(self._change.T @ (self._change.T @ against_kept).T)

    def forces(self, on_kept: Array) -> Array:
        """Return Q^T f."""
        return on_kept if self._change is None else np.asarray(self._change.T @ on_kept)

    def values(self, jumps: Array, others: Array) -> Array:
        """Return Q y."""
        if self._change is None:
            return jumps
        changed = np.zeros(self._change.shape[0])
        changed[self.jumps], changed[self.others] = jumps, others
        return np.asarray(self._change @ changed)


def _among(change: Change, numbers: NDArray[np.int64], size: int) -> sparse.csr_array:
    """Return Q at kept nodes, given their global numbers."""
    order = np.argsort(numbers)
    places = order[np.searchsorted(numbers, change.nodes, sorter=order)]
    rows = (places[:, None] * size + np.arange(size)).ravel()
    entries = change.matrix.tocoo()
    rest = np.setdiff1d(np.arange(numbers.size * size), rows)
    values = np.concatenate([entries.data, np.ones(rest.size)])
    where = [np.concatenate([rows[part], rest]) for part in (entries.row, entries.col)]
    shape = (numbers.size * size, numbers.size * size)
    return sparse.csr_array((values, (where[0], where[1])), shape=shape)


def at_kept_nodes(interface: Interface) -> Interface:
    """Return an interface whose nodes are numbered among the kept ones."""
    count = interface.jump.nodes.size
    positions = np.arange(interface.coupled.size, dtype=np.int32)
    held = interface.held
    if held is not None:
        held = replace(held, jump=replace(held.jump, nodes=positions[count:], links=None))
    return replace(
        interface,
        jump=replace(
            interface.jump, nodes=positions[:count], motion=None, carried=None, links=None
        ),
        held=held,
    )
