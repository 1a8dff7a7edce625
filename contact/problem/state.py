"""The unknowns of a contact problem at the contact nodes, and how they are read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contact.problem.problem import ContactProblem
from contact.typing import Array


@dataclass(frozen=True)
class Multipliers:
    """Contact forces at the owned contact nodes.

    Attributes
    ----------
    pressure
        lambda_c = -sigma_nu without the layer's part, shape (n,).
    friction
        lambda_f = -sigma_tau, tangential vectors, shape (n, d).
    """

    pressure: Array
    friction: Array

    @staticmethod
    def zero(problem: ContactProblem) -> Multipliers:
        """Return vanishing contact forces."""
        n = problem.trace.nodes.size
        return Multipliers(np.zeros(n), np.zeros((n, problem.dim)))

    def vectors(self, problem: ContactProblem) -> Array:
        """Return lambda_c nu + lambda_f, shape (n, d)."""
        return self.pressure[:, None] * problem.trace.normal + self.friction


def nodal_iterate(problem: ContactProblem) -> Array:
    """Return the iterate at the owned contact nodes, shape (n, block size)."""
    return problem.trace.values(problem.unknowns[: problem.owned])


def slip_of(problem: ContactProblem, nodal: Array) -> Array:
    """Return |u_tau| at nodal unknowns of shape (n, block size)."""
    return np.linalg.norm(problem.trace.tangential_component(nodal), axis=1)


def total_pressure(problem: ContactProblem, nodal: Array, forces: Multipliers) -> Array:
    """Return -sigma_nu: the multiplier and the layer's pressure."""
    return forces.pressure + problem.response.layer_pressure(nodal)


def bound_of(problem: ContactProblem, nodal: Array, forces: Multipliers) -> Array:
    """Return the friction bound s at nodal unknowns and contact forces. Collective."""
    pressure = total_pressure(problem, nodal, forces)
    return np.asarray(problem.friction_bound(pressure, slip_of(problem, nodal)), dtype=float)
