"""How a loop of steps is controlled by its residuals; all ranks decide alike.

`Stagnation` ends it, and `Best` keeps the iterate with the least residual. `Chord` decides whether
a step is a modified Newton step with a frozen factorisation: a Newton step costs a factorisation, a
chord step a few substitutions, and chord steps converge linearly, but fast where little of the body
is in the plastic range. `ConductivityDerivative` decides whether a step includes the derivative of
the conductivity by the gap.

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

#: Ratio to the least residual so far below which a residual counts as progress.
PROGRESS = 0.5

T = TypeVar("T")


@dataclass
class Best(Generic[T]):
    """The iterate with the least residual, which a method returns where it fails.

    Attributes
    ----------
    found
        The iterate; None before there was one that has a residual.
    """

    found: T | None = None
    _least: float = np.inf

    def see(self, iterate: T, residual: float) -> None:
        """Keep an iterate if its residual is the least; NaN is no residual."""
        if residual < self._least:
            self.found, self._least = iterate, residual


@dataclass
class Stagnation:
    """Counts the steps since the last progress; all ranks count alike.

    Attributes
    ----------
    limit
        Steps without progress after which the iteration is given up.
    progress
        Ratio to the reference below which a measure is progress.
    cumulative
        Whether the decrease over several steps counts: the reference is then the least measure at
        the last progress, else the least of all steps before. With a ratio of 1/2, steps that
        reduce the measure by a fifth each would be given up else.
    best
        The least measure so far.
    """

    limit: int
    progress: float
    cumulative: bool = False
    best: float = np.inf
    _since: int = 0
    _reference: float = np.inf

    def __call__(self, measure: float, limit: int | None = None) -> bool:
        """Count a step by its measure; tell whether the limit is reached.

        Parameters
        ----------
        measure
            The residual, or another number that is to vanish.
        limit
            Limit for this step in place of the attribute.
        """
        gained = measure < self.progress * self._reference
        self._since = 0 if gained else self._since + 1
        self.best = min(self.best, measure)
        if gained or not self.cumulative:
            self._reference = self.best
        return self._since >= (self.limit if limit is None else limit)


def undeformed_equilibrium(problem: Problem, tolerance: float) -> tuple[State, Residuals] | None:
    """Return zero displacement and its residuals, where it is in equilibrium. Collective.

    Residuals are relative to the forces that act. Where all of these vanish in the limit, as at
    zero displacement without loads, a method that approaches it never has a small residual, and
    does not end. Asked only where a method has failed: with friction there may be other solutions.
    """
    state = problem.start()
    residuals = evaluate(problem, state)
    return (state, residuals) if residuals.significant <= tolerance else None


#: Chord steps that cost as much as a new factorisation: more are not taken with the old one.
MOST_STEPS = 10.0

#: Residual above which no factorisation is frozen: the tangent is not good there.
RADIUS = 0.05


class Chord:
    """Decides by the residuals whether the next step is a chord step, which needs no factorisation.

    Parameters
    ----------
    goal
        The residual that is to be reached.
    most_steps
        Most chord steps to the goal for which the factorisation is kept; 0: it never is.
    """

    def __init__(self, goal: float, most_steps: float) -> None:
        self._goal, self._most_steps = goal, most_steps
        self.drop()
        self.begin()

    def drop(self) -> None:
        """Drop the factorisation: the next step makes a new one."""
        self._factorised = self._keeps = False

    def begin(self) -> None:
        """Begin another loop, with other loads or another initial guess."""
        self._before: State | None = None
        self._reached = np.inf

    def choose(
        self, state: State, reached: float, linearised_at: Array | None = None
    ) -> tuple[State, bool]:
        """Return the state to go on from, and whether the factorisation is kept.

        Parameters
        ----------
        state
            The last iterate.
        reached
            The largest residual there.
        linearised_at
            Unknowns at which the material is to be linearised; None for those of the state.
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
        """Take note that a step has made, or kept, a factorisation."""
        self._factorised = True


@dataclass
class ConductivityDerivative:
    """Decides by the residuals whether a step includes the derivative of the conductivity.

    With it, the charge psi(u_nu - rho) phi_L(phi - phi_F) is linearised consistently, and Newton's
    method converges fast even where the ramp psi is steep. But a node that opens draws less charge,
    and may thus open further. The linearised charge then leads back to contact, where the node is
    under tension: the active set cycles. Without the derivative (psi frozen, Picard) the node opens
    to the other end of the ramp.

    Attributes
    ----------
    near
        Largest residual at which the derivative may be included at all.
    included
        Whether the last step has included it.
    """

    near: float = np.inf
    included: bool = False
    _limit: float = np.inf

    def worsened(self, residual: float) -> bool:
        """Tell whether the last step included the derivative and has raised the residual.

        If so, it is included again only below a tenth of the residual before that step.

        Parameters
        ----------
        residual
            The largest residual after that step.
        """
        if not self.included or residual <= self._limit:
            return False
        # The next step, with psi frozen, may only undo this one: ask for a smaller residual.
        self._limit *= 0.1
        self.included = False
        return True

    def __call__(self, residual: float, allowed: bool = True) -> bool:
        """Tell whether the next step is to include the derivative.

        Parameters
        ----------
        residual
            The largest residual before that step.
        allowed
            Whether the solver would include it.
        """
        self.worsened(residual)
        self.included = allowed and residual <= min(self.near, self._limit)
        if self.included:
            self._limit = residual
        return self.included
