"""Expressions of a body's unknowns, evaluated in its cells."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from typing import Any

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray
from ufl.core.expr import Expr

from contact.typing import Array

#: Cells, or pairs of facets, that are evaluated at once: bounds the memory.
CHUNK = 100_000


def in_chunks(cells: NDArray[np.integer[Any]]) -> list[NDArray[Any]]:
    """Return cells, or their places, part by part; an empty part where there are none."""
    return np.array_split(cells, cells.size // CHUNK + 1)


class Pointwise:
    """Expressions of the unknowns in a space, compiled once, evaluated at points of cells."""

    def __init__(self, space: fem.FunctionSpace) -> None:
        self._space = space
        self._at: fem.Function | None = None
        self._made: dict[Hashable, fem.Expression] = {}
        #: The last caller, whose unknowns are in the function.
        self._reader = object()

    def values(
        self,
        name: Hashable,
        expression: Callable[[fem.Function], Expr],
        points: Array,
        x: Array,
        cells: NDArray[np.int32],
    ) -> Iterator[tuple[NDArray[np.int32], Array]]:
        """Yield some cells after others, and a vector there, shape (cells, points, components).

        Collective where a name is asked for the first time.

        Parameters
        ----------
        name, expression
            Name, and the function that makes the expression of the unknowns at its first use.
        points
            Points of the reference cell, shape (points, d).
        x, cells
            Local unknowns, of which the global ones are ignored, and local numbers of cells.
        """
        at = self._at = self._at or fem.Function(self._space)
        if name not in self._made:
            self._made[name] = fem.Expression(expression(at), points)
        made, reader = self._made[name], object()
        for chosen in in_chunks(cells):
            if self._reader is not reader:
                self._reader, at.x.array[:] = reader, x[: at.x.array.size]
            found = np.asarray(made.eval(self._space.mesh, chosen))
            yield chosen, found.reshape(chosen.size, len(points), made.value_size)
