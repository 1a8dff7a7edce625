"""The outer loops of the thesis, and method `uzawa`: fixed point over Uzawa block relaxation.

Algorithm 1 is the iteration (3.28): with the secant modulus and the friction of u_n, find u_{n+1}
in K such that for all v in K

    B(u_n; u_{n+1}, v - u_{n+1}) + j(u_n, v) - j(u_n, u_{n+1}) >= (f, v - u_{n+1}),

the minimum (3.31) of J_n + j_n on K. With a potential it is a saddle point of x = (u, phi), least
in u and greatest in phi, with B-check, f_3-check and l-check, (5.28)-(5.32) and (6.33); the thesis
calls J_n strictly convex, which holds once phi is eliminated. Then the friction bound follows,
s_{n+1} = mu(|u_tau|) max(R p, 0) (`_update_bound`), p = -sigma_nu of the last Step 1: R p may be
negative at an iterate, where |R sigma_nu| of (3.6) would hold an open node. In load steps |u_tau|
is the accumulated slip. As printed the load follows too, with f_3-check and l-check for f_3 and l
if there is a potential:

    f                                           Algorithm 1, Problem (PV)
    f_n     = f_3 - l(x_n, .)                   Algorithm 4, Problem (P~V), with charge
    f_{1,n} = f_3 - j_1(x_n, .) - l(x_n, .)     Algorithm 6, Problem (PV2), with a layer
    f_{2,n} = f_3 - j_1(x_n, .)                 Algorithm 8, Problem (PV1), without friction

These are loads of `FrozenProblem` where charge and layer are `lagged`. By default psi and h_nu
alone are those of x_n, tangents follow near the solution, and residuals end the loop: the options
for the algorithms as printed are in docs/algorithms.md, Fixed points. The inner Algorithms 2, 5, 7
and 9 are `uzawa.uzawa_block_relaxation`, with another `Interface.foundation` each.

`OuterLoop` is the loop of `uzawa` and `penalty`: freeze, solve, evaluate the residuals. One that
fails ends with its best iterate, by the thesis's rules with the last.
"""

from __future__ import annotations

import time
from abc import ABC, abstractmethod
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from contact.linear.operator import Counters, Operator
from contact.methods.options import FixedPointOptions, LoopOptions
from contact.methods.report import Best, Monitor, Outcome, Record, Recorder, Stagnation
from contact.methods.safeguards import ConductivityDerivative
from contact.methods.unconstrained_modes import UnconstrainedModes, all_loads, sum_of_forces
from contact.problem.problem import ContactProblem
from contact.problem.residuals import (
    EvaluatedState,
    Residuals,
    evaluate_state,
    undeformed_equilibrium,
)
from contact.problem.state import State
from contact.thesis.softest_mode import conditioning, fitted_augmentation
from contact.thesis.uzawa import (
    FrozenProblem,
    augmentation,
    displacement_and_slip,
    uzawa_block_relaxation,
)
from contact.typing import Array

#: Residual below which tangents take the place of frozen coefficients.
NEAR = 1e-2

#: Note of a step of the penalty method with a singular linear system.
LOST = "the linear system is singular: a rigid-body mode is unconstrained at this iterate"


@dataclass
class OuterLoop(ABC):
    """Outer loop of the algorithms of the thesis; see `Method`.

    `state` is the last iterate, `bound` its friction bound, shape (n,) (stress).
    """

    problem: ContactProblem
    options: LoopOptions
    monitor: Monitor | None = None
    counters: Counters = field(default_factory=Counters)

    #: Stagnation limit, and ratio of residuals that is progress.
    stagnation: ClassVar[tuple[int, float]]

    def __post_init__(self) -> None:
        """Start from zero with an empty history."""
        thesis = self.options.stopping == "thesis"
        self._norm = self.problem.body.l2_norm() if thesis else None
        self.set_load_step(self.problem)

    def set_load_step(self, problem: ContactProblem) -> None:
        """Take another load step; see `Method`. Collective."""
        if not problem.same_unknowns(self.problem):
            self.problem = problem
            return self.__post_init__()
        self.problem, self.state = problem, problem.start()
        self.recorder = Recorder(self.monitor)
        self.bound: Array = np.zeros(problem.interface.nodes.gap.size)

    @property
    def history(self) -> list[Record]:
        """The outer iterations of the last solves."""
        return self.recorder.records

    @abstractmethod
    def _step(self, iteration: int) -> tuple[int, str]:
        """Solve a frozen problem for the state; return its inner iterations and a note."""

    @abstractmethod
    def _target(self, residuals: Residuals) -> float:
        """Return the residual that the loop controls."""

    @abstractmethod
    def _adapt(self, residual: float, best: float) -> None:
        """Choose the next linearisation by the last residual and the least one."""

    def _limit(self) -> int:
        """Return the stagnation limit."""
        return self.stagnation[0]

    def _advice(self, residual: float | None = None) -> str:
        """Return advice on failure; `residual`: where the loop stalled."""
        return ""

    def _iterate(self, first: int = 1) -> Outcome:
        """Iterate until convergence, stagnation or the limit; keep the best iterate."""
        begin, problem, options = time.perf_counter(), self.problem, self.options
        stagnation = Stagnation(*self.stagnation)
        best: Best[EvaluatedState] = Best()
        by_thesis = options.stopping == "thesis"
        for iteration in range(first, options.max_outer + 1):
            previous = self.state
            inner, note = self._step(iteration)
            iterate = evaluate_state(problem, self.state)
            residuals = iterate.residuals
            residual = self._target(residuals)
            best.see(iterate, residual)
            change, seconds = self._update_bound(iteration), time.perf_counter() - begin
            self.recorder.add(Record(iteration, inner, residuals, change, seconds, note))
            if by_thesis and iteration > first and self._thesis_criterion(change, previous):
                return self._outcome(residuals, criterion="the thesis's criterion is met")
            if not by_thesis and residual <= options.tolerance:
                return self._outcome(residuals)
            if note == LOST:
                ended = LOST + self._advice()
                break
            if not np.isfinite(residual):
                ended = "the iteration diverged"
                break
            given_up = stagnation(residual, self._limit())
            self._adapt(residual, stagnation.best)
            if given_up and not by_thesis:
                ended = f"the residual stalled at {stagnation.best:.2e}"
                ended += self._advice(stagnation.best)
                break
        else:
            ended = f"not converged in {options.max_outer} outer iterations{self._advice()}"
        if best.iterate is not None and not by_thesis:
            if undeformed := undeformed_equilibrium(problem, options.tolerance):
                best.iterate, ended = undeformed, ""
            self.state, residuals = best.iterate.state, best.iterate.residuals
        return self._outcome(residuals, ended)

    def _update_bound(self, iteration: int) -> float:
        """Update the friction bound; return its relative change (3.46), NaN without friction."""
        interface, multipliers, old = self.problem.interface, self.state.multipliers, self.bound
        if not interface.friction.acts:
            return np.nan
        jump = interface.nodes.jump(self.state.x)
        if iteration == 0:  # frictionless start: bound of zero slip
            pressure = interface.pressure(jump, multipliers)
            self.bound = interface.friction.bound(np.zeros_like(pressure), pressure)
        else:
            self.bound = interface.bound(jump, multipliers)
        size = interface.nodes.norm(self.bound)
        return interface.nodes.norm(self.bound - old) / size if size > 0 else 0.0

    def _thesis_criterion(self, change: float, previous: State) -> bool:
        """Tell whether (4.38) or (6.40) is met, on the change of the unknowns in L2(Omega)."""
        assert self._norm is not None
        owned_part = self.problem.body.owned_part
        now, before = owned_part(self.state.x), owned_part(previous.x)
        return self._norm(now - before) < self.options.eps_fp * self._norm(now)

    def _outcome(self, residuals: Residuals, ended: str = "", criterion: str = "") -> Outcome:
        return Outcome(residuals, self.options.allowed, ended, criterion=criterion)


#: First friction bound where friction has to balance loads, as a force over all loads.
STUCK = 10.0

#: Stagnation limit where the Uzawa block relaxation stagnates too.
STALLED = 3

#: Advice where the loop stalls though its Uzawa block relaxations converge.
FROZEN = (
    " though each frozen problem is solved: the frozen terms (friction bound, conducting nodes, "
    "material) cycle"
)


def sticking_bound(problem: ContactProblem) -> Array | None:
    """Return friction bounds above all loads, shape (n,) (stress), for the first problem.

    None where supports and frictionless contact balance all loads. Collective.
    """
    modes, weight = UnconstrainedModes.of(problem), problem.nodes.weight
    if not (problem.frictional and (modes.friction_alone or modes.overloaded(0 * weight))):
        return None
    # Friction need not bear the forces of prescribed displacements.
    loads = sum_of_forces(problem.body, problem.body.external(problem.time))
    return np.asarray(STUCK * (loads or all_loads(problem)) / weight, dtype=float)


@dataclass
class FixedPoint(OuterLoop):
    """Algorithms 1, 4, 6 and 8; see `OuterLoop`."""

    options: FixedPointOptions
    stagnation: ClassVar[tuple[int, float]] = (25, 0.9)

    def __post_init__(self) -> None:
        """Choose r and set up the operator."""
        super().__post_init__()
        r = self.options.r
        self.r = self.problem.scales.r if r == "auto" else r
        # Whether r is fitted, once for all load steps: from nearby they would stall with another.
        self._fitted: bool | None = None
        self.operator = self._new_operator(symmetric=True)

    def _new_operator(self, symmetric: bool) -> Operator:
        solver = "many" if self.options.linear == "auto" else self.options.linear
        return self.problem.operator(symmetric=symmetric, counters=self.counters, solver=solver)

    def solve(self, start: State | None = None) -> tuple[State, Outcome]:
        """Iterate until convergence, stagnation or the limit; see `Method`. Collective."""
        self._stalled, self._residual = False, np.inf
        self._gap_derivative = ConductivityDerivative(NEAR)
        if not self.operator.symmetric:  # of an earlier solve
            self.operator = self._new_operator(symmetric=True)
        problem, interface = self.problem, self.problem.interface
        frictional = interface.friction.acts
        if start is None:
            # Secant at zero strain: prescribed values so far strain only the elements beside them.
            self.state = replace(problem.start(), secant_at=problem.body.zero_displacement())
            stuck = sticking_bound(problem)
            # Iteration 0 is the "pure contact problem" of section 7.2.1: not with single_loop, nor
            # where friction alone constrains a rigid-body mode.
            first = 0 if frictional and not self.options.single_loop and stuck is None else 1
            self._z = self._initial_z(0.0, frictional and first > 0)
            self.bound = np.zeros(interface.nodes.gap.size) if stuck is None else stuck
        else:
            self.state, first = start, 1
            jump, pressure = interface.nodes.jump(start.x), start.multipliers.contact
            if interface.foundation.normal_graph(jump) is not None:
                pressure = interface.pressure(jump, start.multipliers)
            self._z = np.column_stack([pressure, start.multipliers.friction])
            self.bound = interface.bound(jump, start.multipliers)
        self._first, self._tangent, self._first_bound = first, False, self.bound
        outcome = self._iterate(first)
        return self.state, outcome

    def _initial_z(self, q: Array | float, friction: bool) -> Array:
        """Return z = q - r u_n of q = lambda + r u."""
        jump = self.problem.interface.nodes.jump(self.state.x)
        return q - self.r * displacement_and_slip(self.problem.interface, jump, friction)

    def _step(self, iteration: int) -> tuple[int, str]:
        """Freeze, and solve by the Uzawa block relaxation."""
        problem, interface = self.problem, self.problem.interface
        friction, body = interface.friction.acts and iteration > 0, problem.body
        if friction and self._first == 0 and iteration == 1:
            # Slip without friction is a bad guess: phi = lambda = 0 instead.
            self._z = self._initial_z(0.0, friction)
        if self._stalled and self._fitted is None:
            self._fit_to_softest_mode(friction)
        state, jump = self.state, interface.nodes.jump(self.state.x)
        blocks = augmentation(interface.nodes, self.r, friction)
        if interface.foundation.active:
            blocks = blocks + self._charge_block(jump, interface.pressure(jump, state.multipliers))
        # At zero strain the tangent is the secant.
        kind = "tangent" if self._tangent and iteration > self._first else "secant"
        weighted = interface.weighted(blocks, state.x)
        self.operator.update(kind, state, weighted)
        frozen = FrozenProblem(problem, state, friction, self.r)
        result = uzawa_block_relaxation(
            frozen,
            self.operator,
            self._z,
            self.bound,
            self.options,
            self._norm,
            self.recorder.poll,
        )
        self._stalled = result.stalled and not self._gap_derivative.included
        x = body.updated(state.x, result.increment)
        self.state = replace(state, x=x, multipliers=result.multipliers, secant_at=None)
        self._z = result.z
        return result.iterations, "tangent" if kind == "tangent" else ""

    def _fit_to_softest_mode(self, friction: bool) -> None:
        """Begin anew with the r of a mode softer than those of a block, if there is one."""
        options, problem, start = self.options, self.problem, self.problem.start()
        if options.r != "auto" or options.stopping == "thesis":
            return
        r = fitted_augmentation(problem, self._new_operator(symmetric=True), start)
        self._fitted = r is not None
        if r is not None:
            self.r = r
            self.state = replace(start, secant_at=problem.body.zero_displacement())
            self.bound = self._first_bound
            self._z = self._initial_z(0.0, friction)

    def _charge_block(self, jump: Array, pressure: Array) -> Array:
        """Linearise the charge, near the solution with the derivative of psi by the gap."""
        law = self.problem.interface.foundation
        if not law.follows_gap or not self._gap_derivative(self._residual):
            return law.charge_block(jump, pressure)
        if self.operator.symmetric:
            self.operator = self._new_operator(symmetric=False)
        return law.charge_block(jump, pressure, full=True)

    def _target(self, residuals: Residuals) -> float:
        """Return the largest residual."""
        self._residual = residuals.significant
        return self._residual

    def _adapt(self, residual: float, best: float) -> None:
        """Choose the tangent of the material near the solution."""
        choice = self.options.material_step
        if choice == "auto" and not self.problem.body.linear:
            self._tangent = residual < (2 * best if self._tangent else NEAR)
        else:
            self._tangent = choice == "tangent"

    def _limit(self) -> int:
        # Of slender bodies each relaxation brings contact or friction nearer, in turn.
        return STALLED if self._stalled and not self._fitted else self.stagnation[0]

    def _thesis_criterion(self, change: float, previous: State) -> bool:
        """Tell whether (3.46) is met, or (6.40) without friction."""
        if self.problem.interface.friction.acts:
            return change < self.options.eps_fp
        return super()._thesis_criterion(change, previous)

    def _advice(self, residual: float | None = None) -> str:
        if self._stalled:
            words = f": the Uzawa block relaxation with r = {self.r:.3g} stalls"
            why = conditioning(self.problem.scales, self.r) if self._fitted else ""
            return f"{words}{why}; accepted: method newton"
        return FROZEN if residual is not None and residual > NEAR else ""
