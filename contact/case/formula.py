"""Formulas of the case file, such as ``"-10*x"``, as functions of the coordinates and the time."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from contact.case.grammar import (
    VARIABLES,
    Number,
    evaluate,
    parse,
    variables,
)
from contact.case.showing import shown
from contact.errors import InputError
from forms import ops

if TYPE_CHECKING:
    from mpi4py import MPI
    from ufl.core.expr import Expr


class Expression:
    """A scalar function of the coordinates and the time, given as a number or a formula.

    Formulas have NumPy's meaning: ``log`` is natural, angles are in radians, ``min`` and
    ``max`` take two arguments or more, and a comparison counts as 1 or 0.

    Parameters
    ----------
    source
        A finite number or a formula in x, y, z and t.

    Raises
    ------
    InputError
        If the source is anything else; the message names the source and what is accepted.
    """

    __slots__ = ("_tree", "names", "source")

    source: float | str
    #: Coordinates that the formula uses, and "t" if it uses the time.
    names: frozenset[str]

    def __init__(self, source: float | str) -> None:
        if isinstance(source, bool) or not isinstance(source, int | float | str):
            raise InputError(f"{source!r} is neither a number nor a formula")
        try:
            self.source = source if isinstance(source, str) else float(source)
        except OverflowError:
            # A whole number may be as long as it likes.
            raise InputError(f"{shown(source)} is not finite; accepted: finite numbers") from None
        self._tree = parse(self.source)
        self.names = frozenset(VARIABLES[i] for i in variables(self._tree))

    @property
    def is_constant(self) -> bool:
        """True if the value is the same everywhere at all times."""
        return isinstance(self._tree, Number)

    @property
    def value(self) -> float:
        """Value of a constant expression.

        Raises
        ------
        ValueError
            If the expression depends on the coordinates or the time.
        """
        if not isinstance(self._tree, Number):
            raise ValueError(f"{self} depends on the coordinates or the time")
        return self._tree.value

    def number(self, time: float) -> float:
        """Return the value of an expression that depends on the time alone."""
        return float(self.numpy(np.zeros((1, 3)), time=time)[0])

    def numpy(
        self, points: ArrayLike, comm: MPI.Comm | None = None, time: float | None = None
    ) -> NDArray[np.float64]:
        """Evaluate at points.

        Parameters
        ----------
        points
            Coordinates, shape (n, 2) or (n, 3).
        comm
            If given, the call is collective, and a bad value on one rank raises on all.
        time
            The time, for a formula in t.

        Returns
        -------
        Values, shape (n,).

        Raises
        ------
        InputError
            If a value is not finite, or z is used in the plane.
        """
        points = np.asarray(points, dtype=np.float64)
        self.check_dimension(points.shape[1])
        with np.errstate(all="ignore"):
            result = evaluate(self._tree, self._variables(points.T, time))
        values = np.array(np.broadcast_to(result, points.shape[:1]), dtype=np.float64)
        bad = points[~np.isfinite(values)][:1].tolist()
        # The lowest rank that has a bad point speaks for all.
        found = bad if comm is None else list(itertools.chain(*comm.allgather(bad)))
        if found:
            place = ", ".join(f"{c:g}" for c in found[0])
            raise InputError(f"{self} is not finite at ({place}); accepted: a formula that is")
        return values

    def _variables(self, x: Any, time: Any) -> list[Any]:
        """Return the values of the variables: the time stands behind three coordinates."""
        if time is None and "t" in self.names:
            raise InputError(f"{self} uses t; accepted in a static problem: formulas without")
        given = list(x)
        return [*given, *[None] * (3 - len(given)), time]

    def ufl(self, x: Expr, time: Any = None) -> Expr:
        """Return the scalar UFL expression at ``x``, a vector of length 2 or 3, and a time.

        Raises
        ------
        InputError
            If z is used in the plane.
        """
        (dimension,) = x.ufl_shape
        self.check_dimension(dimension)
        return ops.symbolic(
            evaluate(self._tree, self._variables([x[i] for i in range(dimension)], time))
        )

    def check_dimension(self, dimension: int) -> None:
        """Raise an InputError if z is used in the plane."""
        if dimension < 3 and "z" in self.names:
            raise InputError(f"{self} uses z in a plane problem; accepted there: x and y")

    def __repr__(self) -> str:
        """Return the call that makes this expression."""
        return f"Expression({self.source!r})"

    def __str__(self) -> str:
        """Return the source as in the case file."""
        return shown(self.source)

    def __eq__(self, other: object) -> bool:
        """Compare the sources."""
        return isinstance(other, Expression) and self.source == other.source

    def __hash__(self) -> int:
        """Hash the source."""
        return hash(self.source)

    def __reduce__(self) -> tuple[type[Expression], tuple[float | str]]:
        """Pickle the source alone."""
        # The tree's functions would not pass between ranks.
        return Expression, (self.source,)
