"""The protocol `Method` of all methods, and the methods by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

from contact.linear.operator import Counters
from contact.methods.newton import Newton
from contact.methods.report import Monitor, Outcome, Record
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.thesis.fixed_point import FixedPoint
from contact.thesis.penalty import Penalty
from contact.typing import Array


class Method(Protocol):
    """A solver of one problem, from an initial guess to a state and its `Outcome`.

    A new one is a class made of a problem, its options and a monitor, with an entry in `METHODS`;
    and its options, with an entry in `contact.methods.options.OPTIONS`. One that uses others makes
    their options by `with_method`, and has their records in its history.
    """

    @property
    def options(self) -> Any:
        """Its options; `allowed` is the tolerance of each residual."""

    @property
    def history(self) -> list[Record]:
        """Records of the outer iterations."""

    @property
    def counters(self) -> Counters:
        """Factorisations and solves."""

    @property
    def state(self) -> State:
        """The last iterate: the end of a solve after a signal."""

    def set_load_step(self, problem: ContactProblem) -> None:
        """Take another load step of the same problem; factorisations remain, records start anew."""

    def solve(
        self, start: State | None = None, linearised_at: Array | None = None
    ) -> tuple[State, Outcome]:
        """Iterate until convergence or a limit. Collective.

        Parameters
        ----------
        start
            Initial guess; zero by default.
        linearised_at
            Unknowns of the first secant of the material; those of the start by default. Prescribed
            values that have changed strain the elements beside them alone.

        Raises
        ------
        InputError
            If the linear system is singular.
        """


#: Name of a method -> its class.
METHODS: Mapping[str, Callable[[ContactProblem, Any, Monitor | None], Method]] = {
    "uzawa": FixedPoint,
    "penalty": Penalty,
    "newton": Newton,
}
