"""Rigid shapes: plane, sphere, cylinder, cone, paraboloid, punch, and one by its signed distance.

A shape is a class that returns signed distances with normals (`protocol.Shape.distance`); all else
follows from it.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass, field
from numbers import Real
from typing import Annotated, Literal

import numpy as np
from annotated_types import Gt, Lt
from pydantic import Field

from contact.arguments import expect, fill, real
from contact.errors import InputError
from contact.model.formula import Expression
from contact.model.obstacle.protocol import Shape
from contact.model.values import FormulaOrFunction
from contact.settings import Accepted, Direction, NonNegative, Positive, Switch, Vector
from contact.tolerances import EPS
from contact.typing import Array


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

    def distance(self, points: Array) -> tuple[Array, Array]:
        """Return distances and normals."""
        normal = np.asarray(self.normal) / np.linalg.norm(self.normal)
        distance = (points - np.asarray(self.point)) @ normal
        return distance, np.broadcast_to(normal, points.shape).copy()


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


@dataclass(frozen=True)
class AboutAxis(Shape):
    """Base class of shapes of revolution; in 2-D their axis lies in the plane."""

    @abstractmethod
    def profile(self, along: Array, radius: Array) -> tuple[Array, Array, Array]:
        """Return distances, and the parts of the normals along and away from the axis, (n,).

        Parameters
        ----------
        along, radius
            Places along the axis, from the origin of the shape on, and distances from it, (n,).
        """

    def distance(self, points: Array) -> tuple[Array, Array]:
        """Return distances and normals."""
        origin, axis = (
            np.asarray(next(getattr(self, name) for name in names if hasattr(self, name)))
            for names in (("point", "centre", "apex"), ("axis",))
        )
        unit = axis / np.linalg.norm(axis)
        offset = points - origin
        along = offset @ unit
        across = offset - along[:, None] * unit
        radius = np.linalg.norm(across, axis=1)
        away = across / np.where(radius > 0, radius, 1.0)[:, None]
        distance, upwards, outwards = self.profile(along, radius)
        return distance, outwards[:, None] * away + upwards[:, None] * unit


@dataclass(frozen=True)
class Cylinder(AboutAxis):
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

    def profile(self, along: Array, radius: Array) -> tuple[Array, Array, Array]:
        """Return distances and normals; NaN on the axis itself."""
        inward = -1.0 if self.inside else 1.0
        known = np.where(radius > 1e-12 * self.radius, inward, np.nan)
        return inward * (radius - self.radius), 0.0 * known, known


@dataclass(frozen=True)
class Cone(AboutAxis):
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
        fits = isinstance(angle, Real) and 0 < angle < 90
        expect("Cone: half_angle", angle, "degrees between 0 and 90", fits)

    def profile(self, along: Array, radius: Array) -> tuple[Array, Array, Array]:
        """Return distances and normals; those of the tip where it is nearest."""
        angle = np.deg2rad(self.half_angle)
        cosine, sine = np.cos(angle), np.sin(angle)
        length = np.hypot(radius, along)
        tip = (radius * sine + along * cosine <= 0) & (length > 0)
        scale = np.where(tip, length, 1.0)
        # On the axis within the cone all sides are equally near: away from the tip.
        side = np.where(radius > 0, -sine, -1.0)
        return (
            np.where(tip, length, radius * cosine - along * sine),
            np.where(tip, along / scale, side),
            np.where(tip, radius / scale, cosine),
        )


@dataclass(frozen=True)
class Paraboloid(AboutAxis):
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

    def profile(self, along: Array, radius: Array) -> tuple[Array, Array, Array]:
        """Return distances and normals, by the cubic equation of the nearest point.

        It lies at the distance s from the axis with s^3/(2 R^2) + s (1 - h/R) = r. From the
        right, where the cubic is convex, Newton's method goes down to its largest root.
        """
        big = self.radius
        s = np.maximum(radius, np.sqrt(2 * big * np.maximum(along, 0.0)))
        for _ in range(100):
            value = s**3 / (2 * big**2) + s * (1 - along / big) - radius
            slope = 3 * s**2 / (2 * big**2) + 1 - along / big
            step = value / np.where(slope > 0, slope, 1.0)
            s = np.maximum(s - np.where(slope > 0, step, 0.0), 0.0)
            if np.all(np.abs(step) <= 1e-15 * (s + big)):
                break
        # Outward normal at the nearest point: (s/R, -1) in (r, h).
        length = np.hypot(s / big, 1.0)
        distance = ((radius - s) * s / big - (along - s**2 / (2 * big))) / length
        return distance, -1 / length, s / big / length


@dataclass(frozen=True)
class Punch(AboutAxis):
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
        fits = isinstance(self.edge_radius, Real) and 0 <= self.edge_radius <= self.radius
        expect("Punch: edge_radius", self.edge_radius, "a length from 0 to the radius", fits)

    def profile(self, along: Array, radius: Array) -> tuple[Array, Array, Array]:
        """Return distances and normals: those of a smaller punch, less the edge radius."""
        e = self.edge_radius
        side, face = radius - (self.radius - e), e - along
        outside = np.hypot(np.maximum(side, 0.0), np.maximum(face, 0.0))
        within = np.minimum(np.maximum(side, face), 0.0)
        # On the surface of the smaller punch, and in it, the nearer of side and face.
        out = outside > 0
        scale = np.where(out, outside, 1.0)
        outwards = np.where(out, np.maximum(side, 0.0) / scale, side > face)
        upwards = np.where(out, np.maximum(face, 0.0) / scale, side <= face)
        return outside + within - e, -upwards, outwards


#: Step of the central differences, over the size of the coordinates: the third root of rounding.
STEP = EPS ** (1 / 3)


@dataclass(frozen=True)
class Level(Shape):
    """A rigid body where a function is negative: a formula, or one of points of shape (n, d).

    Attributes
    ----------
    function
        Signed distance, positive outside. Where its slope is not 1 it is divided by that, which is
        exact on the surface, and nearly so close to it.
    """

    function: Annotated[FormulaOrFunction, Field(alias="distance")]
    shape: Literal["distance"] = field(default="distance", kw_only=True)

    def __post_init__(self) -> None:
        """Refuse an object that is no function."""
        super().__post_init__()
        if isinstance(self.function, str):
            fill(self, function=Expression(self.function))
        words = "a formula, or a function of points of shape (n, d)"
        fits = isinstance(self.function, Expression) or callable(self.function)
        expect("Level: function", self.function, words, fits)

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
        # A rank without points asks too: mistakes are found by all.
        asked = points if count > 0 else np.zeros((d + 1, d))
        if isinstance(self.function, Expression):
            try:
                return self.function.numpy(asked)[:count]
            except InputError:  # no value at one of them: ranks ask at points of their own
                return np.full(count, np.nan)
        words = f"one number for each of the points, an array of shape {asked.shape}"
        assert callable(self.function)
        return real(self.function(asked), asked.shape[:1], words)[:count]
