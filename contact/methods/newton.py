"""Semismooth Newton method, a primal-dual active set strategy: the default solver; its fallbacks.

1. Complementarity functions p - max(0, p + c (u_nu - rho)) and lambda - proj(lambda + c u_tau)
   state contact and friction at each node. Their arguments define the active set: which nodes are
   open, stick or slip (`contact.interface.active_set`). On it each has a generalised derivative
   (`contact.interface.complementarity`).
2. A step linearises material, contact, friction, layer and current together (`newton_step`). The
   multipliers are eliminated node by node with the augmentation parameter gamma, so that one
   linear system in the unknowns of the body is left: with gamma far above the stiffness of the
   body its solution nearly meets u_nu = rho where a node touches, and u_tau = 0 where it sticks.
   The material is linearised by its tangent while the residual of equilibrium falls, else by its
   secant (Kacanov). Steps are taken whole, without a line search: the residuals may rise while the
   active set changes, and the stagnation limit bounds how long.
3. Where the contact nodes are few, the body is condensed onto them first: a step then linearises
   the material, and a Newton method of its own solves contact on the Schur complement
   (`condensed_step`).
4. The iteration ends by the residuals of the problem, computed from scratch, or by their
   stagnation: the active sets cycle. Where the body is not condensed first, it also ends after a
   first step whose penetration shows that c is far above the stiffness of the body, as of slender
   ones. Loads that friction is found not to balance end the solve, without further fallbacks.

Where steps on the condensed body have ended without convergence, those on the whole body follow.
Then the state with all nodes open is tried, by one linear solve, where the supports constrain all
rigid-body modes, and from there contact at one node more in turn (`working_set`). If neither is a
solution the fallbacks follow, in this order; each condensed contact problem has 1 to 3 of its own:

1. on a condensed body with charge at its contact nodes, continuation in the conductivity of the
   foundation (`continuation`);
2. on a condensed body that the supports do not constrain, a rigid motion to a state in which
   all nodes are open (`unconstrained_modes`);
3. a primal-dual interior point on the same operator, which finds the active sets, with the friction
   bound updated outside, and Newton's last steps from there (`interior_point`). A converged
   solution in which contact has moved a body to where nothing constrains it, although friction
   could, gives way to that of a fallback if there is one;
4. the condensed body, where it has so many contact nodes that it was not condensed before.

The notes of the history name the first three.

References
----------
Alart and Curnier, A mixed formulation for frictional contact problems prone to Newton like solution
methods, Comput. Methods Appl. Mech. Engrg. 92 (1991).
Hintermueller, Ito and Kunisch, The primal-dual active set strategy as a semismooth Newton method,
SIAM J. Optim. 13 (2002).
Hueeber, Stadler and Wohlmuth, A primal-dual active set algorithm for three-dimensional contact
problems with Coulomb friction, SIAM J. Sci. Comput. 30 (2008).
Haslinger, Approximation of the Signorini problem with friction, obeying the Coulomb law, Math.
Methods Appl. Sci. 5 (1983).
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from contact.errors import SingularError
from contact.interface.active_set import touching
from contact.interface.complementarity import ComplementarityParameters
from contact.interface.multipliers import Multipliers
from contact.linear.operator import Counters
from contact.methods.complementarity_parameters import (
    complementarity_parameters,
    overestimates_stiffness,
)
from contact.methods.condensed_step import CondensedStep
from contact.methods.continuation import CONTINUATION, continuation
from contact.methods.interior_point import INTERIOR_POINT, interior_point
from contact.methods.newton_loop import NewtonLoop
from contact.methods.newton_step import Iterate, Iteration, NewtonStep
from contact.methods.options import NewtonOptions
from contact.methods.report import IterationHistory, Monitor, Outcome
from contact.methods.stagnation import Best
from contact.methods.unconstrained_modes import RIGID_MOTION, UnconstrainedModes
from contact.methods.working_set import WORKING_SET, working_set
from contact.problem.condensed import Condensation, CondensedProblem, condensable, condensation_pays
from contact.problem.problem import ContactProblem
from contact.problem.protocols import Problem
from contact.problem.residuals import evaluate, residual_forces
from contact.problem.state import State
from contact.typing import Array

logger = logging.getLogger("contact.solver")

#: Stagnation limit in a continuation: condensed steps cost little beside another value of the
#: parameter, and Example 8.4 with ten times its conductivity needs them.
CONTINUATION_LIMIT = 20


@dataclass
class Newton:
    """The semismooth Newton method on one problem.

    Parameters
    ----------
    problem
        The contact problem, or a condensed one.
    options
        Options of the method.
    monitor
        Told of every step.
    parameters
        Parameters of the complementarity functions; chosen from the body by default.
    modes
        Rigid-body modes; a condensed problem, which has no supports, is given those of the whole.
    """

    problem: Problem
    options: NewtonOptions = field(default_factory=NewtonOptions)
    monitor: Monitor | None = None
    counters: Counters = field(default_factory=Counters)
    parameters: ComplementarityParameters | None = None
    modes: UnconstrainedModes | None = None
    history: IterationHistory = field(init=False)

    def __post_init__(self) -> None:
        """Choose the complementarity parameters, and condense the body where that pays."""
        problem, options, self.history = self.problem, self.options, IterationHistory(self.monitor)
        self._parameters = self.parameters or complementarity_parameters(
            problem.scales, options.gamma
        )
        self._begin()
        modes = self.modes
        if modes is None:
            assert isinstance(problem, ContactProblem)
            modes = UnconstrainedModes(problem)
        self._modes = modes
        underconstrained = not self._modes.constrained_undeformed
        self.whole = NewtonStep(problem, options, self._parameters, self.counters, underconstrained)
        self._condensed: CondensedStep | None = None
        self._condensable, self._pays = False, False
        if options.condense and isinstance(problem, ContactProblem):
            self._condensable = condensable(problem, options.linear)
            self._pays = condensation_pays(problem, options.linear)

    @property
    def condensation(self) -> Condensation | None:
        """The body condensed onto its contact nodes, where that has been asked for."""
        return None if self._condensed is None else self._condensed.condensation

    def _condensed_step(self) -> CondensedStep:
        """Return the steps on the condensed body, made when they are first asked for."""
        if self._condensed is None:
            assert isinstance(self.problem, ContactProblem)
            body = Condensation(self.problem, self.counters)
            self._condensed = CondensedStep(
                body,
                self.options,
                self._parameters,
                partial(_solve_condensed, modes=self._modes),
                self.history,
                self.counters,
            )
        return self._condensed

    def set_load_step(self, problem: Problem) -> None:
        """Go on with another step of the same problem; factorisations remain."""
        self.problem = self.whole.problem = problem
        self.history = IterationHistory(self.monitor)
        if isinstance(problem, ContactProblem):
            self._modes.problem = problem
            if self._condensed is not None:
                self._condensed.set_load_step(problem, self.history)
        self._begin()

    def _begin(self, iterate: Iterate | None = None) -> None:
        at = Iterate(self.problem.start()) if iterate is None else iterate
        self.iteration = Iteration(self.problem, self.options, self.history, at)

    @property
    def state(self) -> State:
        """The state after the last step."""
        return self.iteration.at.state

    def solve(
        self, start: State | None = None, linearised_at: Array | None = None
    ) -> tuple[State, Outcome]:
        """Iterate until convergence or the limit. Collective.

        Parameters
        ----------
        start
            Initial guess; zero by default, where the material is linearised in the reference
            configuration.
        linearised_at
            Unknowns at which the material is linearised first; those of the start by default.
        """
        self._begin()
        if self._condensed is not None:
            self._condensed.begin_solve()
        iterate = self.iteration.at if start is None else self.iterate_at(start)
        body = self.problem.equilibrium
        if not body.linear:
            iterate = replace(
                iterate, linearised_at=body.rest() if start is None else linearised_at
            )
        iterate, outcome = self.run(iterate)
        return iterate.state, outcome

    def iterate_at(self, start: State) -> Iterate:
        """Return an iterate at a given state."""
        interface, c = self.problem.interface, self._parameters.c
        nodal = interface.jump.apply(start.x)
        # A remainder of pressure where a node is open would give it a friction bound: one of the
        # size of rounding, with friction of any direction, on which the node would stick.
        closed = touching(start.forces.pressure, interface.opening(nodal), c)
        pressure = np.where(closed, start.forces.pressure, 0.0)
        forces = Multipliers.of(interface.jump, pressure, start.forces.friction)
        bound = interface.bound(nodal, forces)
        active_set = interface.active_set(nodal, forces, bound, c)
        return Iterate(replace(start, forces=forces), active_set)

    def run(self, iterate: Iterate) -> tuple[Iterate, Outcome]:
        """Iterate, with fallbacks; the best iterate if all fail. Collective."""
        self._begin(iterate)
        iteration = self.iteration
        self.history.restart()
        self._without_contact: State | None = None
        iterate, outcome = self._iterate(iterate)
        if not outcome.converged and not outcome.overloaded:
            found = self._from_open()
            iterate, outcome = found or self._fall_back(iterate, outcome)
        elif not self._pays and self._modes.pushed_aside(self.problem, iterate.state):
            found = self._fall_back(iterate, outcome)
            iterate, outcome = found if found[1].converged else (iterate, outcome)
        unsolved = not outcome.converged and not outcome.overloaded
        if unsolved and iteration.best.found is not None:
            iterate = iteration.best.found
            outcome = replace(outcome, kkt=evaluate(self.problem, iterate.state))
        iteration.at = iterate
        return iterate, outcome

    def _from_open(self) -> tuple[Iterate, Outcome] | None:
        """Return a solution with all nodes open, or with a working set. Collective.

        Active sets may cycle on contact forces that are rounding of the other forces. Not tried
        where contact constrains a mode: a body moved aside may be in balance too, though friction
        has another solution that holds it.
        """
        if not self._modes.constrained_by_supports:
            return None
        best = self.iteration.best.found
        try:
            state = self.whole.without_contact(self.problem.start() if best is None else best.state)
        except SingularError:  # without contact nothing may hold the potential
            self.whole.renew()
            return None
        residuals = evaluate(self.problem, state)
        if not residuals.excess(self.options.allowed):
            return Iterate(state), Outcome(residuals, self.options.allowed, "")
        self._without_contact = state
        found = working_set(self.problem, Iterate(state), self._with_gaps)
        if found is None:
            return None
        residuals = evaluate(self.problem, found.state)
        self.iteration.see(found, residuals)
        outcome = Outcome(residuals, self.options.allowed, "")
        return (found, outcome) if outcome.converged else None

    def _with_gaps(self, gap: Array, iterate: Iterate) -> tuple[Iterate, Outcome]:
        """Solve with other gaps of the unilateral constraint, from an iterate on. Collective."""
        problem, interface = self.problem, self.problem.interface
        less = problem.with_interface(replace(interface, jump=replace(interface.jump, gap=gap)))
        # Of one stiff node in a soft body a forcing term leaves pressures of any size and sign.
        self.whole.problem, self.whole.exact = less, True
        try:
            iteration = replace(self.iteration, problem=less, best=Best())
            return NewtonLoop(iteration, self.whole).run(iterate, WORKING_SET)
        finally:
            self.whole.problem, self.whole.exact = problem, False

    def _iterate(self, iterate: Iterate) -> tuple[Iterate, Outcome]:
        """Take Newton's steps, with the body condensed where that pays."""
        iteration = self.iteration
        if self._pays:
            iterate, outcome = NewtonLoop(iteration, self._condensed_step()).run(iterate)
            if outcome.converged or outcome.overloaded or iteration.left <= 0:
                return iterate, outcome
            logger.info("%s; going on with the whole body", outcome.ended)
            return NewtonLoop(iteration, self.whole).run(iterate)
        give_up = partial(overestimates_stiffness, self.problem, self._parameters)
        return NewtonLoop(iteration, self.whole, give_up=give_up).run(iterate)

    def _fall_back(self, iterate: Iterate, outcome: Outcome) -> tuple[Iterate, Outcome]:
        """Try the fallbacks in turn, on the condensed body where there is one.

        Their many steps cost one factorisation of the body there. They start from the zero initial
        guess: where the active sets cycle, a body may have moved far away.
        """
        iteration, singular = self.iteration, None
        found: tuple[Iterate, Outcome] | None
        if isinstance(self.problem, CondensedProblem):
            found = self._continuation(self.problem) or self._separated(self.problem, outcome)
            if found is not None:
                return found
        last = not self._condensable or self._pays
        if iteration.left > 0:
            logger.info("%s; going on with an interior point", outcome.ended)
            # Half of the steps remain for the condensed body, where that is still to come.
            iteration.reserved = 0 if last else (iteration.left + 1) // 2
            try:
                iterate, outcome = interior_point(
                    iteration, self.whole, self._modes, self.last_steps, self._without_contact
                )
            except SingularError as error:
                self.whole.renew()
                singular = error
            iteration.reserved = 0
        if not (last or outcome.converged or outcome.overloaded) and iteration.left > 0:
            logger.info("%s; going on with the condensed body", outcome.ended)
            begin = Iterate(self.problem.start())
            found = NewtonLoop(iteration, self._condensed_step()).run(begin)
            # Where steps are left the interior point says more of the reason.
            if found[1].converged or iteration.left <= 0:
                iterate, outcome = found
        # Another material may have softened too much at the strains of a step.
        if singular is not None and self.problem.equilibrium.linear and not outcome.converged:
            raise singular
        return iterate, outcome

    def _continuation(self, problem: CondensedProblem) -> tuple[Iterate, Outcome] | None:
        """Solve by continuation in the conductivity of the foundation, if it conducts."""
        interface = problem.interface
        if interface.law.conductor is None:
            return None

        def solve(part: float, iterate: Iterate) -> tuple[Iterate, Outcome]:
            law = interface.law.conducting(part)
            less = problem.with_interface(replace(interface, law=law))
            iteration = (
                self.iteration if part == 1 else replace(self.iteration, problem=less, best=Best())
            )
            step = NewtonStep(iteration.problem, self.options, self._parameters, self.counters)
            return NewtonLoop(iteration, step, CONTINUATION_LIMIT).run(iterate, CONTINUATION)

        return continuation(solve, Iterate(problem.start()))

    def _separated(
        self, problem: CondensedProblem, outcome: Outcome
    ) -> tuple[Iterate, Outcome] | None:
        """Return a state with all nodes open that a rigid motion leads to, if any. Collective."""
        if outcome.converged or self._modes.constrained_by_supports:
            return None
        state = self._modes.separated(
            problem, self.whole.operator, self._parameters.nodal_stiffness
        )
        if state is None:
            return None
        # All forces are rounding then: they are relative to those at zero displacement.
        body = problem.equilibrium
        left, first = (
            body.norm(body.unbalanced(residual_forces(problem, at)))
            for at in (state, problem.start())
        )
        equilibrium = left / first if first > 0 else 0.0
        residuals = replace(evaluate(problem, state), equilibrium=equilibrium)
        self.history.record(residuals, RIGID_MOTION, inner=2)
        outcome = Outcome(residuals, self.options.allowed)
        self.iteration.see(Iterate(state), residuals)
        return (Iterate(state), outcome) if outcome.converged else None

    def last_steps(self, state: State) -> tuple[Iterate, Outcome]:
        """Take Newton's last steps from the state that a fallback has reached. Collective."""
        return NewtonLoop(self.iteration, self.whole).run(self.iterate_at(state), INTERIOR_POINT)


def _solve_condensed(
    problem: CondensedProblem,
    options: NewtonOptions,
    parameters: ComplementarityParameters,
    history: IterationHistory,
    iterate: Iterate,
    modes: UnconstrainedModes,
) -> tuple[Iterate, Outcome]:
    """Solve a condensed contact problem."""
    method = Newton(problem, options, parameters=parameters, modes=modes)
    method.history = history
    return method.run(iterate)
