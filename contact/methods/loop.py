"""Newton's loop: step after step, until the residuals say that it has converged or stalled."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from contact.interface.residuals import interface_residuals
from contact.methods.report import Outcome
from contact.methods.search import Search
from contact.methods.stagnation import Stagnation
from contact.methods.step import Iterate, Step
from contact.problem.kkt import KKT, evaluate
from contact.problem.state import State
from contact.typing import Array

#: What counts as progress of a step.
PROGRESS = 0.5

#: Why a loop with a frozen friction bound ends.
UPDATE = "friction bound to be updated"

#: Why a loop that is hopeless ends.
SOFTER = "the body is far softer than a block"


@dataclass
class NewtonLoop:
    """Newton's loop with one kind of step.

    Attributes
    ----------
    search
        What is solved, with the tolerances; told of every iterate.
    step
        Takes the steps.
    secant_until
        Equilibrium residual below which the material's tangent replaces its secant: far from the
        solution the tangent is too soft, and overshoots.
    patience
        Steps without progress after which it is given up; that of the options by default.
    hopeless
        Asked after the first step from rest whether to give up at once; None to go on.
    """

    search: Search
    step: Step
    secant_until: float
    patience: int | None = None
    hopeless: Callable[[State], bool] | None = None

    def run(
        self, iterate: Iterate, note: str = "", bound: Array | None = None, goal: float = 0.0
    ) -> tuple[Iterate, Outcome]:
        """Iterate. Collective.

        Parameters
        ----------
        iterate
            Where from.
        note
            What the history says of the steps.
        bound
            A frozen friction bound, shape (n,): Tresca's law in place of Coulomb's.
        goal
            With a frozen bound, what the residual of that bound has to fall below.
        """
        search, problem, options = self.search, self.search.problem, self.search.options
        linear, patience = problem.equilibrium.linear, self.patience or options.patience
        goal = max(goal, options.tolerance)
        residuals = evaluate(problem, iterate.state)
        stagnation = Stagnation(patience, PROGRESS, together=True)
        self.step.begin()
        # A start from elsewhere is near the solution; zero displacement has no better tangent.
        tangent = iterate.status is not None and not linear
        for _ in range(min(options.max_iterations, search.left)):
            before, kept = residuals, iterate
            taken = self.step(iterate, tangent, residuals, bound)
            if taken is None:
                return kept, self._end(residuals, self.step.fault)
            iterate = taken.iterate
            residuals = evaluate(problem, iterate.state)
            worse = self.step.following.worsened(residuals.largest)
            search.see(iterate, residuals)
            words = (note, taken.note, "tangent" * tangent, "taken back" * worse)
            said = " ".join(word for word in words if word)
            search.history.record(residuals, said, contact=taken.solves)
            if worse:
                iterate = kept
                residuals = evaluate(problem, iterate.state)
                search.see(iterate, residuals)
            measured = self._measure(iterate, residuals, bound)
            if residuals.largest <= options.tolerance:
                return iterate, self._end(residuals)
            if bound is not None and measured <= goal:
                return iterate, self._end(residuals, UPDATE)
            if self.hopeless is not None and kept.status is None and self.hopeless(iterate.state):
                return iterate, self._end(residuals, SOFTER)
            if not np.isfinite(measured):
                return iterate, self._end(residuals, "Newton's method diverged")
            if not linear:
                falls = residuals.equilibrium < max(before.equilibrium, options.tolerance)
                near = residuals.equilibrium < self.secant_until
                # The energy falls along a step that is lengthened, where residuals may rise.
                tangent = taken.lengthened or (near and (falls or not tangent))
            if stagnation(measured):
                words_of_end = f"Newton's method stalled at {stagnation.best:.1e}"
                return iterate, self._end(residuals, words_of_end)
        steps = len(search.history.records)
        return iterate, self._end(residuals, f"not converged in {steps} steps")

    def _measure(self, iterate: Iterate, residuals: KKT, bound: Array | None) -> float:
        """Return the largest residual, with the frozen friction bound if there is one."""
        if bound is None:
            return residuals.largest
        interface, state = self.search.problem.interface, iterate.state
        nodal = interface.jump.apply(state.x)
        return max(
            residuals.equilibrium, *interface_residuals(interface, nodal, state.forces, bound)
        )

    def _end(self, residuals: KKT, ended: str = "") -> Outcome:
        return Outcome(residuals, self.search.options.allowed, ended)
