"""Rigid shapes: plane, sphere, cylinder, cone, paraboloid, punch, and one by its signed distance.

A shape is a class that returns signed distances with normals (`protocol.Shape.distance`) and, where
these are known, distances along rays and the depth of chords; all else follows from it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from annotated_types import Gt, Lt

from contact.arguments import expect, real
from contact.interface.obstacle.protocol import GRAZING, Shape, split
from contact.settings import Accepted, Direction, NonNegative, Positive, Switch, Vector
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

    def ray(self, points: Array, rays: Array) -> Array:
        """Return the distances along rays."""
        distance, normal = self.distance(points)
        cosine = -np.einsum("ni,ni->n", rays, normal)
        facing = cosine > GRAZING
        return np.where(facing, distance / np.where(facing, cosine, 1.0), np.inf)


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
        """Refuse an object that is no function."""
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
        # A rank without points asks too: mistakes are found by all.
        asked = points if count > 0 else np.zeros((d + 1, d))
        words = f"one number for each of the points, an array of shape {asked.shape}"
        return real(self.function(asked), asked.shape[:1], words)[:count]
