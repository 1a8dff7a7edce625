"""Semismooth Newton method on one problem, the whole body or the condensed one.

Each step linearises all laws together (`newton_step`); the residuals, computed from scratch, end
the iteration. `iterate` takes no fallback: these are of `fallbacks`, which is given this object.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from contact.interface.multipliers import Multipliers, constraint_active
from contact.methods.newton_step import NewtonStep
from contact.methods.options import NewtonOptions
from contact.methods.report import PROGRESS, Best, Outcome, Record, Recorder, Stagnation
from contact.methods.unconstrained_modes import UnconstrainedModes, all_loads
from contact.problem.condensed import AnyProblem
from contact.problem.residuals import Residuals, evaluate_state, undeformed_equilibrium
from contact.problem.state import State

#: Ratio of c times the penetration of the first step to all loads above which c overestimates the
#: stiffness of the body: for a block, whose stiffness c estimates, it is about sqrt(H/h).
OVERESTIMATE = 1e3

#: Reason of an end whose complementarity parameter overestimates the stiffness.
OVERESTIMATED = "the complementarity parameter is far above the stiffness of the body"

#: Last iterate and outcome of a stage.
End: TypeAlias = tuple[State, Outcome]


class SemismoothNewton:
    """The semismooth Newton method on one problem, with one operator, that of its step.

    `modes` are those of the whole problem; `last` and `best` are the last iterate and that of least
    residual. `condensed_steps` are the last fallback of a whole problem, from an initial guess.
    """

    def __init__(
        self,
        problem: AnyProblem,
        options: NewtonOptions,
        step: NewtonStep,
        modes: UnconstrainedModes,
        recorder: Recorder,
        condensed_steps: Callable[[SemismoothNewton, State], End] | None = None,
    ) -> None:
        self.problem, self.options, self.step = problem, options, step
        self.modes, self.recorder = modes, recorder
        self.condensed_steps = condensed_steps
        self.begin(problem.start())

    def begin(self, state: State) -> None:
        """Begin a solve from an initial guess."""
        self.last = state
        self.best: Best[State] = Best()

    @property
    def steps_left(self) -> int:
        """Number of steps left of the limit."""
        return self.options.max_outer - len(self.recorder.records)

    def see(self, state: State, residuals: Residuals) -> None:
        """Keep an iterate as the last one, and as the best one if it is."""
        self.last = state
        self.best.see(state, residuals.significant)

    def with_problem(self, problem: AnyProblem) -> SemismoothNewton:
        """Return the method on a problem with another interface, with the same operator."""
        return SemismoothNewton(problem, self.options, self.step, self.modes, self.recorder)

    def started(self, start: State) -> State:
        """Return an initial guess with its active set."""
        interface, c = self.problem.interface, self.step.parameters.c
        jump = interface.nodes.jump(start.x)
        # Rounding of lambda_c at an open node would be a friction bound, and make it stick.
        closed = constraint_active(start.multipliers.contact, interface.normal_gap(jump), c)
        contact = np.where(closed, start.multipliers.contact, 0.0)
        multipliers = Multipliers.of(interface.nodes, contact, start.multipliers.friction)
        bound = interface.bound(jump, multipliers)
        active_set = interface.active_set(jump, multipliers, bound, c)
        return replace(start, multipliers=multipliers, active_set=active_set, layer_pressure=None)

    def iterate(
        self,
        state: State,
        note: str = "",
        stagnation_limit: int | None = None,
        check_c: bool = False,
        exact: bool = False,
        steps: int | None = None,
    ) -> End:
        """Iterate from an initial guess until the residuals converge or stagnate. Collective.

        The records of the steps have the note. By default the stagnation limit is that of the
        options, and the most `steps` are those left; never more than `max_iterations`. `check_c`:
        end after a first step from zero that shows c to overestimate the stiffness. `exact`:
        iterative solvers go to their own tolerance, without a forcing term.
        """
        problem, options, step = self.problem, self.options, self.step
        linear = problem.body.linear
        monitor = ConvergenceMonitor(self, state, note, stagnation_limit)
        if monitor.starts_converged:
            return state, monitor.outcome()
        step.begin()
        # At zero strain the secant is the tangent.
        tangent = state.starts_with_tangent and not linear
        for _ in range(min(options.max_iterations, self.steps_left if steps is None else steps)):
            previous = monitor.iterate
            taken = step(problem, previous, tangent, exact)
            if taken is None:
                return state, monitor.outcome(step.fault)
            state = taken
            monitor.evaluate(state)
            rejected = step.rejected(monitor.residuals.significant)
            monitor.record("tangent" * tangent, "rejected" * rejected)
            if rejected:
                state = replace(previous.state, secant_at=None)
                monitor.evaluate(state)
            if (end := monitor.end()) is not None:
                return end
            if check_c and previous.state.active_set is None:
                if _overestimates_stiffness(problem, step.parameters.c, state):
                    return state, monitor.outcome(OVERESTIMATED)
            if not linear:
                tangent = monitor.next_is_tangent(tangent, previous.residuals)
            if (stalled := monitor.stalled()) is not None:
                return state, stalled
        return state, monitor.out_of_steps()


class ConvergenceMonitor:
    """Monitor of convergence: residuals of each iterate, their record, and the ends by them.

    An iteration ends by convergence, divergence, loss of contact, stagnation or its limit of steps.
    """

    def __init__(
        self,
        semismooth: SemismoothNewton,
        state: State,
        note: str = "",
        stagnation_limit: int | None = None,
    ) -> None:
        self._semismooth, self._note = semismooth, note
        self._problem, self._options = semismooth.problem, semismooth.options
        limit = stagnation_limit or self._options.stagnation_limit
        self._stagnation = Stagnation(limit, PROGRESS, cumulative=True)
        self.iterate = evaluate_state(self._problem, state)
        self._pressed = self._largest_pressure(state)
        self.starts_converged = state.active_set is not None and self.converged
        if self.starts_converged:
            semismooth.see(state, self.residuals)
            semismooth.recorder.record(self.residuals, f"{note} initial guess".strip(), inner=0)

    @property
    def residuals(self) -> Residuals:
        """Residuals of the last iterate."""
        return self.iterate.residuals

    @property
    def converged(self) -> bool:
        """Whether the residuals of the last iterate are below tolerance, or rounding."""
        return not self.residuals.unmet(self._options.allowed)

    def evaluate(self, state: State) -> None:
        """Evaluate the residuals of an iterate. Collective."""
        self.iterate = evaluate_state(self._problem, state)
        self._semismooth.see(state, self.residuals)

    def record(self, *words: str, steps: tuple[Record, ...] = ()) -> None:
        """Record the step to the last iterate. Collective."""
        note = " ".join(word for word in (self._note, *words) if word)
        sizes = _node_counts(self.iterate.state, self._problem)
        self._semismooth.recorder.record(self.residuals, note, sizes=sizes, steps=steps)

    def end(self) -> End | None:
        """Return the end by convergence, divergence, or loss of contact; else None. Collective."""
        state = self.iterate.state
        if self.converged:
            return state, self.outcome()
        if (lost := self._loss_of_contact(state)) is not None:
            return lost
        self._pressed = max(self._pressed, self._largest_pressure(state))
        if not np.isfinite(self.residuals.significant):
            return state, self.outcome("Newton's method diverged")
        return None

    def next_is_tangent(self, tangent: bool, previous: Residuals) -> bool:
        """Tell whether the next step takes the tangent.

        The secant (Kacanov) follows a tangent that has not reduced the equilibrium residual.
        """
        reference = max(previous.equilibrium, self._options.tolerance)
        return self.residuals.equilibrium < reference or not tangent

    def stalled(self) -> Outcome | None:
        """Count a step; return the outcome at the stagnation limit, else None."""
        if not self._stagnation(self.residuals.significant):
            return None
        return self.outcome(f"Newton's method stalled at {self._stagnation.best:.1e}")

    def out_of_steps(self) -> Outcome:
        """Return the outcome at the limit of steps."""
        return self.outcome(f"not converged in {len(self._semismooth.recorder.records)} steps")

    def outcome(self, ended: str = "") -> Outcome:
        """Return the outcome at the last iterate."""
        return Outcome(self.residuals, self._options.allowed, ended)

    def _largest_pressure(self, state: State) -> float:
        interface = self._problem.interface
        jump = interface.nodes.jump(state.x)
        return interface.nodes.maximum(interface.pressure(jump, state.multipliers))

    def _loss_of_contact(self, state: State) -> End | None:
        """Return zero displacement if contact is lost and no load acts; else None. Collective."""
        # Displacements and forces then fall together from step to step: no relative residual does.
        counts, tolerance = _node_counts(state, self._problem), self._options.tolerance
        if counts is None:
            return None
        if counts[1] + counts[2] > 0 and self._largest_pressure(state) > tolerance * self._pressed:
            return None
        evaluated = undeformed_equilibrium(self._problem, tolerance)
        if evaluated is None:
            return None
        undeformed = replace(
            evaluated.state, active_set=state.active_set, layer_pressure=state.layer_pressure
        )
        self.iterate = replace(evaluated, state=undeformed)
        self._semismooth.see(undeformed, self.residuals)
        words = f"{self._note} zero displacement".strip()
        self._semismooth.recorder.record(self.residuals, words, inner=0)
        return undeformed, self.outcome()


def _node_counts(state: State, problem: AnyProblem) -> tuple[int, int, int] | None:
    """Return the numbers of open, stick and slip nodes; None without an active set. Collective."""
    if state.active_set is None:
        return None
    interface = problem.interface
    return interface.node_counts(interface.nodes.jump(state.x), state.active_set)


def _overestimates_stiffness(problem: AnyProblem, c: float, state: State) -> bool:
    """Tell whether c times the penetration of a first state is far above all loads. Collective."""
    interface = problem.interface
    penetration = np.maximum(-interface.normal_gap(interface.nodes.jump(state.x)), 0.0)
    # A given motion of the foundation alone is no load to compare with.
    return bool(c * interface.nodes.sum(penetration) > OVERESTIMATE * all_loads(problem) > 0)
