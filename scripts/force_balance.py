"""The balance of the forces on a body, by which solutions are verified."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from contact.problem.problem import ContactProblem
from contact.problem.residuals import residual_forces, rounding_forces
from contact.problem.state import State
from contact.typing import Array


@dataclass(frozen=True)
class ForceBalance:
    """Resultants of the forces on a body, of shape (d,); of one of revolution along its axis."""

    #: Given tractions and body forces.
    applied: Array
    #: Reactions of the prescribed displacements, and of rigid parts.
    supports: Array
    #: Forces of the foundations on the body; between bodies they cancel.
    contact: Array
    #: Force on the side `on` of each of the contacts, shape (contacts, d).
    passed: Array
    #: Rounding floor of these sums: see `rounding_forces`.
    rounding_force: float

    @property
    def imbalance(self) -> float:
        """The norm of the sum over the sum of the norms, for contact those of `passed`.

        Two bodies that are both constrained have no other resultant than the force between them,
        and none at all apart: 0 where all is rounding.
        """
        parts = self.applied, self.supports, *self.passed
        scale = sum(float(np.linalg.norm(part)) for part in parts)
        total = self.applied + self.supports + self.contact
        return float(np.linalg.norm(total)) / scale if scale > self.rounding_force else 0.0


def force_balance(problem: ContactProblem, state: State) -> ForceBalance:
    """Return the resultant forces at a state. Collective."""
    body, d = problem.body, problem.dim
    residual = body.nodal(residual_forces(problem, state))[:, :d]
    supports = np.where(problem.body.free[:, :d], 0.0, residual).sum(axis=0)
    stress = problem.interface.traction(problem.nodal(state), state.multipliers)
    given = body.nodal(body.external(state.time))[:, :d].sum(axis=0)
    pushes = np.zeros_like(body.external(state.time))
    forces = -problem.nodes.weight[:, None] * stress
    problem.nodes.add_jump_transposed(forces, pushes)
    contact = body.nodal(pushes)[:, :d].sum(axis=0)
    ends = np.cumsum([own.nodes.nodes.size for own in problem.geometries])[:-1]
    passed = [part.sum(axis=0) for part in np.split(forces, ends)]
    local = np.stack([given, supports, contact, *passed])
    total = problem.domain.resultant(problem.comm.allreduce(local, op=MPI.SUM))
    rounding_force = np.linalg.norm(rounding_forces(problem, state, body.internal_forces(state))[0])
    return ForceBalance(total[0], total[1], total[2], total[3:], float(rounding_force))
