"""Bodies that touch each other, condensed: the other sides are eliminated with the bodies.

Kept are contact nodes and what is opposite of them. In jumps and other unknowns, x = Q y, the
Schur complement S becomes Q^T S Q, and of that what is opposite is eliminated exactly. What is
left is of the size of one body's contact nodes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import lu_factor, lu_solve

from contact.body.equilibrium import BodyEquilibrium
from contact.interface.interface import Interface
from contact.linear.change import Change
from contact.mesh.entities import owned_among
from contact.typing import Array


class CondensedPairs:
    """What is opposite of the contact nodes of a condensed body.

    Parameters
    ----------
    body, interface
        The body and its interface.
    change
        The change of unknowns.

    Attributes
    ----------
    nodes
        Owned nodes that are kept besides the coupled ones, local numbers.
    offset
        Where the coupled unknowns of this rank begin among those of all ranks.
    """

    def __init__(self, body: BodyEquilibrium, interface: Interface, change: Change) -> None:
        layout, comm = body.layout, body.comm
        _, here = owned_among(layout.index_map, change.nodes)
        coupled = interface.coupled
        self.nodes: NDArray[np.int32] = np.setdiff1d(here, coupled)
        self.offset = layout.block_size * sum(comm.allgather(coupled.size)[: comm.rank])
        kept = np.concatenate([coupled, self.nodes])
        is_jump = np.arange(kept.size) < coupled.size
        numbers = np.concatenate(comm.allgather(layout.index_map.local_to_global(kept)))
        jumps = np.repeat(np.concatenate(comm.allgather(is_jump)), layout.block_size)
        free = np.concatenate(comm.allgather(layout.free[kept])).ravel()
        self._change = _among(change, numbers, layout.block_size)
        self._jumps, self._others = np.flatnonzero(jumps), np.flatnonzero(~jumps & free)

    def eliminate(self, stiffness: Array) -> Array:
        """Return the stiffness against jumps, given that against kept unknowns."""
        change, jumps, others = self._change, self._jumps, self._others
        total = change.T @ (change.T @ stiffness).T
        self._coupling = total[np.ix_(others, jumps)]
        self._factors = lu_factor(total[np.ix_(others, others)], check_finite=False)
        self._follows = self._solve(self._coupling)
        return np.asarray(total[np.ix_(jumps, jumps)] - self._coupling.T @ self._follows)

    def _solve(self, values: Array) -> Array:
        return np.asarray(lu_solve(self._factors, values, check_finite=False))

    def forces(self, on_kept: Array) -> Array:
        """Return the forces on jumps, given those on kept unknowns."""
        changed = self._change.T @ on_kept
        self._rest = self._solve(changed[self._others])
        return np.asarray(changed[self._jumps] - self._coupling.T @ self._rest)

    def expand(self, jumps: Array) -> Array:
        """Return the increments of kept unknowns, given those of the jumps of all ranks."""
        changed = np.zeros(self._change.shape[0])
        changed[self._jumps] = jumps
        changed[self._others] = -self._rest - self._follows @ jumps
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
