"""What tables and figures need of a solution."""

from __future__ import annotations

from typing import Protocol

from contact.interface.jump import Multipliers
from contact.output.options import OutputOptions
from contact.output.record import StepRecord
from contact.output.units import Units
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.typing import Array


class Solved(Protocol):
    """A solved problem; its quantities are those of `contact.output.solution.Solution`."""

    @property
    def title(self) -> str:
        """Title of the case."""

    @property
    def units(self) -> Units:
        """Names of its units."""

    @property
    def output(self) -> OutputOptions:
        """What is written of it."""

    @property
    def steps(self) -> list[StepRecord]:
        """The steps of an evolution."""

    @property
    def problem(self) -> ContactProblem:
        """The problem."""

    @property
    def state(self) -> State:
        """Where it is."""

    @property
    def nodal(self) -> Array:
        """Unknowns at the contact nodes."""

    @property
    def forces(self) -> Multipliers:
        """Multipliers."""

    @property
    def pressure(self) -> Array:
        """Contact pressure."""

    @property
    def friction(self) -> Array:
        """Friction stress."""

    @property
    def friction_bound(self) -> Array:
        """Its bound."""

    @property
    def normal_displacement(self) -> Array:
        """u_nu."""

    @property
    def slip(self) -> Array:
        """u_tau."""

    @property
    def status(self) -> Array:
        """What each node does."""
