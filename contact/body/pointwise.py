"""Expressions of a body's unknowns, evaluated in its cells."""

from __future__ import annotations

from collections.abc import Callable, Hashable

import numpy as np
from dolfinx import fem
from numpy.typing import NDArray
from ufl.core.expr import Expr

from contact.typing import Array


class Pointwise:
    """Values of expressions at points of the cells.

    Each expression is compiled once for a body: to find the code of one again takes as long as a
    small problem.

    Parameters
    ----------
    space
        Of the unknowns.
    """

    def __init__(self, space: fem.FunctionSpace) -> None:
        self._space = space
        self._at: fem.Function | None = None
        self._made: dict[Hashable, fem.Expression] = {}

    def values(
        self,
        name: Hashable,
        expression: Callable[[fem.Function], Expr],
        points: Array,
        x: Array,
        cells: NDArray[np.int32],
    ) -> Array:
        """Return the values of a vector, shape (cells, points, components).

        Parameters
        ----------
        name
            What the expression is known by from the first time on.
        expression
            Makes it of the unknowns.
        points
            Points of the reference cell, shape (points, d).
        x
            The local unknowns of the nodes.
        cells
            Local numbers of cells.
        """
        if self._at is None:
            self._at = fem.Function(self._space)
        if name not in self._made:
            self._made[name] = fem.Expression(expression(self._at), points)
        self._at.x.array[:] = x
        made = self._made[name]
        found = np.asarray(made.eval(self._space.mesh, cells))
        return found.reshape(cells.size, len(points), made.value_size)
