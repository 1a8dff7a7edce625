"""A rigid cone."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from annotated_types import Gt, Lt

from contact.interface.obstacle.protocol import Shape, split
from contact.kinds import expect, names_arguments
from contact.settings import Accepted, Direction, Vector
from contact.typing import Array


@names_arguments
@dataclass(frozen=True)
class Cone(Shape):
    """A rigid cone without end; in 2-D a wedge.

    Attributes
    ----------
    apex
        Its tip.
    axis
        From the tip into the cone, of any length.
    half_angle
        Between the axis and the side (degrees).
    """

    apex: Vector
    axis: Direction
    half_angle: Annotated[
        float, Gt(0), Lt(90), Accepted("an angle between 0 and 90 degrees, both excluded")
    ]
    shape: Literal["cone"] = field(default="cone", kw_only=True)

    def __post_init__(self) -> None:
        """Refuse an angle that is none of a cone."""
        super().__post_init__()
        angle = self.half_angle
        expect("Cone: half_angle", angle, "degrees between 0 and 90", 0 < angle < 90)

    def distance(self, points: Array) -> tuple[Array, Array]:
        """Return distances and normals; those of the tip where it is nearest."""
        unit, along, radius, away = split(points, self.apex, self.axis)
        angle = np.deg2rad(self.half_angle)
        side = radius * np.cos(angle) - along * np.sin(angle)
        normal = np.cos(angle) * away - np.sin(angle) * unit
        # On the axis within the cone all sides are equally near: away from the tip.
        normal = np.where((radius > 0)[:, None], normal, -unit)
        beyond = radius * np.sin(angle) + along * np.cos(angle) <= 0
        length = np.hypot(radius, along)
        tip = np.where(length > 0, length, 1.0)[:, None]
        radial = np.where((length > 0)[:, None], (radius / tip[:, 0])[:, None] * away, 0.0)
        radial = radial + np.where(length > 0, along / tip[:, 0], -1.0)[:, None] * unit
        return np.where(beyond, length, side), np.where(beyond[:, None], radial, normal)

    def chord_depth(self, length: float, points: Array) -> float:
        """Return how deep the tip reaches beyond a facet that it divides in two."""
        return float(0.5 * length / np.tan(np.deg2rad(self.half_angle)))
