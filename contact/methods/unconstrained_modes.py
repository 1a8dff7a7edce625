"""Rigid-body modes of a problem's bodies: constrained by supports, by contact or by friction alone.

Where friction alone constrains a mode, the linear systems are singular without friction, and at
zero displacement there are no pressures yet that would give a friction bound. The nodes that touch
first are therefore given a bound at which they stick (`UnconstrainedModes.stuck_bound`).

Where nothing constrains a mode at a solution, a rigid motion costs nothing: of all solutions the
one is taken whose displacements have the least norm in L2.

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
from numpy.typing import NDArray
from scipy.optimize import nnls

from contact.interface.multipliers import Multipliers
from contact.linear.operator import Operator
from contact.mesh.cells import rule, shape_of
from contact.mesh.entities import component_sums
from contact.mesh.geometry import geometry_nodes, measures
from contact.methods.report import Outcome
from contact.problem.condensed import CondensedProblem
from contact.problem.limit_analysis import Overload
from contact.problem.problem import ContactProblem
from contact.problem.protocols import Problem
from contact.problem.residuals import evaluate, residual_forces
from contact.problem.rigid_modes import Group, constrained_by_supports, groups, null_space
from contact.problem.state import State
from contact.tolerances import EPS, NEGLIGIBLE
from contact.typing import Array

#: Note of a rigid motion to where all nodes are open.
RIGID_MOTION = "rigid motion"

#: Friction bound of such a node, as a force over all loads.
STUCK = 10.0


@dataclass(frozen=True)
class RigidMotion:
    """Rigid motions that nothing constrains at a solution, and the amounts to subtract.

    Attributes
    ----------
    motions, columns
        Of the whole problem's unknowns, shape (unknowns, m), and of the jumps, (n, d, m).
    wanted, amounts
        For the least norm of the displacements, and for the least without penetration, (m,).
    depth
        Penetration with `wanted` (length); 0 without any.
    limited
        Whether that is more than rounding.
    """

    motions: Array
    columns: Array
    wanted: Array
    amounts: Array
    depth: float
    limited: bool

    @property
    def motion(self) -> Array:
        """The motion to subtract, of owned and global unknowns of the whole problem."""
        return self.motions @ self.amounts


@dataclass
class UnconstrainedModes:
    """How the rigid-body modes are constrained; computed when first asked for. Collective.

    Parameters
    ----------
    problem
        The whole problem: of a condensed one the supports are not seen.
    """

    problem: ContactProblem

    @cached_property
    def constrained_by_supports(self) -> bool:
        """Whether the supports constrain all modes without contact."""
        return constrained_by_supports(self.problem)

    @cached_property
    def constrained_undeformed(self) -> bool:
        """Whether supports, and contact where it touches in the reference configuration, do."""
        return self._held_undeformed(self.problem.frictional)

    @cached_property
    def friction_alone(self) -> bool:
        """Whether a mode is constrained by friction alone.

        Nodes that touch at once hold bodies along their normals, no others: a ring between two
        plates moves far aside before others touch.
        """
        return self.problem.frictional and not self._held_undeformed(friction=False)

    def _held_undeformed(self, friction: bool) -> bool:
        """Tell whether supports, and contact where it touches undeformed, hold all bodies."""
        interface, rest = self.problem.interface, self.problem.start()
        touching = interface.opening(interface.jump.apply(rest.x)) <= 1e-12 * interface.diameter
        held = [group.held(friction, touching) for group in groups(self.problem)]
        return all(null_space(gram).size == 0 for gram in held)

    def stuck_bound(self) -> Array | None:
        """Return friction bounds that no load exceeds, shape (n,) (stress). Collective.

        None where supports and the foundation restrain all modes, and the loads on them, without
        friction.
        """
        problem = self.problem
        weight = problem.interface.jump.weight
        if not problem.frictional:
            return None
        if not self.friction_alone and self.overload(np.zeros_like(weight)) == 1:
            return None
        loads = _loads(problem)
        borne, total = float(loads[_without_supports(problem)].sum()), float(loads.sum())
        # Loads on another body need not be borne, but where a body is squeezed by it alone.
        bound = STUCK * (borne if borne > EPS * total else total)
        return np.where(self._nearest(), bound / weight, 0.0)

    def overload(self, bound: Array) -> float:
        """Return the least multiple of friction bounds that balances the loads, at least 1.

        Infinity where none does, however large the pressures. Collective.

        Parameters
        ----------
        bound
            The bounds at the contact nodes of this rank, shape (n,) (stress).
        """
        friction, time = self.problem.nodes.weight * bound, self.problem.time
        found = [Overload.of(group, time, friction) for group in self._unsupported]
        return max((lost.multiple for lost in found if lost is not None), default=1.0)

    def _nearest(self) -> NDArray[np.bool_]:
        """Tell which nodes of each unsupported body touch first, shape (n,). Collective.

        By friction at others, whose tangents are inclined, a body could hang without pressure.
        """
        interface, rest = self.problem.interface, self.problem.start()
        opening = interface.opening(interface.jump.apply(rest.x))
        found = np.zeros(opening.size, dtype=bool)
        for group in self._unsupported:
            moved = np.abs(group.normal).sum(axis=1) + np.abs(group.tangential).sum(axis=(1, 2))
            own = np.where(moved > 0, opening, np.inf)
            found |= own <= NEGLIGIBLE * interface.diameter - interface.jump.maximum(-own)
        return found

    @cached_property
    def _unsupported(self) -> list[Group]:
        return [group for group in groups(self.problem) if null_space(group.supports).size > 0]

    def separated(
        self, problem: CondensedProblem, operator: Operator, stiffness: float
    ) -> State | None:
        """Return a state with all nodes open, by a rigid motion out of penetration. Collective.

        None where the motion is longer than sqrt(2) times the penetration, more than 45 degrees off
        the normal: out of a wedge, say, in which friction might hold the body.

        Parameters
        ----------
        problem
            The condensed problem.
        operator
            That of its body.
        stiffness
            Of a node (stress/length). A proximal term of sqrt(EPS) times it makes the system
            regular and leaves rigid motions as they are; a second step removes its forces.
        """
        jump, start = problem.interface.jump, problem.start()
        blocks = np.zeros((jump.nodes.size, jump.block_size, jump.block_size))
        blocks[:] = np.sqrt(EPS) * stiffness * np.eye(jump.block_size)
        operator.update("secant", start, problem.interface.weighted(blocks, start.x))
        state = start
        for _ in range(2):  # each leaves the root of the rounding
            increment = operator.solve(-residual_forces(problem, state))
            state = replace(state, x=problem.equilibrium.moved(state.x, increment))
        found = self.free_motion(problem, state)
        if found is None:
            return None
        further = found.columns @ (found.amounts - found.wanted)
        way = jump.maximum(np.linalg.norm(further, axis=1))
        if not way**2 <= 2 * found.depth**2:  # more than 45 degrees off the normal
            return None
        moved = np.zeros((state.x.size // jump.block_size, jump.block_size))
        moved[jump.nodes, : jump.dim] = found.columns @ found.amounts
        return replace(state, x=state.x - moved.ravel())

    def free_motion(self, problem: Problem, state: State) -> RigidMotion | None:
        """Return the free rigid motion to take off a solution; None without any. Collective.

        Parameters
        ----------
        problem
            The whole problem, or the condensed one.
        state
            Its solution.
        """
        interface = problem.interface
        jump, nodal = interface.jump, interface.jump.apply(state.x)
        # Pressures that are rounding hold nothing.
        pressed = interface.pressure(nodal, state.forces) > interface.rounding(nodal)
        motions, columns = [], []
        for group in self._unsupported:
            free = null_space(group.held(self.problem.frictional, pressed))
            if free.shape[1] > 0:
                along = group.normal[:, None, :] * jump.lift[:, :, None]
                columns.append((along + group.tangential) @ free)
                motions.append(group.moved @ free)
        if not motions:
            return None
        moved, whole = np.concatenate(columns, axis=2), np.hstack(motions)
        if isinstance(problem, ContactProblem):
            body = problem.equilibrium
            vectors = [*(body.local(column) for column in whole.T), state.x]
            rows, weights = _by_volume(problem, vectors)
        else:  # of a condensed body the displacements at contact nodes, relative to the other side
            values = np.concatenate([moved, nodal[:, : jump.dim, None]], axis=2)
            rows, weights = values.reshape(-1, values.shape[2]), np.repeat(jump.weight, jump.dim)
        gram = jump.comm.allreduce(rows.T @ (weights[:, None] * rows), op=MPI.SUM)
        products, sides = gram[:-1, :-1], gram[:-1, -1]
        wanted = amounts = np.linalg.lstsq(products, sides, rcond=EPS)[0]
        near, opening = np.isfinite(jump.gap), interface.opening(nodal)
        rising = np.einsum("ni,nik->nk", jump.normal, moved)
        depth = jump.maximum(-(opening + rising @ wanted)[near])
        limited = depth > NEGLIGIBLE * interface.diameter
        if limited:
            # Depths of a solution are rounding.
            deep = opening < -NEGLIGIBLE * interface.diameter
            room = np.where(deep, opening, np.maximum(opening, 0.0))
            parts = jump.comm.allgather((rising[near], room[near]))
            cone, room = (np.concatenate(part) for part in zip(*parts, strict=True))
            amounts = _least_distance(products, wanted, cone, -room)
        return RigidMotion(whole, moved, wanted, amounts, depth, limited)

    def pushed_aside(self, problem: Problem, state: State) -> bool:
        """Tell whether contact has moved a body to where nothing constrains it. Collective.

        With friction there may be another solution, in which it is constrained.
        """
        if not problem.interface.friction.acts or self.constrained_by_supports:
            return False
        found = self.free_motion(problem, state)
        return found is not None and found.limited


def _by_volume(problem: ContactProblem, vectors: Sequence[Array]) -> tuple[Array, Array]:
    """Return displacements at points of this rank's cells, (n, k), and the points' volumes, (n,).

    Of local unknowns; products with these weights, some of which are negative, are those in L2.
    Foundations that move count as the whole body.
    """
    body, domain = problem.equilibrium, problem.domain
    shape, nodes = shape_of(domain.mesh), geometry_nodes(domain)
    straight = shape.simplex and domain.order == 1
    points, weights = rule(shape, 2 * body.degree + (1 if straight else 3 * domain.order))
    size = measures(domain.revolved, shape, nodes, points, weights)
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
    """Take a rigid motion that costs nothing off a solution, whatever found it. Collective.

    Parameters
    ----------
    modes
        Those of the whole problem, at the time of the step.
    state, outcome
        Where a method has ended; without convergence nothing is changed but where the bodies are in
        balance without any contact force.

    Returns
    -------
    The solution with the least displacements in L2, and its residuals; those given where nothing is
    free.
    """
    problem, body = modes.problem, modes.problem.equilibrium
    if outcome.signal or modes.constrained_by_supports:
        return state, outcome
    if not outcome.converged:
        # Bodies that have been pushed aside press by rounding, on which a method stalls.
        free = replace(state, forces=Multipliers.zero(problem.interface.jump))
        residuals = evaluate(problem, free)
        if residuals.excess(outcome.allowed):
            return state, outcome
        state, outcome = free, replace(outcome, residuals=residuals)
    found = modes.free_motion(problem, state)
    if found is None:
        return state, outcome
    x = body.moved(state.x, -found.motion)
    # Where nothing presses, forces by rounding alone are out of balance elsewhere.
    for forces in (Multipliers.zero(problem.interface.jump), state.forces):
        least = replace(state, x=x, forces=forces)
        residuals = evaluate(problem, least)
        if not residuals.excess(outcome.allowed):
            outcome = replace(outcome, residuals=residuals)
            pressed = problem.interface.jump.maximum(state.forces.pressure) > 0
            if pressed and forces is not state.forces:
                # Pressures that are gone, as rounding, have held other motions.
                return with_least_displacements(modes, least, outcome)
            return least, outcome
    return state, outcome


def _least_distance(products: Array, wanted: Array, cone: Array, least: Array) -> Array:
    """Return the q nearest to a wanted one in the norm of `products` with cone q >= least.

    NaN where there is none.
    """
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


def all_loads(problem: Problem) -> float:
    """Return the sum of the magnitudes of all loads at zero displacement. Collective."""
    return float(_loads(problem).sum())


def _loads(problem: Problem) -> Array:
    """Return these sums of each connected component, shape (k,). Collective."""
    body, of = problem.equilibrium, problem.equilibrium.component_norms
    residual = residual_forces(problem, problem.start())
    forces = np.abs(body.unbalanced(residual)) * of.mechanical
    own = np.repeat(of.component, body.block_size)
    found = component_sums(body.comm, own, forces[: body.owned], of.count)
    return found + np.bincount(of.behind, forces[body.owned :], of.count)


def _without_supports(problem: ContactProblem) -> NDArray[np.bool_]:
    """Return which connected components have no support at all, shape (k,). Collective."""
    body, of = problem.equilibrium, problem.equilibrium.component_norms
    supported = np.any(~body.unsupported[:, : body.dim], axis=1).astype(float)
    if body.layout.inclined is not None:
        supported[body.layout.inclined.nodes] = 1.0
    return component_sums(problem.comm, of.component, supported, of.count) == 0
