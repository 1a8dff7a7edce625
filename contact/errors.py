"""Errors of the input, and counts, values and suggestions in messages."""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

#: A number of NumPy as its repr.
NUMBER = re.compile(r"\bnp\.(?:u?int|float|bool|str)\d*_?\(([^()]*)\)|\bnp\.(True|False)_?\b")

#: Modules that are no dependencies of the plain package, and ways to them.
OF_EXTRAS = (
    "mpi4py",
    "petsc4py",
    "dolfinx",
    "basix",
    "ffcx",
    "ufl",
    "cffi",
    "pyvista",
    "vtkmodules",
)
WAYS = (
    'pip install "contact-fenicsx[fenicsx]" (Linux on x86-64, Python >= 3.12), or in a clone '
    "conda env create -f environment.yml, scripts/fx COMMAND (Debian's packages), docker build ."
)

#: Most characters of a quoted value.
VALUE = 60


def counted(number: float, noun: str) -> str:
    """Return a number of things in words: ``1 node``, ``2 nodes``."""
    text = f"{number:.3g}" if isinstance(number, float) else str(number)
    return f"{text} {noun}" + ("" if text == "1" else "s")


def clipped(text: str, length: int = 100) -> str:
    """Return a text of at most a length, characters that are not printable as their codes."""
    text = text if len(text) <= length else text[: length - 3] + "..."
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def shown(given: Any) -> str:
    """Show a given value as in the case file."""
    try:
        text = str(given) if isinstance(given, float) else json.dumps(given, default=str)
    except ValueError:
        # Python writes out integers up to a limit of digits only.
        text = "a whole number of thousands of digits"
    except RecursionError:
        text = "a deeply nested list"
    return clipped(text, VALUE)


def nearest(name: str, options: Iterable[str], words: str = " (did you mean {}?)") -> str:
    """Return a suggestion of the nearest name, whatever its capitals; an empty text if none is."""
    known = {option.lower(): option for option in options}
    near = difflib.get_close_matches(name.lower(), known, n=1)
    return words.format(clipped(known[near[0]])) if near else ""


class InputError(ValueError):
    """Bad input: the message names the fault and the accepted values, and ends in an identifier.

    The command line prints the message alone and leaves with exit status 2.

    Parameters
    ----------
    words
        The message; numbers of NumPy that it repeats stand there as numbers.
    identifier
        The entry of the page of messages, docs/troubleshooting.md, which it shares with others
        of the same remedy.
    """

    def __init__(self, words: str, identifier: str) -> None:
        super().__init__(words, identifier)
        self.words = NUMBER.sub(lambda found: found[1] or found[2] or "", words)
        self.identifier = identifier

    def __str__(self) -> str:
        """Return the message."""
        return f"{self.words} [{self.identifier}]"

    def within(self, place: str) -> InputError:
        """Return the error with words before its own, such as the name of a file."""
        return InputError(f"{place}{self.words}", self.identifier)


class SingularError(InputError):
    """A singular linear system: a rigid-body mode is unconstrained where it is linearised."""


@contextmanager
def installed() -> Iterator[None]:
    """Raise an InputError where FEniCSx, pyvista or a C compiler is missing."""
    try:
        yield
    except ModuleNotFoundError as error:
        name = (error.name or "").partition(".")[0]
        if name not in OF_EXTRAS:
            raise
        text = f"the Python module {name} is needed; accepted: {WAYS}"
        raise InputError(text, "fenicsx") from None
    except Exception as error:
        if re.search("MPI library|libmpi", str(error)):
            text = f"no library of MPI is found ({error}); accepted: {WAYS}"
            raise InputError(text, "fenicsx") from None
        # cffi's, and dolfinx's on several ranks.
        of_ranks = re.search("(JIT|just-in-time) compilation", str(error))
        if not of_ranks and type(error).__name__ != "VerificationError":
            raise
        reason = str(error).strip().splitlines()[-1]
        text = f"a form cannot be compiled ({reason}); accepted: a C compiler, Python's headers"
        raise InputError(text, "compiler") from error
