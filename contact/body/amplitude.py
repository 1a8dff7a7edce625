"""How loads and prescribed values change with time: amplitudes, and fields that know the time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol, TypeAlias, runtime_checkable

from mpi4py import MPI

from contact.calling import OfTime, check_finite, naming, on_all_ranks, real
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


@runtime_checkable
class Moving(Protocol):
    """A given function of position and time."""

    def at(self, time: Any) -> Any:
        """Return the function of position at a time: a number, or a constant of a form."""


def at_time(field: Any, time: Any) -> Any:
    """Return a given function of position at a time, whether it depends on that or not."""
    return field.at(time) if isinstance(field, Moving) else field


def own_amplitude(what: str, given: Any) -> Amplitude | None:
    """Return a given function of time so that it says whose amplitude it is where it fails."""
    fits = given is None or callable(given)
    expect(f"{what}: amplitude", given, "a function of time, such as lambda t: 2 * t", fits)
    return given if given in (None, steady) else OfTime(given, f"{what}: amplitude")


def amplitude_of(given: Amplitude | None, fields: list[Any]) -> Amplitude:
    """Return the amplitude that goes with fields, where none may be given.

    It is `ramp` by default; of fields that know the time themselves `steady`.
    """
    if given is not None:
        return given
    return steady if any(isinstance(field, Moving) for field in fields) else ramp


def values_at(field: Any, points: Array, time: float, what: str, comm: MPI.Intracomm) -> Array:
    """Return the values of a field at points of shape (n, d) and a time, shape (n,). Collective.

    Raises
    ------
    InputError
        On all ranks, with the name of the field, if they are no finite numbers on one.
    """
    with on_all_ranks(comm), naming(what):
        values = at_time(field, time).numpy(points)
        found = real(values, points.shape[:1], "one number for each of the points")
        check_finite(found, lambda i: f"at ({', '.join(f'{x:g}' for x in points[i] + 0.0)})")
    return found
