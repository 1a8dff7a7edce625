"""The outer loop of Algorithms 1, 4, 6 and 8.

Each iteration freezes what makes the problem nonlinear (secant modulus, friction bound, what
the foundation answers), solves the frozen problem by block relaxation and updates. Elastic
and piezoelectric bodies, rigid and compliant foundations differ in what there is to freeze:

- Algorithm 1, Problem (PV): the secant modulus and the friction bound s_n.
- Algorithm 4, Problem (P~V): also psi, or all of the charge l where it is lagged.
- Algorithm 6, Problem (PV2): also h_nu, or all of the layer's force j_1 where it is lagged.
- Algorithm 8, Problem (PV1): as Algorithm 6 without friction and current.

All four are `FixedPoint.solve` with `_step`, `_base_residual` and `_update_bound`; their inner
Algorithms 2, 5, 7 and 9 are `uzawa.block_relaxation`. What differs is `ContactProblem.response`.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from contact.body.norms import domain_norm
from contact.linear.operator import Counters
from contact.methods.following import Following
from contact.methods.options import FixedPointOptions
from contact.methods.report import History, Monitor, Outcome, Record
from contact.methods.uzawa import (
    Linearised,
    Relaxation,
    augmentation,
    automatic_r,
    block_relaxation,
    split,
)
from contact.problem.condensed import operator
from contact.problem.kkt import KKT, evaluate, residual_forces
from contact.problem.problem import ContactProblem
from contact.problem.state import Multipliers, bound_of, nodal_iterate, total_pressure
from contact.tolerances import PRECISION
from contact.typing import Array

#: Outer iterations without progress after which the loop is given up, and how many where the
#: block relaxation gets no further either.
PATIENCE, PATIENCE_STALLED = 25, 3

#: Residual below which frozen coefficients give way to their derivatives.
NEAR = 1e-2


@dataclass
class FixedPoint:
    """The outer loop, one iteration at a time.

    Parameters
    ----------
    problem
        The contact problem; its iterate is the current one.
    options
        Options of the loop.
    monitor
        Told of every outer iteration.
    poll
        Called in every inner iteration, on all ranks, to stop the solve by an exception; that of
        the monitor by default.
    """

    problem: ContactProblem
    options: FixedPointOptions
    monitor: Monitor | None = None
    counters: Counters = field(default_factory=Counters)
    poll: Callable[[], None] | None = None

    def __post_init__(self) -> None:
        """Choose r and set up the operator."""
        given = self.options.r
        self.r = automatic_r(self.problem) if given == "auto" else given
        self.operator = operator(self.problem, counters=self.counters, kind=self.options.linear)
        self.history = History(self.monitor)
        self.forces = Multipliers.zero(self.problem)
        thesis = self.options.stopping == "thesis"
        inner = self.options.inner_tolerance or max(self.options.tolerance / 10, PRECISION)
        self._stalled = False
        self._following = Following(NEAR)
        self._relaxation = Relaxation(
            self.r,
            inner,
            self.options.max_inner,
            self.options.depth if self.options.acceleration == "anderson" else 0,
            self.options.relaxation,
            self.options.eps if thesis else None,
            self.options.single_loop,
        )
        self._norm = domain_norm(self.problem) if thesis else None

    def solve(self) -> Outcome:
        """Iterate from zero displacement until convergence, stagnation or the limit. Collective."""
        problem = self.problem
        problem.reset()
        n = problem.trace.nodes.size
        # Iteration 0 is the pure contact problem that the thesis starts from. A bound that is
        # updated in the block relaxation needs none.
        first = 0 if problem.frictional and not self.options.single_loop else 1
        return self._solve(np.zeros((n, 1 + problem.dim)), np.zeros(n), first)

    def solve_from(self, forces: Multipliers) -> Outcome:
        """Iterate from the problem's present iterate and given contact forces. Collective."""
        problem, nodal = self.problem, nodal_iterate(self.problem)
        self.forces = forces
        pressure = forces.pressure
        if problem.response.normal_law(nodal) is not None:
            pressure = total_pressure(problem, nodal, forces)
        z = np.column_stack([pressure, forces.friction])
        z = z + self.r * split(problem, nodal, problem.frictional)
        return self._solve(z, bound_of(problem, nodal, forces), 1)

    def _solve(self, z: Array, bound: Array, first: int) -> Outcome:
        """Iterate from the iterate, a state of the relaxation and a friction bound."""
        begin, problem, options = time.perf_counter(), self.problem, self.options
        tangent = options.material_step == "tangent"
        best, since = np.inf, 0
        for iteration in range(first, options.max_outer + 1):
            friction = problem.frictional and iteration > 0
            if friction and first == 0 and iteration == 1:
                # The slip without friction is a bad guess, and so is the contact that goes with it.
                z = np.zeros_like(z)
            previous = problem.unknowns[: problem.owned].copy()
            # Newton's tangent of a zero strain is the secant, and cheaper.
            inner, z = self._step(bound, z, friction, tangent and iteration > first)
            residuals = evaluate(problem, self.forces)
            change, bound = self._update_bound(bound, iteration == 0)
            note = "tangent" if tangent and iteration > first else ""
            self.history.add(
                Record(iteration, inner, residuals, change, time.perf_counter() - begin, note)
            )
            if options.stopping == "thesis":
                if iteration > first and self._thesis_criterion(change, previous):
                    return self._outcome(residuals, "the thesis's criterion is met")
            elif residuals.largest <= options.tolerance:
                return self._outcome(residuals)
            if not np.isfinite(residuals.largest):
                return self._outcome(residuals, "the iteration diverged")
            if options.material_step == "auto" and not problem.linear_material:
                # Far from the solution the tangent is too soft and overshoots.
                tangent = residuals.largest < (NEAR if not tangent else 2 * best)
            since = 0 if residuals.largest < 0.9 * best else since + 1
            best = min(best, residuals.largest)
            patience = PATIENCE_STALLED if self._stalled else PATIENCE
            if since >= patience and options.stopping == "residual":
                return self._outcome(residuals, f"the residual stalled at {best:.2e}")
        return self._outcome(residuals, f"not converged in {options.max_outer} outer iterations")

    def _step(self, bound: Array, z: Array, friction: bool, tangent: bool) -> tuple[int, Array]:
        """Freeze, solve the frozen problem, and move the iterate."""
        problem = self.problem
        form = problem.tangent if tangent else problem.secant
        nodal = nodal_iterate(problem)
        blocks = augmentation(problem, self.r, friction)
        if problem.response.active:
            pressure = total_pressure(problem, nodal, self.forces)
            weight = problem.trace.weight[:, None, None]
            blocks = blocks + weight * self._current_block(nodal, pressure)
        self.operator.update(form, blocks, constant=problem.linear_material)
        residual = self._base_residual(nodal)
        law = problem.response.normal_law(nodal)
        step = Linearised(self.operator, residual, nodal, bound, law, friction)
        poll = self.poll or self.history.poll
        result = block_relaxation(problem, step, z, self._relaxation, self._norm, poll)
        self._stalled = result.stalled
        problem.add(result.increment)
        self.forces = result.forces
        return result.iterations, result.z

    def _current_block(self, nodal: Array, pressure: Array) -> Array:
        """Linearise the charge: near the solution with psi, which depends on the gap.

        Frozen, a steep ramp costs many iterations there; followed from afar, it overshoots.
        """
        response, records = self.problem.response, self.history.records
        residual = records[-1].kkt.largest if records else np.inf
        if not response.follows_gap or not self._following(residual):
            return response.current_block(nodal, pressure)
        if self.operator.symmetric:
            self.operator = operator(
                self.problem, symmetric=False, counters=self.counters, kind=self.options.linear
            )
        return response.current_jacobian(nodal, pressure)

    def _base_residual(self, nodal: Array) -> Array:
        """Return the residual without multipliers: they are the unknowns of the relaxation.

        So is the layer's pressure, unless it is lagged. The contact flag of the perfect
        conductor still looks at the last pressure.
        """
        problem, trace = self.problem, self.problem.trace
        residual = residual_forces(problem, self.forces)
        unknown = self.forces.vectors(problem)
        if problem.response.normal_law(nodal) is not None:
            unknown += problem.response.layer_pressure(nodal)[:, None] * trace.normal
        trace.add(residual, -trace.weight[:, None] * unknown)
        return residual

    def _update_bound(self, old: Array, start: bool) -> tuple[float, Array]:
        """Return the relative change (3.46) and the new friction bound.

        After the frictionless start the bound is that of zero slip.
        """
        problem, trace = self.problem, self.problem.trace
        if not problem.frictional:
            return np.nan, old
        nodal = nodal_iterate(problem)
        if start:
            nodal = np.zeros_like(nodal)
            pressure = total_pressure(problem, nodal_iterate(problem), self.forces)
            new = np.asarray(problem.friction_bound(pressure, np.zeros_like(pressure)))
        else:
            new = bound_of(problem, nodal, self.forces)
        size = trace.norm(new)
        return (trace.norm(new - old) / size if size > 0 else 0.0), new

    def _thesis_criterion(self, change: float, previous: Array) -> bool:
        """Tell whether (3.46), or (6.40) without friction, is met."""
        if self.problem.frictional:
            return change < self.options.eps_fp
        assert self._norm is not None
        now = self.problem.unknowns[: self.problem.owned]
        return self._norm(now - previous) < self.options.eps_fp * self._norm(now)

    def _outcome(self, residuals: KKT, ended: str = "") -> Outcome:
        return Outcome(residuals, self.options.allowed, ended)
