"""What every method is."""

from __future__ import annotations

from typing import Any, Protocol

from contact.linear.operator import Counters
from contact.methods.report import History, Outcome
from contact.problem.state import State


class Method(Protocol):
    """A solver of one problem: from a state to another one, and how that went.

    A new one is a class with these, its options in `contact.methods.options`, and an entry in
    `contact.solving.METHODS`.

    Attributes
    ----------
    options
        What it was told; `allowed` among it, how large each residual may be at the end.
    history
        The outer iterations.
    counters
        Factorisations and solves.
    """

    options: Any
    history: History
    counters: Counters

    @property
    def state(self) -> State:
        """What the last outer iteration has left, for a solve that is ended by a signal."""

    def solve(self, start: State | None = None) -> tuple[State, Outcome]:
        """Iterate until convergence or a limit; from rest by default. Collective.

        Raises
        ------
        InputError
            If the linear system is singular.
        """
