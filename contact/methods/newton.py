"""Semismooth Newton method, a primal-dual active set strategy: the default solver.

1. A step linearises material, contact, friction, layer and charge together (`newton_step`), and
   eliminates the multipliers node by node (`contact.interface.complementarity`). Steps are taken
   whole, without a line search: the residuals may rise while the active set changes, and the
   stagnation limit bounds how long.
2. Where the contact nodes are few, the body is condensed onto them (static condensation): a loop
   linearises the material (`CondensedSteps`), and the same method solves contact on the Schur
   complement, in small dense steps (`semismooth`).
3. `Newton.solve` begins on the condensed body where that pays, then or else on the whole one; the
   stages after these, in turn, are in `fallbacks`.

References
----------
Alart and Curnier, A mixed formulation for frictional contact problems prone to Newton like solution
methods, Comput. Methods Appl. Mech. Engrg. 92 (1991).
Hintermueller, Ito and Kunisch, The primal-dual active set strategy as a semismooth Newton method,
SIAM J. Optim. 13 (2002).
Kelley, Iterative Methods for Linear and Nonlinear Equations, SIAM (1995), section 5.4: chord steps.
Hueeber, Stadler and Wohlmuth, A primal-dual active set algorithm for three-dimensional contact
problems with Coulomb friction, SIAM J. Sci. Comput. 30 (2008).
"""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass, field, replace

import numpy as np

from contact.linear.operator import Counters
from contact.methods.fallbacks import (
    CONTINUATION,
    PROXIMAL_POINT,
    SECANT,
    WORKING_SET,
    fall_back,
    solve_with_fallbacks,
)
from contact.methods.interior_point import INTERIOR_POINT, OVERLOADED
from contact.methods.newton_step import NewtonStep
from contact.methods.options import NewtonOptions
from contact.methods.report import Monitor, Outcome, Record, Recorder
from contact.methods.semismooth import ConvergenceMonitor, End, SemismoothNewton
from contact.methods.unconstrained_modes import RIGID_MOTION, UnconstrainedModes
from contact.problem.condensed import (
    Condensation,
    CondensedProblem,
    condensable,
    condensation_pays,
)
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.settings import MOST_COUNT
from contact.tolerances import PRECISION

logger = logging.getLogger("contact.solver")

#: Ratio of the tolerance of the condensed contact problem to the residual before the step.
CONTACT_PART = 1e-3

#: Largest ratio of the residual of the condensed contact problem to that before the step; above
#: it the whole body is solved.
UNSOLVED = 0.05

#: Notes of fallbacks on the condensed problem, repeated in the record of the whole one.
FALLBACKS = WORKING_SET, CONTINUATION, SECANT, RIGID_MOTION, INTERIOR_POINT, PROXIMAL_POINT

#: Reason of an end without solution of a condensed contact problem.
UNSOLVED_ON_CONTACT_NODES = "the condensed contact problem is not solved"

#: Most chord steps to the goal for which a factorisation is reused: they cost as much as a new one.
MOST_STEPS = 10.0

#: Residual above which there are no chord steps.
RADIUS = 0.05


class Chord:
    """Choice between a Newton step and a chord step, by the rate of convergence to a tolerance.

    `most_steps` is the largest predicted number of chord steps; with 0 all are Newton steps.
    """

    def __init__(self, goal: float, most_steps: float) -> None:
        self._goal, self._most_steps = goal, most_steps
        self.drop()
        self.begin()

    def drop(self) -> None:
        """Take a Newton step next."""
        self._factorised = self._reused = False

    def begin(self) -> None:
        """Begin an iteration with other loads or another initial guess."""
        self._before: State | None = None
        self._reached = np.inf

    def choose(self, state: State, reached: float) -> tuple[State, bool]:
        """Return the iterate to step from, and whether the step is a chord step.

        Given the last iterate and its residual; where a chord step has raised it, the iterate
        before is taken.
        """
        before, last = self._before, self._reached
        if not self._factorised or self._most_steps <= 0:
            reuse = False
        elif before is None:
            reuse = state.starts_with_tangent
        elif reached >= last and self._reused:
            state, reached, reuse = before, last, False
        else:
            rate = reached / last
            steps_left = np.log(self._goal / reached) / np.log(rate) if rate < 1 else np.inf
            reuse = bool(steps_left <= self._most_steps and reached <= RADIUS)
        self._before, self._reached, self._reused = state, reached, reuse
        self._factorised = True
        return state, reuse


class CondensedSteps:
    """Newton's steps on the condensed body: a loop over the material of a whole problem.

    Each solves contact on the Schur complement by the same method, with fallbacks of its own.
    """

    def __init__(self, options: NewtonOptions, linear: bool, counters: Counters) -> None:
        self._counters = counters
        # The factorisation of a linear body serves all steps.
        reuses = options.reuse != "never" and not linear
        self.chord = Chord(options.tolerance, MOST_STEPS if reuses else 0.0)
        #: The condensed body; None before the first step.
        self.condensation: Condensation | None = None

    def __call__(self, whole: SemismoothNewton, state: State) -> End:
        """Iterate from an initial guess until convergence or the limit. Collective."""
        if self.condensation is None:
            self.condensation = Condensation(whole.modes.problem, self._counters)
        options, body = whole.options, whole.problem.body
        monitor, chord = ConvergenceMonitor(whole, state), self.chord
        if monitor.starts_converged:
            return state, monitor.outcome()
        chord.begin()
        tangent = state.starts_with_tangent and not body.linear
        for _ in range(min(options.max_iterations, whole.steps_left)):
            previous, last = state, monitor.iterate
            largest = last.residuals.significant
            state, reuse = chord.choose(state, largest)
            internal = last.internal if state is previous and state.secant_at is None else None
            kind = "tangent" if tangent else "secant"
            condensed_problem = self.condensation.linearise(kind, state, reuse, internal)
            if condensed_problem is None:
                chord.drop()
                return previous, monitor.outcome(UNSOLVED_ON_CONTACT_NODES)
            # Inexact Newton: no more digits than the linearised material has.
            enough = 0.1 * options.tolerance
            if not body.linear and not reuse:
                enough = max(enough, CONTACT_PART * min(largest, 1.0))
            method = _on_contact_nodes(whole, condensed_problem, enough)
            begin = replace(state, x=condensed_problem.body.x_0, secant_at=None)
            solved, outcome = solve_with_fallbacks(method, begin)
            records = tuple(method.recorder.records)
            self._counters.contact_solves += sum(record.inner for record in records)
            overloaded = outcome.overloaded and body.linear
            unsolved = outcome.residuals.significant > max(enough, UNSOLVED * largest)
            if unsolved and not overloaded:
                return previous, monitor.outcome(UNSOLVED_ON_CONTACT_NODES)
            increment = self.condensation.expand(condensed_problem, solved.x)
            state = replace(solved, x=body.updated(state.x, increment), history=state.history)
            monitor.evaluate(state)
            taken = [word for word in FALLBACKS if any(word in r.note for r in records)]
            note = ", ".join([*["chord step"] * reuse, *taken])
            monitor.record(note, "tangent" * tangent, steps=records)
            if overloaded and not monitor.converged:
                return state, replace(monitor.outcome(OVERLOADED), overloaded=True)
            if (end := monitor.end()) is not None:
                return end
            if not body.linear:
                tangent = monitor.next_is_tangent(tangent, last.residuals)
            if (stalled := monitor.stalled()) is not None:
                return state, stalled
        return state, monitor.out_of_steps()


def _on_contact_nodes(
    whole: SemismoothNewton, problem: CondensedProblem, tolerance: float
) -> SemismoothNewton:
    """Return the method on a condensed problem, to a tolerance."""
    # Each stage has a limit of its own.
    changes = {"tolerance": max(tolerance, PRECISION), "max_outer": MOST_COUNT}
    options = whole.options.model_copy(update=changes)
    underconstrained = not whole.modes.constrained_undeformed
    step = NewtonStep(problem, options, whole.step.parameters, Counters(), underconstrained)
    recorder = Recorder(lambda _: whole.recorder.poll(), logging.DEBUG)
    return SemismoothNewton(problem, options, step, whole.modes, recorder)


@dataclass
class Newton:
    """The semismooth Newton method with its fallbacks, on a whole problem; see `Method`."""

    problem: ContactProblem
    options: NewtonOptions = field(default_factory=NewtonOptions)
    monitor: Monitor | None = None
    counters: Counters = field(default_factory=Counters)

    def __post_init__(self) -> None:
        """Choose the complementarity parameters, and whether the body is to be condensed."""
        problem, options = self.problem, self.options
        parameters = problem.scales.complementarity_parameters(options.gamma)
        self._modes = UnconstrainedModes.of(problem)
        underconstrained = not self._modes.constrained_undeformed
        self._step = NewtonStep(problem, options, parameters, self.counters, underconstrained)
        self._condenses = options.condense and condensable(problem, options.linear)
        self._pays = self._condenses and condensation_pays(problem, options.linear)
        #: Steps on the condensed body: the first stage where they pay, else the last fallback.
        self.condensed_steps = CondensedSteps(options, problem.body.linear, self.counters)
        self.set_load_step(problem)

    def set_load_step(self, problem: ContactProblem) -> None:
        """Take another load step; see `Method`. Collective."""
        if not problem.same_unknowns(self.problem):
            self.problem = problem
            return self.__post_init__()
        if problem.nodes is self.problem.nodes:
            self._modes = replace(self._modes, problem=problem)
        else:  # normals and gaps of another geometry
            self._modes = UnconstrainedModes.of(problem)
            self._step.underconstrained = not self._modes.constrained_undeformed
        self.problem = problem
        self.recorder = Recorder(self.monitor)
        if self.condensed_steps.condensation is not None:
            self.condensed_steps.condensation.set_load_step(problem)
        at_last = self.condensed_steps if self._condenses and not self._pays else None
        #: The method on the whole body.
        self.semismooth = SemismoothNewton(
            problem, self.options, self._step, self._modes, self.recorder, at_last
        )

    @property
    def history(self) -> list[Record]:
        """The steps of the last solves."""
        return self.recorder.records

    @property
    def state(self) -> State:
        """The state after the last step."""
        return self.semismooth.last

    def solve(self, start: State | None = None) -> tuple[State, Outcome]:
        """Iterate until convergence or the limit; the best iterate on failure; see `Method`."""
        semismooth, problem, body = self.semismooth, self.problem, self.problem.body
        self.recorder.begin = time.perf_counter()
        if self.options.reuse != "across":
            self.condensed_steps.chord.drop()
        if start is None:
            begin = replace(problem.start(), secant_at=body.zero_displacement())
        else:
            begin = semismooth.started(start)
        if body.linear:
            begin = replace(begin, secant_at=None)
        semismooth.begin(begin)
        if self._pays:
            state, outcome = self.condensed_steps(semismooth, begin)
            if not outcome.final and semismooth.steps_left > 0:
                logger.info("%s; going on with the whole body", outcome.ended)
                state, outcome = semismooth.iterate(state)
            if not outcome.final:
                state, outcome = fall_back(semismooth, state, outcome)
        else:
            state, outcome = solve_with_fallbacks(semismooth, begin)
        semismooth.last = state
        return state, outcome
