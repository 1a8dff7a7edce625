"""The discrete norm of H^-1/2(Gamma_3): how strongly a pressure acts on the body."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from mpi4py import MPI

from contact.history import BodyState
from contact.linear.operator import SparseOperator
from contact.problem.problem import ContactProblem
from contact.typing import Array


class DualNorm:
    """sup <q, v_nu> / |v|_V over the discrete displacements v, with |v|_V the linear energy.

    The supremum is reached by the displacement w under the pressure q alone, and is its energy:
    |q|^2 = <q, w_nu>. On Gamma_3 that is the inverse of the body condensed onto it, the discrete
    Steklov operator, and as that is one of order 1/2, a norm of H^-1/2.

    Parameters
    ----------
    problem
        Whose contact nodes carry the pressures.
    """

    def __init__(self, problem: ContactProblem) -> None:
        self.problem = problem
        body, size = problem.body, problem.interface.nodes.block_size
        self._rest = body.zero_displacement()
        coupled = problem.interface.coupled
        self._operator = SparseOperator(body, coupled)
        self._operator.update("secant", BodyState(self._rest), np.zeros((coupled.size, size, size)))

    def pressure(self, q: Array) -> float:
        """Return the norm of nodal pressures, shape (n,). Collective."""
        body, nodes = self.problem.body, self.problem.interface.nodes
        load = np.zeros(body.owned)
        vectors = np.zeros((q.size, nodes.block_size))
        vectors[:, : nodes.dim] = (nodes.weight * q)[:, None] * nodes.normal
        nodes.add_jump_transposed(vectors, load)
        load = np.where(body.free.ravel(), load, 0.0)
        return self._root(load, self._operator.solve(load))

    def compliance(self, loads: Sequence[Array]) -> Array:
        """Return the work of loads on each other's displacements, shape (n, n). Collective."""
        free = self.problem.body.free.ravel()
        acting = np.array([np.where(free, load, 0.0) for load in loads])
        moved = np.array([self._operator.solve(load) for load in acting])
        work = self.problem.comm.allreduce(acting @ moved[:, : free.size].T, op=MPI.SUM)
        return np.asarray((work + work.T) / 2)

    def displacement(self, x: Array, other: Array) -> float:
        """Return |u - v|_V of local unknowns, the energy of the linear body. Collective."""
        body = self.problem.body
        forces = (body.internal_forces(BodyState(y), self._rest) for y in (x, other))
        difference = (x - other)[: body.owned]
        free = np.where(body.free.ravel(), np.subtract(*forces), 0.0)
        return self._root(free, difference)

    def _root(self, force: Array, displacement: Array) -> float:
        total = self.problem.comm.allreduce(float(force @ displacement), op=MPI.SUM)
        return float(np.sqrt(max(total, 0.0)))
