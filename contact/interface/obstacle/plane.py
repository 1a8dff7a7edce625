"""A rigid half space."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from contact.interface.obstacle.protocol import GRAZING, Shape
from contact.kinds import names_arguments
from contact.settings import Direction, Vector
from contact.typing import Array


@names_arguments
@dataclass(frozen=True)
class Plane(Shape):
    """A half space: the foundation lies below the plane through `point`.

    Attributes
    ----------
    point
        A point of the plane.
    normal
        Normal towards the body, of any length.
    """

    point: Vector
    normal: Direction
    shape: Literal["plane"] = field(default="plane", kw_only=True)

    def chord_depth(self, length: float, points: Array) -> float:
        """Return 0: chords of a plane lie in it."""
        return 0.0

    def distance(self, points: Array) -> tuple[Array, Array]:
        """Return distances and normals."""
        normal = np.asarray(self.normal) / np.linalg.norm(self.normal)
        distance = (points - np.asarray(self.point)) @ normal
        return distance, np.broadcast_to(normal, points.shape).copy()

    def ray(self, points: Array, rays: Array) -> Array:
        """Return the distances along rays."""
        distance, normal = self.distance(points)
        cosine = -np.einsum("ni,ni->n", rays, normal)
        facing = cosine > GRAZING
        return np.where(facing, distance / np.where(facing, cosine, 1.0), np.inf)
