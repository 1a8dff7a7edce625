"""Checks of arguments in Python: kinds of objects, ranges, and names of arguments."""

from __future__ import annotations

import functools
import inspect
from typing import Any, TypeVar

import numpy as np

from contact.errors import InputError
from contact.tolerances import HUGE

T = TypeVar("T")

#: Elastic constants that a law has; sizes and starts are taken from them.
CONSTANTS = ("young", "poisson", "bulk", "shear")

#: Most letters of a given value that a message repeats.
LONGEST = 80


def expect(name: str, given: Any, accepted: str, fits: object) -> None:
    """Refuse a value that does not fit.

    Parameters
    ----------
    name, given
        Name and value.
    accepted
        The accepted values in words.
    fits
        Whether it fits.

    Raises
    ------
    InputError
        If it does not.
    """
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
    """Return one object of a kind, or several, as a tuple.

    Raises
    ------
    InputError
        If something else is among them.
    """
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


def names_arguments(cls: type[T]) -> type[T]:
    """Let a class say which arguments it has where it is given others."""
    made = cls.__init__
    signature = inspect.signature(made)
    names = ", ".join([*signature.parameters][1:])

    @functools.wraps(made)
    def checked(self: T, *values: Any, **named: Any) -> None:
        try:
            signature.bind(self, *values, **named)
        except TypeError as error:
            raise InputError(f"{cls.__name__}: {error}; accepted: {names}") from None
        made(self, *values, **named)

    cls.__init__ = checked  # type: ignore[method-assign, assignment]
    return cls
