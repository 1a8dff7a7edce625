"""The equations of a contact problem linearised at a solution, and their transpose.

At a solution whose active set does not change nearby, the unknowns x and the contact forces
lambda = lambda_c nu + lambda_f of the nodes (f in the code) satisfy smooth equations,

    F(x) + P(T x) - f + T^T W lambda = 0,     C(T x, lambda) = 0,

with the forces P of layer and charge: equilibrium and, node by node, one vector condition:
lambda_c = 0 and lambda_f = 0 (open), u_nu - gap = 0 (in contact), u_tau = 0 (stick),
lambda_f = s u_tau/|u_tau| (slip); gaps and slips times `Interface.c_b`. An open
node with a friction bound sticks or slips too, with lambda_c = 0.
`SolutionJacobian` solves with their derivative, the Jacobian J = [[K, T^T W], [C_u T, C_f]], and
with its transpose. lambda is eliminated node by node, with gamma as in Newton's method; the
remainder that gamma leaves in C is corrected by further back-substitutions with the same
factorisation (augmented Lagrangian iterations), and so is the coupling of the nodes by a smoothed
pressure.

In an evolution a step ends with x and the history h' = H(x, h), and its equations
G(x, lambda, h) = 0 have the history h at its beginning. The tangent goes forwards,
dh' = dH/dx dx + dH/dh dh, and dG/dh dh is part of the equations of dx. The adjoint goes backwards:
given the derivatives g of a quantity by h', those by x are (dH/dx)^T g, and those by h are
(dH/dh)^T g - (dG/dh)^T w, with the adjoint w of the step.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from contact.body.internal_variables import VARIABLES
from contact.errors import InputError
from contact.history import History, InternalVariables, Part
from contact.interface.complementarity import ComplementarityParameters
from contact.interface.multipliers import ActiveSet, Multipliers, SlipHistory
from contact.interface.nodes import unit_vectors
from contact.linear import multigrid
from contact.linear.operator import Counters
from contact.problem.problem import SLIP, ContactProblem
from contact.problem.residuals import residual_forces
from contact.problem.state import State
from contact.tolerances import EPS
from contact.typing import Array

#: Weakly active nodes: ratio to the largest pressure, or to c times the largest displacement.
WEAK = 1e-6


@dataclass(frozen=True)
class Equations:
    """Residuals of equilibrium and of the contact conditions, or a change of both.

    Attributes
    ----------
    forces
        On the owned free unknowns, global ones behind them.
    conditions
        At the contact nodes, shape (n, d): stresses, or gaps and slips times
        `Interface.c_b`.
    """

    forces: Array
    conditions: Array

    def __add__(self, other: Equations) -> Equations:
        """Return the sum of two changes."""
        return Equations(self.forces + other.forces, self.conditions + other.conditions)


def active_set(problem: ContactProblem, state: State) -> ActiveSet:
    """Return the active set of a solution. Collective."""
    interface, jump = problem.interface, problem.nodal(state)
    return interface.active_set(jump, state.multipliers, interface.bound(jump, state.multipliers))


def equations(problem: ContactProblem, state: State, active: ActiveSet) -> Equations:
    """Return the residuals of the equations of an active set. Collective."""
    interface, nodes, jump = problem.interface, problem.nodes, problem.nodal(state)
    vectors = state.multipliers.vectors(nodes)
    slip, pressure = interface.slip(jump), interface.pressure(jump, state.multipliers)
    length = np.linalg.norm(slip, axis=1)
    bound = interface.friction.bound(length, pressure)
    along = unit_vectors(slip)
    friction = nodes.tangential_component(vectors)
    slides = friction - np.where(active.slips, bound, 0.0)[:, None] * along
    tangential = np.where(active.sticks[:, None], interface.c_b * slip, slides)
    closing = -interface.c_b * interface.normal_gap(jump)
    normal = np.where(active.closed, closing, nodes.normal_component(vectors))
    conditions = normal[:, None] * nodes.normal + tangential
    # Forces on nodes of a rigid part as forces on it: a parameter may be its moment arm.
    forces = problem.body.unbalanced(residual_forces(problem, state))
    return Equations(forces, conditions)


def reference_norms(problem: ContactProblem, state: State) -> tuple[float, float]:
    """Return reference norms of forces and, in L2(Gamma_3), of conditions. Collective."""
    body, nodes, scales = problem.body, problem.nodes, problem.scales
    least = WEAK * scales.young * scales.area
    forces = body.norm(body.internal_forces(state)) + body.norm(body.external(state.time))
    moved = problem.interface.c_b * problem.nodal(state)[:, : problem.dim]
    stresses = nodes.norm(moved) + nodes.norm(state.multipliers.vectors(nodes))
    return forces + least, stresses + least / scales.area**0.5


def weakly_active(problem: ContactProblem, state: State) -> Array:
    """Return the points of weakly active nodes, shape (n, d). Collective.

    In contact without pressure, sticking at the friction bound, slipping by nothing, or at a jump
    of the layer's stiffness: there the solution has one-sided derivatives only.
    """
    interface, jump, multipliers = problem.interface, problem.nodal(state), state.multipliers
    active, c = active_set(problem, state), interface.c_b
    moved = c * np.linalg.norm(jump[:, : problem.dim], axis=1)
    small = WEAK * problem.nodes.maximum(np.maximum(interface.pressure(jump, multipliers), moved))
    normal_gap, length = np.abs(interface.normal_gap(jump)), interface.slip_length(jump)
    weak = np.where(active.closed, np.abs(multipliers.contact) <= small, c * normal_gap <= small)
    if interface.friction.acts:
        bound = interface.bound(jump, multipliers)
        margin = np.abs(bound - np.linalg.norm(multipliers.friction, axis=1))
        weak |= active.sticks & active.closed & (margin < small) & (bound > 0)
        weak |= active.slips & (c * length < small)
    weak |= interface.foundation.kinks(jump, max(small / c, EPS * interface.size))
    return problem.nodes.gather(problem.nodes.points[weak])


class SolutionJacobian:
    """The Jacobian of the equations at a solution, factorised once: for derivatives of results.

    In an evolution problem and state are those of one step. The complementarity parameters give
    gamma; `active` is the active set of the solution.
    """

    def __init__(
        self,
        problem: ContactProblem,
        state: State,
        parameters: ComplementarityParameters,
        counters: Counters,
    ) -> None:
        self.problem, self.state = problem, state
        self.active = active_set(problem, state)
        interface, nodes, jump = problem.interface, problem.nodes, problem.nodal(state)
        self._pressure = interface.pressure(jump, state.multipliers)
        law = interface.foundation.block(jump, self._pressure, full=True)
        self._conditions(jump)
        regular = self._by_force.copy()
        normal = nodes.normal[:, :, None] * nodes.normal[:, None, :]
        small = interface.c_b / parameters.gamma
        regular -= np.where(self.active.closed, small, 0.0)[:, None, None] * normal
        sticks = np.where(self.active.sticks, small, 0.0)
        regular -= sticks[:, None, None] * nodes.tangential_projector
        self._regular = np.linalg.inv(regular)
        d = nodes.dim
        law[:, :d] -= self._regular @ self._by_jump
        solver = "auto" if multigrid.is_large(problem.body.layout) else "lu"
        self._operator = problem.operator(symmetric=False, counters=counters, solver=solver)
        self._operator.update("tangent", state, interface.weighted(law, state.x))

    def _conditions(self, jump: Array) -> None:
        """Compute C_u, shape (n, d, block size), and C_f, shape (n, d, d)."""
        interface, nodes, active = self.problem.interface, self.problem.nodes, self.active
        d, slip = nodes.dim, interface.slip(jump)
        length = np.linalg.norm(slip, axis=1)
        size = np.where(active.slips, np.maximum(length, EPS * interface.size), 1.0)
        along = slip / size[:, None]
        normal = nodes.normal[:, :, None] * nodes.normal[:, None, :]
        friction, closed = interface.friction, active.closed[:, None, None]
        bound = friction.bound(length, self._pressure)
        across = nodes.tangential_projector - along[:, :, None] * along[:, None, :]
        by_slip = friction.by_slip(length, self._pressure)
        turning = (bound / size)[:, None, None] * across
        falls = turning + by_slip[:, None, None] * (along[:, :, None] * along[:, None, :])
        slips, sticks = active.slips[:, None, None], active.sticks[:, None, None]
        self._along = np.where(active.slips[:, None], along, 0.0)
        #: Derivative of the bound by the smoothed pressure; by the nodal one it is in C_f.
        self._rate = np.zeros_like(length)
        if friction.law is not None:
            total, smooth = friction.history.accumulated + length, friction.smooth(self._pressure)
            rate = np.asarray(friction.law.by_pressure(total, smooth), dtype=float)
            self._rate = np.broadcast_to(rate, length.shape) * (smooth > 0)
        self._layer = interface.foundation.layer_gradient(jump)
        local = self._rate * friction.local
        self._by_jump = np.zeros((length.size, d, nodes.block_size))
        self._by_jump[:, :, :d] = np.where(closed, interface.c_b * normal, 0.0)
        #: Derivative of the conditions by the slip alone, and by its length.
        self.by_slip = np.where(sticks, interface.c_b * nodes.tangential_projector, 0.0)
        self.by_slip -= np.where(slips, falls, 0.0)
        self.by_length = -by_slip[:, None] * self._along
        self._by_jump[:, :, :d] += self.by_slip
        self._by_jump -= (local[:, None] * self._along)[:, :, None] * self._layer[:, None, :]
        pressed = (local[:, None] * self._along)[:, :, None] * nodes.normal[:, None, :]
        self._by_force = np.where(closed, 0.0, normal) + np.where(
            sticks, 0.0, nodes.tangential_projector
        )
        # No contact force along fixed components.
        self._by_force += np.eye(d) - normal - nodes.tangential_projector
        self._by_force -= pressed

    def solve(self, change: Equations) -> tuple[Array, Array]:
        """Return dx on the owned unknowns and df with J (dx, df) = -change. Collective."""
        nodes = self.problem.nodes
        rhs, residual = -change.forces, -change.conditions
        x, f = np.zeros_like(rhs), np.zeros_like(residual)
        size, steps = 0.0, list[float]()
        while True:
            df_0 = np.einsum("nij,nj->ni", self._regular, residual)
            nodes.add_jump_transposed(-nodes.weight[:, None] * df_0, rhs)
            dx = self._operator.solve(rhs, EPS)
            moved = nodes.jump(self.problem.body.local(dx))
            df = df_0 - np.einsum(
                "nij,nj->ni", self._regular, np.einsum("nij,nj->ni", self._by_jump, moved)
            )
            x, f = x + dx, f + df
            residual = residual - self._conditions_of(moved, df)
            rhs -= self._operator.multiply(dx)  # rounding of stiff blocks: iterative refinement
            size, steps = max(size, self._norm(x, f)), [*steps, self._norm(dx, df)]
            if self._enough(steps, size):
                return x, f

    def solve_transposed(self, by_x: Array, by_force: Array) -> tuple[Array, Array]:
        """Return w with J^T w = (by_x, by_force), shapes (owned,) and (n, d). Collective."""
        nodes, weight = self.problem.nodes, self.problem.nodes.weight[:, None]
        rhs, residual = by_x.copy(), by_force
        x, c = np.zeros_like(rhs), np.zeros_like(residual)
        size, steps = 0.0, list[float]()
        while True:
            dc_0 = np.einsum("nji,nj->ni", self._regular, residual)
            nodes.add_jump_transposed(-np.einsum("nji,nj->ni", self._by_jump, dc_0), rhs)
            dx = self._operator.solve_transposed(rhs, EPS)
            moved = weight * nodes.jump(self.problem.body.local(dx))[:, : nodes.dim]
            dc = dc_0 - np.einsum("nji,nj->ni", self._regular, moved)
            x, c = x + dx, c + dc
            by_jump, by_multiplier = self._smoothed_transposed(dc)
            residual = (
                residual - moved - np.einsum("nji,nj->ni", self._by_force, dc) - by_multiplier
            )
            rhs -= self._operator.multiply(dx, transposed=True)
            nodes.add_jump_transposed(-by_jump, rhs)
            size, steps = max(size, self._norm(x, c)), [*steps, self._norm(dx, dc)]
            # Displacements that are rounding beside those of such conditions at the nodes.
            at_nodes = np.divide(c, weight, out=np.zeros_like(c), where=weight > 0)
            if steps[-1] <= EPS * nodes.norm(at_nodes) or self._enough(steps, size):
                return x, c

    def by_gap(self, x: Array, conditions: Array) -> Array:
        """Return the derivatives by the gap at each node, (n,), from the adjoint. Collective."""
        nodes, d = self.problem.nodes, self.problem.dim
        by_normal = np.einsum("nij,nj->ni", self._by_jump[:, :, :d], nodes.normal)
        by_conditions = np.einsum("ni,ni->n", conditions, by_normal)
        moved = nodes.jump(self.problem.body.local(x))
        pressed = nodes.weight * nodes.normal_component(moved)
        return by_conditions + pressed * np.einsum("ni,ni->n", self._layer[:, :d], nodes.normal)

    def _conditions_of(self, moved: Array, f: Array) -> Array:
        """Return C_u du + C_f df, with the smoothed pressure. Collective."""
        changed = np.einsum("nij,nj->ni", self._by_jump, moved)
        changed += np.einsum("nij,nj->ni", self._by_force, f)
        friction = self.problem.interface.friction
        if friction.local:
            return changed
        pressure = self.problem.nodes.normal_component(f)
        pressure = pressure + np.einsum("ni,ni->n", self._layer, moved)
        bound = self._rate * friction.smoothing(pressure)
        return changed - bound[:, None] * self._along

    def _smoothed_transposed(self, conditions: Array) -> tuple[Array, Array]:
        """Return the transposed derivative of the smoothed pressure, by jumps and forces."""
        friction = self.problem.interface.friction
        if friction.local:
            return np.zeros_like(self._layer), np.zeros_like(conditions)
        by_bound = -self._rate * np.einsum("ni,ni->n", self._along, conditions)
        by_pressure = friction.smoothing.transposed(by_bound)[:, None]
        return by_pressure * self._layer, by_pressure * self.problem.nodes.normal

    def _enough(self, taken: list[float], size: float) -> bool:
        """Tell whether corrections have converged; raise InputError where they do not halve."""
        last, now = (np.inf, *taken)[-2:]
        if EPS * 2.0 ** len(taken) > 1:
            if self.problem.interface.friction.local:
                layout = self.problem.body.layout
                most = multigrid.LARGE[layout.dim, layout.piezoelectric]
                raise InputError(
                    "derivatives: corrections of their linear solves do not converge; accepted: a "
                    f"problem that is not nearly singular, or fewer than {most:,} unknowns",
                    "no-derivative",
                )
            raise InputError(
                "friction.radius: the coupling of the nodes by a smoothed pressure is too strong "
                "for derivatives; accepted: a smaller radius or coefficient of friction",
                "smoothed-pressure",
            )
        # Linear convergence, or rounding if two corrections in turn are not smaller: those of
        # multigrid shrink unevenly. The first ones may grow by the smoothed pressure.
        stagnates = now <= WEAK * size and min(taken[-2:]) >= min(taken[:-2], default=np.inf)
        return stagnates or now**2 <= EPS * size * min(last, size)

    def _norm(self, x: Array, f: Array) -> float:
        """Return |x| + EPS |f|."""
        return self.problem.body.norm(x) + EPS * self.problem.nodes.norm(f)


def moved_state(problem: ContactProblem, state: State, x: Array, f: Array) -> State:
    """Return a state moved by changes of owned unknowns and contact forces. Collective."""
    nodes = problem.nodes
    vectors = state.multipliers.vectors(nodes) + f
    multipliers = Multipliers.of(nodes, nodes.normal_component(vectors), vectors)
    return replace(state, x=problem.body.updated(state.x, x), multipliers=multipliers)


def commit_along(jacobian: SolutionJacobian, x: Array, change: History) -> History:
    """Return dh' = dH/dx dx + dH/dh dh, given dx of the owned unknowns and dh. Collective."""
    problem, state = jacobian.problem, jacobian.state
    slip, variables = _parts(change)
    along = problem.body.local(x)
    jump = problem.nodes.tangential_component(problem.nodes.jump(along))
    longer = np.einsum("ni,ni->n", _direction(problem, problem.nodal(state)), jump - slip.jump)
    parts: dict[str, Part] = {SLIP: SlipHistory(jump, slip.accumulated + longer)}
    if variables is not None:
        parts[VARIABLES] = problem.body.laws.commit_along(state, along, variables)
    return History(parts)


def before_along(jacobian: SolutionJacobian, change: History) -> Equations:
    """Return dG/dh dh. Collective."""
    problem, state = jacobian.problem, jacobian.state
    slip, variables = _parts(change)
    conditions = jacobian.by_length * slip.accumulated[:, None]
    conditions -= np.einsum("nij,nj->ni", jacobian.by_slip, slip.jump)
    if variables is None:
        return Equations(np.zeros_like(problem.body.owned_part(state.x)), conditions)
    problem.body.laws.before_along(state, variables)
    return Equations(problem.body.forces_of_laws(), conditions)


def commit_transposed(problem: ContactProblem, state: State, after: History) -> Array:
    """Return (dH/dx)^T g on the owned unknowns, given g by h'. Collective."""
    slip, variables = _parts(after)
    by_x = np.zeros_like(problem.body.owned_part(state.x))
    if variables is not None:
        problem.body.laws.commit_transposed(state, variables)
        by_x += problem.body.forces_of_laws()
    nodes, jump = problem.nodes, problem.nodal(state)
    by_jump = np.zeros_like(jump)
    by_jump[:, : nodes.dim] = nodes.tangential_component(slip.jump)
    by_jump[:, : nodes.dim] += slip.accumulated[:, None] * _direction(problem, jump)
    nodes.add_jump_transposed(by_jump, by_x)
    return by_x


def before_transposed(
    jacobian: SolutionJacobian, along: Array, conditions: Array, after: History | None
) -> History:
    """Return (dH/dh)^T g - (dG/dh)^T w. Collective.

    w is given as `along`, by the internal forces on the owned unknowns, and `conditions`; g are the
    derivatives by h' `after` the step, None for the last one.
    """
    problem, state = jacobian.problem, jacobian.state
    jump = np.einsum("nji,nj->ni", jacobian.by_slip, conditions)
    accumulated = -np.einsum("ni,ni->n", jacobian.by_length, conditions)
    slip, variables = (None, None) if after is None else _parts(after)
    if slip is not None:
        jump -= slip.accumulated[:, None] * _direction(problem, problem.nodal(state))
        accumulated += slip.accumulated
    parts: dict[str, Part] = {SLIP: SlipHistory(jump, accumulated)}
    local = problem.body.local(along)
    before = problem.body.laws.before_transposed(state, local, variables)
    return History(parts if before is None else {**parts, VARIABLES: before})


def _direction(problem: ContactProblem, jump: Array) -> Array:
    """Return the slip directions in a step, shape (n, d)."""
    return unit_vectors(problem.interface.slip(jump))


def _parts(history: History) -> tuple[SlipHistory, InternalVariables | None]:
    """Return slip and internal variables of a history."""
    slip, variables = history[SLIP], history.get(VARIABLES)
    assert isinstance(slip, SlipHistory)
    assert variables is None or isinstance(variables, InternalVariables)
    return slip, variables
