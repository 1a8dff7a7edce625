"""The global unknowns of a condensed body: rigid motions and electrodes, eliminated with it."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from contact.body.equilibrium import BodyEquilibrium
from contact.interface.interface import Interface
from contact.linear.bordered import BorderedBulk
from contact.linear.elimination import Elimination
from contact.linear.schur import SchurComplement
from contact.typing import Array


class CondensedMasters:
    """What the free global unknowns of a body do to it, seen from the kept nodes.

    A foundation that moves is seen by the kept nodes alone; that needs no solve. Plates and
    electrodes border the matrix, and are condensed with it by a solve each.

    Parameters
    ----------
    body
        The body.
    projection
        How the foundation moves at the kept unknowns of all ranks, shape (k, m).
    """

    def __init__(self, body: BodyEquilibrium, projection: Array) -> None:
        self._body, self._projection = body, projection
        self._free = np.flatnonzero(body.masters.free)
        ties = body.masters.ties
        self.bulk = BorderedBulk(body, ties, body.masters.free)
        #: Free unknowns to which nodes are tied: the others have no columns.
        sizes = np.abs(ties).sum(axis=0)
        tied = np.asarray(body.comm.allreduce(sizes, op=MPI.SUM)) > 0
        self._tied = [k for k, column in enumerate(self._free) if tied[column]]
        self._responses = np.zeros((body.owned, self._free.size))

    @staticmethod
    def of(body: BodyEquilibrium, interface: Interface, size: int) -> CondensedMasters | None:
        """Return those of a body and its interface; None where there are none. Collective.

        Parameters
        ----------
        body, interface
            The body and its interface.
        size
            Number of kept unknowns of this rank, those of the contact nodes first.
        """
        if body.masters.size == 0:
            return None
        kept = np.zeros((size, body.masters.size))
        motion = interface.jump.motion
        if motion is not None:
            kept[: motion.shape[0] * motion.shape[1]] = motion.reshape(-1, motion.shape[2])
        return CondensedMasters(body, np.concatenate(body.comm.allgather(kept)))

    def eliminate(self, schur: SchurComplement, stiffness: Array) -> Array:
        """Return the stiffness against jumps, for a body that was condensed. Collective."""
        free, comm, bulk = self._free, self._body.comm, self.bulk
        coupling = np.zeros((stiffness.shape[0], free.size))
        for k in self._tied:
            coupling[:, k] = schur.condense(bulk.columns[:, free[k]])
            self._responses[:, k] = schur.expand(np.zeros(stiffness.shape[0]))
        inside = comm.allreduce(bulk.columns[:, free].T @ self._responses, op=MPI.SUM)
        corner = bulk.corner[np.ix_(free, free)] - inside
        self._elimination = Elimination(stiffness, self._projection[:, free], coupling, corner)
        return self._elimination.stiffness

    def forces(self, on_kept: Array, residual: Array) -> Array:
        """Return the forces on jumps, given those on kept unknowns, and all. Collective."""
        body, free = self._body, self._free
        self._residual = residual[: body.owned]
        inside = body.comm.allreduce(
            self._responses.T @ body.layout.mask(self._residual), op=MPI.SUM
        )
        on_masters = body.unbalanced(residual)[body.owned :][free] - inside
        return self._elimination.forces(on_kept, on_masters)

    def expand(self, schur: SchurComplement, jumps: Array) -> Array:
        """Return the increment of all owned unknowns and the global ones. Collective."""
        body, free = self._body, self._free
        kept, moved = self._elimination.motion(jumps)
        q = np.zeros(body.masters.size)
        q[free] = moved
        if self._tied:
            schur.condense(body.layout.mask(-self._residual) - self.bulk.columns @ q)
        return np.concatenate([schur.expand(kept) + body.masters.ties @ q, q])
