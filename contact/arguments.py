"""Checks of arguments in Python: kinds of objects, ranges, names, values of a user's functions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from contact.errors import InputError
from contact.tolerances import HUGE
from contact.typing import Array

T = TypeVar("T")

#: Elastic constants that a law has; sizes and starts are taken from them.
CONSTANTS = ("young", "poisson", "bulk", "shear")

#: Most letters of a given value that a message repeats.
LONGEST = 80


def expect(name: str, given: Any, accepted: str, fits: object) -> None:
    """Raise an InputError that shows a value and the accepted ones in words, unless it fits."""
    if not fits:
        raise InputError(f"{name}: given {shorten(repr(given))}; accepted: {accepted}")


def check_range(key: str, value: float, least: float = 1 / HUGE) -> None:
    """Refuse a size whose square is no number any more, or nothing."""
    if not least <= value <= HUGE:
        raise InputError(
            f"{key}: a size of {value:.3g} leads to numbers that overflow; accepted: units that "
            f"keep sizes between {1 / HUGE:g} and {HUGE:g}"
        )


def shorten(text: str) -> str:
    """Return a text in one line, as far as messages repeat it."""
    line = " ".join(text.split())
    return line if len(line) <= LONGEST else f"{line[:LONGEST]}..."


def several(name: str, given: Any, kind: type[T], accepted: str) -> tuple[T, ...]:
    """Return one object of a kind, or several, as a tuple; anything else is an InputError."""
    every = tuple(given) if isinstance(given, list | tuple) else (given,)
    for one in every:
        expect(name, one, accepted, isinstance(one, kind))
    return every


def is_law(given: Any) -> bool:
    """Tell whether an object has the constants of a law of the stress."""
    try:
        return all(np.isfinite(float(getattr(given, name))) for name in CONSTANTS)
    except ZeroDivisionError:  # a law with constants that are none: `Body.check` names them
        return True
    except (AttributeError, TypeError, ValueError):
        return False


class _Returned(ValueError):
    """A function has returned a value that is not accepted."""


def real(values: Any, shape: tuple[int, ...], each: str) -> Array:
    """Return the value of a function as numbers, inside `naming`.

    Parameters
    ----------
    values
        The value; a number stands for itself everywhere.
    shape
        The shape to broadcast it to.
    each
        The accepted values in words: "one number ...".
    """
    if type(values) is np.ndarray and values.dtype == float and values.shape == shape:
        return values.copy()
    try:
        array = np.asarray(values)
    except ValueError:  # lists of different lengths
        array = np.asarray(None)
    if array.dtype.kind not in "biuf":
        raise _Returned(f"the function returns {shorten(repr(values))}; accepted: {each}")
    try:
        array = np.broadcast_to(array, shape)
    except ValueError:
        raise _Returned(
            f"the function returns values of shape {array.shape}; accepted: {each}"
        ) from None
    return array.astype(float)


def check_finite(values: Array, where: Callable[[int], str]) -> None:
    """Refuse infinity and NaN, shape (n,), inside `naming`; ``where(i)`` names the i-th place."""
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size > 0:
        raise _Returned(
            f"not finite {where(bad[0])}; accepted: a finite number, formula or function"
        )


@contextmanager
def naming(name: str) -> Iterator[None]:
    """Let errors in a user's function name the argument."""
    try:
        yield
    except InputError:
        raise
    except _Returned as error:
        raise InputError(f"{name}: {error}") from None
    except Exception as error:
        raise InputError(
            f"{name}: the function raises {type(error).__name__}: {shorten(str(error))}"
        ) from error


@dataclass(frozen=True)
class OfTime:
    """A user's function of time.

    Attributes
    ----------
    function
        The function.
    name
        Its name in messages.
    """

    function: Callable[[float], Any]
    name: str = field(compare=False)

    def __call__(self, time: float) -> float:
        """Return its value at a time."""
        with naming(self.name):
            value = real(self.function(time), (), "a number")
            check_finite(value.reshape(1), lambda _: f"at t = {time:g}")
            return float(value)
