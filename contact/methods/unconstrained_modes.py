"""Rigid-body modes that the supports do not constrain: by contact, by friction alone, by nothing.

Solutions with an unconstrained mode differ by a rigid motion: the one of least displacements in L2
is taken (`with_least_displacements`).

References
----------
Lawson and Hanson, Solving least squares problems (1974), chapter 23: least distances with
inequalities by non-negative least squares.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from mpi4py import MPI
from scipy.optimize import nnls

from contact.body.equilibrium import BodyEquilibrium
from contact.interface.multipliers import Multipliers
from contact.mesh.cells import rule, shape_of
from contact.mesh.geometry import geometry_nodes, integration_weights
from contact.methods.newton_step import NewtonStep
from contact.methods.report import Outcome
from contact.problem.condensed import AnyProblem, CondensedEquilibrium, CondensedProblem
from contact.problem.problem import ContactProblem
from contact.problem.residuals import evaluate, residual_forces
from contact.problem.rigid_modes import (
    Group,
    missing_pressure,
    null_space,
    sliding_mode,
    unsupported,
)
from contact.problem.state import State
from contact.ranks import summed
from contact.tolerances import EPS, NEGLIGIBLE
from contact.typing import Array

#: Note of a rigid motion to a state with all nodes open.
RIGID_MOTION = "rigid motion"


@dataclass(frozen=True)
class RigidMotion:
    """The m unconstrained modes of a solution, and the amounts to subtract."""

    motions: Array  #: modes in the unknowns of the whole problem, (unknowns, m)
    columns: Array  #: modes in the jumps, (n, d, m)
    wanted: Array  #: amounts for the displacements of least norm, (m,)
    amounts: Array  #: the same under the condition of no penetration, (m,)
    depth: float  #: penetration with `wanted` (length)
    limited: bool  #: whether `depth` is more than rounding

    @property
    def motion(self) -> Array:
        """The motion to subtract, in owned and global unknowns of the whole problem."""
        return self.motions @ self.amounts


@dataclass(frozen=True)
class UnconstrainedModes:
    """Constraints of the rigid-body modes of the whole problem at a load step. Collective."""

    problem: ContactProblem
    #: Groups of bodies with modes that their supports do not constrain, the same in all load steps
    #: at one geometry.
    groups: tuple[Group, ...]

    @staticmethod
    def of(problem: ContactProblem) -> UnconstrainedModes:
        """Return the modes of a problem. Collective."""
        return UnconstrainedModes(problem, unsupported(problem))

    @property
    def constrained_by_supports(self) -> bool:
        """Whether the supports constrain all modes without contact."""
        return not self.groups

    @cached_property
    def constrained_undeformed(self) -> bool:
        """Whether they do together with the contact of the reference configuration."""
        return self._constrained_undeformed(self.problem.frictional)

    @cached_property
    def friction_alone(self) -> bool:
        """Whether the friction of the reference configuration has to constrain a mode."""
        return self.problem.frictional and not self._constrained_undeformed(friction=False)

    def _constrained_undeformed(self, friction: bool) -> bool:
        """Tell whether supports and contact of the reference configuration constrain all modes."""
        interface, rest = self.problem.interface, self.problem.start()
        touching = interface.normal_gap(interface.nodes.jump(rest.x)) <= 1e-12 * interface.size
        grams = [group.constraints(friction, touching) for group in self.groups]
        return all(null_space(gram).size == 0 for gram in grams)

    def overloaded(self, bound: Array, pressure: Array | None = None) -> bool:
        """Tell whether the loads are more than friction bounds (n,) balance. Collective.

        Of pressures that miss a share of the loads, which may be larger by it, and so friction;
        those that bear less than half of the loads prove nothing.
        """
        weight, missing = self.problem.nodes.weight, 0.0
        loads = self.problem.body.external(self.problem.time)
        if pressure is not None:
            shares = [missing_pressure(group, loads, weight * pressure) for group in self.groups]
            missing = max(shares, default=0.0)
        if not missing <= 1:
            return False
        friction = (1 + missing) * weight * bound
        sliding = [sliding_mode(group, loads, friction) for group in self.groups]
        return any(mode is not None for mode in sliding)

    def separated(self, problem: CondensedProblem, step: NewtonStep) -> State | None:
        """Return a state with all nodes open after a rigid motion; None without one. Collective.

        None too where the motion is more than 45 degrees off the normal: out of a wedge, in which
        friction might constrain the body. A proximal term of sqrt(EPS) times the stiffness of a
        node makes the system regular; a second step removes its forces.
        """
        nodes, start = problem.interface.nodes, problem.start()
        blocks = np.zeros((nodes.nodes.size, nodes.block_size, nodes.block_size))
        blocks[:] = np.sqrt(EPS) * step.parameters.nodal_stiffness * np.eye(nodes.block_size)
        step.operator.update("secant", start, problem.interface.weighted(blocks, start.x))
        state = start
        for _ in range(2):  # each leaves an error of sqrt(EPS)
            increment = step.operator.solve(-residual_forces(problem, state))
            state = replace(state, x=problem.body.updated(state.x, increment))
        motion = self.free_motion(problem, state)
        if motion is None:
            return None
        further = motion.columns @ (motion.amounts - motion.wanted)
        distance = nodes.maximum(np.linalg.norm(further, axis=1))
        if not distance**2 <= 2 * motion.depth**2:  # more than 45 degrees off the normal
            return None
        moved = np.zeros((state.x.size // nodes.block_size, nodes.block_size))
        moved[nodes.nodes, : nodes.dim] = motion.columns @ motion.amounts
        return replace(state, x=state.x - moved.ravel())

    def free_motion(self, problem: AnyProblem, state: State) -> RigidMotion | None:
        """Return the unconstrained modes at a solution; None if there are none. Collective.

        The problem is the whole one or a condensed one.
        """
        interface = problem.interface
        nodes, jump = interface.nodes, interface.nodes.jump(state.x)
        # Pressures that are rounding do not constrain.
        pressed = interface.pressure(jump, state.multipliers) > interface.rounding_stress(jump)
        motions, columns = [], []
        for group in self.groups:
            free = null_space(group.constraints(self.problem.frictional, pressed))
            if free.shape[1] > 0:
                along = group.normal[:, None, :] * nodes.admissible_normal[:, :, None]
                columns.append((along + group.tangential) @ free)
                motions.append(group.moved @ free)
        if not motions:
            return None
        moved, whole = np.concatenate(columns, axis=2), np.hstack(motions)
        if isinstance(problem, ContactProblem):
            body = problem.body
            vectors = [*(body.local(column) for column in whole.T), state.x]
            rows, weights = _by_volume(problem, vectors)
        else:  # of a condensed body the jumps alone are known
            values = np.concatenate([moved, jump[:, : nodes.dim, None]], axis=2)
            rows, weights = values.reshape(-1, values.shape[2]), np.repeat(nodes.weight, nodes.dim)
        gram = nodes.comm.allreduce(rows.T @ (weights[:, None] * rows), op=MPI.SUM)
        products, sides = gram[:-1, :-1], gram[:-1, -1]
        wanted = amounts = np.linalg.lstsq(products, sides, rcond=EPS)[0]
        near, normal_gap = np.isfinite(interface.gap), interface.normal_gap(jump)
        rising = np.einsum("ni,nik->nk", nodes.normal, moved)
        depth = nodes.maximum(-(normal_gap + rising @ wanted)[near])
        limited = depth > NEGLIGIBLE * interface.size
        if limited:
            # Penetration of a solution is rounding.
            deep = normal_gap < -NEGLIGIBLE * interface.size
            room = np.where(deep, normal_gap, np.maximum(normal_gap, 0.0))
            parts = nodes.comm.allgather((rising[near], room[near]))
            cone, room = (np.concatenate(part) for part in zip(*parts, strict=True))
            amounts = _least_distance(products, wanted, cone, -room)
        return RigidMotion(whole, moved, wanted, amounts, depth, limited)

    def unconstrained_at(self, problem: AnyProblem, state: State) -> bool:
        """Tell whether a rigid-body mode has become unconstrained at a solution. Collective.

        With friction there may be another solution, at which it is constrained.
        """
        if not problem.interface.friction.acts or self.constrained_by_supports:
            return False
        motion = self.free_motion(problem, state)
        return motion is not None and motion.limited


def _by_volume(problem: ContactProblem, vectors: Sequence[Array]) -> tuple[Array, Array]:
    """Return displacements at quadrature points, (n, k), of local unknowns, and the weights (n,).

    Motions of a foundation have the volume of the bodies as weight. Some weights are negative.
    """
    body, domain = problem.body, problem.domain
    shape, nodes = shape_of(domain.mesh), geometry_nodes(domain)
    straight = shape.simplex and domain.order == 1
    points, weights = rule(shape, 2 * body.degree + (1 if straight else 3 * domain.order))
    size = integration_weights(domain.revolved, shape, nodes, points, weights)
    functions, cells = shape.lagrange(body.degree, points), body.space.dofmap.list[: len(size)]
    rows = []
    for x in vectors:
        at = np.einsum("qk,nkd->nqd", functions, body.nodal(x)[cells, : body.dim])
        rows.append(np.append(at.ravel(), body.motion(x)))
    behind = np.full(len(rows[0]) - size.size * body.dim, size.sum())
    return np.stack(rows, axis=1), np.append(np.repeat(size, body.dim), behind)


def with_least_displacements(
    modes: UnconstrainedModes, state: State, outcome: Outcome
) -> tuple[State, Outcome]:
    """Subtract unconstrained rigid-body modes from a solution: least displacements in L2.

    Without convergence nothing is changed, unless the bodies are in equilibrium without contact
    forces. Collective.
    """
    problem, body = modes.problem, modes.problem.body
    if outcome.signal or modes.constrained_by_supports:
        return state, outcome
    if not outcome.converged:
        # A method may stall on contact forces that are rounding.
        free = replace(state, multipliers=Multipliers.zero(problem.interface.nodes))
        residuals = evaluate(problem, free)
        if residuals.unmet(outcome.allowed):
            return state, outcome
        state, outcome = free, replace(outcome, residuals=residuals)
    free_motion = modes.free_motion(problem, state)
    if free_motion is None:
        return state, outcome
    x = body.updated(state.x, -free_motion.motion)
    # Contact forces that are rounding are out of balance after the motion.
    for multipliers in (Multipliers.zero(problem.interface.nodes), state.multipliers):
        least = replace(state, x=x, multipliers=multipliers)
        residuals = evaluate(problem, least)
        if not residuals.unmet(outcome.allowed):
            outcome = replace(outcome, residuals=residuals)
            pressed = problem.interface.nodes.maximum(state.multipliers.contact) > 0
            if pressed and multipliers is not state.multipliers:
                # Pressures that were rounding have constrained other modes.
                return with_least_displacements(modes, least, outcome)
            return least, outcome
    return state, outcome


def _least_distance(products: Array, wanted: Array, cone: Array, least: Array) -> Array:
    """Minimise (q - wanted)^T products (q - wanted) with cone q >= least; NaN if infeasible."""
    values, vectors = np.linalg.eigh(products)
    used = values > EPS * values.max()
    back = vectors[:, used] / np.sqrt(values[used])
    rows, below = cone @ back, least - cone @ wanted
    size = max(float(np.abs(below).max()), np.finfo(float).tiny)
    unit = np.append(np.zeros(back.shape[1]), 1.0)
    system = np.vstack([rows.T, below / size])
    residual = system @ nnls(system, unit)[0] - unit
    if residual[-1] == 0:
        return np.full_like(wanted, np.nan)
    return np.asarray(wanted - size * back @ residual[:-1] / residual[-1])


def all_loads(problem: AnyProblem) -> float:
    """Return the sum of |load| over the unknowns, at zero displacement. Collective."""
    body = problem.body
    return sum_of_forces(body, body.unbalanced(residual_forces(problem, problem.start())))


def sum_of_forces(body: BodyEquilibrium | CondensedEquilibrium, forces: Array) -> float:
    """Return the sum of |force| over the unknowns, of owned values. Collective."""
    on_nodes, on_global = np.split(np.abs(forces) * body.component_norms.mechanical, [body.owned])
    return float(summed(body.comm, on_nodes.sum())) + float(on_global.sum())
