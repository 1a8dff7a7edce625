"""The history of an evolution: one value with named parts, which a step begins with.

A part is arrays over places of one kind: the slip at contact nodes, internal variables of the
material at quadrature points. Who keeps, writes, reads or transfers a history goes by names and
places, and knows none of the parts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from contact.typing import Array

#: Kinds of places: the first axis of an array counts those that this rank owns.
CONTACT_NODES, QUADRATURE_POINTS = "contact nodes", "quadrature points"


class Part(Protocol):
    """One part of a history: a frozen value."""

    @property
    def place(self) -> str:
        """Where its arrays live."""

    @property
    def arrays(self) -> Mapping[str, Array]:
        """Its arrays by name, shape (places, ...)."""

    def replaced(self, arrays: Mapping[str, Array]) -> Part:
        """Return the same part with other arrays, of the same names and shapes behind."""


@dataclass(frozen=True)
class InternalVariables:
    """A part that is arrays and no more, not to be written to (they are marked so)."""

    place: str
    arrays: Mapping[str, Array]

    def __post_init__(self) -> None:
        """Keep whoever holds it from changing it."""
        for array in self.arrays.values():
            array.flags.writeable = False

    def replaced(self, arrays: Mapping[str, Array]) -> InternalVariables:
        """Return the same part with other arrays."""
        return InternalVariables(self.place, dict(arrays))


class History(dict[str, Part]):
    """The parts of a history by name; none for a step from the reference configuration."""

    def near(self, other: History, rtol: float = 0.0, atol: float = 0.0) -> bool:
        """Tell whether another history has the same parts and values on this rank."""
        ours, theirs = self.arrays(), other.arrays()
        return ours.keys() == theirs.keys() and all(
            np.allclose(array, theirs[name], rtol=rtol, atol=atol) for name, array in ours.items()
        )

    @property
    def places(self) -> list[str]:
        """The kinds of places that there are arrays at."""
        return sorted({part.place for part in self.values()})

    def arrays(self, place: str | None = None) -> dict[str, Array]:
        """Return the arrays at places of a kind, all by default, by "part.name"."""
        return {
            f"{name}.{key}": array
            for name, part in self.items()
            if place in (None, part.place)
            for key, array in part.arrays.items()
        }

    def replaced(self, arrays: Mapping[str, Array]) -> History:
        """Return the same parts with other arrays, named as by `arrays`."""
        return History(
            {
                name: part.replaced({key: arrays[f"{name}.{key}"] for key in part.arrays})
                for name, part in self.items()
            }
        )


class Evaluated(Protocol):
    """Where a body is evaluated: its unknowns, and the history that its step began with."""

    @property
    def x(self) -> Array:
        """Local unknowns."""

    @property
    def history(self) -> History:
        """The history at the beginning of the step."""


@dataclass(frozen=True)
class BodyState:
    """The state of a body by itself; see `Evaluated`."""

    x: Array
    history: History = field(default_factory=History)
