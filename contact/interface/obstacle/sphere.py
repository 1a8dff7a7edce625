"""A rigid ball, or the room within one."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from contact.interface.obstacle.protocol import Shape, sagitta
from contact.kinds import names_arguments
from contact.settings import Positive, Switch, Vector
from contact.typing import Array


@names_arguments
@dataclass(frozen=True)
class Sphere(Shape):
    """A rigid ball (`inside` false), or the outside of a ball that holds the body (true).

    Attributes
    ----------
    centre
        Centre.
    radius
        Radius.
    inside
        Whether the body lies inside the sphere.
    """

    centre: Vector
    radius: Positive
    inside: Switch = False
    shape: Literal["sphere"] = field(default="sphere", kw_only=True)

    def distance(self, points: Array) -> tuple[Array, Array]:
        """Return distances and normals."""
        offset = points - np.asarray(self.centre)
        distance = np.linalg.norm(offset, axis=1)
        inward = -1.0 if self.inside else 1.0
        # The centre itself has none: NaN, which `find_nodes` refuses on all ranks together.
        known = distance > 1e-12 * self.radius
        radial = offset / np.where(known, distance, np.nan)[:, None]
        return inward * (distance - self.radius), inward * radial

    def ray(self, points: Array, rays: Array) -> Array:
        """Return the distances along rays: x + t d meets the sphere where |offset + t d| = R."""
        offset = points - np.asarray(self.centre)
        distance = np.linalg.norm(offset, axis=1)
        outward = 1.0 if self.inside else -1.0
        along = np.einsum("ni,ni->n", offset, rays)
        root = along**2 + self.radius**2 - distance**2
        gap = -along + outward * np.sqrt(np.maximum(root, 0.0))
        # A ray that misses the ball, or leads away from it, never touches it.
        away = (along > 0) & (distance > self.radius) & (not self.inside)
        return np.where((root >= 0) & ~away, gap, np.inf)

    def chord_depth(self, length: float, points: Array) -> float:
        """Return the sagitta of facets outside of the ball; within it they keep off."""
        return 0.0 if self.inside else sagitta(length, self.radius, len(self.centre))
