"""What a solve gives back."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from contact.linear.operator import Counters
from contact.methods.report import History, Outcome
from contact.output.fields import unknowns
from contact.output.options import OutputOptions
from contact.problem.kkt import stiffness_scale
from contact.problem.problem import ContactProblem
from contact.problem.state import Multipliers, bound_of, nodal_iterate, total_pressure
from contact.typing import Array


@dataclass
class Solution:
    """A solved problem, or what was reached.

    Nodal quantities are those of the contact nodes that this rank owns, in the order of
    `problem.trace`.

    Attributes
    ----------
    problem
        The problem; its iterate is the solution.
    forces
        Multipliers of the unilateral constraint and of friction.
    outcome
        Whether it has converged, why it ended, and the residuals.
    history
        The outer iterations.
    counters
        Factorisations and linear solves.
    method
        Name of the method.
    seconds
        Spent on setup, solve and output.
    notes, warnings
        What there is to say about the solution.
    max_dev_strain
        The largest |dev eps|.
    start
        From where the iteration started, in words.
    title
        Of the case.
    output
        What is written besides the summary and the tables.
    """

    problem: ContactProblem
    forces: Multipliers
    outcome: Outcome
    history: History
    counters: Counters
    method: str
    seconds: dict[str, float]
    notes: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    max_dev_strain: float = np.nan
    start: str = "zero slip"
    title: str = ""
    output: OutputOptions = field(default_factory=OutputOptions)

    @property
    def converged(self) -> bool:
        """Whether all residuals are below the tolerance."""
        return self.outcome.converged

    @cached_property
    def _unknowns(self) -> dict[str, fem.Function]:
        return unknowns(self.problem)

    @property
    def displacement(self) -> fem.Function:
        """The displacement. The first use is collective."""
        return self._unknowns["displacement"]

    @property
    def potential(self) -> fem.Function | None:
        """The electric potential; None for a body without. The first use is collective."""
        return self._unknowns.get("potential")

    @property
    def nodal(self) -> Array:
        """Displacement (and scaled potential) at the contact nodes, shape (n, block size)."""
        return nodal_iterate(self.problem)

    @property
    def pressure(self) -> Array:
        """Contact pressure -sigma_nu, shape (n,): multiplier and layer."""
        return total_pressure(self.problem, self.nodal, self.forces)

    @property
    def friction(self) -> Array:
        """Friction stress -sigma_tau = lambda_f, shape (n, d)."""
        return self.forces.friction

    @property
    def friction_bound(self) -> Array:
        """Friction bound s, shape (n,). Collective."""
        return bound_of(self.problem, self.nodal, self.forces)

    @property
    def normal_displacement(self) -> Array:
        """u_nu along the contact direction, shape (n,)."""
        return self.problem.trace.normal_component(self.nodal)

    @property
    def slip(self) -> Array:
        """Tangential displacement u_tau, shape (n, d)."""
        return self.problem.trace.tangential_component(self.nodal)

    @property
    def contact_force(self) -> Array:
        """The force that the body exerts on the foundation, shape (d,). Collective."""
        trace = self.problem.trace
        vectors = self.pressure[:, None] * trace.normal + self.friction
        return np.asarray(trace.comm.allreduce(trace.weight @ vectors, op=MPI.SUM))

    @property
    def status(self) -> Array:
        """What each contact node does: "open", "stick" or "slip", shape (n,). Collective.

        A node is in contact where p + c (u_nu - rho) > 0 for the multiplier p, or where the
        layer presses; c = E / size as in the residuals. There it slips if |lambda_f + c u_tau|
        exceeds the friction bound (always without friction), and sticks else. What is below
        1e-9 of the largest pressure counts as rounding.
        """
        problem, c = self.problem, stiffness_scale(self.problem)
        opening = self.normal_displacement - problem.trace.gap
        layer = problem.response.layer_pressure(self.nodal)
        rounding = 1e-9 * problem.trace.maximum(self.pressure)
        touching = (self.forces.pressure + c * opening > rounding) | (layer > rounding)
        trial = np.linalg.norm(self.friction + c * self.slip, axis=1)
        slipping = trial > self.friction_bound + rounding
        if not problem.frictional:
            slipping[:] = True
        return np.where(touching, np.where(slipping, "slip", "stick"), "open")
