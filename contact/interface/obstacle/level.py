"""A rigid body by its signed distance, given as a function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from contact.calling import real
from contact.interface.obstacle.protocol import Shape
from contact.kinds import expect
from contact.typing import Array

#: Step of the central differences, over the size of the coordinates: the third root of rounding.
STEP = 6e-6


@dataclass(frozen=True)
class Level(Shape):
    """A rigid body where a function is negative.

    Parameters
    ----------
    function
        Signed distance of points of shape (n, d), positive outside, shape (n,). Its slope need
        not be 1: it is divided by it, which is exact on the surface, and nearly so close to it.
    """

    function: Callable[[Array], Array]

    def __post_init__(self) -> None:
        """Refuse what is no function."""
        super().__post_init__()
        words = "a function of points of shape (n, d)"
        expect("Level: function", self.function, words, callable(self.function))

    def distance(self, points: Array) -> tuple[Array, Array]:
        """Return distances and normals; NaN where the function has no slope."""
        h = STEP * np.maximum(np.abs(points).max(axis=1, initial=0.0), 1e-3)[:, None]
        slope = np.column_stack(
            [
                (self._values(points + h * e) - self._values(points - h * e)) / (2 * h[:, 0])
                for e in np.eye(points.shape[1])
            ]
        )
        size = np.linalg.norm(slope, axis=1)
        known = np.where(size > 0, size, np.nan)
        return self._values(points) / known, slope / known[:, None]

    def _values(self, points: Array) -> Array:
        count, d = points.shape
        # A rank without points asks too: what is wrong is found by all.
        asked = points if count > 0 else np.zeros((d + 1, d))
        words = f"one number for each of the points, an array of shape {asked.shape}"
        return real(self.function(asked), asked.shape[:1], words)[:count]
