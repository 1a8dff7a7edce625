"""The one rule by which a loop that gets no further is given up."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass
class Stagnation:
    """Counts the steps since the last progress; all ranks count alike.

    Attributes
    ----------
    patience
        Steps without progress after which the loop is given up.
    progress
        What counts as progress: a measure below this part of the best one.
    together
        Whether steps make progress together too: what counts is the best one at the last
        progress, not that of the step before. Where steps are to halve the measure, ones that
        take a fifth of it each would be given up else.
    best
        The least measure so far.
    """

    patience: int
    progress: float
    together: bool = False
    best: float = np.inf
    _since: int = 0
    _reference: float = np.inf

    def __call__(self, measure: float, patience: int | None = None) -> bool:
        """Take note of a step's measure; tell whether to give up.

        Parameters
        ----------
        measure
            What is to become small.
        patience
            In place of that of all steps.
        """
        gained = measure < self.progress * self._reference
        self._since = 0 if gained else self._since + 1
        self.best = min(self.best, measure)
        if gained or not self.together:
            self._reference = self.best
        return self._since >= (self.patience if patience is None else patience)
