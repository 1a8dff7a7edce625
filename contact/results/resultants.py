"""Resultants: reactions of supports, charges of electrodes, contact forces, rigid motions.

Forces and charges are not integrals of a discrete stress or D, which converge slowly at edges of
supports and electrodes, but the residuals of the discrete equations, summed over nodes. These
balance to the tolerance of the solver on any mesh. Charges are D.nu integrated, nu pointing out of
the body, in the sign of the given charges q_2 = D.nu.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from numpy.typing import NDArray

from contact.body.loads import Loads
from contact.errors import InputError
from contact.mesh.domain import compiled, members
from contact.mesh.geometry import area
from contact.model.body import Body, Bolt, Electrode
from contact.model.fields import knows_time, steady
from contact.model.formula import is_zero
from contact.problem.problem import ContactProblem
from contact.problem.residuals import residual_forces
from contact.problem.state import State
from contact.typing import Array


@dataclass(frozen=True)
class Resultant:
    """The sum of forces at nodes, in the reference configuration; of revolution of a full turn."""

    force: Array  #: shape (d,)
    moment: Array  #: about the origin, shape (1,) in 2-D, about z, and (3,) in 3-D


def resultant(problem: ContactProblem, points: Array, forces: Array) -> Resultant:
    """Return the resultant of forces at owned points, both of shape (n, d). Collective."""
    d = problem.dim
    if d == 3:
        turns = np.cross(points, forces)
    else:
        turns = (points[:, 0] * forces[:, 1] - points[:, 1] * forces[:, 0])[:, None]
    local = np.concatenate([forces, turns], axis=1).sum(axis=0)
    total = problem.comm.allreduce(local, op=MPI.SUM)
    moment = np.zeros(1) if problem.domain.revolved else total[d:]
    return Resultant(problem.domain.resultant(total[:d]), moment)


def contact_resultant(problem: ContactProblem, state: State) -> Resultant:
    """Return the resultant of the body's forces on the foundations. Collective."""
    nodes = problem.nodes
    stress = problem.interface.traction(problem.nodal(state), state.multipliers)
    return resultant(problem, nodes.points, nodes.weight[:, None] * stress)


def supports(problem: ContactProblem, state: State) -> Mapping[str, Resultant]:
    """Return the forces of the supports on the body, part by part. Collective."""
    d, body = problem.dim, problem.body
    residual = body.nodal(residual_forces(problem, state))[:, :d]
    points = body.space.tabulate_dof_coordinates()[:, :d]
    found = {
        part: resultant(problem, points[nodes], np.einsum("nij,nj->ni", matrices, residual[nodes]))
        for part, (nodes, matrices) in holding(problem, electric=False).items()
    }
    owned = body.owned // body.block_size
    forces_of = body.elastic_forces(state.x)
    for support, forces in zip(problem.description.elastic, forces_of, strict=True):
        on_body = -forces.reshape(-1, body.block_size)[:, :d]
        own = resultant(problem, points[:owned], on_body)
        other = found.get(support.on, Resultant(0 * own.force, 0 * own.moment))
        found[support.on] = Resultant(own.force + other.force, own.moment + other.moment)
    return found


def holding(problem: ContactProblem, electric: bool) -> dict[str, tuple[NDArray[np.int32], Array]]:
    """Return the nodes of supports, or electrodes, and matrices from residuals to reactions there.

    By part; (n, d, d), or (n, 1, 1). A component of a node on two parts counts for the first of
    them, and a roller bears forces along its normal alone. Collective.
    """
    d, body = problem.dim, problem.body
    found: dict[str, tuple[NDArray[np.int32], Array]] = {}
    left = ~body.unsupported[:, slice(d, None) if electric else slice(d)]
    for number, fixed in enumerate(problem.description.fixed):
        constrained = np.isin(np.arange(d), [*fixed.components])
        if electric:
            constrained = np.array([fixed.potential is not None])
        rolls = fixed.normal is not None and not electric
        for part in members(fixed.on) if constrained.any() or rolls else ():
            nodes = nodes_of(problem, part)
            if rolls:
                along = body.rollers.forces(number, nodes)
            else:
                along = np.eye(constrained.size) * (left[nodes] & constrained)[:, None, :]
                if not electric:
                    along = along - along @ body.rollers.borne(nodes)
                left[nodes] &= ~constrained
            if part in found:  # prescribed there by several entries
                along = along + found[part][1]
            found[part] = nodes, along
    return found


def nodes_of(problem: ContactProblem, part: str) -> NDArray[np.int32]:
    """Return the owned nodes of a part of the boundary."""
    body = problem.body
    facets = problem.domain.facets_anywhere(part)
    nodes = fem.locate_dofs_topological(body.space, problem.dim - 1, facets)
    return np.asarray(nodes[nodes < body.owned // body.block_size])


@dataclass(frozen=True)
class DrivenPart:
    """The part that is moved or loaded in time: its way and its force make a loop."""

    #: Where residuals are reactions of its supports, and the matrices of these; `holding`.
    supports: Sequence[tuple[NDArray[np.int32], Array]]
    loads: Loads  #: those on the part alone

    @staticmethod
    def of(problem: ContactProblem) -> DrivenPart | None:
        """Return the driven part of a problem; None without any. Collective."""
        on = driven_part(problem.description)
        if on is None:
            return None
        parts, body = set(members(on)), problem.body
        supports = [at for part, at in holding(problem, electric=False).items() if part in parts]
        within = [load.on for load in problem.description.loads if load.on]
        within = [name for name in within if parts >= set(members(name))]
        return DrivenPart(supports, body.loads_along(body.space, within))

    def force(self, problem: ContactProblem, state: State) -> Array:
        """Return the force on it, of its own supports and loads, shape (d,). Collective."""
        d, body = problem.dim, problem.body
        residual = body.nodal(residual_forces(problem, state))[:, :d]
        total = self.loads.at(state.time).reshape(-1, body.block_size)[:, :d].sum(axis=0)
        for nodes, matrices in self.supports:
            total = total + np.einsum("nij,nj->i", matrices, residual[nodes])
        return np.asarray(problem.comm.allreduce(total, op=MPI.SUM))


def driven_part(body: Body) -> str | None:
    """Return the first part that moves in time, or has a load; None without any."""
    for fixed in body.fixed:
        given = [value for key, value in fixed.given.items() if key != "potential"]
        moves = any(not is_zero(component) for component in given)
        if moves and (knows_time(given) or fixed.factor is not steady):
            return str(fixed.on)
    loaded = [load.on for load in body.loads if load.on is not None]
    return loaded[0] if loaded else None


@dataclass(frozen=True)
class ChargeBalance:
    """Charges of a body: D.nu over its parts, nu out of it, which is minus their free charge.

    A node of two electrodes with a prescribed potential counts for the one that is fixed first.
    `magnitude` is a scale: with an insulator and one electrode all parts are neutral, though not
    free of charge everywhere.
    """

    electrodes: Mapping[str, float]  #: of parts with a prescribed or one unknown potential
    given: Mapping[str, float]  #: prescribed surface charges of parts
    foundation: float  #: charge that passes through the contact part
    body: float  #: prescribed volume charge: the sum of all the others, by Gauss's law
    magnitude: float  #: sum of the absolute nodal charges

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
class Reading:
    """The reading of a sensor's electrode."""

    charge: float | None  #: int D.nu over the part; None if its potential is not prescribed
    potential: float  #: mean over the part


def charge_balance(problem: ContactProblem, state: State) -> ChargeBalance:
    """Return the charges by part at a state; InputError without piezoelectricity. Collective."""
    _demand_potential(problem)
    body, time = problem.body, state.time
    d, bs = problem.dim, body.block_size
    residual = body.nodal(residual_forces(problem, state))[:, d:]
    residual = np.asarray(residual / body.phi_scale)
    parts = holding(problem, electric=True)
    on_parts = {part: matrices[:, 0] * residual[nodes] for part, (nodes, matrices) in parts.items()}
    on_parts |= {e.on: residual[nodes_of(problem, e.on)] for e in problem.description.electrodes}
    electrodes = {part: _sum(problem, charges) for part, charges in on_parts.items()}
    magnitude = sum(_sum(problem, np.abs(charges)) for charges in on_parts.values())
    given: dict[str | None, float] = {}
    loads = [
        load for load in problem.description.loads if {"charge", "body_charge"} & load.given.keys()
    ]
    for on in dict.fromkeys(load.on for load in loads):  # None is the whole body
        acting = body.loads_along(body.space, [on]).at(time)
        charges = acting.reshape(-1, bs)[:, d]
        given[on] = _sum(problem, charges) / body.phi_scale
        magnitude += _sum(problem, np.abs(charges)) / body.phi_scale
    in_volume = -given.pop(None, 0.0)
    passed = _foundation_charges(problem, state)
    magnitude += _sum(problem, np.abs(passed))
    surface = {str(part): charge for part, charge in given.items()}
    return ChargeBalance(electrodes, surface, _sum(problem, passed), in_volume, magnitude)


def _foundation_charges(problem: ContactProblem, state: State) -> Array:
    """Return the charges that leave the owned nodes through contact; between bodies they cancel."""
    body = problem.body
    leaving = np.zeros_like(body.external(state.time))
    for law, jump, pressure in problem.interface.acting(state.x, state.multipliers):
        density = np.zeros((jump.shape[0], body.block_size))
        density[:, -1] = law.nodes.weight * law.charge(jump, pressure)
        law.nodes.add_jump_transposed(density, leaving)
    return np.asarray(body.nodal(leaving)[:, -1])


def mean_potential(problem: ContactProblem, state: State, part: str) -> float:
    """Return the mean potential over a part; InputError without potential or part. Collective."""
    _demand_potential(problem)
    body = problem.body
    _, phi = body.split(body.function(state.x))
    ds = problem.domain.ds(part)
    integral = problem.comm.allreduce(fem.assemble_scalar(compiled(phi * ds)), op=MPI.SUM)
    return float(integral / area(problem.domain, part))


def sensor(problem: ContactProblem, state: State, electrode: str) -> Reading:
    """Return charge and mean potential of an electrode, or of a strip of surface. Collective."""
    charges = charge_balance(problem, state).electrodes
    return Reading(charges.get(electrode), mean_potential(problem, state, electrode))


def _demand_potential(problem: ContactProblem) -> None:
    if not problem.piezoelectric:
        raise InputError("charges and potentials need a piezoelectric material", "piezo")


def _sum(problem: ContactProblem, values: Array) -> float:
    return float(problem.comm.allreduce(float(np.sum(values)), op=MPI.SUM))


#: Motions of rigid bodies, states of electrodes and bolts, by part: see `movements`.
Movements = dict[str, dict[str, Any]]


def movements(problem: ContactProblem, state: State) -> Movements:
    """Return `rigid`, `rigid_parts`, `electrodes` and `bolts` of the summary. Collective."""
    # Forces, moments and charges act from outside: those given, or reactions of given components.
    foundations, parts, electrodes, bolts = (dict[str, Any]() for _ in range(4))
    body = problem.body
    global_unknowns, q = body.global_unknowns, body.motion(state.x)
    if global_unknowns.size == 0:
        return {}
    residual = residual_forces(problem, state)
    forces = body.motion(residual) + global_unknowns.gathered(residual[: body.owned])
    forces += global_unknowns.forces(state.time)
    for group in global_unknowns.groups:
        values, own = q[group.columns] * group.units, forces[group.columns]
        part = group.part
        if isinstance(group.description, Electrode):
            charge = float((own / group.units)[0])
            electrodes[part] = {"potential": float(values[0]), "charge": charge}
            continue
        if isinstance(group.description, Bolt):
            bolts[part] = {"shortening": float(values[0]), "force": float(own[0])}
            continue
        if problem.domain.revolved:
            # Over the full turn forces across the axis, and moments about it, cancel.
            own = np.where(np.arange(own.size) == 1, own, 0.0)
        own, d = own / group.units, len(group.description.displacement or ())
        (foundations if group.is_foundation else parts)[part] = {
            "displacement": [float(value) for value in values[:d]],
            "rotation": _one_or_more(np.rad2deg(values[d:])),
            "force": [float(value) for value in own[:d]],
            "moment": _one_or_more(own[d:]),
        }
    rigid = next(iter(foundations.values())) if len(foundations) == 1 else foundations
    found = {"rigid": rigid, "rigid_parts": parts, "electrodes": electrodes, "bolts": bolts}
    return {key: value for key, value in found.items() if value}


def _one_or_more(values: Array) -> Any:
    return float(values[0]) if values.size == 1 else values.tolist()


#: Keys of the movement of a rigid body -> the beginnings of their columns.
NAMES = {
    "displacement": "rigid",
    "rotation": "rigid_rotation",
    "force": "rigid_force",
    "moment": "rigid_moment",
}


def rigid_columns(moving: Movements, *keys: str) -> dict[str, float]:
    """Return the columns of some keys of rigid bodies, from their `movements`."""
    rigid, parts = moving.get("rigid", {}), moving.get("rigid_parts", {})
    foundations = {"": rigid} if isinstance(rigid.get("displacement"), list) else rigid
    bodies, found = [*foundations.values(), *parts.values()], dict[str, float]()
    for body, end in zip(bodies, name_ends([*foundations], [*parts]), strict=True):
        for key in keys:
            values = [float(value) for value in np.atleast_1d(body[key])]
            found |= zip(columns_of(NAMES[key], len(values), end), values, strict=True)
    return found


def part_columns(moving: Movements, kind: str, prefix: str, *keys: str) -> dict[str, float]:
    """Return the columns of some keys of electrodes or bolts, from the `movements`."""
    parts = moving.get(kind, {}).items()
    return {f"{prefix}{key}_{part}": values[key] for part, values in parts for key in keys}


def name_ends(foundations: Sequence[str], parts: Sequence[str]) -> list[str]:
    """Return the ends of columns: the part of one of several foundations, and of rigid parts."""
    names = [f"_{part}" for part in (*foundations, *parts)]
    if len(foundations) == 1 or len(names) == 1:
        names[0] = ""
    return names


def columns_of(name: str, size: int, end: str) -> list[str]:
    """Return the columns of a scalar or vector of a rigid body."""
    axes = [f"_{axis}" for axis in "xyz"[:size]] if size > 1 else [""]
    return [f"{name}{axis}{end}" for axis in axes]
