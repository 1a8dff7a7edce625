"""A Newton step on the condensed body: one linearisation of the material, all of contact within it.

Where the contact nodes are few, the linearised body is condensed onto them (static condensation).
Active sets and friction are iterated there, in small dense steps on the Schur complement; the outer
iteration is over the material alone, with chord steps.
"""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable
from dataclasses import replace

from contact.interface.complementarity import ComplementarityParameters
from contact.linear.operator import Counters
from contact.methods.chord import MOST_STEPS, Chord
from contact.methods.conductivity_derivative import ConductivityDerivative
from contact.methods.continuation import CONTINUATION
from contact.methods.interior_point import INTERIOR_POINT
from contact.methods.newton_step import Iterate, StepResult
from contact.methods.options import NewtonOptions
from contact.methods.report import IterationHistory, Outcome
from contact.methods.unconstrained_modes import RIGID_MOTION
from contact.methods.working_set import WORKING_SET
from contact.problem.condensed import Condensation, CondensedProblem
from contact.problem.problem import ContactProblem
from contact.problem.residuals import Residuals
from contact.typing import Array

#: Ratio of the tolerance of the condensed contact problem to the residual before the step.
CONTACT_PART = 1e-3

#: Ratio of the residual of the condensed contact problem to that before the step above which the
#: problem counts as unsolved, and the whole body is taken.
UNSOLVED = 0.05

#: Notes of fallbacks that a record of the whole problem repeats.
FALLBACKS = WORKING_SET, CONTINUATION, RIGID_MOTION, INTERIOR_POINT

#: Solves a condensed problem from an iterate, with a history of its own.
Solver = Callable[
    [CondensedProblem, NewtonOptions, ComplementarityParameters, IterationHistory, Iterate],
    tuple[Iterate, Outcome],
]


class CondensedStep:
    """Linearises the material, and solves the condensed contact problem.

    Parameters
    ----------
    condensation
        Condenses the body of the whole problem.
    options, parameters
        Those of the whole problem.
    solve
        Solves the condensed contact problem.
    history
        Of the whole problem: it is asked whether the solve is to end.
    counters
        Where solves of the condensed problem are counted.
    """

    fault = "the condensed contact problem is not solved"

    def __init__(
        self,
        condensation: Condensation,
        options: NewtonOptions,
        parameters: ComplementarityParameters,
        solve: Solver,
        history: IterationHistory,
        counters: Counters,
    ) -> None:
        self.condensation, self.options, self.parameters = condensation, options, parameters
        self.counters, self.conductivity_derivative = counters, ConductivityDerivative()
        self._solve, self._history = solve, history
        most_steps = MOST_STEPS if options.keep != "never" else 0.0
        self._chord = Chord(options.tolerance, most_steps)

    def set_load_step(self, problem: ContactProblem, history: IterationHistory) -> None:
        """Go on with another step of the same problem."""
        self.condensation.set_load_step(problem)
        self._history = history

    def begin_solve(self) -> None:
        """Begin another solve; drop the factorisation unless it may be kept across solves."""
        if self.options.keep != "across":
            self._chord.drop()

    def begin(self) -> None:
        """Begin another loop of steps in the same solve; the factorisation remains."""
        self._chord.begin()

    def __call__(
        self, iterate: Iterate, tangent: bool, reached: Residuals, internal: Array | None
    ) -> StepResult | None:
        """Take a step; None where the body cannot be condensed or contact is not solved."""
        body = self.condensation.full.equilibrium
        last = iterate
        iterate, keep = self._chord.choose(iterate, reached.significant)
        state = iterate.state
        kind = "tangent" if tangent else "secant"
        known = internal if iterate is last else None
        condensed = self.condensation.linearise(kind, state, keep, iterate.linearised_at, known)
        if condensed is None:
            return None
        # No more accurate than the material is linearised, nor than the end asks for.
        enough = 0.1 * self.options.tolerance
        if not body.linear and not keep:
            enough = max(enough, CONTACT_PART * min(reached.significant, 1.0))
        options = replace(
            self.options,
            tolerance=enough,
            max_outer=sys.maxsize,  # each of its stages has a limit
            condense=False,
        )
        history = IterationHistory(lambda _: self._history.poll(), level=logging.DEBUG)
        begin = replace(
            iterate, state=replace(state, x=condensed.equilibrium.at), linearised_at=None
        )
        end, outcome = self._solve(condensed, options, self.parameters, history, begin)
        solves = sum(record.inner for record in history.records)
        self.counters.contact_solves += solves
        overloaded = outcome.overloaded and body.linear
        unsolved = outcome.kkt.significant > max(enough, UNSOLVED * reached.significant)
        if unsolved and not overloaded:
            return None
        increment = self.condensation.expand(condensed, end.state.x)
        new = replace(state, x=body.moved(state.x, increment), forces=end.state.forces)
        if not body.linear:
            self._chord.note_factorisation()
        notes = [record.note for record in history.records]
        taken = [word for word in FALLBACKS if any(word in note for note in notes)]
        note = ", ".join([*["chord step"] * keep, *taken])
        return StepResult(replace(end, state=new), note, tuple(history.records), overloaded)
