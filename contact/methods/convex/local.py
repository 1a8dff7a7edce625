"""Contact problems in local variables: u = W r + q between jumps and forces of the contacts.

For each contact u = (u_N, u_T), how far it is open and what has slipped, and r = (r_N, r_T), the
force on the body, with

    u_N + mu |u_T| and u_T together in C*_mu,   r in C_mu = {|r_T| <= mu r_N},   both orthogonal:

Signorini's conditions with Coulomb's law. That is the form in which other solvers exchange them.

References
----------
Acary, Bremond, Koziara and Perignon, FCLIB: a collection of discrete 3D frictional contact
problems, INRIA RT-0444 (2014).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve

from contact.errors import InputError
from contact.methods.convex.cones import Array
from contact.methods.convex.haslinger import coulomb
from contact.methods.convex.reduced import cholesky
from contact.methods.convex.tresca import TrescaSolver

#: Least pivot of a flexibility with ones on its diagonal that leaves its inverse some digits.
SINGULAR = 1e-14


@dataclass(frozen=True)
class LocalSolution:
    """Jumps u and forces r of the contacts, shape (k, d) each, and how the solver ended."""

    jump: Array
    force: Array
    converged: bool
    message: str


@dataclass(frozen=True)
class LocalProblem:
    """Contacts with a flexible body behind them.

    Attributes
    ----------
    flexibility
        W, symmetric, contact by contact with the normal first, shape (k d, k d) (length/force).
    free
        q, the jumps without contact forces, shape (k d,) (length).
    coefficient
        mu >= 0 of each contact, shape (k,).
    """

    flexibility: Array
    free: Array
    coefficient: Array

    @property
    def dim(self) -> int:
        """Number of components of a contact."""
        return self.free.size // self.coefficient.size

    def solve(self, tolerance: float = 1e-8) -> LocalSolution:
        """Solve by the interior point, friction by Haslinger's fixed point.

        Parameters
        ----------
        tolerance
            Relative change of the friction bound that ends the iteration.

        Raises
        ------
        InputError
            If W is not definite: rigid bodies with more contacts than motions have such ones.
        """
        k, d = self.coefficient.size, self.dim
        diagonal = np.diag(self.flexibility)
        size = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
        factor = cholesky(np.asfortranarray(self.flexibility / size[:, None] / size))
        if factor is None or np.diag(factor).min() ** 2 < SINGULAR:
            raise InputError(
                "the flexibility W of the contacts is singular; accepted: a definite one, as of "
                "contacts that deform, each with all its directions free"
            )
        stiffness = cho_solve((factor, True), np.eye(k * d)) / size[:, None] / size
        normal = np.zeros((k, d))
        normal[:, 0] = -1.0
        tangent = np.tile(np.diag([0.0] + [1.0] * (d - 1)), (k, 1, 1))
        solver = TrescaSolver(
            (stiffness + stiffness.T) / 2,
            normal,
            tangent,
            np.zeros(k),
            np.ones(k),
            rubbing=self.coefficient > 0,
        )
        load = cho_solve((factor, True), self.free / size) / size
        if np.any(self.coefficient > 0):
            loop = coulomb(
                solver, load, lambda p, _: self.coefficient * p, tolerance=tolerance, inner=1e-12
            )
            result, message = loop.result, loop.message
            converged = loop.converged
        else:
            result = solver.solve(load, np.zeros(k))
            converged, message = result.certified, result.message
        force = -result.friction
        force[:, 0] = result.pressure
        return LocalSolution(result.displacement, force, converged, message)

    def residual(self, jump: Array, force: Array) -> float:
        """Return how well jumps and forces meet law and equation, relative to their sizes.

        By the natural map r - P(r - rho (u_N + mu |u_T|, u_T)) onto the cones, rho from the
        diagonal of W.
        """
        d, mu = self.dim, self.coefficient
        rho = 1 / np.diag(self.flexibility).reshape(-1, d).max(axis=1)
        raised = jump.copy()
        raised[:, 0] += mu * np.linalg.norm(jump[:, 1:], axis=1)
        law = force - on_cones(force - rho[:, None] * raised, mu)
        equation = jump.ravel() - self.flexibility @ force.ravel() - self.free
        of_law = np.abs(law).max() / (np.abs(force).max() or 1.0)
        return float(max(of_law, np.abs(equation).max() / (np.abs(self.free).max() or 1.0)))


def on_cones(vectors: Array, mu: Array) -> Array:
    """Project vectors (n, t), shape (k, d), onto the cones |t| <= mu n."""
    n, t = vectors[:, 0], vectors[:, 1:]
    size = np.linalg.norm(t, axis=1)
    inside, polar = size <= mu * n, mu * size <= -n
    lead = (n + mu * size) / (1 + mu**2)
    rim = np.column_stack([lead, (mu * lead / np.where(size > 0, size, 1.0))[:, None] * t])
    return np.where(inside[:, None], vectors, np.where(polar[:, None], 0.0, rim))
