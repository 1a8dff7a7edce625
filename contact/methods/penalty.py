"""Algorithm 3: the penalty method, through PETSc's SNES.

The Signorini and Coulomb conditions are replaced by the laws of `contact.interface.penalised`,
so that the penalised problem (PV_eps) is one nonlinear equation in the displacement. An outer
iteration freezes the secant modulus of the material and the friction modulus of (4.33); what is
left of (4.32), the unilateral [u_nu - rho]^+ of the *new* iterate, is solved by SNES as a
semismooth equation, with a compliant layer where there is one. An outer count is that of
Algorithm 3; the inner one counts SNES's iterations.

Convergence. A penalty run solves the penalised problem: it has converged when the equilibrium
residual with the forces of the regularised laws at the final displacement is below the
tolerance (those laws then hold by construction). The residuals `contact` and `friction` of the
reported KKT are those of the Signorini-Coulomb laws themselves; they measure how far the
penalised solution is from the limit, and fall like eps. Where they are above `LAWS_HOLD`, what
has been solved says nothing of contact, and the run has not converged.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace

import numpy as np

from contact.body.norms import domain_norm
from contact.errors import SingularError
from contact.interface.penalised import (
    Implicit,
    Lagged,
    NodalLaw,
    Regularisation,
    penalised_forces,
)
from contact.linear.operator import Counters
from contact.methods.options import PenaltyOptions
from contact.methods.penalised import PenalisedProblem
from contact.methods.progress import Best, Stagnation
from contact.methods.report import History, Monitor, Outcome, Record
from contact.methods.resting import resting
from contact.problem.expected import expected_displacements
from contact.problem.kkt import KKT, evaluate
from contact.problem.mobility import held_by_friction
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.tolerances import LAWS_HOLD
from contact.typing import Array

#: What to do about an end without convergence.
HARDER = "the larger eps_contact and eps_slip, the easier the problem"

#: What is said where the linear system is singular, though the body was held at rest.
LOST = "the body has been moved to where nothing holds it"

#: Least part of the displacement that a step is taken to add to it.
LEAST_ADDED = 1e-2

#: Outer iterations in which the residual has to fall by 1 %.
PATIENCE, PROGRESS = 100, 0.99


def regularisation(problem: ContactProblem, options: PenaltyOptions) -> Regularisation:
    """Return the parameters of the penalised laws. Collective."""
    automatic = automatic_eps(problem)
    if options.eps_contact is None:
        contact, slip = automatic.contact, automatic.slip
    else:
        contact = slip = options.eps_contact
    return Regularisation(contact, slip if options.eps_slip is None else options.eps_slip)


def automatic_eps(problem: ContactProblem) -> Regularisation:
    """Return parameters that fit the body, its mesh and its loads, in any units. Collective.

    The foundation is a hundred times stiffer than a layer of elements, E/h. The slip length is a
    hundredth of the displacement that the loads, as a stress on Gamma_3, give a block of the
    body's size; in a step of an evolution, of what they add to it there.
    """
    body, scales = problem.equilibrium, problem.scales
    loads, prescribed = body.external(problem.time), problem.start().x
    displacement = max(expected_displacements(problem, loads, prescribed))
    if problem.since is not None:
        before = problem.start(problem.since).x
        added = loads - body.external(problem.since), prescribed - before
        displacement = max(*expected_displacements(problem, *added), LEAST_ADDED * displacement)
    slip = 1e-2 * displacement or 1e-6 * scales.size
    # Of what touches: slips of a stiff part are those of its own, whatever soft one holds it.
    young = problem.interface.stiffness * scales.size
    return Regularisation(1e-2 * scales.spacing / young, slip * min(1.0, scales.young / young))


@dataclass
class Penalty:
    """Algorithm 3, one outer iteration at a time.

    Parameters
    ----------
    problem
        The contact problem.
    options
        Options of the method.
    monitor
        Told of every outer iteration.

    Attributes
    ----------
    state
        What the last outer iteration has left.
    """

    problem: ContactProblem
    options: PenaltyOptions
    monitor: Monitor | None = None
    counters: Counters = field(default_factory=Counters)

    def __post_init__(self) -> None:
        """Start from rest with an empty history."""
        self.history = History(self.monitor)
        self.state = self.problem.start()
        self._eps = regularisation(self.problem, self.options)
        self._solvers: dict[bool, PenalisedProblem] = {}
        thesis = self.options.stopping == "thesis"
        self._norm = domain_norm(self.problem.equilibrium) if thesis else None

    def turn_to(self, problem: ContactProblem) -> None:
        """Go on with another step of the same problem; what is factorised remains."""
        self.problem, self.state = problem, problem.start()
        self.history = History(self.monitor)
        self._eps = regularisation(problem, self.options)
        for solver in self._solvers.values():
            solver.turn_to(problem, self._eps)

    def solve(self, start: State | None = None) -> tuple[State, Outcome]:
        """Iterate until convergence, stagnation or the limit. Collective.

        Parameters
        ----------
        start
            Where from; from rest by default. From the solution of a somewhat larger eps, small
            ones are reached that are too hard from there.
        """
        self.state = self.problem.start() if start is None else start
        implicit = start is not None and self.options.material_step != "secant"
        outcome = self._solve(implicit)
        return self.state, outcome

    def _solve(self, implicit: bool) -> Outcome:
        """Iterate; the first time with implicit laws or not."""
        begin, problem, options = time.perf_counter(), self.problem, self.options
        interface = problem.interface
        # The lagged friction modulus can creep: what counts is the last hundred iterations.
        stagnation = Stagnation(PATIENCE, PROGRESS)
        best: Best[tuple[State, KKT]] = Best()
        # The residual below which material and friction become implicit.
        switch = {"secant": 0.0, "auto": 1e-2, "tangent": np.inf}[options.material_step]
        bound: Array = np.zeros(interface.jump.gap.size)
        for iteration in range(1, options.max_outer + 1):
            previous = self.state
            x, inner, note = self._step(implicit)
            failed = implicit and bool(note)
            # Where Newton's method failed its step is given up, for Algorithm 3 to go on a while.
            x = previous.x if failed else x
            nodal = interface.jump.apply(x)
            forces = penalised_forces(interface, nodal, self._eps)
            self.state = replace(previous, x=x, forces=forces)
            residuals = evaluate(problem, self.state)
            old, bound = bound, interface.bound(nodal, self.state.forces)
            change = self._change(old, bound)
            note = note or ("implicit" if implicit else "")
            seconds = time.perf_counter() - begin
            self.history.add(Record(iteration, inner, residuals, change, seconds, note))
            residual = residuals.equilibrium
            best.see((self.state, residuals), residual)
            if note == LOST and not failed:
                ended = f"{LOST}; {HARDER}"
                break
            if not np.isfinite(residual):
                ended = "the iteration diverged"
                break
            if options.stopping == "thesis":
                if self._thesis_criterion(previous):
                    return self._outcome(residuals, "the thesis's criterion is met")
            elif residual <= options.tolerance:
                return self._outcome(residuals)
            stalled = stagnation(residual)
            switch = stagnation.best / 10 if failed else switch
            if stalled and options.stopping == "residual":
                ended = f"the residual stalled at {stagnation.best:.2e}; {HARDER}"
                break
            implicit = residual < switch
        else:
            ended = f"not converged in {options.max_outer} outer iterations; {HARDER}"
        if best.found is not None and options.stopping == "residual":
            if rest := resting(problem):
                best.found, ended = rest, ""
            self.state, residuals = best.found
        return self._outcome(residuals, ended)

    def _step(self, implicit: bool) -> tuple[Array, int, str]:
        """Solve (4.32), or the penalised problem itself, by SNES from the state."""
        interface = self.problem.interface
        nodal = interface.jump.apply(self.state.x)
        law: NodalLaw = Implicit(interface, self._eps) if implicit else self._lagged(nodal)
        symmetric = not (implicit and interface.friction.acts)
        if symmetric not in self._solvers:
            self._solvers[symmetric] = PenalisedProblem(
                self.problem, self.options, self._eps, self.counters, symmetric
            )
        solver = self._solvers[symmetric]
        try:
            return solver.solve(law, self.state, implicit, self.history.poll)
        except SingularError:
            taken = solver.snes.getIterationNumber()
            if taken == 0 and not self.history.records:
                raise
            del self._solvers[symmetric]  # MUMPS does not begin anew after that
            return self.state.x, taken, LOST

    def _lagged(self, nodal: Array) -> Lagged:
        """Return the laws with the friction of an iterate; of stuck nodes where that has none.

        At rest nothing presses, and there is no friction. What friction alone holds would fly away.
        """
        law = Lagged(self.problem.interface, self._eps, nodal)
        if self.problem.frictional and not law.acts() and held_by_friction(self.problem):
            law.stick()
        return law

    def _change(self, old: Array, new: Array) -> float:
        """Return the relative change (3.46) of the friction bound."""
        interface = self.problem.interface
        if not interface.friction.acts:
            return np.nan
        size = interface.jump.norm(new)
        return interface.jump.norm(new - old) / size if size > 0 else 0.0

    def _thesis_criterion(self, previous: State) -> bool:
        """Tell whether (4.38) is met."""
        assert self._norm is not None
        own = self.problem.equilibrium.owned_part
        now, before = own(self.state.x), own(previous.x)
        return self._norm(now - before) < self.options.eps_fp * self._norm(now)

    def _outcome(self, residuals: KKT, words: str = "") -> Outcome:
        options, limit = self.options, max(residuals.contact, residuals.friction)
        words = words or f"the residual of the penalised problem is <= {options.tolerance:g}"
        if residuals.equilibrium <= options.tolerance:
            words += f"; the contact laws hold to {limit:.1e}"
        if limit > LAWS_HOLD:
            words += "; a smaller eps_contact or eps_slip brings them nearer"
        return Outcome(residuals, options.allowed, words)
