"""The progress of an iteration: its best iterate, and the limit of its stagnation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from contact.problem.protocols import Problem
from contact.problem.residuals import Residuals, evaluate
from contact.problem.state import State

#: Part of the least residual below which a step is progress.
PROGRESS = 0.5

T = TypeVar("T")


@dataclass
class Best(Generic[T]):
    """The iterate with the least residual, which a method leaves where it fails.

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
        A measure below this part of the best one is progress.
    together
        Whether steps make progress together too: the reference is the best measure at the last
        progress, not that of the step before. Where steps are to halve the measure, ones that
        take a fifth of it each would be given up else.
    best
        The least measure so far.
    """

    limit: int
    progress: float
    together: bool = False
    best: float = np.inf
    _since: int = 0
    _reference: float = np.inf

    def __call__(self, measure: float, limit: int | None = None) -> bool:
        """Take note of a step's measure; tell whether to give up.

        Parameters
        ----------
        measure
            The residual, or another number that is to vanish.
        limit
            In place of that of all steps.
        """
        gained = measure < self.progress * self._reference
        self._since = 0 if gained else self._since + 1
        self.best = min(self.best, measure)
        if gained or not self.together:
            self._reference = self.best
        return self._since >= (self.limit if limit is None else limit)


def undeformed_equilibrium(problem: Problem, tolerance: float) -> tuple[State, Residuals] | None:
    """Return zero displacement and its residuals, where it is in equilibrium. Collective.

    Beside forces that vanish no residual is small, and only those that are 0 have none: a method
    that comes nearer and nearer to them never ends. Asked where a method has failed: a body that
    friction has locked in may be in equilibrium elsewhere.
    """
    state = problem.start()
    residuals = evaluate(problem, state)
    return (state, residuals) if residuals.significant <= tolerance else None
