"""Control of an iteration by its residuals, alike on all ranks.

`Stagnation` is the stagnation limit, `Best` the iterate of least residual. `Chord` chooses between
Newton and chord steps: a chord step keeps the factorisation and costs a few substitutions, but
converges linearly; fast while little of the body is in the plastic range. `ConductivityDerivative`
chooses between Newton's method and Picard's in the conductivity.

References
----------
Kelley, Iterative Methods for Linear and Nonlinear Equations, SIAM (1995), section 5.4: chord steps.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from contact.problem.protocols import Problem
from contact.problem.residuals import Residuals, evaluate
from contact.problem.state import State
from contact.typing import Array

#: Ratio to the least residual so far that is progress.
PROGRESS = 0.5

T = TypeVar("T")


@dataclass
class Best(Generic[T]):
    """Iterate of least residual, `found`: the end of a method that fails."""

    found: T | None = None
    _least: float = np.inf

    def see(self, iterate: T, residual: float) -> None:
        """Keep an iterate if its residual is the least, and not NaN."""
        if residual < self._least:
            self.found, self._least = iterate, residual


@dataclass
class Stagnation:
    """Stagnation limit: number of steps without progress.

    Attributes
    ----------
    limit
        Steps without progress at which the iteration is given up.
    progress
        Ratio to the reference residual that is progress.
    cumulative
        Whether the reference is the least residual at the last progress, so that a slow decrease
        over several steps counts; else the least residual of all steps before.
    best
        Least residual so far.
    """

    limit: int
    progress: float
    cumulative: bool = False
    best: float = np.inf
    _since: int = 0
    _reference: float = np.inf

    def __call__(self, residual: float, limit: int | None = None) -> bool:
        """Count a step by its residual; True at the limit, that of this step if given."""
        gained = residual < self.progress * self._reference
        self._since = 0 if gained else self._since + 1
        self.best = min(self.best, residual)
        if gained or not self.cumulative:
            self._reference = self.best
        return self._since >= (self.limit if limit is None else limit)


def undeformed_equilibrium(problem: Problem, tolerance: float) -> tuple[State, Residuals] | None:
    """Return zero displacement and its residuals if it is in equilibrium, else None. Collective.

    Residuals are relative to the forces that act: approaching a state without forces, none becomes
    small. With friction there may be other solutions, so a method asks for this where it fails.
    """
    state = problem.start()
    residuals = evaluate(problem, state)
    return (state, residuals) if residuals.significant <= tolerance else None


#: Cost of a factorisation, in chord steps.
MOST_STEPS = 10.0

#: Residual above which there are no chord steps.
RADIUS = 0.05


class Chord:
    """Choice between a Newton step and a chord step, by the rate of convergence.

    Parameters
    ----------
    goal
        Tolerance on the residual.
    most_steps
        Most chord steps to the goal; 0 for none at all.
    """

    def __init__(self, goal: float, most_steps: float) -> None:
        self._goal, self._most_steps = goal, most_steps
        self.drop()
        self.begin()

    def drop(self) -> None:
        """Take a Newton step next."""
        self._factorised = self._keeps = False

    def begin(self) -> None:
        """Begin an iteration with other loads or another initial guess."""
        self._before: State | None = None
        self._reached = np.inf

    def choose(
        self, state: State, reached: float, linearised_at: Array | None = None
    ) -> tuple[State, bool]:
        """Return the iterate to step from, and whether the step is a chord step.

        Parameters
        ----------
        state, reached
            Last iterate and its residual. Where a chord step has raised it, the one before is
            taken.
        linearised_at
            Unknowns of the secant; None for those of the state.
        """
        before, last = self._before, self._reached
        if not self._factorised or self._most_steps <= 0:
            keep = False
        elif before is None:
            keep = state.active_set is not None and linearised_at is None
        elif reached >= last and self._keeps:
            state, reached, keep = before, last, False
        else:
            rate = reached / last
            left = np.log(self._goal / reached) / np.log(rate) if rate < 1 else np.inf
            keep = bool(left <= self._most_steps and reached <= RADIUS)
        self._before, self._reached, self._keeps = state, reached, keep
        return state, keep

    def note_factorisation(self) -> None:
        """Note that there is a factorisation."""
        self._factorised = True


@dataclass
class ConductivityDerivative:
    """Choice between psi'(u_nu - rho) in the tangent (Newton) and psi frozen (Picard).

    With it, the charge psi(u_nu - rho) phi_L(phi - phi_F) is linearised consistently, and steep
    ramps psi converge fast. But a node that opens draws less charge, and may open further: the
    linearised charge leads back to contact, the node is then under tension, and the active set
    cycles. With psi frozen it opens to the other end of the ramp.

    Attributes
    ----------
    near
        Largest residual with the derivative.
    included
        Whether the last step had it.
    """

    near: float = np.inf
    included: bool = False
    _limit: float = np.inf

    def worsened(self, residual: float) -> bool:
        """Tell whether a step with the derivative has raised the residual: it is to be rejected.

        The derivative is taken again below a tenth of the residual before that step.
        """
        if not self.included or residual <= self._limit:
            return False
        # A step with psi frozen may only undo this one.
        self._limit *= 0.1
        self.included = False
        return True

    def __call__(self, residual: float, allowed: bool = True) -> bool:
        """Tell whether the next step is to have the derivative, by the residual before it."""
        self.worsened(residual)
        self.included = allowed and residual <= min(self.near, self._limit)
        if self.included:
            self._limit = residual
        return self.included
