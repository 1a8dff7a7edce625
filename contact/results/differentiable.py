"""Named results of a state with their derivatives by unknowns and contact forces."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Protocol, runtime_checkable

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.model.rigid import Rigid
from contact.model.body import Electrode
from contact.results.resultants import (
    NAMES,
    DrivenPart,
    columns_of,
    holding,
    name_ends,
    nodes_of,
)
from contact.problem.energy import dissipated, stored
from contact.problem.problem import ContactProblem
from contact.problem.residuals import residual_forces
from contact.problem.state import State
from contact.typing import Array

AXES = "xyz"


class Quantity(Protocol):
    """A result as a function of problem and state; any callable is one."""

    def __call__(self, problem: ContactProblem, state: State) -> float:
        """Return the value. Collective."""


@runtime_checkable
class Differentiable(Quantity, Protocol):
    """A result that knows its derivatives, which the adjoint asks for."""

    def gradient(self, problem: ContactProblem, state: State) -> tuple[Array, Array]:
        """Return them by the owned unknowns, and by the forces at the nodes, shape (n, d).

        Collective.
        """


def _of_contact(problem: ContactProblem, number: int | None) -> NDArray[np.bool_]:
    """Return which owned contact nodes are those of one contact; of all for None."""
    return (
        np.ones(problem.nodes.weight.size, bool)
        if number is None
        else (problem.entry_numbers == number)
    )


@dataclass(frozen=True)
class ContactForce:
    """A component of the force of the body on the foundations, as ``contact_force_x``.

    Attributes
    ----------
    axis
        The component.
    contact
        Number of the contact; None for the sum of all.
    """

    axis: int
    contact: int | None = None

    def __call__(self, problem: ContactProblem, state: State) -> float:
        """Return it. Collective."""
        nodes = problem.nodes
        stress = problem.interface.stress(problem.nodal(state), state.forces)
        own = _of_contact(problem, self.contact)
        return self._turn(problem) * nodes.sum(np.where(own, stress[:, self.axis], 0.0))

    def _turn(self, problem: ContactProblem) -> float:
        """Return how much of a force per radian there is: the full turn of a ring."""
        unit = np.eye(problem.dim)[self.axis]
        return float(problem.domain.resultant(unit)[self.axis])

    def gradient(self, problem: ContactProblem, state: State) -> tuple[Array, Array]:
        """Return the derivatives. Collective."""
        jump = problem.nodes
        turn = np.where(_of_contact(problem, self.contact), self._turn(problem), 0.0)
        by_force = np.zeros_like(jump.normal)
        by_force[:, self.axis] = turn * jump.weight
        layer = problem.interface.law.layer_gradient(problem.nodal(state))
        by_x = np.zeros_like(problem.equilibrium.owned_part(state.x))
        jump.transpose((turn * jump.weight * jump.normal[:, self.axis])[:, None] * layer, by_x)
        return by_x, by_force


class Largest(ABC):
    """The largest of values at nodes; its derivative is that at the first of the largest."""

    @abstractmethod
    def values(self, problem: ContactProblem, state: State) -> Array:
        """Return the values at the owned nodes. Collective."""

    def __call__(self, problem: ContactProblem, state: State) -> float:
        """Return it. Collective."""
        own = float(self.values(problem, state).max(initial=0.0))
        return float(problem.comm.allreduce(own, op=MPI.MAX))

    def located(self, problem: ContactProblem, state: State) -> Quantity:
        """Return the value at the node that has the largest here, whatever others have. Collective.

        Where two nodes have the largest, a difference of the maximum would be that of the other.
        """
        at = _largest(problem, self.values(problem, state))

        def value(problem: ContactProblem, state: State) -> float:
            own = float(at @ self.values(problem, state))
            return float(problem.comm.allreduce(own, op=MPI.SUM))

        return value


@dataclass(frozen=True)
class MaxPressure(Largest):
    """The largest contact pressure; `contact` is the number of a contact, None for all."""

    contact: int | None = None

    def values(self, problem: ContactProblem, state: State) -> Array:
        """Return the pressures."""
        pressure = problem.interface.pressure(problem.nodal(state), state.forces)
        return np.where(_of_contact(problem, self.contact), pressure, 0.0)

    def gradient(self, problem: ContactProblem, state: State) -> tuple[Array, Array]:
        """Return the derivatives. Collective."""
        jump = problem.nodes
        at = _largest(problem, self.values(problem, state))
        layer = problem.interface.law.layer_gradient(problem.nodal(state))
        by_x = np.zeros_like(problem.equilibrium.owned_part(state.x))
        jump.transpose(at[:, None] * layer, by_x)
        return by_x, at[:, None] * jump.normal


@dataclass(frozen=True)
class MaxDisplacement(Largest):
    """The largest norm of the displacement over the nodes."""

    def values(self, problem: ContactProblem, state: State) -> Array:
        """Return the norms."""
        return np.asarray(np.linalg.norm(self._nodal(problem, state), axis=1))

    @staticmethod
    def _nodal(problem: ContactProblem, state: State) -> Array:
        body = problem.equilibrium
        return body.nodal(body.owned_part(state.x))[:, : problem.dim]

    def gradient(self, problem: ContactProblem, state: State) -> tuple[Array, Array]:
        """Return the derivatives. Collective."""
        body, u = problem.equilibrium, self._nodal(problem, state)
        length = np.linalg.norm(u, axis=1)
        at = _largest(problem, length) / np.maximum(length, np.finfo(float).tiny)
        by_x = np.zeros_like(body.owned_part(state.x))
        body.nodal(by_x)[:, : problem.dim] = at[:, None] * u
        return by_x, np.zeros_like(problem.nodes.normal)


@dataclass(frozen=True)
class MeanDisplacement:
    """A component of the mean displacement of the nodes of a part: the approach of a block."""

    part: str
    axis: int

    def __call__(self, problem: ContactProblem, state: State) -> float:
        """Return it. Collective."""
        body = problem.equilibrium
        return body.product(self._weights(problem), body.owned_part(state.x))

    def _weights(self, problem: ContactProblem) -> Array:
        weights, nodes = _no_weights(problem), nodes_of(problem, self.part)
        count = problem.comm.allreduce(nodes.size, op=MPI.SUM)
        problem.equilibrium.nodal(weights)[nodes, self.axis] = 1 / max(count, 1)
        return weights

    def gradient(self, problem: ContactProblem, state: State) -> tuple[Array, Array]:
        """Return the derivatives. Collective."""
        return self._weights(problem), np.zeros_like(problem.nodes.normal)


@dataclass(frozen=True)
class Reaction:
    """A weighted sum of residual forces: of a support, an electrode, or a rigid foundation.

    Attributes
    ----------
    weights
        Returns those of the residual of a problem, on the owned unknowns and the global ones.
    given
        Returns a given force that the residual is without; None for none.
    """

    weights: Callable[[ContactProblem], Array]
    given: Callable[[ContactProblem, State], float] | None = None

    def __call__(self, problem: ContactProblem, state: State) -> float:
        """Return it. Collective."""
        residual = residual_forces(problem, state)
        given = 0.0 if self.given is None else self.given(problem, state)
        return problem.equilibrium.product(self.weights(problem), residual) + given

    def gradient(self, problem: ContactProblem, state: State) -> tuple[Array, Array]:
        """Return the derivatives. Collective."""
        body, interface, jump = problem.equilibrium, problem.interface, problem.nodes
        weights = self.weights(problem)
        by_x = body.tangent_transposed(state, weights)
        seen = jump.apply(body.local(weights))
        by_force = jump.weight[:, None] * seen[:, : jump.dim]
        for law, nodal, pressure in interface.acting(state.x, state.forces):
            block = law.block(nodal, pressure, full=law is interface.law)
            there = law.jump.apply(body.local(weights))
            law.jump.transpose(
                law.jump.weight[:, None] * np.einsum("nji,nj->ni", block, there), by_x
            )
        return by_x, by_force


@dataclass(frozen=True)
class GlobalUnknown:
    """A motion of a rigid foundation, or the potential of an electrode.

    Attributes
    ----------
    member, component
        Which of the global unknowns it is.
    unit
        In which unit, of that of the unknowns: degrees.
    """

    member: int
    component: int
    unit: float = 1.0

    def _place(self, problem: ContactProblem) -> tuple[int, float]:
        member = problem.equilibrium.global_unknowns.members[self.member]
        return member.begin + self.component, float(member.units[self.component]) * self.unit

    def __call__(self, problem: ContactProblem, state: State) -> float:
        """Return it."""
        at, unit = self._place(problem)
        return float(problem.equilibrium.motion(state.x)[at] * unit)

    def gradient(self, problem: ContactProblem, state: State) -> tuple[Array, Array]:
        """Return the derivatives."""
        body, (at, unit) = problem.equilibrium, self._place(problem)
        by_x = np.zeros_like(body.owned_part(state.x))
        body.motion(by_x)[at] = unit
        return by_x, np.zeros_like(problem.nodes.normal)


@dataclass(frozen=True)
class FoundationCharge:
    """The charge that passes through the contact nodes."""

    def __call__(self, problem: ContactProblem, state: State) -> float:
        """Return it. Collective."""
        found = 0.0
        for law, nodal, pressure in problem.interface.acting(state.x, state.forces):
            found += law.jump.sum(law.charge(nodal, pressure))
        return found

    def gradient(self, problem: ContactProblem, state: State) -> tuple[Array, Array]:
        """Return the derivatives. Collective."""
        by_x = np.zeros_like(problem.equilibrium.owned_part(state.x))
        for law, nodal, pressure in problem.interface.acting(state.x, state.forces):
            full = law is problem.interface.law
            slope = -law.current_block(nodal, pressure, full)[:, -1] / law.phi_scale
            law.jump.transpose(law.jump.weight[:, None] * slope, by_x)
        return by_x, np.zeros_like(problem.nodes.normal)


def _largest(problem: ContactProblem, values: Array) -> Array:
    """Return 1 at the first of the largest values of all ranks, 0 elsewhere. Collective."""
    comm, at = problem.comm, np.zeros_like(values)
    own = float(values.max(initial=-np.inf))
    _, rank = comm.allreduce((own, -comm.rank), op=MPI.MAX)
    if comm.rank == -rank and values.size:
        at[np.argmax(values)] = 1.0
    return at


def named_quantities(problem: ContactProblem) -> dict[str, Quantity]:
    """Return the results of a problem that have derivatives, by their columns. Collective.

    They are columns of ``steps.csv``: no times, counts, residuals or work in a step, nor a column
    that is not listed here.
    """
    axes, body = AXES[: problem.dim], problem.equilibrium
    found: dict[str, Quantity] = {
        "max_pressure": MaxPressure(),
        "max_displacement": MaxDisplacement(),
        "energy": stored,
        "dissipation": dissipated,
    }
    if body.laws.initial is not None:
        found["plastic_dissipation"] = _lost
    found |= {f"contact_force_{axis}": ContactForce(i) for i, axis in enumerate(axes)}
    for number, contact in enumerate(problem.contacts if len(problem.contacts) > 1 else ()):
        name = contact.name
        found |= {f"contact_force_{x}_{name}": ContactForce(i, number) for i, x in enumerate(axes)}
        found[f"max_pressure_{name}"] = MaxPressure(number)
        found[f"dissipation_{name}"] = partial(_rubbed, contact=number)
    driven = DrivenPart.of(problem)
    for i, axis in enumerate(axes):
        for part in holding(problem, electric=False):
            found[f"reaction_{axis}_{part}"] = Reaction(partial(_on_support, part=part, axis=i))
        if driven is not None:
            found[f"driven_{axis}"] = MeanDisplacement(driven.on, i)
            found[f"driven_force_{axis}"] = partial(_driving, axis=i)
    if problem.piezoelectric:
        found["charge_foundation"] = FoundationCharge()
        for part in holding(problem, electric=True):
            found[f"charge_{part}"] = Reaction(partial(_on_electrode, part=part))
    members = body.global_unknowns.members
    rigid = [i for i, member in enumerate(members) if isinstance(member.description, Rigid)]
    foundations = [members[i].description.on for i in rigid if members[i].foundation]
    parts = [members[i].description.on for i in rigid if not members[i].foundation]
    for index, end in zip(rigid, name_ends(foundations, parts), strict=True):
        found |= _of_rigid(problem, index, end)
    for index, member in enumerate(members):
        part = member.description.on
        if isinstance(member.description, Electrode):
            found[f"potential_{part}"] = GlobalUnknown(index, 0)
            found[f"charge_{part}"] = Reaction(
                partial(_on_member, index=index, i=0), partial(_given, index=index, i=0)
            )
    return found


def _of_rigid(problem: ContactProblem, index: int, end: str) -> dict[str, Quantity]:
    """Return the motions, forces and moments of a rigid body, given the end of their columns."""
    member, found = problem.equilibrium.global_unknowns.members[index], dict[str, Quantity]()
    d = problem.dim
    for first, size, motion, force in (
        (0, d, "displacement", "force"),
        (d, member.free.size - d, "rotation", "moment"),
    ):
        unit = np.rad2deg(1.0) if first else 1.0
        for i in range(size):
            moved = columns_of(NAMES[motion], size, end)[i]
            found[moved] = GlobalUnknown(index, first + i, unit)
            acting = columns_of(NAMES[force], size, end)[i]
            found[acting] = Reaction(
                partial(_on_member, index=index, i=first + i),
                partial(_given, index=index, i=first + i),
            )
    return found


def _rubbed(problem: ContactProblem, state: State, contact: int) -> float:
    """Return the energy that friction of one contact takes in the step of a state. Collective."""
    return dissipated(problem, state, _of_contact(problem, contact))


def _lost(problem: ContactProblem, state: State) -> float:
    """Return the energy that plastic flow takes in the step of a state. Collective."""
    return problem.equilibrium.laws.energies(state)[0]


def _driving(problem: ContactProblem, state: State, axis: int) -> float:
    """Return a component of the force that drives a part. Collective."""
    driven = DrivenPart.of(problem)
    assert driven is not None
    return float(driven.force(problem, state)[axis])


def _on_support(problem: ContactProblem, part: str, axis: int) -> Array:
    """Return the weights of a support's reaction. Collective."""
    nodes, held = holding(problem, electric=False)[part]
    weights = _no_weights(problem)
    turn = float(problem.domain.resultant(np.eye(problem.dim)[axis])[axis])
    problem.equilibrium.nodal(weights)[nodes, : problem.dim] = turn * held[:, axis]
    return weights


def _on_electrode(problem: ContactProblem, part: str) -> Array:
    """Return the weights of the charge of a prescribed potential. Collective."""
    nodes, held = holding(problem, electric=True)[part]
    body, weights = problem.equilibrium, _no_weights(problem)
    body.nodal(weights)[nodes, -1] = held[:, 0, 0] / body.phi_scale
    return weights


def _on_member(problem: ContactProblem, index: int, i: int) -> Array:
    """Return the weights of a force on a rigid body, or of the charge of an electrode."""
    body, weights = problem.equilibrium, _no_weights(problem)
    member = body.global_unknowns.members[index]
    if problem.domain.revolved and isinstance(member.description, Rigid) and i != 1:
        return weights  # over the full turn it cancels
    at = member.begin + i
    weights[: body.owned] = body.global_unknowns.ties[:, [at]].toarray()[:, 0] / member.units[i]
    body.motion(weights)[at] = 1 / member.units[i]
    return weights


def _given(problem: ContactProblem, state: State, index: int, i: int) -> float:
    """Return the given force on a rigid body, or charge of an electrode, where that is free."""
    member = problem.equilibrium.global_unknowns.members[index]
    return float(member.forces(state.time)[i] / member.units[i])


def _no_weights(problem: ContactProblem) -> Array:
    body = problem.equilibrium
    return np.zeros(body.owned + body.global_unknowns.size)
