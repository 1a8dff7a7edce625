"""Functionals of a state with their derivatives by unknowns and contact forces.

The entries of `contact.results.quantities` name those of columns; `Integral` makes one of a UFL
density.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import chain
from typing import Protocol, runtime_checkable

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray
from ufl.core.expr import Expr

from contact.body.loads import assembled
from contact.mesh.contents import in_space
from contact.mesh.domain import compiled
from contact.model.body import Bolt, Electrode
from contact.model.rigid import Motion
from contact.problem.problem import ContactProblem
from contact.problem.residuals import dissipated, residual_forces
from contact.problem.state import State
from contact.ranks import summed
from contact.results.resultants import (
    NAMES,
    DrivenPart,
    columns_of,
    driven_part,
    holding,
    name_ends,
    nodes_of,
)
from contact.typing import Array


class Functional(Protocol):
    """A number as a function of problem and state; any callable is one."""

    def __call__(self, problem: ContactProblem, state: State) -> float:
        """Return the value. Collective."""


@runtime_checkable
class Differentiable(Functional, Protocol):
    """A functional that knows its derivatives, which the adjoint asks for."""

    def gradient(self, problem: ContactProblem, state: State) -> tuple[Array, Array]:
        """Return derivatives by the owned and global unknowns, and by forces (n, d). Collective."""


#: Functionals by the names of their columns.
Functionals = Mapping[str, Functional]

AXES = "xyz"


@dataclass(frozen=True)
class Integral:
    """The integral of a UFL density over the body, or over a part of its boundary."""

    #: Of displacement and potential (None without one), for instance ``lambda u, phi: u[1]``;
    #: products and derivatives of them too, ``ufl.div(u)``. It does not know jumps at bolts.
    density: Callable[[Expr, Expr | None], Expr]
    on: str | None = None  #: the part; None for the body. Of bodies of revolution the full turn

    def _form(self, problem: ContactProblem, at: fem.Function) -> ufl.Form:
        domain = problem.domain
        dx = domain.dx if self.on is None else domain.ds(self.on)
        return self.density(*problem.body.split(at)) * dx

    def __call__(self, problem: ContactProblem, state: State) -> float:
        """Return it. Collective."""
        form = compiled(self._form(problem, problem.body.function(state.x)))
        return float(summed(problem.comm, fem.assemble_scalar(form)))

    def gradient(self, problem: ContactProblem, state: State) -> tuple[Array, Array]:
        """Return the derivatives. Collective."""
        body, by_x = problem.body, _no_weights(problem)
        at = body.function(state.x)
        by_x[: body.owned] = assembled(
            compiled(ufl.derivative(self._form(problem, at), at)), body.owned
        )
        return by_x, np.zeros_like(problem.nodes.normal)


def _of_contact(problem: ContactProblem, number: int | None) -> NDArray[np.bool_]:
    """Return the owned contact nodes of one contact, or all for None, as a mask (n,)."""
    if number is None:
        return np.ones(problem.nodes.weight.size, bool)
    return problem.entry_numbers == number


def _share(problem: ContactProblem, axis: int) -> float:
    """Return the share of a force in the resultant: 0 across an axis of revolution, else 1."""
    return float(problem.domain.resultant(np.eye(problem.dim)[axis])[axis])


def _by_layer(problem: ContactProblem, state: State, weights: Array) -> Array:
    """Return the derivatives by unknowns of a weighted sum of the pressures of layers, (n,)."""
    by_x = _no_weights(problem)
    layer = problem.interface.foundation.layer_gradient(problem.nodal(state))
    problem.nodes.add_jump_transposed(weights[:, None] * layer, by_x)
    return by_x


@dataclass(frozen=True)
class ContactForce:
    """A component of the force of the body on the foundations, or of its moment."""

    axis: int
    contact: int | None = None  #: number of the contact; None for the sum of all
    moment: bool = False  #: whether it is the moment about that axis through the origin

    def _levers(self, problem: ContactProblem) -> Array:
        """Return the derivatives by the stresses at the contact nodes over their areas, (n, d)."""
        nodes, levers = problem.nodes, np.zeros_like(problem.nodes.normal)
        if not self.moment:
            levers[:, self.axis] = _share(problem, self.axis)
        elif not problem.domain.revolved:
            levers = np.cross(np.eye(3)[self.axis], in_space(nodes.points))[:, : nodes.dim]
        return np.where(_of_contact(problem, self.contact)[:, None], levers, 0.0)

    def __call__(self, problem: ContactProblem, state: State) -> float:
        """Return it. Collective."""
        stress = problem.interface.traction(problem.nodal(state), state.multipliers)
        return problem.nodes.sum(np.einsum("nd,nd->n", self._levers(problem), stress))

    def gradient(self, problem: ContactProblem, state: State) -> tuple[Array, Array]:
        """Return the derivatives. Collective."""
        by_force = problem.nodes.weight[:, None] * self._levers(problem)
        along = np.einsum("nd,nd->n", by_force, problem.nodes.normal)
        return _by_layer(problem, state, along), by_force


class Largest(ABC):
    """The largest of values at nodes; its derivative is that at the first of the largest."""

    @abstractmethod
    def values(self, problem: ContactProblem, state: State) -> Array:
        """Return the values at the owned nodes. Collective."""

    def __call__(self, problem: ContactProblem, state: State) -> float:
        """Return it. Collective."""
        own = float(self.values(problem, state).max(initial=0.0))
        return float(problem.comm.allreduce(own, op=MPI.MAX))

    def located(self, problem: ContactProblem, state: State) -> Functional:
        """Return the value at the node that has the largest here, whatever others have."""
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
        pressure = problem.interface.pressure(problem.nodal(state), state.multipliers)
        return np.where(_of_contact(problem, self.contact), pressure, 0.0)

    def gradient(self, problem: ContactProblem, state: State) -> tuple[Array, Array]:
        """Return the derivatives. Collective."""
        at = _largest(problem, self.values(problem, state))
        return _by_layer(problem, state, at), at[:, None] * problem.nodes.normal


@dataclass(frozen=True)
class MeanPressure:
    """The mean pressure of a contact over the nodes that it presses; their area does not vary."""

    contact: int  #: its number

    def _pressures(self, problem: ContactProblem, state: State) -> tuple[Array, Array]:
        """Return the pressures of its nodes, and their shares of the area, (n,)."""
        pressure = problem.interface.pressure(problem.nodal(state), state.multipliers)
        pressed = _of_contact(problem, self.contact) & (pressure > 0)
        area = problem.nodes.sum(pressed.astype(np.float64))
        return pressure, np.where(pressed, problem.nodes.weight / (area or 1.0), 0.0)

    def __call__(self, problem: ContactProblem, state: State) -> float:
        """Return it. Collective."""
        pressure, shares = self._pressures(problem, state)
        return float(summed(problem.comm, shares @ pressure))

    def gradient(self, problem: ContactProblem, state: State) -> tuple[Array, Array]:
        """Return the derivatives. Collective."""
        shares = self._pressures(problem, state)[1]
        return _by_layer(problem, state, shares), shares[:, None] * problem.nodes.normal


@dataclass(frozen=True)
class MaxDisplacement(Largest):
    """The largest norm of the displacement over the nodes."""

    def values(self, problem: ContactProblem, state: State) -> Array:
        """Return the norms."""
        return np.asarray(np.linalg.norm(self._nodal(problem, state), axis=1))

    @staticmethod
    def _nodal(problem: ContactProblem, state: State) -> Array:
        body = problem.body
        return body.nodal(body.owned_part(state.x))[:, : problem.dim]

    def gradient(self, problem: ContactProblem, state: State) -> tuple[Array, Array]:
        """Return the derivatives. Collective."""
        body, u = problem.body, self._nodal(problem, state)
        length = np.linalg.norm(u, axis=1)
        at = _largest(problem, length) / np.maximum(length, np.finfo(float).tiny)
        by_x = _no_weights(problem)
        body.nodal(by_x)[:, : problem.dim] = at[:, None] * u
        return by_x, np.zeros_like(problem.nodes.normal)


@dataclass(frozen=True)
class Weighted:
    """A weighted sum of the unknowns: a mean displacement, a rigid motion, a potential."""

    #: Returns the weights of a problem, on the owned unknowns and the global ones. Collective.
    weights: Callable[[ContactProblem], Array]

    def __call__(self, problem: ContactProblem, state: State) -> float:
        """Return it. Collective."""
        body = problem.body
        return body.product(self.weights(problem), body.owned_part(state.x))

    def gradient(self, problem: ContactProblem, state: State) -> tuple[Array, Array]:
        """Return the derivatives. Collective."""
        return self.weights(problem), np.zeros_like(problem.nodes.normal)


@dataclass(frozen=True)
class Reaction:
    """A weighted sum of residual forces: of a support, an electrode, or a rigid foundation."""

    #: Returns the weights of a problem's residual, on the owned unknowns and the global ones.
    weights: Callable[[ContactProblem], Array]
    #: Returns a given force that the residual is without; None for none.
    given: Callable[[ContactProblem, State], float] | None = None

    def __call__(self, problem: ContactProblem, state: State) -> float:
        """Return it. Collective."""
        residual = residual_forces(problem, state)
        given = 0.0 if self.given is None else self.given(problem, state)
        return problem.body.product(self.weights(problem), residual) + given

    def gradient(self, problem: ContactProblem, state: State) -> tuple[Array, Array]:
        """Return the derivatives. Collective."""
        body, interface, nodes = problem.body, problem.interface, problem.nodes
        weights = self.weights(problem)
        by_x = body.tangent_transposed(state, weights)
        seen = nodes.jump(body.local(weights))
        by_force = nodes.weight[:, None] * seen[:, : nodes.dim]
        for law, jump, pressure in interface.acting(state.x, state.multipliers):
            block = law.block(jump, pressure, full=law is interface.foundation)
            there = law.nodes.jump(body.local(weights))
            law.nodes.add_jump_transposed(
                law.nodes.weight[:, None] * np.einsum("nji,nj->ni", block, there), by_x
            )
        return by_x, by_force


@dataclass(frozen=True)
class FoundationCharge:
    """The charge that passes through the contact nodes."""

    def __call__(self, problem: ContactProblem, state: State) -> float:
        """Return it. Collective."""
        acting = problem.interface.acting(state.x, state.multipliers)
        return float(sum(law.nodes.sum(law.charge(jump, p)) for law, jump, p in acting))

    def gradient(self, problem: ContactProblem, state: State) -> tuple[Array, Array]:
        """Return the derivatives. Collective."""
        by_x = _no_weights(problem)
        for law, jump, pressure in problem.interface.acting(state.x, state.multipliers):
            full = law is problem.interface.foundation
            slope = -law.charge_block(jump, pressure, full)[:, -1] / law.phi_scale
            law.nodes.add_jump_transposed(law.nodes.weight[:, None] * slope, by_x)
        return by_x, np.zeros_like(problem.nodes.normal)


def _largest(problem: ContactProblem, values: Array) -> Array:
    """Return 1 at the first of the largest values of all ranks, 0 elsewhere. Collective."""
    comm, at = problem.comm, np.zeros_like(values)
    own = float(values.max(initial=-np.inf))
    _, rank = comm.allreduce((own, -comm.rank), op=MPI.MAX)
    if comm.rank == -rank and values.size:
        at[np.argmax(values)] = 1.0
    return at


def max_pressures(problem: ContactProblem, contact: int | None = None) -> Functionals:
    """Return the largest pressure, of all contacts or of one."""
    return {"max_pressure": MaxPressure(contact)}


def mean_pressures(problem: ContactProblem, contact: int) -> Functionals:
    """Return the mean pressure of one contact."""
    return {"mean_pressure": MeanPressure(contact)}


def contact_forces(problem: ContactProblem, contact: int | None = None) -> Functionals:
    """Return the components of the contact force, of all contacts or of one."""
    axes = AXES[: problem.dim]
    return {f"contact_force_{axis}": ContactForce(i, contact) for i, axis in enumerate(axes)}


def contact_moments(problem: ContactProblem, contact: int | None = None) -> Functionals:
    """Return the components of the contact moment, of all contacts or of one; in 2-D about z."""
    if problem.dim == 2:
        return {"contact_moment": ContactForce(2, contact, moment=True)}
    about = {axis: ContactForce(i, contact, moment=True) for i, axis in enumerate(AXES)}
    return {f"contact_moment_{axis}": found for axis, found in about.items()}


def dissipations(problem: ContactProblem, contact: int | None = None) -> Functionals:
    """Return the dissipation by friction, of all contacts or of one."""
    return {"dissipation": partial(_rubbed, contact=contact)}


def plastic_dissipations(problem: ContactProblem) -> Functionals:
    """Return the dissipation in the materials, of bodies with internal variables."""
    return {"plastic_dissipation": _lost} if problem.body.laws.initial is not None else {}


def reactions(problem: ContactProblem) -> Functionals:
    """Return the components of the reactions of supports. Collective."""
    # Forces of elastic supports are no reactions: a part with both is left out.
    elastic = {support.on for support in problem.description.elastic}
    return {
        f"reaction_{axis}_{part}": Reaction(partial(_on_support, part=part, axis=i))
        for i, axis in enumerate(AXES[: problem.dim])
        for part in holding(problem, electric=False)
        if part not in elastic
    }


def driven_displacements(problem: ContactProblem) -> Functionals:
    """Return the components of the displacement of the driven part. Collective."""
    on, axes = driven_part(problem.description), enumerate(AXES[: problem.dim])
    if on is None:
        return {}
    return {f"driven_{x}": Weighted(partial(_mean, part=on, axis=i)) for i, x in axes}


def driving_forces(problem: ContactProblem) -> Functionals:
    """Return the components of the force on the driven part. Collective."""
    axes = AXES[: problem.dim] if driven_part(problem.description) is not None else ""
    return {f"driven_force_{axis}": partial(_driving, axis=i) for i, axis in enumerate(axes)}


def charges(problem: ContactProblem) -> Functionals:
    """Return the charges of electrodes and of the foundation. Collective."""
    found: dict[str, Functional] = {}
    if problem.piezoelectric:
        found["charge_foundation"] = FoundationCharge()
        for part in holding(problem, electric=True):
            found[f"charge_{part}"] = Reaction(partial(_on_electrode, part=part))
    for index, part in _groups(problem, Electrode):
        found[f"charge_{part}"] = _acting(index, 0)
    return found


def of_groups(problem: ContactProblem, kind: type, name: str) -> Functionals:
    """Return the unknowns of all electrodes, or of all bolts."""
    return {
        f"{name}_{part}": Weighted(partial(_unknown, index=i, i=0))
        for i, part in _groups(problem, kind)
    }


#: Potentials of electrodes where they are unknown, and shortenings of bolts.
potentials = partial(of_groups, kind=Electrode, name="potential")
bolt_shortenings = partial(of_groups, kind=Bolt, name="bolt_shortening")


def rigid_motions(problem: ContactProblem) -> Functionals:
    """Return displacements and rotations of moving foundations and rigid parts."""
    return {
        column: Weighted(partial(_unknown, index=index, i=i, turns=i >= problem.dim))
        for column, index, i in _rigid_columns(problem, "displacement", "rotation")
    }


def rigid_forces(problem: ContactProblem) -> Functionals:
    """Return forces and moments on moving foundations and rigid parts."""
    return {
        column: _acting(index, i) for column, index, i in _rigid_columns(problem, "force", "moment")
    }


def _groups(problem: ContactProblem, kind: type) -> list[tuple[int, str]]:
    """Return numbers and parts of the global unknowns of a kind."""
    groups = enumerate(problem.body.global_unknowns.groups)
    return [(i, group.part) for i, group in groups if isinstance(group.description, kind)]


def _rigid_columns(problem: ContactProblem, *keys: str) -> Iterator[tuple[str, int, int]]:
    """Yield the columns of rigid bodies, and group and component of each."""
    groups, rigid = problem.body.global_unknowns.groups, _groups(problem, Motion)
    foundations = [part for i, part in rigid if groups[i].is_foundation]
    parts = [part for i, part in rigid if not groups[i].is_foundation]
    for (index, _), end in zip(rigid, name_ends(foundations, parts), strict=True):
        sizes = problem.dim, groups[index].free.size - problem.dim
        columns = [columns_of(NAMES[k], n, end) for k, n in zip(keys, sizes, strict=True) if n]
        yield from ((column, index, i) for i, column in enumerate(chain(*columns)))


def _acting(index: int, i: int) -> Reaction:
    """Return a force or moment on a rigid body, or the charge of an electrode."""
    return Reaction(partial(_on_group, index=index, i=i), partial(_given, index=index, i=i))


def _rubbed(problem: ContactProblem, state: State, contact: int | None) -> float:
    """Return the energy that friction takes in the step of a state. Collective."""
    return dissipated(problem, state, _of_contact(problem, contact))


def _lost(problem: ContactProblem, state: State) -> float:
    """Return the energy dissipated in the materials in the step of a state. Collective."""
    return problem.body.laws.energies(state)[0]


def _driving(problem: ContactProblem, state: State, axis: int) -> float:
    """Return a component of the force that drives a part. Collective."""
    driven = DrivenPart.of(problem)
    assert driven is not None
    return float(driven.force(problem, state)[axis])


def _mean(problem: ContactProblem, part: str, axis: int) -> Array:
    """Return the weights of a component of the mean displacement of a part. Collective."""
    weights, nodes = _no_weights(problem), nodes_of(problem, part)
    count = problem.comm.allreduce(nodes.size, op=MPI.SUM)
    problem.body.nodal(weights)[nodes, axis] = 1 / max(count, 1)
    return weights


def _unknown(problem: ContactProblem, index: int, i: int, turns: bool = False) -> Array:
    """Return the weights of a global unknown; those of rotations in degrees."""
    body, weights = problem.body, _no_weights(problem)
    group = body.global_unknowns.groups[index]
    unit = float(group.units[i]) * (np.rad2deg(1.0) if turns else 1.0)
    body.motion(weights)[group.begin + i] = unit
    return weights


def _on_support(problem: ContactProblem, part: str, axis: int) -> Array:
    """Return the weights of a support's reaction. Collective."""
    nodes, matrices = holding(problem, electric=False)[part]
    weights = _no_weights(problem)
    problem.body.nodal(weights)[nodes, : problem.dim] = _share(problem, axis) * matrices[:, axis]
    return weights


def _on_electrode(problem: ContactProblem, part: str) -> Array:
    """Return the weights of the charge of a prescribed potential. Collective."""
    nodes, matrices = holding(problem, electric=True)[part]
    body, weights = problem.body, _no_weights(problem)
    body.nodal(weights)[nodes, -1] = matrices[:, 0, 0] / body.phi_scale
    return weights


def _on_group(problem: ContactProblem, index: int, i: int) -> Array:
    """Return the weights of a force on a rigid body, or of the charge of an electrode."""
    body, weights = problem.body, _no_weights(problem)
    group = body.global_unknowns.groups[index]
    if problem.domain.revolved and isinstance(group.description, Motion) and i != 1:
        return weights  # over the full turn it cancels
    at = group.begin + i
    tied_motion = body.global_unknowns.tied_motion[:, [at]].toarray()[:, 0]
    weights[: body.owned] = tied_motion / group.units[i]
    body.motion(weights)[at] = 1 / group.units[i]
    return weights


def _given(problem: ContactProblem, state: State, index: int, i: int) -> float:
    """Return the given force on a rigid body, or charge of an electrode, where that is free."""
    group = problem.body.global_unknowns.groups[index]
    return float(group.forces(state.time)[i] / group.units[i])


def _no_weights(problem: ContactProblem) -> Array:
    body = problem.body
    return np.zeros(body.owned + body.global_unknowns.size)
