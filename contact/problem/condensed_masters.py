"""The masters of a condensed body, eliminated with it: all that only its jumps are relative to.

These are the nodes opposite of contact nodes or beside them on quadratic facets, rigid motions and
the potentials of electrodes.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from scipy import sparse

from contact.body.equilibrium import BodyEquilibrium
from contact.interface.interface import Interface
from contact.linear.bordered import BorderedBulk
from contact.linear.elimination import Elimination
from contact.linear.schur import SchurComplement
from contact.problem.kept_unknowns import KeptUnknowns
from contact.typing import Array


class CondensedMasters:
    """What masters do to a body, seen from its jumps. Collective.

    What is opposite is kept with the jumps, and a foundation that moves is seen by these alone;
    neither needs a solve. Plates and electrodes border the matrix, and are condensed with it by a
    solve each.

    Parameters
    ----------
    body, interface, kept
        The body, its interface, and which of its unknowns are kept.
    """

    def __init__(self, body: BodyEquilibrium, interface: Interface, kept: KeptUnknowns) -> None:
        self._body, self._kept = body, kept
        self._free = np.flatnonzero(body.masters.free)
        ties = body.masters.ties
        self.bulk = BorderedBulk(body, ties, body.masters.free)
        #: Free unknowns to which nodes are tied: the others have no columns.
        sizes = np.abs(ties).sum(axis=0)
        tied = np.asarray(body.comm.allreduce(sizes, op=MPI.SUM)) > 0
        self._tied = [k for k, column in enumerate(self._free) if tied[column]]
        self._responses = np.zeros((body.owned, self._free.size))
        self._projection = self._moves(interface)

    @staticmethod
    def of(
        body: BodyEquilibrium, interface: Interface, kept: KeptUnknowns
    ) -> CondensedMasters | None:
        """Return those of a body and its interface; None where there are none. Collective."""
        if body.masters.size == 0 and interface.change is None:
            return None
        return CondensedMasters(body, interface, kept)

    def _moves(self, interface: Interface) -> sparse.csr_array:
        """Return how jumps move with the masters: not with others, with q as the foundation."""
        own = np.zeros((interface.coupled.size * self._body.block_size, self._body.masters.size))
        motion = interface.jump.carried
        if motion is not None:
            own[: motion.shape[0] * motion.shape[1]] = motion.reshape(-1, motion.shape[2])
        moves = np.concatenate(self._body.comm.allgather(own))[:, self._free]
        none = sparse.csr_array((moves.shape[0], self._kept.others.size))
        return sparse.csr_array(sparse.hstack([none, sparse.csr_array(moves)]))

    def eliminate(self, schur: SchurComplement, stiffness: Array) -> Array:
        """Return the stiffness against jumps, for a body that was condensed. Collective."""
        free, comm, bulk, kept = self._free, self._body.comm, self.bulk, self._kept
        columns = np.zeros((stiffness.shape[0], free.size))
        for k in self._tied:
            columns[:, k] = kept.forces(schur.condense(bulk.columns[:, free[k]]))
            self._responses[:, k] = schur.expand(np.zeros(stiffness.shape[0]))
        inside = comm.allreduce(bulk.columns[:, free].T @ self._responses, op=MPI.SUM)
        own = bulk.corner[np.ix_(free, free)] - inside
        jumps, others, changed = kept.jumps, kept.others, kept.stiffness(stiffness)
        coupling = np.hstack([changed[np.ix_(jumps, others)], columns[jumps]])
        across, corner = columns[others], changed[np.ix_(others, others)]
        corner = np.block([[corner, across], [across.T, own]])
        if jumps.size < len(changed):
            changed = changed[np.ix_(jumps, jumps)]
        self._elimination = Elimination(changed, self._projection, coupling, corner)
        return self._elimination.stiffness

    def forces(self, on_kept: Array, residual: Array) -> Array:
        """Return the forces on jumps, given those on kept unknowns, and all. Collective."""
        body, free, kept = self._body, self._free, self._kept
        self._residual = residual[: body.owned]
        inside = body.comm.allreduce(
            self._responses.T @ body.layout.mask(self._residual), op=MPI.SUM
        )
        changed = kept.forces(on_kept)
        on_q = body.unbalanced(residual)[body.owned :][free] - inside
        on_masters = np.concatenate([changed[kept.others], on_q])
        return self._elimination.forces(changed[kept.jumps], on_masters)

    def expand(self, schur: SchurComplement, jumps: Array) -> Array:
        """Return the increment of all owned unknowns and the global ones. Collective."""
        body, kept = self._body, self._kept
        moved, masters = self._elimination.motion(jumps)
        others, free = np.split(masters, [kept.others.size])
        q = np.zeros(body.masters.size)
        q[self._free] = free
        if self._tied:
            schur.condense(body.layout.mask(-self._residual) - self.bulk.columns @ q)
        values = schur.expand(kept.values(moved, others))
        return np.concatenate([values + body.masters.ties @ q, q])
