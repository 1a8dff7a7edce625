"""Method `uzawa`, the outer loop of Algorithms 1, 4, 6 and 8: fixed point, Uzawa block relaxation.

The algorithms differ in the frozen terms:

- Algorithm 1, Problem (PV): the secant modulus and the friction bound s_n.
- Algorithm 4, Problem (P~V): also psi, or all of the charge l where it is lagged.
- Algorithm 6, Problem (PV2): also h_nu, or all of the layer's force j_1 where it is lagged.
- Algorithm 8, Problem (PV1): as Algorithm 6 without friction and current.

Their inner Algorithms 2, 5, 7 and 9 are `uzawa.uzawa_block_relaxation`, with another
`Interface.law` each.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from contact.linear.operator import Operator
from contact.methods.options import FixedPointOptions
from contact.methods.report import Outcome
from contact.methods.step_control import ConductivityDerivative
from contact.methods.unconstrained_modes import UnconstrainedModes
from contact.problem.residuals import Residuals
from contact.problem.state import State
from contact.thesis.outer_loop import NEAR, OuterLoop
from contact.thesis.uzawa import augmentation, split, uzawa_block_relaxation
from contact.typing import Array

#: Stagnation limit where the Uzawa block relaxation stagnates too.
STALLED = 3

#: Advice where the loop stalls though its Uzawa block relaxations converge.
FROZEN = (
    " though each frozen problem is solved: the frozen terms (friction bound, conducting nodes, "
    "material) cycle"
)


@dataclass
class FixedPoint(OuterLoop):
    """Algorithms 1, 4, 6 and 8; see `OuterLoop`."""

    options: FixedPointOptions
    stagnation: ClassVar[tuple[int, float]] = (25, 0.9)

    def __post_init__(self) -> None:
        """Choose r and set up the operator."""
        super().__post_init__()
        given = self.options.r
        self.r = self.problem.scales.augmentation if given == "auto" else given
        self.operator = self._new_operator(symmetric=True)

    def _new_operator(self, symmetric: bool) -> Operator:
        kind = "many" if self.options.linear == "auto" else self.options.linear
        return self.problem.operator(symmetric=symmetric, counters=self.counters, kind=kind)

    def solve(
        self, start: State | None = None, linearised_at: Array | None = None
    ) -> tuple[State, Outcome]:
        """Iterate until convergence, stagnation or the limit; see `Method`. Collective."""
        self._stalled, self._residual = False, np.inf
        self._gap_derivative = ConductivityDerivative(NEAR)
        if not self.operator.symmetric:  # of an earlier solve
            self.operator = self._new_operator(symmetric=True)
        problem, interface = self.problem, self.problem.interface
        frictional = interface.friction.acts
        if start is None:
            # Secant at zero strain: prescribed values so far strain only the elements beside them.
            self.state, self._secant_at = problem.start(), problem.equilibrium.rest()
            stuck = UnconstrainedModes(problem).stuck_bound()
            # Iteration 0 is the frictionless problem of the thesis: none with a bound that is
            # updated in the relaxation, or with a mode that friction alone constrains.
            first = 0 if frictional and not self.options.single_loop and stuck is None else 1
            self._z = self._about(0.0, frictional and first > 0)
            self.bound = np.zeros(interface.nodes.gap.size) if stuck is None else stuck
        else:
            self.state, first = start, 1
            self._secant_at = start.x if linearised_at is None else linearised_at
            nodal, pressure = interface.nodes.apply(start.x), start.forces.pressure
            if interface.layer.normal_law(nodal) is not None:
                pressure = interface.pressure(nodal, start.forces)
            self._z = np.column_stack([pressure, start.forces.friction])
            self.bound = interface.bound(nodal, start.forces)
        self._first, self._tangent = first, False
        outcome = self._iterate(first)
        return self.state, outcome

    def _about(self, z: Array | float, friction: bool) -> Array:
        """Return z = lambda + r (u - u_0) of lambda + r u, with u_0 of the iterate."""
        nodal = self.problem.interface.nodes.apply(self.state.x)
        return z - self.r * split(self.problem.interface, nodal, friction)

    def _step(self, iteration: int) -> tuple[int, str]:
        """Freeze, and solve by the Uzawa block relaxation."""
        problem, interface = self.problem, self.problem.interface
        friction, body = interface.friction.acts and iteration > 0, problem.equilibrium
        if friction and self._first == 0 and iteration == 1:
            # Slip and contact without friction are a bad initial guess.
            self._z = self._about(0.0, friction)
        state, nodal = self.state, interface.nodes.apply(self.state.x)
        blocks = augmentation(interface.nodes, self.r, friction)
        if interface.layer.active:
            blocks = blocks + self._current_block(nodal, interface.pressure(nodal, state.forces))
        # At zero strain the tangent is the secant.
        kind = "tangent" if self._tangent and iteration > self._first else "secant"
        linearised_at = self._secant_at if kind == "secant" else state.x
        weighted = interface.weighted(blocks, state.x)
        self.operator.update(kind, replace(state, x=linearised_at), weighted, constant=body.linear)
        result = uzawa_block_relaxation(
            problem,
            state,
            self.operator,
            self.bound,
            friction,
            self._secant_at,
            self._z,
            self.r,
            self.options,
            self._norm,
            self.recorder.poll,
        )
        self._stalled = result.stalled and not self._gap_derivative.included
        x = body.moved(state.x, result.increment)
        self.state, self._z = replace(state, x=x, forces=result.forces), result.z
        self._secant_at = x
        return result.iterations, "tangent" if kind == "tangent" else ""

    def _current_block(self, nodal: Array, pressure: Array) -> Array:
        """Linearise the charge, near the solution with the derivative of psi by the gap."""
        law = self.problem.interface.layer
        if not law.follows_gap or not self._gap_derivative(self._residual):
            return law.charge_block(nodal, pressure)
        if self.operator.symmetric:
            self.operator = self._new_operator(symmetric=False)
        return law.charge_block(nodal, pressure, full=True)

    def _target(self, residuals: Residuals) -> float:
        """Return the largest residual."""
        self._residual = residuals.significant
        return self._residual

    def _adapt(self, residual: float, best: float) -> None:
        """Choose the tangent of the material near the solution."""
        choice = self.options.material_step
        if choice == "auto" and not self.problem.equilibrium.linear:
            self._tangent = residual < (2 * best if self._tangent else NEAR)
        else:
            self._tangent = choice == "tangent"

    def _limit(self) -> int:
        return STALLED if self._stalled else self.stagnation[0]

    def _thesis_criterion(self, change: float, previous: State) -> bool:
        """Tell whether (3.46) is met, or (6.40) without friction."""
        if self.problem.interface.friction.acts:
            return change < self.options.eps_fp
        return super()._thesis_criterion(change, previous)

    def _advice(self, residual: float | None = None) -> str:
        if self._stalled:
            return f": the Uzawa block relaxation with r = {self.r:.3g} stalls"
        return FROZEN if residual is not None and residual > NEAR else ""
