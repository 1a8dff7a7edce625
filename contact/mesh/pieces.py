"""Pieces of a mesh that are not connected: each of them has to be held by itself."""

from __future__ import annotations

import numpy as np
from dolfinx import fem, la
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from contact._compat import lasting


def connected_pieces(space: fem.FunctionSpace) -> tuple[NDArray[np.int32], int]:
    """Return the piece of each owned node, shape (n,), and the number of pieces. Collective.

    Nodes of one cell are in one piece. Meshes made of several regions fall apart where these do
    not share their nodes.
    """
    comm, index_map, cells = lasting(space.mesh.comm), space.dofmap.index_map, space.dofmap.list
    owned = index_map.size_local
    first = np.repeat(cells[:, 0], cells.shape[1] - 1)
    count, here = joined(first, cells[:, 1:].ravel(), owned + index_map.num_ghosts)
    here = here + comm.scan(count) - count
    total = comm.allreduce(count, op=MPI.SUM)
    # What a ghost is called here and what its owner calls it are one piece.
    names = la.vector(index_map)
    names.array[:] = here
    names.scatter_forward()
    there = names.array[owned:].astype(np.int64)
    pairs = np.unique(np.column_stack([here[owned:], there]), axis=0)
    both = np.concatenate(comm.allgather(pairs))
    pieces, labels = joined(both[:, 0], both[:, 1], total)
    return labels[here[:owned]], pieces


def sums(
    comm: MPI.Intracomm, piece: NDArray[np.integer], values: NDArray[np.float64], count: int
) -> NDArray[np.float64]:
    """Return the sums of the values of all ranks over each piece, shape (count,). Collective."""
    # Of no values at all numpy makes integers.
    own = np.bincount(piece, values, minlength=count).astype(np.float64)
    return np.asarray(comm.allreduce(own, op=MPI.SUM))


def joined(
    one: NDArray[np.integer], other: NDArray[np.integer], size: int
) -> tuple[int, NDArray[np.int32]]:
    """Return the number of components of a graph given by its edges, and that of each vertex."""
    graph = sparse.coo_array((np.ones(one.size, dtype=bool), (one, other)), shape=(size, size))
    count, labels = connected_components(graph, directed=False)
    return int(count), labels
