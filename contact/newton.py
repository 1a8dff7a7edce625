"""Semismooth Newton: contact, friction, material and foundation in one loop.

The nodal multipliers are condensed onto the displacement, so that the linear systems keep
the size and the pattern of the elastic ones. Where the loop cycles, friction is frozen and
updated outside (Algorithm 1 with Newton inside); where that fails too, the block relaxation
takes over, and at last the load is applied in steps. The history says which.

References
----------
Alart and Curnier, Comput. Methods Appl. Mech. Engrg. 92 (1991).
Hueeber, Stadler and Wohlmuth, SIAM J. Sci. Comput. 30 (2008).
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from contact.fixed_point import FixedPoint, FixedPointOptions
from contact.following import Following
from contact.kkt import KKT, evaluate, interface_residuals, residual_forces
from contact.linear import Counters, LinearOperator
from contact.newton_laws import Moduli, linearise, node_status
from contact.problem import ContactProblem
from contact.projections import Array
from contact.report import History, Monitor, Outcome, Record
from contact.state import Multipliers, bound_of, nodal_iterate, total_pressure
from contact.uzawa import automatic_r

#: Residual from which on the foundation's conductivity is followed although nodes still change
#: their status.
NEAR = 0.05

#: Iterate, contact forces, status and layer pressure.
_State = tuple[Array, Multipliers, NDArray[np.int8] | None, Array | None]


@dataclass(frozen=True)
class NewtonOptions:
    """Options of Newton's method.

    Attributes
    ----------
    tolerance
        On every KKT residual.
    max_iterations
        Number of steps allowed in each stage.
    limit
        Number of steps allowed in all stages together.
    gamma
        Stiffness of the condensed constraints over that of the body.
    secant_until
        Equilibrium residual below which the material's tangent replaces its secant.
    patience
        Steps without progress after which the stage is given up.
    linear
        Kind of linear solver, see `linear.LinearOperator`.
    """

    tolerance: float = 1e-8
    max_iterations: int = 60
    limit: int = 1000
    gamma: float = 1e4
    secant_until: float = 1e-2
    patience: int = 12
    linear: str = "auto"


@dataclass
class Newton:
    """Newton's method on one problem.

    Parameters
    ----------
    problem
        The contact problem; its iterate is the current one.
    options
        Options of the method.
    monitor
        Told of every step.
    """

    problem: ContactProblem
    options: NewtonOptions = field(default_factory=NewtonOptions)
    monitor: Monitor | None = None
    counters: Counters = field(default_factory=Counters)

    def __post_init__(self) -> None:
        """Choose the moduli and set up the operator."""
        middle = automatic_r(self.problem)
        nodal = middle**2 / float(self.problem.body.law.young)
        self.moduli = Moduli(middle, nodal, self.options.gamma * max(middle, nodal))
        self.operator = LinearOperator(
            self.problem,
            symmetric=not self._asymmetric,
            counters=self.counters,
            kind=self.options.linear,
        )
        self.history = History(self.monitor)
        self.forces = Multipliers.zero(self.problem)
        self._status: NDArray[np.int8] | None = None
        self._layer_pressure: Array | None = None  # after the last step; None: that of the iterate
        self._following = Following()
        self._calm = 0  # steps in which no node has changed its status
        self._begin = 0.0

    @property
    def _asymmetric(self) -> bool:
        return self.problem.frictional or self.problem.response.active

    def solve(self) -> Outcome:
        """Iterate from zero displacement until convergence or the limit. Collective."""
        self.problem.reset()
        self.forces = Multipliers.zero(self.problem)
        self._status = self._layer_pressure = None
        return self._solve()

    def solve_from(self, forces: Multipliers) -> Outcome:
        """Iterate from the problem's present iterate and given contact forces. Collective."""
        problem, nodal = self.problem, nodal_iterate(self.problem)
        bound = bound_of(problem, nodal, forces)
        self.forces = forces
        self._status = node_status(problem, nodal, forces, bound, self.moduli.status)
        self._layer_pressure = None
        return self._solve()

    def _solve(self) -> Outcome:
        """Iterate, and fall back on slower methods where that fails."""
        self._begin = time.perf_counter()
        outcome = self._newton("")
        if not outcome.converged and self.problem.frictional and self._left > 0:
            outcome = self._frozen_friction()
        if not outcome.converged and self._left > 0:
            outcome = self._block_relaxation()
        if not outcome.converged and self._left > 0:
            outcome = self._load_steps()
        return outcome

    @property
    def _left(self) -> int:
        """Number of steps that are left of the limit."""
        return self.options.limit - len(self.history.records)

    def _block_relaxation(self) -> Outcome:
        """Solve by the fixed point over block relaxation, which damps what Newton lets cycle."""

        def note(record: Record) -> None:
            self._record(record.kkt, "block relaxation", record.inner)

        options = FixedPointOptions(
            tolerance=self.options.tolerance,
            max_outer=min(FixedPointOptions.max_outer, self._left),
            linear=self.options.linear,
        )
        relaxed = FixedPoint(self.problem, options, note, self.counters, self.history.poll)
        try:
            return relaxed.solve()
        finally:
            self.forces, self._status, self._layer_pressure = relaxed.forces, None, None

    def _newton(self, note: str, frozen: Array | None = None, goal: float = 0.0) -> Outcome:
        """Iterate on the full problem, or on the one with a frozen friction bound.

        With a frozen bound the residual of that bound has to fall below `goal`.
        """
        problem, options = self.problem, self.options
        goal = max(goal, options.tolerance)
        residuals = evaluate(problem, self.forces)
        best, since = np.inf, 0
        self._following, self._calm = Following(), 0
        # A start from elsewhere is near the solution; zero displacement has no better tangent.
        tangent = self._status is not None and not problem.linear_material
        steps = min(options.max_iterations, self._left)
        for _ in range(steps):
            before, kept = residuals, self._state()
            self._step(tangent, frozen, residuals.largest)
            residuals = evaluate(problem, self.forces)
            worse = self._following.worsened(residuals.largest)
            words = (note, "tangent" * tangent, "taken back" * worse)
            self._record(residuals, " ".join(word for word in words if word))
            if worse:
                self._return_to(kept)
                residuals = evaluate(problem, self.forces)
            measured = self._measure(residuals, frozen)
            if residuals.largest <= options.tolerance:
                return Outcome(True, f"all residuals <= {options.tolerance:g}", residuals)
            if frozen is not None and measured <= goal:
                return Outcome(False, "friction bound to be updated", residuals)
            if not np.isfinite(measured):
                return Outcome(False, "Newton's method diverged", residuals)
            if not problem.linear_material:
                falls = residuals.equilibrium < max(before.equilibrium, options.tolerance)
                tangent = residuals.equilibrium < options.secant_until and (falls or not tangent)
            since = 0 if measured < 0.9 * best else since + 1
            best = min(best, measured)
            # A node that opens along the ramp of psi, frozen from step to step, takes its time.
            if since >= options.patience * (3 if self._following.frozen else 1):
                return Outcome(False, f"Newton's method stalled at {best:.1e}", residuals)
        return Outcome(False, f"not converged in {steps} steps", residuals)

    def _measure(self, residuals: KKT, frozen: Array | None) -> float:
        """Return the largest residual, with the frozen friction bound if there is one."""
        if frozen is None:
            return residuals.largest
        nodal = nodal_iterate(self.problem)
        interface = interface_residuals(self.problem, nodal, self.forces, frozen)
        return max(residuals.equilibrium, *interface)

    def _frozen_friction(self) -> Outcome:
        """Update the friction bound outside of Newton's method: each step is then convex."""
        bound = bound_of(self.problem, nodal_iterate(self.problem), self.forces)
        outcome, goal = None, 1e-2
        for _ in range(40):
            outcome = self._newton("frozen friction", bound, goal)
            if outcome.converged or outcome.reason != "friction bound to be updated":
                break
            new = bound_of(self.problem, nodal_iterate(self.problem), self.forces)
            goal = 0.1 * outcome.kkt.largest
            bound = new
        assert outcome is not None
        return outcome

    def _load_steps(self) -> Outcome:
        """Apply loads and prescribed displacements in steps, halved where they are too large."""
        problem, step, reached = self.problem, 0.25, 0.0
        problem.reset()
        self.forces = Multipliers.zero(problem)
        self._status = self._layer_pressure = None
        outcome = None
        while reached < 1.0 and step > 1e-2 and self._left > 0:
            kept = self._state()
            factor = min(1.0, reached + step)
            problem.apply_load(factor)
            outcome = self._newton(f"load {factor:.3g}")
            if not outcome.converged and problem.frictional:
                outcome = self._frozen_friction()
            if outcome.converged:
                reached = factor
                continue
            self._return_to(kept)
            step /= 2
        problem.apply_load(1.0)
        assert outcome is not None
        return Outcome(outcome.converged, outcome.reason, evaluate(problem, self.forces))

    def _state(self) -> _State:
        """Return what `_return_to` needs to take steps back."""
        return self.problem.x.x.array.copy(), self.forces, self._status, self._layer_pressure

    def _return_to(self, kept: _State) -> None:
        """Go back to a state before."""
        self.problem.x.x.array[:], self.forces, self._status, self._layer_pressure = kept

    def _step(self, tangent: bool, frozen: Array | None, reached: float) -> None:
        """Take one Newton step: one assembly, one factorisation, one solve."""
        problem, trace = self.problem, self.problem.trace
        nodal = nodal_iterate(problem)
        contact = linearise(
            problem, nodal, self.forces, self.moduli, self._status, frozen, self._calm
        )
        self._calm = self._calm + 1 if contact.settled else 0
        blocks = contact.blocks
        layer, shift = self._layer(nodal, contact.settled)
        if problem.response.active:
            pressure = total_pressure(problem, nodal, contact.forces)
            response = problem.response
            follow = contact.settled or reached < NEAR
            if response.follows_gap:
                follow = self._following(reached, follow)
            current = response.current_jacobian if follow else response.current_block
            blocks = blocks + layer + current(nodal, pressure)
        self.operator.update(
            problem.tangent if tangent else problem.secant,
            trace.weight[:, None, None] * blocks,
            constant=problem.linear_material,
        )
        # An iterative solver need be neither more accurate than the step nor than the end asks for.
        enough = 0.1 * self.options.tolerance / max(reached, self.options.tolerance)
        rtol = min(1e-3, max(1e-2 * reached, enough))
        residual = residual_forces(problem, contact.forces)
        trace.add(residual, (trace.weight * shift)[:, None] * trace.normal)
        increment = self.operator.solve(-residual, rtol)
        problem.add(increment)
        moved = trace.values(increment)
        change = np.einsum("nij,nj->ni", contact.blocks, moved)
        vectors = contact.forces.vectors(problem) + change[:, : problem.dim]
        self.forces = Multipliers(
            trace.normal_component(vectors), trace.tangential_component(vectors)
        )
        self._status = contact.status
        pressed = trace.normal_component(np.einsum("nij,nj->ni", layer, moved))
        self._layer_pressure = problem.response.layer_pressure(nodal) + shift + pressed

    def _layer(self, nodal: Array, full: bool) -> tuple[Array, Array]:
        """Linearise the layer; return its block, and how it differs from the layer's force.

        It is linearised where the law is met from the pressure and the displacement of the
        step before together, as the status of a contact node is found. Linearised about the
        displacement alone, a layer stiffer than the body cycles between its regimes.
        """
        problem, c = self.problem, self.moduli.status
        law = problem.response.normal_law(nodal)
        if law is None:
            none = np.zeros(nodal.shape[0])
            return problem.response.layer_block(nodal, full), none
        trace, response = problem.trace, problem.response
        u_n, layer = trace.normal_component(nodal), response.layer_pressure(nodal)
        known = layer if self._layer_pressure is None else self._layer_pressure
        place = law.displacement(self.forces.pressure + known + c * u_n, c)
        about = nodal.copy()
        about[:, : problem.dim] += (place - u_n)[:, None] * trace.normal
        block = response.layer_block(about, full)
        back = trace.normal_component(np.einsum("nij,nj->ni", block, nodal - about))
        return block, response.layer_pressure(about) + back - layer

    def _record(self, residuals: KKT, note: str, solves: int = 1) -> None:
        seconds = time.perf_counter() - self._begin
        number = len(self.history.records) + 1
        self.history.add(Record(number, solves, residuals, np.nan, seconds, note))
