"""Newton's method, and the roads that are taken where it fails.

First the condensed body, where the contact nodes are few, then the whole one. Where Newton's loop
cycles at the contact nodes of a condensed body, an interior-point method takes over. Where that
fails, and for the whole body, friction is frozen and updated outside (Algorithm 1 with Newton
inside); then the block relaxation takes over, and at last the load is applied in steps. The
history says which.

References
----------
Alart and Curnier, Comput. Methods Appl. Mech. Engrg. 92 (1991).
Hueeber, Stadler and Wohlmuth, SIAM J. Sci. Comput. 30 (2008).
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, field, replace

import numpy as np

from contact.interface.linearised import Moduli
from contact.interface.multipliers import Multipliers
from contact.interface.status import touching
from contact.linear.operator import Counters
from contact.methods.fixed_point import FixedPoint
from contact.methods.loop import UPDATE, NewtonLoop
from contact.methods.material import SECANT_UNTIL, MaterialStep
from contact.methods.options import FixedPointOptions, NewtonOptions
from contact.methods.report import History, Monitor, Outcome, Record
from contact.methods.step import Iterate, WholeStep
from contact.methods.sure import INTERIOR_POINT, solve_convex
from contact.methods.uzawa import automatic_r
from contact.problem.condensed import CondensedProblem
from contact.problem.condensing import condensation, pays
from contact.problem.kkt import KKT, evaluate
from contact.problem.problem import ContactProblem
from contact.problem.protocols import Problem
from contact.problem.scales import Scales
from contact.problem.state import State

logger = logging.getLogger("contact.solver")

#: What the history says of the slower methods.
FROZEN_FRICTION, BLOCK_RELAXATION = "frozen friction", "block relaxation"
SLOWER = INTERIOR_POINT, FROZEN_FRICTION, BLOCK_RELAXATION

#: Patience with the whole body where a surer road is left.
SHORT = 4

#: Updates of a frozen friction bound, and what the first of its problems is solved to.
MOST_UPDATES, FIRST_GOAL = 40, 1e-2

#: Part of the load in the first of the load steps, and the least one that is tried.
FIRST_STEP, LEAST_STEP = 0.25, 1e-2


def moduli_of(scales: Scales, gamma: float) -> Moduli:
    """Return stiffnesses of the linearised laws that fit a body and its mesh, in any units.

    A mode of Gamma_3 as long as the body is high has the stiffness E'/H, and with r* in the
    middle, one as short as an element has r*^2 H/E'.
    """
    middle = automatic_r(scales)
    nodal = middle**2 * scales.height / scales.plane_modulus
    return Moduli(middle, nodal, gamma * max(middle, nodal))


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
    """

    problem: Problem
    options: NewtonOptions = field(default_factory=NewtonOptions)
    monitor: Monitor | None = None
    counters: Counters = field(default_factory=Counters)
    moduli: Moduli | None = None
    history: History = field(init=False)

    def __post_init__(self) -> None:
        """Choose the moduli, and condense the body where that pays."""
        problem, options = self.problem, self.options
        self.history = History(self.monitor)
        self._moduli = self.moduli or moduli_of(problem.scales, options.gamma)
        self._forget()
        self.whole = WholeStep(problem, options, self._moduli, self.counters)
        self._condensed: MaterialStep | None = None
        self._pays = False
        if options.condense and isinstance(problem, ContactProblem):
            body = condensation(problem, self.counters, options.linear)
            if body is not None:
                self._condensed = MaterialStep(
                    body, options, self._moduli, _solve_condensed, self.history, self.counters,
                    SLOWER,
                )  # fmt: skip
                self._pays = pays(problem)

    def turn_to(self, problem: Problem) -> None:
        """Go on with another step of the same problem; what is factorised remains."""
        self.problem = self.whole.problem = problem
        self.history = History(self.monitor)
        if self._condensed is not None:
            assert isinstance(problem, ContactProblem)
            self._condensed.turn_to(problem, self.history)
        self._forget()

    def _forget(self) -> None:
        self._at = Iterate(self.problem.start())
        self._best: Iterate | None = None
        self._least = np.inf

    @property
    def state(self) -> State:
        """What the last step has left."""
        return self._at.state

    def solve(self, start: State | None = None) -> tuple[State, Outcome]:
        """Iterate until convergence or the limit. Collective.

        Parameters
        ----------
        start
            Where from; from rest by default.
        """
        self._forget()
        iterate = self._at if start is None else self._started(start)
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
        self._at, self._best, self._least = iterate, None, np.inf
        self.history.restart()
        iterate, outcome = self._roads(iterate)
        if not outcome.converged and self._best is not None:
            iterate = self._best
            outcome = replace(outcome, kkt=evaluate(self.problem, iterate.state))
        self._at = iterate
        return iterate, outcome

    def _see(self, iterate: Iterate, residuals: KKT) -> None:
        """Remember where the method is, and which iterate meets the whole load best."""
        self._at = iterate
        if iterate.state.time == self.problem.time and residuals.largest < self._least:
            self._best, self._least = iterate, residuals.largest

    @property
    def _left(self) -> int:
        """Number of steps that are left of the limit."""
        return self.options.max_outer - len(self.history.records)

    def _roads(self, iterate: Iterate) -> tuple[Iterate, Outcome]:
        if self._condensed is not None and self._pays:
            iterate, outcome = self._at_contact(self._condensed, iterate)
            if outcome.converged or self._left <= 0:
                return iterate, outcome
            logger.info("%s; going on with the whole body", outcome.ended)
        surer = None if self._pays else self._condensed
        loop = self._whole_loop(SHORT if surer is not None else None)
        iterate, outcome = loop.run(iterate)
        if not outcome.converged and surer is not None:
            logger.info("%s; going on at the contact nodes", outcome.ended)
            # From rest: where Newton's method has failed, the body may have flown away.
            start = Iterate(self.problem.start())
            iterate, outcome = self._at_contact(surer, start)
        if not outcome.converged and isinstance(self.problem, CondensedProblem):
            iterate, outcome = self._convex(self.problem, iterate, outcome)
        if not outcome.converged and self.problem.interface.friction.acts and self._left > 0:
            iterate, outcome = self._frozen_friction(loop, iterate)
        if not outcome.converged and self._left > 0:
            iterate, outcome = self._block_relaxation()
        if not outcome.converged and self._left > 0 and self.options.load_steps:
            iterate, outcome = self._load_steps(loop)
        return iterate, outcome

    def _at_contact(self, step: MaterialStep, iterate: Iterate) -> tuple[Iterate, Outcome]:
        """Iterate with the body condensed onto the contact nodes."""
        loop = NewtonLoop(self.problem, self.options, step, self.history, self._see, SECANT_UNTIL)
        return loop.run(iterate)

    def _convex(
        self, problem: CondensedProblem, iterate: Iterate, outcome: Outcome
    ) -> tuple[Iterate, Outcome]:
        """Solve convex problems for sure, and let Newton's loop finish what they leave.

        Without friction first: where the body touches, Newton's method mostly finds the rest.
        """
        for friction in (False, True) if problem.interface.friction.acts else (False,):
            start = problem.start() if self._best is None else self._best.state
            found = solve_convex(problem, start, self.history.poll, friction)
            if found is None:
                break
            residuals = evaluate(problem, found.state)
            iterate = self._started(found.state)
            self._see(iterate, residuals)
            self.history.record(residuals, INTERIOR_POINT, found.steps)
            outcome = Outcome(residuals, self.options.allowed, found.words)
            if outcome.converged or self._left <= 0:
                break
            loop = self._whole_loop(None if friction else SHORT)
            iterate, outcome = loop.run(iterate, INTERIOR_POINT)
            if outcome.converged:
                break
        return iterate, outcome

    def _whole_loop(self, patience: int | None = None) -> NewtonLoop:
        options = replace(self.options, patience=patience or self.options.patience)
        return NewtonLoop(
            self.problem, options, self.whole, self.history, self._see, options.secant_until
        )

    def _frozen_friction(self, loop: NewtonLoop, iterate: Iterate) -> tuple[Iterate, Outcome]:
        """Update the friction bound outside of Newton's loop: each problem is then convex."""
        goal, interface = FIRST_GOAL, self.problem.interface
        for _ in range(MOST_UPDATES):
            state = iterate.state
            bound = interface.bound(interface.jump.apply(state.x), state.forces)
            iterate, outcome = loop.run(iterate, FROZEN_FRICTION, bound, goal)
            if outcome.converged or outcome.ended != UPDATE:
                break
            goal = 0.1 * outcome.kkt.largest
        return iterate, outcome

    def _block_relaxation(self) -> tuple[Iterate, Outcome]:
        """Solve by the fixed point over block relaxation, which damps what Newton lets cycle."""

        def note(record: Record) -> None:
            self._see(Iterate(relaxed.state), record.kkt)
            self.history.record(record.kkt, BLOCK_RELAXATION, record.inner)

        options = FixedPointOptions(
            tolerance=self.options.tolerance,
            max_outer=min(FixedPointOptions.max_outer, self._left),
            linear=self.options.linear,
        )
        relaxed = FixedPoint(self.problem, options, note, self.counters, self.history.poll)
        state, outcome = relaxed.solve()
        return Iterate(state), outcome

    def _load_steps(self, loop: NewtonLoop) -> tuple[Iterate, Outcome]:
        """Apply loads and prescribed displacements in steps, halved where they are too large.

        For a static problem, whose loads grow with time from 0 to 1.
        """
        body, step, reached = self.problem.equilibrium, FIRST_STEP, 0.0
        iterate = Iterate(self.problem.start(0.0))
        while reached < 1.0 and step > LEAST_STEP and self._left > 0:
            load = min(1.0, reached + step)
            state = iterate.state
            loaded = replace(state, x=body.prescribe(state.x, load), time=load)
            tried, outcome = loop.run(replace(iterate, state=loaded), f"load {load:.3g}")
            if not outcome.converged and self.problem.interface.friction.acts:
                tried, outcome = self._frozen_friction(loop, tried)
            if outcome.converged:
                iterate, reached = tried, load
            else:
                step /= 2
        state = iterate.state
        time = self.problem.time
        whole = replace(state, x=body.prescribe(state.x, time), time=time)
        iterate = replace(iterate, state=whole)
        residuals = evaluate(self.problem, iterate.state)
        self._see(iterate, residuals)
        ended = "" if reached == 1.0 else f"load steps ended at {reached:.3g} of the load"
        return iterate, Outcome(residuals, self.options.allowed, ended)


def _solve_condensed(
    problem: Problem, options: NewtonOptions, moduli: Moduli, history: History, iterate: Iterate
) -> tuple[Iterate, Outcome]:
    """Solve a contact problem at its own nodes, by all roads that are open there."""
    method = Newton(problem, options, moduli=moduli)
    method.history = history
    return method.run(iterate)
