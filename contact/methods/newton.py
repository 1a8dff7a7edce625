"""Newton's method, and the roads that are taken where it fails.

First the condensed body, where the contact nodes are few, then the whole one. Where Newton's loop
cycles, an interior-point method takes over, a dense one at the contact nodes of a condensed body,
for others a sparse one. Where that fails, friction is frozen and updated outside (Algorithm 1 with
Newton inside); then the load is applied in steps, and at last the block relaxation takes over. The
history says which.

References
----------
Alart and Curnier, Comput. Methods Appl. Mech. Engrg. 92 (1991).
Hueeber, Stadler and Wohlmuth, SIAM J. Sci. Comput. 30 (2008).
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from contact.interface.linearised import Moduli
from contact.interface.multipliers import Multipliers
from contact.interface.status import touching
from contact.linear.operator import Counters
from contact.methods.barrier import interior_point
from contact.methods.best import Best
from contact.methods.conductivity_steps import CONDUCTIVITY, conductivity_steps
from contact.methods.few import FEW_NODES, at_few_nodes
from contact.methods.frozen_friction import FROZEN_FRICTION, frozen_friction
from contact.methods.load_steps import load_steps
from contact.methods.loop import SOFTER, NewtonLoop
from contact.methods.material import SECANT_UNTIL, MaterialStep
from contact.methods.moduli import far_softer, moduli_of
from contact.methods.options import NewtonOptions
from contact.methods.relaxed import BLOCK_RELAXATION, block_relaxation
from contact.methods.report import History, Monitor, Outcome
from contact.methods.resting import resting
from contact.methods.search import Search
from contact.methods.step import Iterate, WholeStep
from contact.methods.sure import INTERIOR_POINT, solve_convex
from contact.problem.condensed import CondensedProblem
from contact.problem.condensing import condensation, pays
from contact.problem.kkt import evaluate
from contact.problem.mobility import held_at_rest
from contact.problem.problem import ContactProblem
from contact.problem.protocols import Problem
from contact.problem.state import State

logger = logging.getLogger("contact.solver")

#: What the history says of other roads than Newton's loop.
ROADS = FEW_NODES, CONDUCTIVITY, INTERIOR_POINT, FROZEN_FRICTION, BLOCK_RELAXATION

#: Patience with the whole body where a surer road is left.
SHORT = 4


@dataclass
class Newton:
    """Newton's method on one problem.

    Parameters
    ----------
    problem
        The contact problem.
    options
        Options of the method.
    monitor
        Told of every step.
    moduli
        Stiffnesses of the linearised laws; chosen from those of the body by default.
    soft
        Whether it is known that Newton's loop is hopeless, for the body is far softer than these.
    loose
        As of `WholeStep`; of a condensed body, whose supports are not seen, it has to be told.
    """

    problem: Problem
    options: NewtonOptions = field(default_factory=NewtonOptions)
    monitor: Monitor | None = None
    counters: Counters = field(default_factory=Counters)
    moduli: Moduli | None = None
    soft: bool = False
    loose: bool = False
    history: History = field(init=False)

    def __post_init__(self) -> None:
        """Choose the moduli, and condense the body where that pays."""
        problem, options, self.history = self.problem, self.options, History(self.monitor)
        self._moduli = self.moduli or moduli_of(problem.scales, options.gamma)
        self._begin()
        if isinstance(problem, ContactProblem):
            self.loose = not held_at_rest(problem)
        self.whole = WholeStep(problem, options, self._moduli, self.counters, self.loose)
        self._condensed: MaterialStep | None = None
        self._pays = False
        if options.condense and isinstance(problem, ContactProblem):
            body = condensation(problem, self.counters, options.linear)
            if body is not None:
                self._pays = pays(problem, options.linear)
                # Where the whole body comes first, its loop has found out already.
                inner = options if self._pays else replace(options, patience=SHORT)
                self._condensed = MaterialStep(
                    body, inner, self._moduli, partial(_solve_condensed, loose=self.loose),
                    self.history, self.counters, ROADS,
                )  # fmt: skip

    def turn_to(self, problem: Problem) -> None:
        """Go on with another step of the same problem; what is factorised remains."""
        self.problem = self.whole.problem = problem
        self.history = History(self.monitor)
        if self._condensed is not None:
            assert isinstance(problem, ContactProblem)
            self._condensed.turn_to(problem, self.history)
        self._begin()

    def _begin(self, iterate: Iterate | None = None) -> None:
        at = Iterate(self.problem.start()) if iterate is None else iterate
        self.search = Search(self.problem, self.options, self.history, at)

    @property
    def state(self) -> State:
        """What the last step has left."""
        return self.search.at.state

    def solve(self, start: State | None = None) -> tuple[State, Outcome]:
        """Iterate until convergence or the limit. Collective.

        Parameters
        ----------
        start
            Where from; from rest by default.
        """
        self._begin()
        if self._condensed is not None:
            self._condensed.forget()
        iterate = self.search.at if start is None else self._started(start)
        iterate, outcome = self.run(iterate)
        return iterate.state, outcome

    def _started(self, start: State) -> Iterate:
        """Return an iterate at a given state."""
        interface, c = self.problem.interface, self._moduli.status
        nodal = interface.jump.apply(start.x)
        # What is left of a pressure where a node is open would give it a friction bound: one of
        # the size of rounding, with friction of any direction, on which the node would stick.
        closed = touching(start.forces.pressure, interface.opening(nodal), c)
        pressure = np.where(closed, start.forces.pressure, 0.0)
        forces = Multipliers(pressure, start.forces.friction)
        bound = interface.bound(nodal, forces)
        status = interface.status(nodal, forces, bound, c)
        return Iterate(replace(start, forces=forces), status)

    def run(self, iterate: Iterate) -> tuple[Iterate, Outcome]:
        """Take one road after the other from an iterate; the best iterate if all fail."""
        self._begin(iterate)
        search = self.search
        self.history.restart()
        iterate, outcome = self._roads(iterate)
        if not outcome.converged and search.best.found is not None:
            iterate = search.best.found
            outcome = replace(outcome, kkt=evaluate(self.problem, iterate.state))
        search.at = iterate
        return iterate, outcome

    def _roads(self, iterate: Iterate) -> tuple[Iterate, Outcome]:
        search = self.search
        if self._condensed is not None and self._pays:
            iterate, outcome = self._at_contact(self._condensed, iterate)
            if outcome.converged or search.left <= 0:
                return iterate, outcome
            logger.info("%s; going on with the whole body", outcome.ended)
        surer = None if self._pays else self._condensed
        loop = self.whole_loop(SHORT if surer is not None else None)
        if self.soft:
            outcome = Outcome(evaluate(self.problem, iterate.state), self.options.allowed, SOFTER)
        else:
            # Where the condensed body has come first, its loop has found out already.
            soft = None if self._pays else partial(far_softer, self.problem, self._moduli)
            iterate, outcome = replace(loop, hopeless=soft).run(iterate)
            if not outcome.converged:
                iterate, outcome = self._at_few_nodes(iterate, outcome)
        if not outcome.converged and surer is not None:
            logger.info("%s; going on at the contact nodes", outcome.ended)
            # From rest: where Newton's method has failed, the body may have flown away.
            start, surer.soft = Iterate(self.problem.start()), outcome.ended == SOFTER
            iterate, outcome = self._at_contact(surer, start)
        if not outcome.converged:
            iterate, outcome = self._resting() or (iterate, outcome)
        if not outcome.converged and isinstance(self.problem, CondensedProblem):
            iterate, outcome = self._conducting(self.problem) or self._convex(
                self.problem, iterate, outcome
            )
        elif not outcome.converged and search.left > 0:
            logger.info("%s; going on with an interior point", outcome.ended)
            iterate, outcome = interior_point(search, self.whole, self._finished)
        if not outcome.converged and self.problem.interface.friction.acts and search.left > 0:
            iterate, outcome = frozen_friction(loop, iterate)
        if not outcome.converged and search.left > 0 and self.options.load_steps:
            iterate, outcome = load_steps(loop)
        if not outcome.converged and search.left > 0:
            iterate, outcome = block_relaxation(search, self.counters)
        return iterate, outcome

    def _at_few_nodes(self, iterate: Iterate, outcome: Outcome) -> tuple[Iterate, Outcome]:
        """Let a body that is free so far touch at a few nodes. Collective."""
        operator, tolerance = self.whole.operator, self.options.tolerance
        balanced = outcome.kkt.equilibrium <= tolerance
        found = balanced and at_few_nodes(self.problem, operator, iterate.state, tolerance)
        if not found:
            return iterate, outcome
        iterate, residuals = self._started(found), evaluate(self.problem, found)
        self.search.see(iterate, residuals)
        self.history.record(residuals, FEW_NODES)
        outcome = Outcome(residuals, self.options.allowed, FEW_NODES)
        return (iterate, outcome) if outcome.converged else self._finished(found, FEW_NODES)

    def _resting(self) -> tuple[Iterate, Outcome] | None:
        """Return the body at rest where nothing is left that acts on it. Collective."""
        found = resting(self.problem)
        if found is None:
            return None
        iterate, residuals = Iterate(found[0]), found[1]
        self.search.see(iterate, residuals)
        self.history.record(residuals, "at rest")
        return iterate, Outcome(residuals, self.options.allowed, "nothing acts")

    def _at_contact(self, step: MaterialStep, iterate: Iterate) -> tuple[Iterate, Outcome]:
        """Iterate with the body condensed onto the contact nodes."""
        return NewtonLoop(self.search, step, SECANT_UNTIL).run(iterate)

    def _conducting(self, problem: CondensedProblem) -> tuple[Iterate, Outcome] | None:
        """Follow solutions from a foundation that hardly conducts, if it conducts."""
        interface = problem.interface
        if interface.response.conductor is None:
            return None

        def loop(part: float) -> NewtonLoop:
            response = interface.response.conducting(part)
            less = replace(problem, interface=replace(interface, response=response))
            search = self.search if part == 1 else replace(self.search, problem=less, best=Best())
            step = WholeStep(search.problem, self.options, self._moduli, self.counters)
            return NewtonLoop(search, step, self.options.secant_until, SHORT)

        return conductivity_steps(loop, Iterate(problem.start()))

    def _convex(
        self, problem: CondensedProblem, iterate: Iterate, outcome: Outcome
    ) -> tuple[Iterate, Outcome]:
        """Solve convex problems for sure, and let Newton's loop finish what they leave.

        Without friction first: where the body touches, Newton's method mostly finds the rest. What
        is linear is so from anywhere, and least rounded from rest: Newton's loop may have let a
        loose body fly away.
        """
        answers = problem.interface.response.active
        for friction in (False, True) if problem.interface.friction.acts else (False,):
            best = self.search.best.found
            start = best.state if answers and best is not None else problem.start()
            poll, goal = self.history.poll, self.options.tolerance
            found = solve_convex(problem, start, poll, friction, goal)
            if found is None:
                break
            residuals = evaluate(problem, found.state)
            iterate = self._started(found.state)
            self.search.see(iterate, residuals)
            self.history.record(residuals, INTERIOR_POINT, found.steps)
            outcome = Outcome(residuals, self.options.allowed, found.words)
            if outcome.converged or self.search.left <= 0:
                break
            loop = self.whole_loop(None if friction else SHORT)
            iterate, outcome = loop.run(iterate, INTERIOR_POINT)
            if outcome.converged:
                break
        return iterate, outcome

    def _finished(self, state: State, note: str = INTERIOR_POINT) -> tuple[Iterate, Outcome]:
        """Go on from what a surer road has left."""
        return self.whole_loop(SHORT).run(self._started(state), note)

    def whole_loop(self, patience: int | None = None) -> NewtonLoop:
        """Return Newton's loop on the problem's own body."""
        return NewtonLoop(self.search, self.whole, self.options.secant_until, patience)


def _solve_condensed(
    problem: Problem,
    options: NewtonOptions,
    moduli: Moduli,
    history: History,
    iterate: Iterate,
    soft: bool,
    loose: bool,
) -> tuple[Iterate, Outcome]:
    """Solve a contact problem at its own nodes, by all roads that are open there."""
    method = Newton(problem, options, moduli=moduli, soft=soft, loose=loose)
    method.history = history
    return method.run(iterate)
