"""A rigid paraboloid of revolution."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from contact.interface.obstacle.protocol import Shape, sagitta, split
from contact.kinds import names_arguments
from contact.settings import Direction, Positive, Vector
from contact.typing import Array


@names_arguments
@dataclass(frozen=True)
class Paraboloid(Shape):
    """A rigid paraboloid, h >= r^2/(2 R) at the height h and the distance r; in 2-D a parabola.

    Attributes
    ----------
    apex
        Its tip.
    axis
        From the tip into the paraboloid, of any length.
    radius
        Radius of curvature R at the tip.
    """

    apex: Vector
    axis: Direction
    radius: Positive
    shape: Literal["paraboloid"] = field(default="paraboloid", kw_only=True)

    def distance(self, points: Array) -> tuple[Array, Array]:
        """Return distances and normals, by the cubic equation of the nearest point.

        It lies at the distance s from the axis with s^3/(2 R^2) + s (1 - h/R) = r. From the
        right, where the cubic is convex, Newton's method goes down to its largest root.
        """
        unit, along, r, away = split(points, self.apex, self.axis)
        big = self.radius
        s = np.maximum(r, np.sqrt(2 * big * np.maximum(along, 0.0)))
        for _ in range(100):
            value = s**3 / (2 * big**2) + s * (1 - along / big) - r
            slope = 3 * s**2 / (2 * big**2) + 1 - along / big
            step = value / np.where(slope > 0, slope, 1.0)
            s = np.maximum(s - np.where(slope > 0, step, 0.0), 0.0)
            if np.all(np.abs(step) <= 1e-15 * (s + big)):
                break
        across, up = r - s, along - s**2 / (2 * big)
        # Outward normal at the nearest point: (s/R, -1) in (r, h).
        length = np.hypot(s / big, 1.0)
        normal = (s / big / length)[:, None] * away - unit / length[:, None]
        return (across * s / big - up) / length, normal

    def chord_depth(self, length: float, points: Array) -> float:
        """Return the sagitta at the tip, where the curvature is largest."""
        return sagitta(length, self.radius, len(self.apex))
