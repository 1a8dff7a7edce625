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
    best
        The least measure so far.
    """

    patience: int
    progress: float
    best: float = np.inf
    _since: int = 0

    def __call__(self, measure: float, patience: int | None = None) -> bool:
        """Take note of a step's measure; tell whether to give up.

        Parameters
        ----------
        measure
            What is to become small.
        patience
            In place of that of all steps.
        """
        self._since = 0 if measure < self.progress * self.best else self._since + 1
        self.best = min(self.best, measure)
        return self._since >= (self.patience if patience is None else patience)
