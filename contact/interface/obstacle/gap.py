"""A gap that is given as a function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from contact.body.fields import Given, field
from contact.typing import Array


@dataclass(frozen=True)
class GapFunction:
    """A gap given along the body's own normal.

    Parameters
    ----------
    gap
        Function of points of shape (n, d) that returns the gap, shape (n,) (length).
        `GapFunction.of` takes numbers, functions of x, UFL and dolfinx Functions.
    """

    gap: Callable[[Array], Array]

    @staticmethod
    def of(value: Given) -> GapFunction:
        """Return the gap that is given as `contact.body.fields.field` takes it."""
        return GapFunction(field(value).numpy)

    direction = "body"
    is_shape = False

    def chord_depth(self, length: float, points: Array) -> float:
        """Return 0: given gaps are not those of a shape."""
        return 0.0

    def measure(self, points: Array, body_normal: Array) -> tuple[Array, Array]:
        """Return the body's normals and the gap at the points."""
        return body_normal, np.broadcast_to(self.gap(points), points.shape[:1]).astype(float)
