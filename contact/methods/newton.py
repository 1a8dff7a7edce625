"""Semismooth Newton: contact, friction, material and foundation in one loop.

The nodal multipliers are condensed onto the displacement, so that the linear systems keep
the size and the pattern of the elastic ones. Where the contact nodes are few, the linearised
body is condensed onto them in turn: the loop over contact and friction then takes place there,
in small dense steps, and the one around it follows the material alone. Where a loop cycles,
friction is frozen and updated outside (Algorithm 1 with Newton inside); where that fails too,
the block relaxation takes over, and at last the load is applied in steps. The history says
which.

References
----------
Alart and Curnier, Comput. Methods Appl. Mech. Engrg. 92 (1991).
Hueeber, Stadler and Wohlmuth, SIAM J. Sci. Comput. 30 (2008).
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from contact.interface.linearised import (
    MORE_SOFTENING,
    Moduli,
    linearise,
    node_status,
    touching,
)
from contact.linear.operator import Counters, LinearOperator
from contact.methods.fixed_point import FixedPoint
from contact.methods.following import Following
from contact.methods.options import FixedPointOptions, NewtonOptions
from contact.methods.report import History, Monitor, Outcome, Quiet, Record
from contact.methods.uzawa import automatic_r
from contact.problem.condensed import (
    Condensation,
    CondensedProblem,
    DenseOperator,
    condensation,
    operator,
)
from contact.problem.kkt import KKT, evaluate, interface_residuals, residual_forces
from contact.problem.problem import ContactProblem
from contact.problem.state import Multipliers, bound_of, nodal_iterate, total_pressure
from contact.typing import Array

logger = logging.getLogger("contact.solver")

#: Residual from which on the foundation's conductivity is followed although nodes still change
#: their status.
NEAR = 0.05

#: How much more accurately than the material is linearised the contact problem is solved.
CONTACT_PART = 1e-3

#: Most dense steps in one solve of the condensed contact problem.
CONTACT_STEPS = 1000

#: Equilibrium residual below which the tangent replaces the secant of a condensed body.
CONDENSED_SECANT_UNTIL = 0.3

#: What the history says of the slower methods.
SLOWER = FROZEN_FRICTION, BLOCK_RELAXATION = "frozen friction", "block relaxation"

#: Why Newton's method with a frozen friction bound ends.
UPDATE = "friction bound to be updated"

#: Iterate, contact forces, status and layer pressure.
_State = tuple[Array, Multipliers, NDArray[np.int8] | None, Array | None]


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
    given
        Stiffnesses of the linearised laws; chosen from those of the body by default.
    """

    problem: ContactProblem
    options: NewtonOptions = field(default_factory=NewtonOptions)
    monitor: Monitor | None = None
    counters: Counters = field(default_factory=Counters)
    given: Moduli | None = None

    def __post_init__(self) -> None:
        """Choose the moduli, and condense the body where that pays."""
        self.moduli = self.given or self._moduli()
        self.history = History(self.monitor)
        self.forces = Multipliers.zero(self.problem)
        self._status: NDArray[np.int8] | None = None
        self._layer_pressure: Array | None = None  # after the last step; None: that of the iterate
        self._following = Following()
        self._calm = 0  # steps in which no node has changed its status
        self._begin = 0.0
        self._load = 1.0  # part of the loads and prescribed displacements that is applied
        self._best: _State | None = None
        self._least = np.inf
        self._operator: LinearOperator | DenseOperator | None = None
        self._body: Condensation | None = None
        if self.options.condense:
            self._body = condensation(self.problem, self.counters, self.options.linear)
        if self._body is not None:
            options = replace(self.options, condense=False, max_outer=CONTACT_STEPS)
            quiet = Quiet(self.history.poll)
            self._at_contact = Newton(self._body.problem, options, quiet, given=self.moduli)
            self._at_contact.history.level = logging.DEBUG

    def _moduli(self) -> Moduli:
        """Return stiffnesses that fit the body and its mesh."""
        middle = automatic_r(self.problem)
        nodal = middle**2 / float(self.problem.body.law.young)
        return Moduli(middle, nodal, self.options.gamma * max(middle, nodal))

    @property
    def operator(self) -> LinearOperator | DenseOperator:
        """The operator of the linear systems."""
        if self._operator is None:
            asymmetric = self.problem.frictional or self.problem.response.active
            self._operator = operator(
                self.problem,
                symmetric=not asymmetric,
                counters=self.counters,
                kind=self.options.linear,
            )
        return self._operator

    def solve(self) -> Outcome:
        """Iterate from zero displacement until convergence or the limit. Collective."""
        self.problem.reset()
        self.forces = Multipliers.zero(self.problem)
        self._status = self._layer_pressure = None
        return self.resume()

    def solve_from(self, forces: Multipliers) -> Outcome:
        """Iterate from the problem's present iterate and given contact forces. Collective."""
        problem, nodal = self.problem, nodal_iterate(self.problem)
        # What is left of a pressure where a node is open would give it a friction bound: one of
        # the size of rounding, with friction of any direction, on which the node would stick.
        closed = touching(problem, nodal, forces.pressure, self.moduli.status)
        self.forces = Multipliers(np.where(closed, forces.pressure, 0.0), forces.friction)
        bound = bound_of(problem, nodal, self.forces)
        self._status = node_status(problem, nodal, self.forces, bound, self.moduli.status)
        self._layer_pressure = None
        return self.resume()

    def resume(self) -> Outcome:
        """Iterate from where the method is, and fall back on slower ones where that fails."""
        self._begin = time.perf_counter()
        self._best, self._least = None, np.inf
        outcome = self._resume()
        if not outcome.converged and self._best is not None:
            self._return_to(self._best)
            outcome = replace(outcome, kkt=evaluate(self.problem, self.forces))
        return outcome

    def _resume(self) -> Outcome:
        if self._body is not None:
            outcome = self._newton("", self._condensed_step)
            if outcome.converged or self._left <= 0:
                return outcome
            logger.info("%s; going on with the whole body", outcome.reason)
        outcome = self._newton("")
        if not outcome.converged and self.problem.frictional and self._left > 0:
            outcome = self._frozen_friction()
        if not outcome.converged and self._left > 0:
            outcome = self._block_relaxation()
        # A condensed body has been linearised at the whole load.
        condensed = isinstance(self.problem, CondensedProblem)
        if not outcome.converged and self._left > 0 and not condensed:
            outcome = self._load_steps()
        return outcome

    @property
    def _left(self) -> int:
        """Number of steps that are left of the limit."""
        return self.options.max_outer - len(self.history.records)

    def _block_relaxation(self) -> Outcome:
        """Solve by the fixed point over block relaxation, which damps what Newton lets cycle."""

        def note(record: Record) -> None:
            self._record(record.kkt, BLOCK_RELAXATION, record.inner)

        options = FixedPointOptions(
            tolerance=self.options.tolerance,
            max_outer=min(FixedPointOptions.max_outer, self._left),
            linear=self.options.linear,
        )
        relaxed = FixedPoint(self.problem, options, note, self.counters, self.history.poll)
        try:
            outcome = relaxed.solve()
        finally:
            self.forces, self._status, self._layer_pressure = relaxed.forces, None, None
        self._keep_best(outcome.kkt)
        return outcome

    def _newton(
        self,
        note: str,
        step: Callable[[bool, float], tuple[str, int] | None] | None = None,
        frozen: Array | None = None,
        goal: float = 0.0,
    ) -> Outcome:
        """Iterate on the full problem, or on the one with a frozen friction bound.

        With a frozen bound the residual of that bound has to fall below `goal`. `step` takes
        the place of `_step`.
        """
        problem, options = self.problem, self.options
        goal = max(goal, options.tolerance)
        residuals = evaluate(problem, self.forces)
        best, since = np.inf, 0
        self._following, self._calm = Following(), 0
        # Where contact is solved exactly in each step, the tangent does not fear what it changes.
        until = options.secant_until if step is None else CONDENSED_SECANT_UNTIL
        # A start from elsewhere is near the solution; zero displacement has no better tangent.
        tangent = self._status is not None and not problem.linear_material
        for _ in range(min(options.max_iterations, self._left)):
            before, kept = residuals, self._state()
            if step is not None:
                at_contact = step(tangent, residuals.largest)
                if at_contact is None:
                    return self._outcome(residuals, "the condensed contact problem is not solved")
                said, solves = at_contact
            else:
                said, solves = "", 0
                self._step(tangent, residuals.largest, frozen)
            residuals = evaluate(problem, self.forces)
            worse = self._following.worsened(residuals.largest)
            words = (note, said, "tangent" * tangent, "taken back" * worse)
            self._record(residuals, " ".join(word for word in words if word), contact=solves)
            if worse:
                self._return_to(kept)
                residuals = evaluate(problem, self.forces)
            self._keep_best(residuals)
            measured = self._measure(residuals, frozen)
            if residuals.largest <= options.tolerance:
                return self._outcome(residuals)
            if frozen is not None and measured <= goal:
                return self._outcome(residuals, UPDATE)
            if not np.isfinite(measured):
                return self._outcome(residuals, "Newton's method diverged")
            if not problem.linear_material:
                falls = residuals.equilibrium < max(before.equilibrium, options.tolerance)
                tangent = residuals.equilibrium < until and (falls or not tangent)
            since = 0 if measured < 0.9 * best else since + 1
            best = min(best, measured)
            # A node that opens along the ramp of psi, frozen from step to step, takes its time.
            if since >= options.patience * (3 if self._following.frozen else 1):
                return self._outcome(residuals, f"Newton's method stalled at {best:.1e}")
        steps = len(self.history.records)
        return self._outcome(residuals, f"not converged in {steps} steps")

    def _outcome(self, residuals: KKT, ended: str = "") -> Outcome:
        return Outcome(residuals, self.options.allowed, ended)

    def _keep_best(self, residuals: KKT) -> None:
        """Remember the iterate that meets the problem at its whole load best."""
        if self._load == 1.0 and residuals.largest < self._least:
            self._least, self._best = residuals.largest, self._state()

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
            outcome = self._newton(FROZEN_FRICTION, frozen=bound, goal=goal)
            if outcome.converged or outcome.ended != UPDATE:
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
        while reached < 1.0 and step > 1e-2 and self._left > 0:
            kept = self._state()
            self._load = min(1.0, reached + step)
            problem.apply_load(self._load)
            outcome = self._newton(f"load {self._load:.3g}")
            if not outcome.converged and problem.frictional:
                outcome = self._frozen_friction()
            if outcome.converged:
                reached = self._load
                continue
            self._return_to(kept)
            step /= 2
        self._load = 1.0
        problem.apply_load(1.0)
        residuals = evaluate(problem, self.forces)
        self._keep_best(residuals)
        if reached < 1.0:
            return self._outcome(residuals, f"load steps ended at {reached:.3g} of the load")
        return self._outcome(residuals)

    def _state(self) -> _State:
        """Return what `_return_to` needs to take steps back."""
        return self.problem.unknowns.copy(), self.forces, self._status, self._layer_pressure

    def _return_to(self, kept: _State) -> None:
        """Go back to a state before."""
        self.problem.unknowns[:], self.forces, self._status, self._layer_pressure = kept

    def _step(self, tangent: bool, reached: float, frozen: Array | None) -> None:
        """Take one Newton step: one assembly, one factorisation, one solve."""
        problem, trace = self.problem, self.problem.trace
        nodal = nodal_iterate(problem)
        softening = self.options.softening + MORE_SOFTENING * self._calm
        contact = linearise(
            problem, nodal, self.forces, self.moduli, self._status, frozen, softening
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
        # Gamma leaves this part of an interface residual in any case. A goal that depended on the
        # residuals would ask for more digits on finer meshes, whose residuals pass through more
        # values between the first and the last.
        rtol = 1 / self.options.gamma
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

    def _condensed_step(self, tangent: bool, reached: float) -> tuple[str, int] | None:
        """Linearise the material alone, and solve the contact problem that is left.

        Returns the slower methods that this took, in words, and the number of dense solves, or
        None if it could not be solved.
        """
        problem, body, inner = self.problem, self._body, self._at_contact
        assert body is not None
        if not body.linearise(problem.tangent if tangent else problem.secant):
            return None
        # No more accurate than the material is linearised, nor than the end asks for.
        enough = 0.1 * self.options.tolerance
        if not problem.linear_material:
            enough = max(enough, CONTACT_PART * min(reached, 1.0))
        inner.options = replace(inner.options, tolerance=enough)
        inner.take(self)
        inner.history.records.clear()
        outcome = inner.resume()
        records = inner.history.records
        solves = sum(record.inner for record in records)
        self.counters.contact_solves += solves
        if outcome.kkt.largest > max(enough, NEAR * reached):
            return None
        self.take(inner)
        problem.add(body.expand())
        slower = [word for word in SLOWER if any(word in record.note for record in records)]
        return ", ".join(slower), solves

    def take(self, other: Newton) -> None:
        """Go on from where another Newton method on the same contact nodes is."""
        self.forces, self._status = other.forces, other._status
        self._layer_pressure = other._layer_pressure

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

    def _record(self, residuals: KKT, note: str, solves: int = 1, contact: int = 0) -> None:
        seconds = time.perf_counter() - self._begin
        number = len(self.history.records) + 1
        self.history.add(Record(number, solves, residuals, np.nan, seconds, note, contact))
