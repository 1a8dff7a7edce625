"""Stagnation limit of an iteration, its best iterate, and equilibrium at zero displacement."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from contact.problem.protocols import Problem
from contact.problem.residuals import Residuals, evaluate
from contact.problem.state import State

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
