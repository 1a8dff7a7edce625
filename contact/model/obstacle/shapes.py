"""Obstacles as the contact nodes see them: rigid shapes, and gaps that are given as such.

A shape is a class that returns signed distances with normals (`Shape.distance`); all else
follows from it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Literal, Protocol

import numpy as np
from annotated_types import Gt, Lt
from mpi4py import MPI
from pydantic import Field

from contact.arguments import STEP, expect, naming, real
from contact.errors import InputError
from contact.model.fields import Static, static
from contact.model.fields import field as given_field
from contact.model.formula import Expression
from contact.model.section import Direction, FormulaOrFunction, Vector, described
from contact.ranks import on_all_ranks
from contact.settings import Accepted, Internal, NonNegative, Positive, Switch, fault
from contact.tolerances import EPS
from contact.typing import Array

#: Cosine of the steepest angle at which a ray still leads to a surface.
GRAZING = 1e-6

#: Most steps along a ray.
STEPS = 200

#: Most points at which normals are checked.
CHECKED = 50

#: Largest difference of the length of a normal from 1.
UNIT = 1e-6

#: The description of the key `shape`.
NAME = Field(description="Name of the shape, by which the case file selects it.")


class Obstacle(Protocol):
    """A rigid obstacle, seen from the contact nodes: a new shape is a class with these three."""

    @property
    def direction(self) -> str:
        """Whose normal the contact direction is: "foundation", "body", or a given "axis"."""

    @property
    def is_shape(self) -> bool:
        """Whether the gaps are those of a rigid body, which the undeformed mesh must not cut.

        Gaps that are given as such may be negative.
        """

    def measure(self, points: Array, body_normal: Array) -> tuple[Array, Array]:
        """Return the contact direction, shape (n, d), and the gap along it, shape (n,).

        Given the nodes' coordinates and the outward unit normals of the body, shapes (n, d).
        """


@dataclass(frozen=True, kw_only=True)
class Shape(ABC):
    """Base class of shapes: the contact direction, and gaps along rays.

    Attributes
    ----------
    direction
        "foundation": contact along the shape's normal (default); "body": along the body's;
        "axis": along a given direction.
    along
        That direction, from the body towards the foundation, of any length.
    shape
        Name of the shape, by which the case file selects it.
    """

    direction: Internal[Literal["foundation", "body", "axis"]] = "foundation"
    along: Internal[tuple[float, ...]] = ()

    is_shape = True

    #: Names of attributes that are points or directions; dimension of space, if only one.
    vectors: ClassVar[tuple[str, ...]] = ("point", "centre", "apex", "normal", "axis")
    only: ClassVar[int | None] = None

    def check(self, dim: int) -> None:
        """Refuse unknown directions, those without length, and another dimension than space."""
        name = type(self).__name__
        known = self.direction in ("foundation", "body", "axis")
        expect(f"{name}: direction", self.direction, '"foundation", "body", "axis"', known)
        expect(f"{name}: dimension", dim, f"{self.only}", self.only in (None, dim))
        along = ("along",) if self.direction == "axis" else ()
        for key in (*(key for key in self.vectors if hasattr(self, key)), *along):
            given = getattr(self, key)
            try:
                vector = np.asarray(given, dtype=float)
                fits = vector.shape == (dim,) and bool(np.isfinite(vector).all())
            except (TypeError, ValueError):
                fits = False
            expect(f"{name}: {key}", given, f"{dim} numbers in {dim}-D", fits)
            direction = key in ("normal", "axis", "along")
            expect(f"{name}: {key}", given, "a direction, not 0", not direction or vector.any())

    @np.errstate(all="ignore")
    def turned_normals(self, points: Array) -> tuple[int, int, str]:
        """Return at how many of some points normals are wrong, of how many, and one of them.

        They are against the slope, or no unit vectors.
        The slope is the difference quotient of the distance, at some of the points from which the
        shape is seen, shape (n, d).
        """
        x = points[:: len(points) // CHECKED + 1]
        distance, normal = self.distance(x)
        known = np.abs(distance[np.isfinite(distance)])
        h = STEP * max(np.abs(points).max(initial=0.0), known.max(initial=0.0))
        ahead, behind = (
            np.column_stack([self.distance(x + step)[0] for step in side * h * np.eye(x.shape[1])])
            for side in (1, -1)
        )
        slope = (ahead - behind) / (2 * h)
        along = np.einsum("nd,nd->n", normal, slope)
        wrong = (along < 0) | (np.abs(np.linalg.norm(normal, axis=1) - 1) > UNIT)
        turned = np.flatnonzero(wrong)
        words = ""
        if turned.size > 0:
            given, there, place = (
                f"({', '.join(f'{a:.4g}' for a in np.round(vector, 9) + 0.0)})"
                for vector in (normal[turned[0]], slope[turned[0]], x[turned[0]])
            )
            words = f"the normal {given} at {place}, where differences of the distances are {there}"
        return turned.size, int(np.count_nonzero(np.isfinite(along))), words

    @abstractmethod
    def distance(self, points: Array) -> tuple[Array, Array]:
        """Return signed distances, positive outside, (n,), and outward unit normals, (n, d).

        Normals are those of the nearest points; NaN where there is none.
        """

    def ray(self, points: Array, rays: Array) -> Array:
        """Return the distance of the surface along unit vectors, (n,); infinite if they miss it.

        NaN where the distance of the point is.

        From outside a step by the distance leads through no surface (sphere tracing, Hart, The
        Visual Computer 12 (1996) 527), however the body is shaped; near it, and for rays that graze
        it, Newton's method takes over, which from afar would pass by a side of a body that is not
        convex.
        """
        left = np.arange(len(points))
        at = np.zeros(len(points))
        reach = np.zeros(len(points))
        near = np.asarray(np.abs(self.distance(points)[0]) / STEPS)
        found = np.where(np.isnan(near), np.nan, np.inf)
        for step in range(STEPS):
            value, normal = self.distance(points[left] + at[left, None] * rays[left])
            slope = -np.einsum("ni,ni->n", normal, rays[left])
            if step == 0:
                reach = 1e4 * (np.abs(value) + np.linalg.norm(points, axis=1))
            towards = slope > GRAZING
            close = towards & ((value <= near[left]) | (2 * step >= STEPS))
            move = np.where(close, value / np.where(close, slope, 1.0), np.abs(value))
            size = np.maximum(np.abs(points[left]).max(axis=1, initial=0.0), np.abs(at[left]))
            done = close & (np.abs(move) <= 1e-13 * np.maximum(size, np.abs(value)))
            at[left] += move
            found[left[done]] = at[left[done]]
            # A ray that is outside and moves away for good is lost.
            gone = ~done & ~(np.abs(at[left]) <= reach[left])
            left = left[~done & ~gone]
            if left.size == 0:
                break
        return found

    def measure(self, points: Array, body_normal: Array) -> tuple[Array, Array]:
        """Return contact directions and gaps."""
        if self.direction == "foundation":
            distance, normal = self.distance(points)
            return -normal, distance
        rays = body_normal
        if self.direction == "axis":
            axis = np.asarray(self.along) / np.linalg.norm(self.along)
            rays = np.broadcast_to(axis, points.shape).copy()
        return rays, self.ray(points, rays)


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
    def of(value: Static) -> GapFunction:
        """Return the gap that is given as `contact.model.fields.field` takes it.

        Parameters
        ----------
        value
            The gap (length), as of `Contact`: a number, a function of x of shape (3, n), a scalar
            `ufl.core.expr.Expr` or `dolfinx.fem.Function`, or an object with ufl(x) and
            numpy(points).

        Raises
        ------
        InputError
            If it is nothing of these.
        """
        if isinstance(value, float) and np.isinf(value):  # which is no value of a field
            return GapFunction(lambda points: np.full(len(points), value))
        try:
            return GapFunction(static(given_field(value)).numpy)
        except InputError as error:
            raise error.within("gap: ") from None

    direction = "body"
    is_shape = False

    def measure(self, points: Array, body_normal: Array) -> tuple[Array, Array]:
        """Return the body's normals and the gap at the points."""
        return body_normal, np.broadcast_to(self.gap(points), points.shape[:1]).astype(float)


def measured(
    obstacle: Obstacle, points: Array, normal: Array, comm: MPI.Intracomm, key: str
) -> tuple[Array, Array]:
    """Return contact directions, (n, d), and gaps, (n,), or an error on all ranks. Collective."""
    label, gap_shape = f"{key}.{'foundation' if obstacle.is_shape else 'gap'}", points.shape[:1]
    shape = obstacle if isinstance(obstacle, Shape) else None
    with on_all_ranks(comm):
        try:
            if shape is not None:
                shape.check(points.shape[1])
            with naming(label):
                direction, gap = obstacle.measure(points, normal)
                # NaN is refused by those who know whether the value is needed.
                accepted = "a direction and a gap for each of the points"
                found = real(direction, points.shape, accepted), real(gap, gap_shape, accepted)
                votes = (0, 0, "") if shape is None else shape.turned_normals(points)
        except InputError as error:
            own = error.words.startswith(label)
            raise error.within("" if own else f"{label}: ") from error.__cause__
    # At single points, at edges or where the distance is an approximation, the slope may be off.
    turned, known, words = zip(*comm.allgather(votes), strict=True)
    if 2 * sum(turned) > sum(known):
        raise InputError(
            f"{label}: {type(obstacle).__name__}: distance: {next(filter(None, words))}; accepted: "
            "unit normals out of the foundation, the slope of the signed distance",
            "shape-normals",
        )
    return found


@described()
class Plane(Shape):
    """A half space: the foundation lies below the plane through `point`."""

    point: Vector
    """A point of the plane."""
    normal: Direction
    """Normal towards the body, of any length."""
    shape: Annotated[Literal["plane"], NAME] = field(default="plane", kw_only=True)

    def distance(self, points: Array) -> tuple[Array, Array]:
        """Return distances and normals."""
        normal = np.asarray(self.normal) / np.linalg.norm(self.normal)
        distance = (points - np.asarray(self.point)) @ normal
        return distance, np.broadcast_to(normal, points.shape).copy()


@described()
class Sphere(Shape):
    """A rigid ball (`inside` false), or the outside of a ball that holds the body (true)."""

    centre: Vector
    """Centre."""
    radius: Positive
    """Radius."""
    inside: Switch = False
    """Whether the body lies inside the sphere."""
    shape: Annotated[Literal["sphere"], NAME] = field(default="sphere", kw_only=True)

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

        Given places along the axis, from the origin of the shape on, and distances from it, (n,).
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


@described()
class Cylinder(AboutAxis):
    """A rigid cylinder without ends (`inside` false), or the bore that holds the body (true).

    In 2-D the axis lies in the plane: a strip, or about the axis of a body of revolution a shaft.
    """

    point: Vector
    """A point of its axis."""
    axis: Direction
    """Its axis, of any length and either sense."""
    radius: Positive
    """Radius."""
    inside: Switch = False
    """Whether the body lies in the bore."""
    shape: Annotated[Literal["cylinder"], NAME] = field(default="cylinder", kw_only=True)

    def profile(self, along: Array, radius: Array) -> tuple[Array, Array, Array]:
        """Return distances and normals; NaN on the axis itself."""
        inward = -1.0 if self.inside else 1.0
        known = np.where(radius > 1e-12 * self.radius, inward, np.nan)
        return inward * (radius - self.radius), 0.0 * known, known


@described()
class Cone(AboutAxis):
    """A rigid cone without end; in 2-D a wedge."""

    apex: Vector
    """Its tip."""
    axis: Direction
    """From the tip into the cone, of any length."""
    half_angle: Annotated[
        float, Gt(0), Lt(90), Accepted("an angle between 0 and 90 degrees, both excluded")
    ]
    """Between the axis and the side (degrees)."""
    shape: Annotated[Literal["cone"], NAME] = field(default="cone", kw_only=True)

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


@described()
class Paraboloid(AboutAxis):
    """A rigid paraboloid, h >= r^2/(2 R) at the height h and the distance r; in 2-D a parabola."""

    apex: Vector
    """Its tip."""
    axis: Direction
    """From the tip into the paraboloid, of any length."""
    radius: Positive
    """Radius of curvature R at the tip."""
    shape: Annotated[Literal["paraboloid"], NAME] = field(default="paraboloid", kw_only=True)

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


@described()
class Punch(AboutAxis):
    """A rigid cylinder with a flat face; in 2-D a rectangle."""

    centre: Vector
    """Centre of the face."""
    axis: Direction
    """From the face into the punch, of any length."""
    radius: Positive
    """Radius of the punch."""
    edge_radius: NonNegative = 0.0
    """Radius by which its edge is rounded, at most that of the punch; 0: sharp."""
    shape: Annotated[Literal["punch"], NAME] = field(default="punch", kw_only=True)

    def __post_init__(self) -> None:
        """Refuse an edge that is rounder than the punch."""
        if self.edge_radius > self.radius:
            raise fault(
                "edge_radius", self.edge_radius, f"a number from 0 to radius = {self.radius:g}"
            )

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
LEVEL_STEP = EPS ** (1 / 3)


@described()
class Level(Shape):
    """A rigid body where a function is negative: a formula, or one of points of shape (n, d)."""

    function: Annotated[FormulaOrFunction, Field(alias="distance")]
    """Signed distance, positive outside. Where its slope is not 1 it is divided by that, which
    is exact on the surface, and nearly so close to it."""
    shape: Annotated[Literal["distance"], NAME] = field(default="distance", kw_only=True)

    def distance(self, points: Array) -> tuple[Array, Array]:
        """Return distances and normals; NaN where the function has no slope."""
        h = LEVEL_STEP * np.maximum(np.abs(points).max(axis=1, initial=0.0), 1e-3)[:, None]
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
                found = self.function.values(asked)[:count]
            except InputError:  # ranks ask at points of their own
                return np.full(count, np.nan)
            return np.where(np.isfinite(found), found, np.nan)
        words = f"one number for each of the points, an array of shape {asked.shape}"
        assert callable(self.function)
        return real(self.function(asked), asked.shape[:1], words)[:count]
