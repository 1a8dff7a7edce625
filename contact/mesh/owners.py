"""Owners of nodes by their global numbers, and values at nodes of other ranks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import la
from dolfinx.common import IndexMap
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import sparse

from contact._compat import ghosted_map
from contact.ranks import exchanged
from contact.typing import Array

#: Global numbers of nodes.
Numbers = NDArray[np.int64]


@dataclass(frozen=True)
class Owners:
    """Owners of nodes, whose global numbers are contiguous on each rank."""

    comm: MPI.Intracomm
    begins: Numbers  #: the first number of each rank, and the number of all nodes, (ranks + 1,)

    @staticmethod
    def of(index_map: IndexMap, comm: MPI.Intracomm) -> Owners:
        """Return the owners of the nodes of a space. Collective."""
        begins = np.empty(comm.size, dtype=np.int64)
        comm.Allgather(np.array([index_map.local_range[0]], dtype=np.int64), begins)
        return Owners(comm, np.append(begins, index_map.size_global))

    @property
    def begin(self) -> int:
        """The first number of this rank."""
        return int(self.begins[self.comm.rank])

    def ranks(self, numbers: Numbers) -> NDArray[np.intp]:
        """Return the owner of each node."""
        return np.searchsorted(self.begins[1:], numbers, side="right")

    def values(self, numbers: Numbers, of: Callable[[Numbers], NDArray[Any]]) -> NDArray[Any]:
        """Return values at any nodes, (n, ...); `of` returns those of own ones. Collective."""
        asked, place = np.unique(numbers, return_inverse=True)
        ranks, given = exchanged(self.comm, self.ranks(asked), asked)
        return exchanged(self.comm, ranks, of(given))[1][place]

    def requested(self, numbers: Numbers) -> Numbers:
        """Return the nodes of this rank that any rank requests, ascending. Collective."""
        asked = np.unique(numbers)
        return np.unique(exchanged(self.comm, self.ranks(asked), asked)[1])

    def among(self, own: Numbers, numbers: Numbers) -> Numbers:
        """Return own nodes of a set, and others of it among `numbers`, ascending. Collective."""
        inside = self.values(numbers, lambda given: np.isin(given, own))
        return np.unique(np.concatenate([own, numbers[inside]]))

    def sums(self, numbers: Numbers, values: Array) -> tuple[Numbers, Array]:
        """Return the nodes of this rank with contributions, (n, k), and their sums. Collective."""
        asked, totals = _summed(numbers, values)
        _, given, parts = exchanged(self.comm, self.ranks(asked), asked, totals)
        return _summed(given, parts)

    def entries(
        self, rows: Numbers, columns: Numbers, values: Array
    ) -> tuple[Numbers, Numbers, Array]:
        """Return the entries, not summed, of a matrix in the rows of this rank. Collective."""
        return exchanged(self.comm, self.ranks(rows), rows, columns, values)[1:]  # type: ignore[return-value]


def _summed(numbers: Numbers, values: Array) -> tuple[Numbers, Array]:
    found, place = np.unique(numbers, return_inverse=True)
    total = np.zeros((found.size, values.shape[1]))
    np.add.at(total, place, values)
    return found, total


#: Owners on one rank alone.
ALONE = Owners(MPI.COMM_SELF, np.array([0, np.iinfo(np.int64).max]))


class Halo:
    """Values at the `count` nodes of this rank, and then at its ghosts. Collective.

    `numbers` are those of nodes, of this or other ranks, whose values are needed here.
    """

    def __init__(self, owners: Owners, count: int, numbers: Numbers) -> None:
        self._owners, self.count = owners, count
        ranks = owners.ranks(numbers)
        self._ghosts, first = np.unique(numbers[ranks != owners.comm.rank], return_index=True)
        of = ranks[ranks != owners.comm.rank][first].astype(np.int32)
        self._map = ghosted_map(owners.comm, count, self._ghosts, of)
        self._vectors: dict[int, la.Vector] = {}

    @property
    def begin(self) -> int:
        """The global number of the first node of this rank."""
        return self._owners.begin

    @property
    def numbers(self) -> Numbers:
        """The global numbers of the nodes and ghosts."""
        own = np.arange(self.begin, self.begin + self.count)
        return np.concatenate([own, self._ghosts])

    def places(self, numbers: Numbers) -> NDArray[np.intp]:
        """Return the places of nodes among these."""
        own = self._owners.ranks(numbers) == self._owners.comm.rank
        ghost = self.count + np.searchsorted(self._ghosts, numbers)
        return np.where(own, numbers - self.begin, ghost)

    def _vector(self, size: int) -> la.Vector:
        if size not in self._vectors:
            self._vectors[size] = la.vector(self._map, size)
        return self._vectors[size]

    def forward(self, values: Array) -> Array:
        """Update the ghosts of own values; return all, shape (nodes, k). Collective."""
        vector = self._vector(values.shape[1])
        vector.array[: values.size] = values.ravel()
        vector.scatter_forward()
        return vector.array.reshape(-1, values.shape[1]).copy()

    def reverse(self, values: Array) -> Array:
        """Add values at ghosts to those of their owners; return these, (count, k). Collective."""
        vector = self._vector(values.shape[1])
        vector.array[:] = values.ravel()
        vector.scatter_reverse(la.InsertMode.add)
        return vector.array[: self.count * values.shape[1]].reshape(-1, values.shape[1]).copy()


def sparse_rows(
    rows: Numbers, entries: tuple[Numbers, Numbers, Array]
) -> tuple[Numbers, sparse.csr_array]:
    """Return the ascending columns, (m,), and the matrix, (n, m), of entries in ascending rows.

    Entries are rows, columns and values, summed at each place; those of other rows are left out.
    """
    row = np.searchsorted(rows, entries[0])
    inside = row < rows.size
    inside[inside] = rows[row[inside]] == entries[0][inside]
    inside &= entries[2] != 0
    columns, column = np.unique(entries[1][inside], return_inverse=True)
    made = sparse.csr_array(
        (entries[2][inside], (row[inside], column)), shape=(rows.size, columns.size)
    )
    return columns, made
