"""How loads and prescribed values change with time: amplitudes, and fields that know the time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias, runtime_checkable

import numpy as np

from contact.kinds import expect
from contact.typing import Array

#: A factor as a function of time.
Amplitude: TypeAlias = Callable[[float], float]


def ramp(time: float) -> float:
    """Return the time itself: what is given grows with it, and is all there at time 1.

    A static problem is one step from rest at time 0 to time 1.
    """
    return time


def steady(time: float) -> float:
    """Return 1: what is given always acts."""
    return 1.0


@dataclass(frozen=True)
class Tabulated:
    """Values at some times, linear between them, and constant before and after.

    Attributes
    ----------
    times
        Increasing.
    values
        As many.
    """

    times: tuple[float, ...]
    values: tuple[float, ...]

    def __call__(self, time: float) -> float:
        """Return the value at a time."""
        return float(np.interp(time, self.times, self.values))


@runtime_checkable
class Moving(Protocol):
    """A given function of position and time."""

    def at(self, time: Any) -> Any:
        """Return the function of position at a time: a number, or a constant of a form."""


def at_time(field: Any, time: Any) -> Any:
    """Return a given function of position at a time, whether it depends on that or not."""
    return field.at(time) if isinstance(field, Moving) else field


def check_amplitude(what: str, given: Any) -> None:
    """Refuse what is no function of time."""
    fits = given is None or callable(given)
    expect(f"{what}: amplitude", given, "a function of time, such as lambda t: 2 * t", fits)


def amplitude_of(given: Amplitude | None, fields: list[Any]) -> Amplitude:
    """Return the amplitude that goes with fields, where none may be given.

    It is `ramp` by default; of fields that know the time themselves `steady`.
    """
    if given is not None:
        return given
    return steady if any(isinstance(field, Moving) for field in fields) else ramp


def values_at(field: Any, points: Array, time: float) -> Array:
    """Return the values of a field at points of shape (n, d) and a time, shape (n,)."""
    return np.asarray(at_time(field, time).numpy(points))
