"""Chord steps: modified Newton steps with a frozen factorisation, and when they pay.

A Newton step costs a factorisation, a chord step a few substitutions. Chord steps converge
linearly, but fast where little of the body is in the plastic range: Anderson's acceleration makes
them GMRES for the tangent, with the frozen factorisation as the preconditioner, once the active
sets are unchanged. Contact itself is solved exactly in each step.

References
----------
Kelley, Iterative Methods for Linear and Nonlinear Equations, SIAM (1995), section 5.4.
Walker and Ni, Anderson acceleration for fixed-point iterations, SIAM J. Numer. Anal. 49 (2011).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from contact.interface.multipliers import Multipliers
from contact.methods.newton_step import Iterate
from contact.problem.state import State
from contact.typing import Array

#: Chord steps that cost as much as a new factorisation: more are not taken with the old one.
MOST_STEPS = 10.0

#: Residual above which no factorisation is frozen: the tangent is not good there.
RADIUS = 0.05

#: Number of earlier steps that the acceleration uses.
DEPTH = 8

#: Global inner products: maps two matrices (m, k) and (m, l) of local values to the (k, l)
#: matrix of sums over all ranks.
Inner: TypeAlias = Callable[[Array, Array], Array]


class Chord:
    """Decides by the residuals whether a factorisation is kept, and accelerates chord steps.

    All ranks decide alike.

    Parameters
    ----------
    goal
        The residual that is to be reached.
    inner
        Inner products of the owned parts of local unknowns.
    worth
        Steps that a new factorisation is worth; 0: it is never kept.
    """

    def __init__(self, goal: float, inner: Inner, worth: float) -> None:
        self._goal, self._inner, self._worth = goal, inner, worth
        self._changes: deque[tuple[Array, Array]] = deque(maxlen=DEPTH)
        self.forget()
        self.begin()

    def forget(self) -> None:
        """Let the next step make a new factorisation."""
        self._made = self._keeps = False

    def begin(self) -> None:
        """Begin another loop, with other loads or another initial guess."""
        self._before: Iterate | None = None
        self._reached = np.inf
        self._last: tuple[Array, Array] | None = None
        self._changes.clear()

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
        if not self._made or self._worth <= 0:
            keep = False
        elif before is None:
            keep = iterate.active_set is not None and iterate.linearised_at is None
        elif reached >= last and self._keeps:
            iterate, reached, keep = before, last, False
        else:
            rate = reached / last
            left = np.log(self._goal / reached) / np.log(rate) if rate < 1 else np.inf
            keep = bool(left <= self._worth and reached <= RADIUS)
        if not keep:
            self._changes.clear()
            self._last = None
        self._before, self._reached, self._keeps = iterate, reached, keep
        return iterate, keep

    def accelerated(self, state: State, new: State) -> State:
        """Return the end of a chord step after Anderson's acceleration. Collective.

        Parameters
        ----------
        state, new
            Beginning and end of the step.
        """
        end, move = _values(new), new.x - state.x
        if self._last is not None:
            self._changes.append((end - self._last[0], move - self._last[1]))
        self._last, self._made = (end, move), True
        if not self._changes:
            return new
        # Columns one after the other in memory, as the products take them.
        towards, changes = (np.stack(part).T for part in zip(*self._changes, strict=True))
        gram, load = self._inner(changes, changes), self._inner(changes, move[:, None])[:, 0]
        lengths = np.sqrt(np.diag(gram))
        lengths = np.where(lengths > 0, lengths, 1.0)
        gram, load = gram / np.outer(lengths, lengths), load / lengths
        return _with(new, end - towards @ (least_squares(gram, load) / lengths))


def _values(state: State) -> Array:
    """Return unknowns and contact forces as one vector."""
    return np.concatenate([state.x, state.forces.pressure, state.forces.friction.ravel()])


def _with(state: State, values: Array) -> State:
    """Return a state with other unknowns and contact forces."""
    n, count = state.x.size, state.forces.pressure.size
    x, pressure, friction = np.split(values, [n, n + count])
    friction = friction.reshape(state.forces.friction.shape)
    return replace(state, x=x, forces=Multipliers(pressure, friction))


def least_squares(gram: Array, load: Array) -> Array:
    """Solve the normal equations of directions of length 1.

    Combinations that change the residual less than a millionth of their length are left out:
    they act by rounding, as where a body moves that touches nothing.
    """
    values, vectors = np.linalg.eigh(gram)
    kept = values > 1e-12
    return vectors[:, kept] @ ((vectors[:, kept].T @ load) / values[kept])
