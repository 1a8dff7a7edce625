"""The outer loop of Algorithms 1, 4, 6 and 8.

Each iteration freezes the nonlinear terms (secant modulus, friction bound, layer and current),
solves the frozen problem by Uzawa block relaxation and updates. Elastic and piezoelectric bodies,
rigid and compliant foundations differ in the terms that are frozen:

- Algorithm 1, Problem (PV): the secant modulus and the friction bound s_n.
- Algorithm 4, Problem (P~V): also psi, or all of the charge l where it is lagged.
- Algorithm 6, Problem (PV2): also h_nu, or all of the layer's force j_1 where it is lagged.
- Algorithm 8, Problem (PV1): as Algorithm 6 without friction and current.

Their inner Algorithms 2, 5, 7 and 9 are `uzawa.uzawa_block_relaxation`, with another
`Interface.law` each. Where it fails, the best iterate is left, by the thesis's rules the last.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from contact.body.equilibrium import BodyEquilibrium
from contact.linear.operator import Counters, Operator
from contact.methods.gap_derivative import GapDerivative
from contact.methods.options import FixedPointOptions
from contact.methods.parameters import automatic_r
from contact.methods.progress import Best, Stagnation, undeformed_equilibrium
from contact.methods.report import IterationHistory, Monitor, Outcome, Record
from contact.methods.rigid_body_modes import RigidBodyModes
from contact.methods.thesis import uzawa
from contact.methods.thesis.spectrum import SpectralFit, spectral_fit, stall_reason
from contact.methods.thesis.uzawa import augmentation, linearised, split
from contact.problem.kkt import KKT, evaluate
from contact.problem.problem import ContactProblem
from contact.problem.protocols import Problem
from contact.problem.state import State
from contact.tolerances import PRECISION
from contact.typing import Array

#: Outer iterations without progress after which the loop is given up, and how many where the
#: Uzawa block relaxation gets no further either.
STAGNATION_LIMIT, STAGNATION_LIMIT_STALLED, PROGRESS = 25, 3, 0.9

#: Residual of a relaxation that was given up, over its tolerance, from which on r does not fit.
FAR = 100

#: Residual below which frozen coefficients give way to their derivatives.
NEAR = 1e-2

#: Why the loop stalls far from a solution though its Uzawa block relaxations converge.
FROZEN = (
    "though each frozen problem is solved: the frozen terms (friction bound, conducting nodes, "
    "material) cycle"
)


@dataclass
class FixedPoint:
    """The outer loop, one iteration at a time.

    Parameters
    ----------
    problem
        The contact problem.
    options
        Options of the loop.
    monitor
        Told of every outer iteration.
    poll
        Called in every inner iteration, on all ranks, to stop the solve by an exception; that of
        the monitor by default.

    Attributes
    ----------
    state
        The state after the last outer iteration.
    """

    problem: Problem
    options: FixedPointOptions
    monitor: Monitor | None = None
    counters: Counters = field(default_factory=Counters)
    poll: Callable[[], None] | None = None

    def __post_init__(self) -> None:
        """Choose r and set up the operator."""
        options, body = self.options, self.problem.equilibrium
        self.r = automatic_r(self.problem.scales) if options.r == "auto" else options.r
        self._fitted = False
        self._fit: SpectralFit | None = None
        self.operator = self._new_operator(symmetric=True)
        self.history = IterationHistory(self.monitor)
        self.state = self.problem.start()
        thesis = options.stopping == "thesis"
        inner = options.inner_tolerance or max(options.tolerance / 10, PRECISION)
        self._forget()
        self._relaxation = uzawa.Relaxation(
            self.r,
            inner,
            options.max_inner,
            options.depth if options.acceleration == "anderson" else 0,
            options.relaxation,
            options.eps if thesis else None,
            options.single_loop,
        )
        self._norm: Callable[[Array], float] | None = None
        if thesis:
            assert isinstance(body, BodyEquilibrium)  # the thesis's rules are those of the whole
            self._norm = body.l2_norm()

    def turn_to(self, problem: Problem) -> None:
        """Go on with another step of the same problem; factorisations remain."""
        self.problem, self.state = problem, problem.start()
        self.history = IterationHistory(self.monitor)

    def _forget(self) -> None:
        """Begin a solve: it does not depend on an earlier one."""
        self._stalled, self._far, self._residual = False, False, np.inf
        self._gap_derivative = GapDerivative(NEAR)
        if not self.operator.symmetric:
            self.operator = self._new_operator(symmetric=True)

    def _new_operator(self, symmetric: bool) -> Operator:
        return self.problem.equilibrium.operator(
            self.problem.interface.coupled,
            self.problem.constraint,
            symmetric=symmetric,
            counters=self.counters,
            kind="many" if self.options.linear == "auto" else self.options.linear,
        )

    def solve(self, start: State | None = None) -> tuple[State, Outcome]:
        """Iterate until convergence, stagnation or the limit. Collective.

        Parameters
        ----------
        start
            Initial guess; zero by default.
        """
        self._forget()
        problem, interface = self.problem, self.problem.interface
        jump, frictional = interface.jump, interface.friction.acts
        if start is None:
            self.state = problem.start()
            stuck = (
                RigidBodyModes(problem).stuck_bound()
                if isinstance(problem, ContactProblem)
                else None
            )
            # Iteration 0 is the pure contact problem that the thesis starts from. A bound that is
            # updated in the Uzawa block relaxation needs none, and a body that friction alone holds
            # has no such problem.
            first = 0 if frictional and not self.options.single_loop and stuck is None else 1
            # At zero strain: prescribed values strain the elements beside them alone.
            z = self._about(0.0, frictional and first > 0)
            bound = np.zeros(jump.gap.size) if stuck is None else stuck
            return self._solve(z, bound, first, problem.equilibrium.rest())
        self.state, nodal = start, jump.apply(start.x)
        pressure = start.forces.pressure
        if interface.law.normal_law(nodal) is not None:
            pressure = interface.pressure(nodal, start.forces)
        z = np.column_stack([pressure, start.forces.friction])
        return self._solve(z, interface.bound(nodal, start.forces), 1, start.x)

    def _about(self, z: Array | float, friction: bool) -> Array:
        """Return a state of the relaxation lambda + r u as it is about the iterate: less r u_0."""
        nodal = self.problem.interface.jump.apply(self.state.x)
        return z - self.r * split(self.problem.interface, nodal, friction)

    def _solve(self, z: Array, bound: Array, first: int, secant_at: Array) -> tuple[State, Outcome]:
        """Iterate from a state of the relaxation, a friction bound and a secant modulus."""
        begin, problem, options = time.perf_counter(), self.problem, self.options
        body, frictional = problem.equilibrium, problem.interface.friction.acts
        tangent = options.material_step == "tangent"
        stagnation, begun = Stagnation(STAGNATION_LIMIT, PROGRESS), bound
        best: Best[tuple[State, KKT]] = Best()
        for iteration in range(first, options.max_outer + 1):
            friction = frictional and iteration > 0
            if friction and first == 0 and iteration == 1:
                # The slip without friction is a bad guess, and so is the contact that goes with it.
                z = self._about(0.0, friction)
            if self._far and (start := self._fit_to_spectrum(friction)) is not None:
                # A state that was found with an r that does not fit is worse than zero.
                self.state, secant_at = problem.start(), body.rest()
                z, bound = self._about(start, friction), begun
                stagnation, best = Stagnation(STAGNATION_LIMIT, PROGRESS), Best()
            previous = self.state
            # Newton's tangent of a zero strain is the secant, and cheaper.
            kind = "tangent" if tangent and iteration > first else "secant"
            inner, z = self._step(bound, z, friction, kind, secant_at)
            secant_at = self.state.x
            residuals = evaluate(problem, self.state)
            self._residual = residuals.significant
            best.see((self.state, residuals), residuals.significant)
            change, bound = self._update_bound(bound, iteration == 0)
            note = "tangent" if kind == "tangent" else ""
            seconds = time.perf_counter() - begin
            self.history.add(Record(iteration, inner, residuals, change, seconds, note))
            if options.stopping == "thesis":
                if iteration > first and self._thesis_criterion(change, previous):
                    return self._end(residuals, "the thesis's criterion is met")
            elif residuals.significant <= options.tolerance:
                return self._end(residuals)
            if not np.isfinite(residuals.significant):
                ended = "the iteration diverged"
                break
            if options.material_step == "auto" and not body.linear:
                # Far from the solution the tangent is too soft and overshoots.
                tangent = residuals.significant < (NEAR if not tangent else 2 * stagnation.best)
            limit = STAGNATION_LIMIT_STALLED if self._stalled else STAGNATION_LIMIT
            given_up = stagnation(residuals.significant, limit)
            if given_up and options.stopping == "residual":
                ended = f"the residual stalled at {stagnation.best:.2e}"
                if self._far:
                    ended += f": {stall_reason(problem, options.r, self._fit)}"
                elif not self._stalled and stagnation.best > NEAR:
                    ended += f" {FROZEN}"
                break
        else:
            ended = f"not converged in {options.max_outer} outer iterations"
        if best.found is not None and options.stopping == "residual":
            if rest := undeformed_equilibrium(problem):
                best.found, ended = rest, ""
            self.state, residuals = best.found
        return self._end(residuals, ended)

    def _fit_to_spectrum(self, friction: bool) -> Array | None:
        """Take r from the body's softest mode, once; return where to begin if it has changed."""
        possible = self.options.r == "auto" and self.options.stopping == "residual"
        if not possible or self._fitted:
            return None
        self._fitted, self._fit = True, spectral_fit(self.problem, self.operator, friction)
        if self._fit is None:
            return None
        self.r, self._relaxation = self._fit.r, self._fit.fit(self._relaxation)
        return self._fit.z

    def _step(
        self, bound: Array, z: Array, friction: bool, kind: str, secant_at: Array
    ) -> tuple[int, Array]:
        """Freeze, solve the frozen problem, and move the state."""
        problem, interface, state = self.problem, self.problem.interface, self.state
        body, nodal = problem.equilibrium, interface.jump.apply(state.x)
        blocks = augmentation(interface.jump, self.r, friction)
        if interface.law.active:
            pressure = interface.pressure(nodal, state.forces)
            blocks = blocks + self._current_block(nodal, pressure)
        about = secant_at if kind == "secant" else state.x
        weighted = interface.weighted(blocks, state.x)
        self.operator.update(kind, replace(state, x=about), weighted, constant=body.linear)
        step = linearised(problem, state, self.operator, bound, friction, secant_at)
        poll = self.poll or self.history.poll
        result = uzawa.uzawa_block_relaxation(
            interface, step, z, self._relaxation, self._norm, poll
        )
        self._stalled = (
            result.stalled and not self._gap_derivative.included
        )  # freezing is left then
        self._far = self._stalled and result.residual > FAR * self._relaxation.tolerance
        x = body.moved(state.x, result.increment)
        self.state = replace(state, x=x, forces=result.forces)
        return result.iterations, result.z

    def _current_block(self, nodal: Array, pressure: Array) -> Array:
        """Linearise the charge: near the solution with psi, which depends on the gap.

        Frozen, a steep ramp costs many iterations there; its derivative overshoots from afar.
        """
        law = self.problem.interface.law
        if not law.follows_gap or not self._gap_derivative(self._residual):
            return law.current_block(nodal, pressure)
        if self.operator.symmetric:
            self.operator = self._new_operator(symmetric=False)
        return law.current_jacobian(nodal, pressure)

    def _update_bound(self, old: Array, start: bool) -> tuple[float, Array]:
        """Return the relative change (3.46) and the new friction bound.

        After the frictionless start the bound is that of zero slip.
        """
        interface, forces = self.problem.interface, self.state.forces
        if not interface.friction.acts:
            return np.nan, old
        nodal = interface.jump.apply(self.state.x)
        if start:
            pressure = interface.pressure(nodal, forces)
            new = interface.friction.bound(pressure, np.zeros_like(pressure))
        else:
            new = interface.bound(nodal, forces)
        size = interface.jump.norm(new)
        return (interface.jump.norm(new - old) / size if size > 0 else 0.0), new

    def _thesis_criterion(self, change: float, previous: State) -> bool:
        """Tell whether (3.46), or (6.40) without friction, is met."""
        if self.problem.interface.friction.acts:
            return change < self.options.eps_fp
        assert self._norm is not None
        own = self.problem.equilibrium.owned_part
        now, before = own(self.state.x), own(previous.x)
        return self._norm(now - before) < self.options.eps_fp * self._norm(now)

    def _end(self, residuals: KKT, ended: str = "") -> tuple[State, Outcome]:
        return self.state, Outcome(residuals, self.options.allowed, ended)
