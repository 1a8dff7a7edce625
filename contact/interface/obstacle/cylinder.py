"""A rigid cylinder, or a bore."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from contact.interface.obstacle.protocol import Shape, sagitta, split
from contact.kinds import names_arguments
from contact.settings import Direction, Positive, Switch, Vector
from contact.typing import Array


@names_arguments
@dataclass(frozen=True)
class Cylinder(Shape):
    """A rigid cylinder without ends (`inside` false), or the bore that holds the body (true).

    In 2-D the axis lies in the plane: a strip, or about the axis of a body of revolution a shaft.

    Attributes
    ----------
    point
        A point of its axis.
    axis
        Its axis, of any length and either sense.
    radius
        Radius.
    inside
        Whether the body lies in the bore.
    """

    point: Vector
    axis: Direction
    radius: Positive
    inside: Switch = False
    shape: Literal["cylinder"] = field(default="cylinder", kw_only=True)

    def distance(self, points: Array) -> tuple[Array, Array]:
        """Return distances and normals."""
        _, _, radius, away = split(points, self.point, self.axis)
        inward = -1.0 if self.inside else 1.0
        # The axis itself has no normal.
        known = np.where(radius > 1e-12 * self.radius, 1.0, np.nan)
        return inward * (radius - self.radius), inward * known[:, None] * away

    def ray(self, points: Array, rays: Array) -> Array:
        """Return the distances along rays, by the quadratic equation across the axis."""
        unit, _, radius, away = split(points, self.point, self.axis)
        across = rays - (rays @ unit)[:, None] * unit
        a = np.einsum("ni,ni->n", across, across)
        b = radius * np.einsum("ni,ni->n", away, across)
        root = b**2 - a * (radius**2 - self.radius**2)
        outward = 1.0 if self.inside else -1.0
        met = (a > 1e-12) & (root >= 0)
        gap = (-b + outward * np.sqrt(np.maximum(root, 0.0))) / np.where(met, a, 1.0)
        leaving = (b > 0) & (radius > self.radius) & (not self.inside)
        return np.where(met & ~leaving, gap, np.inf)

    def chord_depth(self, length: float, points: Array) -> float:
        """Return the sagitta of a chord across the axis; of a strip there is none."""
        flat = self.inside or len(self.axis) == 2
        return 0.0 if flat else sagitta(length, self.radius, 2)
