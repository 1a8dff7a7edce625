"""Chord steps: modified Newton steps with a frozen factorisation, and when they pay.

A Newton step costs a factorisation, a chord step a few substitutions. Chord steps converge
linearly, but fast where little of the body is in the plastic range. They are steps on the condensed
body (`condensed_step`): the Schur complement is frozen, and contact is solved on it in each step.

References
----------
Kelley, Iterative Methods for Linear and Nonlinear Equations, SIAM (1995), section 5.4.
"""

from __future__ import annotations

import numpy as np

from contact.methods.newton_step import Iterate

#: Chord steps that cost as much as a new factorisation: more are not taken with the old one.
MOST_STEPS = 10.0

#: Residual above which no factorisation is frozen: the tangent is not good there.
RADIUS = 0.05


class Chord:
    """Decides by the residuals whether the next step is a chord step, which needs no factorisation.

    All ranks decide alike.

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
        self._before: Iterate | None = None
        self._reached = np.inf

    def choose(self, iterate: Iterate, reached: float) -> tuple[Iterate, bool]:
        """Return the iterate to go on from, and whether the factorisation is kept.

        Parameters
        ----------
        iterate
            The last iterate.
        reached
            The largest residual there.
        """
        before, last = self._before, self._reached
        if not self._factorised or self._most_steps <= 0:
            keep = False
        elif before is None:
            keep = iterate.active_set is not None and iterate.linearised_at is None
        elif reached >= last and self._keeps:
            iterate, reached, keep = before, last, False
        else:
            rate = reached / last
            left = np.log(self._goal / reached) / np.log(rate) if rate < 1 else np.inf
            keep = bool(left <= self._most_steps and reached <= RADIUS)
        self._before, self._reached, self._keeps = iterate, reached, keep
        return iterate, keep

    def note_factorisation(self) -> None:
        """Take note that a step has made, or kept, a factorisation."""
        self._factorised = True
