"""Newton steps of one kind, until the residuals say that they have converged or stagnate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from contact.methods.interior_point import OVERLOADED
from contact.methods.newton_step import Iterate, Iteration, Step
from contact.methods.report import Outcome
from contact.methods.stagnation import PROGRESS, Stagnation, undeformed_equilibrium
from contact.problem.protocols import Problem
from contact.problem.residuals import Residuals, evaluate_forces
from contact.problem.state import State

#: Why an iteration ends whose complementarity parameter overestimates the stiffness.
OVERESTIMATED = "the complementarity parameter is far above the stiffness of the body"


@dataclass
class NewtonLoop:
    """Steps of one kind, until the residuals say that they have converged or stagnate.

    Attributes
    ----------
    iteration
        The problem with the tolerances; told of every iterate.
    step
        Takes the steps.
    stagnation_limit
        Stagnation limit; that of the options by default.
    give_up
        Asked after the first step from the zero initial guess whether to give up; None to go on.
    """

    iteration: Iteration
    step: Step
    stagnation_limit: int | None = None
    give_up: Callable[[State], bool] | None = None

    def run(self, iterate: Iterate, note: str = "") -> tuple[Iterate, Outcome]:
        """Iterate. Collective.

        Parameters
        ----------
        iterate
            Initial guess.
        note
            Note of the steps in the history.
        """
        iteration, problem, options = self.iteration, self.iteration.problem, self.iteration.options
        linear = problem.equilibrium.linear
        residuals, internal = evaluate_forces(problem, iterate.state)
        pressed = self._largest_pressure(iterate)
        limit = self.stagnation_limit or options.stagnation_limit
        stagnation = Stagnation(limit, PROGRESS, cumulative=True)
        if iterate.active_set is not None and residuals.significant <= options.tolerance:
            iteration.see(iterate, residuals)
            iteration.history.record(residuals, f"{note} initial guess".strip(), inner=0)
            return iterate, self._end(residuals)
        self.step.begin()
        # A start from elsewhere is near the solution; zero displacement has no better tangent.
        tangent = iterate.active_set is not None and iterate.linearised_at is None and not linear
        for _ in range(min(options.max_iterations, iteration.left)):
            before, kept = residuals, iterate
            known = internal if iterate.linearised_at is None else None
            taken = self.step(iterate, tangent, residuals, known)
            if taken is None:
                return kept, self._end(residuals, self.step.fault)
            iterate = taken.iterate
            residuals, internal = evaluate_forces(problem, iterate.state)
            worse = self.step.conductivity_derivative.worsened(residuals.significant)
            iteration.see(iterate, residuals)
            words = (note, taken.note, "tangent" * tangent, "rejected" * worse)
            said = " ".join(word for word in words if word)
            iteration.history.record(
                residuals,
                said,
                sizes=_node_counts(iterate, problem),
                steps=taken.condensed_steps,
            )
            if worse:
                iterate = kept
                residuals, internal = evaluate_forces(problem, iterate.state)
                iteration.see(iterate, residuals)
            if residuals.significant <= options.tolerance:
                return iterate, self._end(residuals)
            if taken.overloaded:
                return iterate, replace(self._end(residuals, OVERLOADED), overloaded=True)
            if (found := self._loss_of_contact(iterate, pressed, note)) is not None:
                return found
            pressed = max(pressed, self._largest_pressure(iterate))
            if self.give_up is not None and kept.active_set is None and self.give_up(iterate.state):
                return iterate, self._end(residuals, OVERESTIMATED)
            if not np.isfinite(residuals.significant):
                return iterate, self._end(residuals, "Newton's method diverged")
            if not linear:
                falls = residuals.equilibrium < max(before.equilibrium, options.tolerance)
                # After a tangent that overshoots, the secant (Kacanov), as where unloading differs
                # from loading.
                tangent = falls or not tangent
            if stagnation(residuals.significant):
                ended = f"Newton's method stalled at {stagnation.best:.1e}"
                return iterate, self._end(residuals, ended)
        steps = len(iteration.history.records)
        return iterate, self._end(residuals, f"not converged in {steps} steps")

    def _largest_pressure(self, iterate: Iterate) -> float:
        return self.iteration.problem.interface.jump.maximum(iterate.state.forces.pressure)

    def _loss_of_contact(
        self, iterate: Iterate, pressed: float, note: str
    ) -> tuple[Iterate, Outcome] | None:
        """Return zero displacement where nothing touches any more and nothing acts. Collective.

        Displacements fall by their rounding in each step then, and so do the forces beside which
        residuals are measured: nodes that touch press by a part of the largest pressure before.
        """
        problem = self.iteration.problem
        counts = _node_counts(iterate, problem)
        if counts is None:
            return None
        tolerance = self.iteration.options.tolerance
        if counts[1] + counts[2] > 0 and self._largest_pressure(iterate) > tolerance * pressed:
            return None
        found = undeformed_equilibrium(problem, tolerance)
        if found is None:
            return None
        iterate = replace(iterate, state=found[0])
        self.iteration.see(iterate, found[1])
        self.iteration.history.record(found[1], f"{note} zero displacement".strip(), inner=0)
        return iterate, self._end(found[1])

    def _end(self, residuals: Residuals, ended: str = "") -> Outcome:
        return Outcome(residuals, self.iteration.options.allowed, ended)


def _node_counts(iterate: Iterate, problem: Problem) -> tuple[int, int, int] | None:
    """Return the numbers of nodes that are open, stick and slip, if they are known. Collective."""
    if iterate.active_set is None:
        return None
    interface = problem.interface
    return interface.node_counts(interface.jump.apply(iterate.state.x), iterate.active_set)
