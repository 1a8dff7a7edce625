"""What Python gives, checked where it comes in: kinds of objects, and names of arguments."""

from __future__ import annotations

import functools
import inspect
from typing import Any, TypeVar

from contact.errors import InputError

T = TypeVar("T")

#: Most letters of what was given that a message repeats.
LONGEST = 80


def expect(what: str, given: Any, accepted: str, fits: object) -> None:
    """Refuse what does not fit.

    Parameters
    ----------
    what, given
        Name and value.
    accepted
        What messages say is accepted.
    fits
        Whether it fits.

    Raises
    ------
    InputError
        If it does not.
    """
    if not fits:
        shown = repr(given)
        shown = shown if len(shown) <= LONGEST else f"{shown[:LONGEST]}..."
        raise InputError(f"{what}: given {shown}; accepted: {accepted}")


def several(what: str, given: Any, kind: type[T], accepted: str) -> tuple[T, ...]:
    """Return one object of a kind, or several, as a tuple.

    Raises
    ------
    InputError
        If something else is among them.
    """
    every = tuple(given) if isinstance(given, list | tuple) else (given,)
    for one in every:
        expect(what, one, accepted, isinstance(one, kind))
    return every


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
