"""The history at the beginning of a load step: a value with named parts.

A part has arrays at contact nodes (slip) or at quadrature points (internal variables). Checkpoints
use the names and places alone.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

from contact.typing import Array

#: Places of a part: the first axis of its arrays, those that this rank owns.
CONTACT_NODES, QUADRATURE_POINTS = "contact nodes", "quadrature points"


class Part(Protocol):
    """One part of a history: a frozen value."""

    @property
    def place(self) -> str:
        """`CONTACT_NODES` or `QUADRATURE_POINTS`."""

    @property
    def arrays(self) -> Mapping[str, Array]:
        """Its arrays by name, shape (places, ...)."""

    def replaced(self, arrays: Mapping[str, Array]) -> Part:
        """Return the part with other arrays of the same names."""


@dataclass(frozen=True)
class InternalVariables:
    """Internal variables of a material; the arrays are read-only."""

    place: str
    arrays: Mapping[str, Array]

    def __post_init__(self) -> None:
        """Mark the arrays as read-only."""
        for array in self.arrays.values():
            array.flags.writeable = False

    def replaced(self, arrays: Mapping[str, Array]) -> InternalVariables:
        """Return the part with other arrays of the same names."""
        return InternalVariables(self.place, dict(arrays))


class History(dict[str, Part]):
    """The parts of a history by name; none for a step from the reference configuration."""

    @property
    def places(self) -> list[str]:
        """The places of its arrays."""
        return sorted({part.place for part in self.values()})

    def arrays(self, place: str | None = None) -> dict[str, Array]:
        """Return the arrays at a place, or all, by "part.name"."""
        return {
            f"{name}.{key}": array
            for name, part in self.items()
            if place in (None, part.place)
            for key, array in part.arrays.items()
        }

    def replaced(self, arrays: Mapping[str, Array]) -> History:
        """Return the history with other arrays, named as by `arrays`."""
        return History(
            {
                name: part.replaced({key: arrays[f"{name}.{key}"] for key in part.arrays})
                for name, part in self.items()
            }
        )


class LinearisationPoint(Protocol):
    """Unknowns x and history at the beginning of the step, for forces and tangents of a body."""

    @property
    def x(self) -> Array:
        """Local unknowns."""

    @property
    def history(self) -> History:
        """The history at the beginning of the step."""

    @property
    def secant_at(self) -> Array | None:
        """Local unknowns of the secant modulus; None for x."""


@dataclass(frozen=True)
class BodyState:
    """Unknowns and history of a body without contact forces; see `LinearisationPoint`."""

    x: Array
    history: History = field(default_factory=History)
    secant_at: Array | None = None
