"""Checks of arguments in Python: types, ranges, a user's functions and their derivatives."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any, TypeVar

import numpy as np

from contact.errors import InputError
from contact.tolerances import EPS, HUGE
from contact.typing import Array

T = TypeVar("T")

#: Elastic constants of a law, from which scales and initial guesses are computed.
CONSTANTS = ("young", "poisson", "bulk", "shear")

#: Largest length of a given value in a message.
LONGEST = 80

#: Relative step of finite differences, and relative error of a derivative that is wrong.
STEP, OFF = 1e-5, 0.02

#: Share of the samples with a wrong derivative that is refused: a kink is at few.
SHARE = 0.1

#: Change of a value over its rounding above which differences are significant.
SEEN = 1e4

#: A bound above zero.
TINY = np.finfo(float).tiny

#: Samples of laws: slips or potential differences, and pressures.
SAMPLES = np.logspace(-9, 3, 49, dtype=np.float64)
PRESSURES = np.logspace(-6, 6, 13, dtype=np.float64)


def expect(
    name: str, given: object, accepted: str, fits: object, identifier: str = "value"
) -> None:
    """Raise an InputError with the given and the accepted values unless the value fits."""
    if not fits:
        words = f"{name}: given {shorten(repr(given))}; accepted: {accepted}"
        raise InputError(words, identifier)


def fill(made: object, **values: object) -> None:
    """Set attributes of a frozen dataclass in its ``__post_init__``."""
    for name, value in values.items():
        object.__setattr__(made, name, value)


def check_range(key: str, value: float, least: float = 1 / HUGE) -> None:
    """Refuse a size whose square overflows or underflows."""
    if not least <= value <= HUGE:
        raise InputError(
            f"{key}: a size of {value:.3g} leads to numbers that overflow; accepted: units that "
            f"keep sizes between {1 / HUGE:g} and {HUGE:g}",
            "overflow",
        )


def shorten(text: str) -> str:
    """Return a text as one line of at most `LONGEST` characters."""
    line = " ".join(text.split())
    return line if len(line) <= LONGEST else f"{line[:LONGEST]}..."


def several(name: str, given: Any, kind: type[T], accepted: str) -> tuple[T, ...]:
    """Return an object of a type, or a list of them, as a tuple; else raise an InputError."""
    every = tuple(given) if isinstance(given, list | tuple) else (given,)
    for one in every:
        expect(name, one, accepted, isinstance(one, kind))
    return every


def one_of(name: str, /, **given: T | None) -> T | None:
    """Return the value of the one keyword that is given, if any; else raise an InputError."""
    names = [key for key, value in given.items() if value is not None]
    expect(name, names, f"one of {', '.join(given)}", len(names) < 2)
    return given[names[0]] if names else None


def is_law(given: object) -> bool:
    """Tell whether an object has the `CONSTANTS` of a law."""
    try:
        return all(np.isfinite(float(getattr(given, name))) for name in CONSTANTS)
    except ZeroDivisionError:  # a law with wrong constants, which `Body.check` names
        return True
    except (AttributeError, TypeError, ValueError):
        return False


class Returned(InputError):
    """Wrong value of a user's function, whose name `naming` adds."""

    def __init__(self, words: str, identifier: str = "own-function") -> None:
        super().__init__(words, identifier)


def real(values: Any, shape: tuple[int, ...], each: str) -> Array:
    """Return the values of a user's function as an array of a shape, by broadcasting.

    Values that do not fit raise `Returned`, to which `naming` adds the name of the function; `each`
    has the accepted values in words.
    """
    if type(values) is np.ndarray and values.dtype == float and values.shape == shape:
        return values.copy()
    try:
        array = np.asarray(values)
    except ValueError:  # lists of different lengths
        array = np.asarray(None)
    if array.dtype.kind not in "biuf":
        raise Returned(f"the function returns {shorten(repr(values))}; accepted: {each}")
    try:
        array = np.broadcast_to(array, shape)
    except ValueError:
        raise Returned(
            f"the function returns values of shape {array.shape}; accepted: {each}"
        ) from None
    return array.astype(float)


def check_finite(values: Array, where: Callable[[int], str]) -> None:
    """Refuse infinity and NaN in values, (n,), at places ``where(i)``, inside `naming`."""
    bad = np.flatnonzero(~np.isfinite(values))
    if bad.size > 0:
        raise Returned(
            f"not finite {where(bad[0])}; accepted: a finite number, formula or function",
            "not-finite",
        )


@contextmanager
def naming(name: str) -> Iterator[None]:
    """Add the name of the argument to the errors of a user's function."""
    try:
        yield
    except Returned as error:
        raise error.within(f"{name}: ") from None
    except InputError:
        raise
    except Exception as error:
        raise InputError(
            f"{name}: the function raises {type(error).__name__}: {shorten(str(error))}",
            "own-function",
        ) from error


class OfTime:
    """A user's function of time, and its name in messages."""

    names = frozenset({"t"})  # as of formulas

    def __init__(self, function: Callable[[float], Any], name: str) -> None:
        self.function, self.name = function, name

    def __eq__(self, other: object) -> bool:
        """Compare the functions."""
        return isinstance(other, OfTime) and self.function == other.function

    def __hash__(self) -> int:
        """Hash the function."""
        return hash(self.function)

    def __call__(self, time: float) -> float:
        """Return its value at a time."""
        with naming(self.name):
            value = real(self.function(time), (), "a number")
            check_finite(value.reshape(1), lambda _: f"at t = {time:g}")
            return float(value)

    def number(self, time: float) -> float:
        """Return its value at a time, as of formulas."""
        return self(time)


def sampled(name: str, shape: tuple[int, ...], *calls: Callable[[], Any]) -> list[Array] | None:
    """Return values of a user's law at samples, each of a shape; None if one raises an error.

    The law may never be evaluated there: a missing attribute alone is an InputError, with `name`.
    """
    try:
        with np.errstate(all="ignore"):
            return [real(call(), shape, "") for call in calls]
    except AttributeError as error:
        with naming(name):
            raise error
    except Exception:
        return None


def check_slope(
    name: str,
    function: Callable[[Array], Array | float],
    slope: Callable[[Array], Array | float],
    at: Array,
) -> None:
    """Compare a derivative with central differences at arguments other than 0, shape (n,).

    InputError, with `name`, if they differ at a share `SHARE` of the samples or more, or if the law
    has no derivative.
    """
    h = STEP * np.abs(at)
    every = sampled(
        name, at.shape, partial(function, at - h), partial(function, at + h), partial(slope, at)
    )
    if every is None:
        return
    low, high, given = every
    with np.errstate(all="ignore"):
        central = (high - low) / (2 * h)
        roundoff = EPS * np.maximum(np.abs(low), np.abs(high)) / h
        off = np.abs(given - central) - OFF * np.abs(central) - SEEN * roundoff
    wrong = np.isfinite(off) & (off > 0)
    if np.count_nonzero(wrong) < SHARE * at.size:
        return
    worst = np.argmax(np.where(wrong, off / (OFF * np.abs(central) + SEEN * roundoff + TINY), 0))
    raise InputError(
        f"{name}: {given[worst]:.4g} at {at[worst]:.3g}, where differences of the values are "
        f"{central[worst]:.4g}; accepted: the derivative of the law",
        "law-derivative",
    )
