"""The sizes of forces that are compared with each other, and with no others.

Forces and charges have no common unit. And what is connected by nothing has nothing in common:
beside the loads of another piece of the mesh any error of a piece may be small.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from contact.body.masters import Masters
from contact.linear.refinement import Pieces
from contact.mesh.domain import Domain
from contact.mesh.pieces import joined, sums
from contact.typing import Array


@dataclass(frozen=True)
class Shares:
    """The forces, and the charges, of each of k pieces.

    Pieces are one where something that moves freely joins them: a plate, a foundation, or an
    electrode. Those that touch each other are not: contact forces act on both.

    Attributes
    ----------
    comm
        Communicator.
    piece
        The piece of each owned node, shape (nodes,).
    behind
        That of each global unknown, shape (m,).
    count
        How many pieces there are.
    block_size, dim
        Unknowns a node, and how many of them are displacements.
    global_mechanical
        Which of the global unknowns are motions, shape (m,).
    """

    comm: MPI.Intracomm
    piece: NDArray[np.intp]
    behind: NDArray[np.intp]
    count: int
    block_size: int
    dim: int
    global_mechanical: NDArray[np.bool_]

    @property
    def mechanical(self) -> NDArray[np.bool_]:
        """Which of owned values, global ones behind them, are displacements or forces."""
        nodal = np.tile(np.arange(self.block_size) < self.dim, self.piece.size)
        return np.concatenate([nodal, self.global_mechanical])

    def at(self, nodes: NDArray[np.int32]) -> Shares:
        """Return those of some owned nodes alone."""
        none = np.zeros(0, dtype=np.intp)
        piece = self.piece[nodes]
        return Shares(
            self.comm, piece, none, self.count, self.block_size, self.dim, none.astype(bool)
        )

    @property
    def apart(self) -> Pieces | None:
        """The pieces of owned unknowns; None where there is one."""
        of = np.repeat(self.piece, self.block_size)
        return Pieces(self.comm, of, self.count) if self.count > 1 else None

    def sizes(self, values: Array) -> Array:
        """Return the Euclidean norms of owned values, by field and piece. Collective.

        Returns
        -------
        Shape (1, k), or (2, k) where there is a potential: of forces, and of charges.
        """
        if self.block_size == self.dim:
            return self._norms(values)[None]
        chosen = self.mechanical
        return np.stack([self._norms(np.where(part, values, 0.0)) for part in (chosen, ~chosen)])

    def _norms(self, values: Array) -> Array:
        owned = values.size - self.behind.size
        own, other = values[:owned], values[owned:]
        if self.count == 1:
            square = self.comm.allreduce(np.dot(own, own), op=MPI.SUM) + np.dot(other, other)
            return np.array([np.sqrt(square)])
        piece = np.repeat(self.piece, self.block_size)
        squares = sums(self.comm, piece, own**2, self.count)
        return np.sqrt(squares + np.bincount(self.behind, other**2, minlength=self.count))

    def spread(self, sizes: Array) -> Array:
        """Return for each owned value the size of what it is compared with."""
        piece = np.concatenate([np.repeat(self.piece, self.block_size), self.behind])
        return np.where(self.mechanical, sizes[0, piece], sizes[-1, piece])


def shares_of(
    domain: Domain,
    space: fem.FunctionSpace,
    masters: Masters,
    pieces: tuple[NDArray[np.int32], int],
) -> Shares:
    """Return what is compared with each other in a body, of given pieces. Collective."""
    (piece, count), members, d = pieces, masters.members, domain.dim
    if count > 1 and members:
        touched = np.zeros((len(members), count), dtype=np.intc)
        for member, at in zip(members, touched, strict=True):
            if member.free.any():
                nodes = fem.locate_dofs_topological(space, d - 1, domain.facets(member.what.on))
                at[piece[nodes[nodes < piece.size]]] = 1
        domain.comm.Allreduce(MPI.IN_PLACE, touched, op=MPI.MAX)
        member_of, piece_of = np.nonzero(touched)
        # What moves as is given joins nothing: what holds it there is of its own.
        count, label = joined(member_of, len(members) + piece_of, len(members) + count)
        piece, of_members = label[len(members) + piece], label[: len(members)]
    else:
        of_members = np.zeros(len(members), dtype=np.intp)
    behind = np.repeat(of_members, [member.free.size for member in members]).astype(np.intp)
    block_size = space.dofmap.index_map_bs
    return Shares(
        domain.comm, piece.astype(np.intp), behind, count, block_size, d, masters.mechanical
    )
