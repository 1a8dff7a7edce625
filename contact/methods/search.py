"""What one search for a solution has met, by whatever roads."""

from __future__ import annotations

from dataclasses import dataclass, field

from contact.methods.best import Best
from contact.methods.options import NewtonOptions
from contact.methods.report import History
from contact.methods.step import Iterate
from contact.problem.kkt import KKT
from contact.problem.protocols import Problem


@dataclass
class Search:
    """Where the roads are, which iterate meets the whole load best, and how many steps are left.

    Attributes
    ----------
    problem, options
        What is solved, and the tolerances and limits.
    history
        Gets a record a step.
    at
        What the last step has left.
    best
        The iterate with the least residual.
    """

    problem: Problem
    options: NewtonOptions
    history: History
    at: Iterate
    best: Best[Iterate] = field(default_factory=Best)

    @property
    def left(self) -> int:
        """Number of steps that are left of the limit."""
        return self.options.max_outer - len(self.history.records)

    def see(self, iterate: Iterate, residuals: KKT) -> None:
        """Remember an iterate. One at a part of the load is nowhere the best."""
        self.at = iterate
        if iterate.state.time == self.problem.time:
            self.best.see(iterate, residuals.largest)
