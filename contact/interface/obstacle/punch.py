"""A rigid punch with a flat face and a rounded edge."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from contact.interface.obstacle.protocol import Shape, sagitta, split
from contact.kinds import expect, names_arguments
from contact.settings import Direction, NonNegative, Positive, Vector
from contact.typing import Array


@names_arguments
@dataclass(frozen=True)
class Punch(Shape):
    """A rigid cylinder with a flat face; in 2-D a rectangle.

    Attributes
    ----------
    centre
        Centre of the face.
    axis
        From the face into the punch, of any length.
    radius
        Radius of the punch.
    edge_radius
        Radius by which its edge is rounded, at most that of the punch; 0: sharp.
    """

    centre: Vector
    axis: Direction
    radius: Positive
    edge_radius: NonNegative = 0.0
    shape: Literal["punch"] = field(default="punch", kw_only=True)

    def __post_init__(self) -> None:
        """Refuse an edge that is rounder than the punch."""
        super().__post_init__()
        fits = 0 <= self.edge_radius <= self.radius
        expect("Punch: edge_radius", self.edge_radius, "a length from 0 to the radius", fits)

    def distance(self, points: Array) -> tuple[Array, Array]:
        """Return distances and normals: those of a smaller punch, less the edge radius."""
        unit, along, radius, away = split(points, self.centre, self.axis)
        e = self.edge_radius
        side, face = radius - (self.radius - e), e - along
        outside = np.hypot(np.maximum(side, 0.0), np.maximum(face, 0.0))
        within = np.minimum(np.maximum(side, face), 0.0)
        # On the surface of the smaller punch, and in it, the nearer of side and face.
        out = outside > 0
        scale = np.where(out, outside, 1.0)
        first = np.where(out, np.maximum(side, 0.0) / scale, side > face)
        second = np.where(out, np.maximum(face, 0.0) / scale, side <= face)
        return outside + within - e, first[:, None] * away - second[:, None] * unit

    def chord_depth(self, length: float, points: Array) -> float:
        """Return the sagitta at the edge, across it; a sharp one fits into no facets."""
        return 0.0 if self.edge_radius == 0 else sagitta(length, self.edge_radius, 2)
