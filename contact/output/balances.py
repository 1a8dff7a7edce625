"""Electric output: charges by part, global balances, and what a sensor's electrode reads.

All charges are integrals of D.nu over a part, nu pointing out of the body, in the sign of the
given charges q_2 = D.nu. They are not integrals of a discrete D, which converges slowly at
electrodes, but the reactions of the discrete equations. These balance to the tolerance of the
solver on any mesh.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.la import InsertMode
from mpi4py import MPI

from contact._compat import collapse
from contact.body.fields import constant
from contact.body.loads import expression
from contact.errors import InputError
from contact.mesh.together import members
from contact.problem.kkt import force_rounding, residual_forces
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.typing import Array


@dataclass(frozen=True)
class ChargeBalance:
    """Free charges of a body.

    Attributes
    ----------
    electrodes
        Part with a prescribed or one unknown potential -> its charge. A node of two parts with a
        prescribed one counts for the one that is fixed first.
    given
        Part -> prescribed surface charge.
    foundation
        Charge that passes through the contact part.
    body
        Prescribed volume charge: the sum of all the others, by Gauss's law.
    magnitude
        The sum of the absolute nodal charges: with an insulator and one electrode all parts
        are neutral, though not free of charge everywhere.
    """

    electrodes: Mapping[str, float]
    given: Mapping[str, float]
    foundation: float
    body: float
    magnitude: float

    @property
    def total(self) -> float:
        """All surface charges less the volume charge: 0 up to the solver's tolerance."""
        surface = sum(self.electrodes.values()) + sum(self.given.values()) + self.foundation
        return surface - self.body

    @property
    def imbalance(self) -> float:
        """|total| / magnitude, or 0 without charges."""
        return abs(self.total) / self.magnitude if self.magnitude > 0 else 0.0


@dataclass(frozen=True)
class ForceBalance:
    """Resultants of the forces on a body, of shape (d,); of one of revolution along its axis.

    Attributes
    ----------
    applied
        Given tractions and body forces.
    supports
        Reactions of the prescribed displacements, and of rigid parts.
    contact
        What the foundations exert on the body; between bodies it cancels.
    passed
        What passes through each of the contacts, as the side `on` feels it, shape (contacts, d).
    rounding
        What is no force: see `kkt.force_rounding`.
    """

    applied: Array
    supports: Array
    contact: Array
    passed: Array
    rounding: float

    @property
    def imbalance(self) -> float:
        """The norm of the sum over the sum of the norms, of contact's that of what passes.

        Two bodies that are both held have no other resultant than what passes between them, and
        none at all apart: 0 where all is rounding.
        """
        parts = self.applied, self.supports, *self.passed
        scale = sum(float(np.linalg.norm(part)) for part in parts)
        total = self.applied + self.supports + self.contact
        return float(np.linalg.norm(total)) / scale if scale > self.rounding else 0.0


@dataclass(frozen=True)
class Reading:
    """What a sensor's electrode shows.

    Attributes
    ----------
    charge
        Free charge of the part; None where its potential is not prescribed.
    potential
        Mean potential over the part.
    """

    charge: float | None
    potential: float


def charge_balance(problem: ContactProblem, state: State) -> ChargeBalance:
    """Return the charges by part at a state. Collective.

    Raises
    ------
    InputError
        If the body is not piezoelectric.
    """
    _demand_potential(problem)
    equilibrium = problem.equilibrium
    d, bs = problem.dim, equilibrium.block_size
    residual = residual_forces(problem, state) / equilibrium.phi_scale
    time = state.time
    electrodes: dict[str, float] = {}
    magnitude = 0.0
    taken = np.zeros(equilibrium.owned, dtype=bool)
    for fixed in problem.body.fixed:
        if fixed.potential is None:
            continue
        for part in members(fixed.on):
            dofs = _electric_dofs(problem, part)
            new = dofs[~taken[dofs]]
            taken[new] = True
            electrodes[part] = electrodes.get(part, 0.0) + _sum(problem, residual[new])
            magnitude += _sum(problem, np.abs(residual[new]))
    for electrode in problem.body.electrodes:
        dofs = _electric_dofs(problem, electrode.on)
        electrodes[electrode.on] = _sum(problem, residual[dofs])
        magnitude += _sum(problem, np.abs(residual[dofs]))
    given: dict[str, float] = {}
    body = 0.0
    x, test = ufl.SpatialCoordinate(problem.domain.mesh), ufl.TestFunction(equilibrium.space)
    for i, load in enumerate(problem.body.loads):
        if load.charge is None:
            continue
        measure = problem.domain.dx if load.on is None else problem.domain.ds(load.on)
        now = constant(problem.domain.mesh, time)
        density = expression(problem.domain, load.charge, x, now, f"load.{i}.charge")
        vector = fem.assemble_vector(fem.form(density * test[d] * measure))
        vector.scatter_reverse(InsertMode.add)
        nodal = load.factor(time) * vector.array[: equilibrium.owned].reshape(-1, bs)[:, d]
        charge = _sum(problem, nodal)
        magnitude += _sum(problem, np.abs(nodal))
        if load.on is None:
            body += charge
        else:
            given[load.on] = given.get(load.on, 0.0) + charge
    passed = _foundation_charges(problem, state)
    magnitude += _sum(problem, np.abs(passed))
    return ChargeBalance(electrodes, given, _sum(problem, passed), body, magnitude)


def _foundation_charges(problem: ContactProblem, state: State) -> Array:
    """Return the charges that leave the owned nodes through contact; between bodies they cancel."""
    interface, nodal, body = problem.interface, problem.nodal(state), problem.equilibrium
    pressure = interface.pressure(nodal, state.forces)
    density = np.zeros((nodal.shape[0], body.block_size))
    density[:, -1] = problem.nodes.weight * interface.law.charge(nodal, pressure)
    leaving = np.zeros_like(body.external(state.time))
    problem.nodes.transpose(density, leaving)
    if interface.held is not None:
        interface.held.add_charge(leaving, state.x)
    return np.asarray(body.nodal(leaving)[:, -1])


def force_balance(problem: ContactProblem, state: State) -> ForceBalance:
    """Return the resultant forces at a state. Collective."""
    body, d = problem.equilibrium, problem.dim
    residual = body.nodal(residual_forces(problem, state))[:, :d]
    supports = np.where(problem.equilibrium.free[:, :d], 0.0, residual).sum(axis=0)
    stress = problem.interface.stress(problem.nodal(state), state.forces)
    given = body.nodal(body.external(state.time))[:, :d].sum(axis=0)
    pushes = np.zeros_like(body.external(state.time))
    forces = -problem.nodes.weight[:, None] * stress
    problem.nodes.transpose(forces, pushes)
    contact = body.nodal(pushes)[:, :d].sum(axis=0)
    ends = np.cumsum([entry.nodes.nodes.size for entry in problem.entries])[:-1]
    passed = [part.sum(axis=0) for part in np.split(forces, ends)]
    local = np.stack([given, supports, contact, *passed])
    total = problem.domain.resultant(problem.comm.allreduce(local, op=MPI.SUM))
    rounding = np.linalg.norm(force_rounding(problem, state, body.internal_forces(state))[0])
    return ForceBalance(total[0], total[1], total[2], total[3:], float(rounding))


def mean_potential(problem: ContactProblem, state: State, part: str) -> float:
    """Return the mean potential over a part of the boundary. Collective.

    Raises
    ------
    InputError
        If the body is not piezoelectric or has no such part.
    """
    _demand_potential(problem)
    body = problem.equilibrium
    _, phi = body.split(body.function(state.x))
    ds = problem.domain.ds(part)
    local = [
        fem.assemble_scalar(fem.form(phi * ds)),
        fem.assemble_scalar(fem.form(constant(problem.domain.mesh, 1.0) * ds)),
    ]
    integral, area = problem.comm.allreduce(np.array(local), op=MPI.SUM)
    return float(integral / area)


def sensor(problem: ContactProblem, state: State, electrode: str) -> Reading:
    """Return what an electrode reads: its charge where it is held at a potential. Collective.

    A short-circuited electrode (prescribed potential) is read by its charge, one that is left
    open by its mean potential; it is then no conductor, but a strip of the free surface.
    """
    charges = charge_balance(problem, state).electrodes
    return Reading(charges.get(electrode), mean_potential(problem, state, electrode))


def _demand_potential(problem: ContactProblem) -> None:
    if not problem.piezoelectric:
        raise InputError("charges and potentials need a piezoelectric material")


def _electric_dofs(problem: ContactProblem, part: str) -> Array:
    """Return the owned electric unknowns on a part."""
    body = problem.equilibrium
    subspace = body.space.sub(problem.dim)
    scalar, _ = collapse(subspace)
    facets = problem.domain.facets(part)
    dofs = fem.locate_dofs_topological((subspace, scalar), problem.dim - 1, facets)[0]
    return dofs[dofs < body.owned]


def _sum(problem: ContactProblem, values: Array) -> float:
    return float(problem.comm.allreduce(float(np.sum(values)), op=MPI.SUM))
