"""Obstacles as the contact nodes see them: the base class of shapes, and given gaps."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, ClassVar, Protocol

import numpy as np
from mpi4py import MPI

from contact.arguments import LEAST, OFF, SHARE, SMOOTH, STEP, expect, naming, real
from contact.errors import InputError
from contact.model.fields import Static, static
from contact.ranks import on_all_ranks
from contact.settings import Internal
from contact.typing import Array

#: Cosine of the steepest angle at which a ray still leads to a surface.
GRAZING = 1e-6

#: Most steps along a ray.
STEPS = 200

#: Most points at which normals are checked, and steps of Newton's method from these to the surface.
CHECKED, TOWARDS = 50, 5


class Obstacle(Protocol):
    """A rigid obstacle, seen from the contact nodes.

    A new shape is a class with these three.
    """

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

        Parameters
        ----------
        points
            Node coordinates, shape (n, d).
        body_normal
            Outward unit normals of the body, shape (n, d).
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

    direction: Annotated[str, Internal()] = "foundation"
    along: Annotated[tuple[float, ...], Internal()] = ()

    is_shape = True

    #: Names of attributes that are points or directions; dimension of space, if only one.
    vectors: ClassVar[tuple[str, ...]] = ("point", "centre", "apex", "normal", "axis")
    only: ClassVar[int | None] = None

    def __post_init__(self) -> None:
        """Refuse a radius that is none, and directions that are not known."""
        name, radius = type(self).__name__, getattr(self, "radius", 1.0)
        number = isinstance(radius, int | float | np.number)
        expect(f"{name}: radius", radius, "a length > 0", number and radius > 0)
        directions = ("foundation", "body", "axis")
        accepted = ", ".join(f'"{direction}"' for direction in directions)
        expect(f"{name}: direction", self.direction, accepted, self.direction in directions)

    def check(self, dim: int) -> None:
        """Refuse a shape of another dimension than space, and directions without length.

        Raises
        ------
        InputError
            If it is one.
        """
        name = type(self).__name__
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
    def check_normals(self, points: Array) -> None:
        """Refuse normals that are not the slopes of the distances, by differences.

        They are compared on the surface that some of the points lead to, for elsewhere a distance
        may be an approximation, as that of a `Level` is; but not at its edges.

        Parameters
        ----------
        points
            Places from which it is seen, shape (n, d).

        Raises
        ------
        InputError
            If they are off.
        """
        x = points[:: len(points) // CHECKED + 1]
        gaps = np.nan_to_num(self.distance(x)[0], posinf=0.0, neginf=0.0)
        h = STEP * max(np.ptp(points, axis=0).max(), np.abs(gaps).max()) if len(x) else 0.0
        if h == 0:
            return
        for step in range(TOWARDS + 1):
            value, normal = self.distance(x)
            ahead, behind = (
                np.column_stack([self.distance(x + to)[0] for to in side * h * np.eye(x.shape[1])])
                for side in (1, -1)
            )
            slope = (ahead - behind) / (2 * h)
            if step < TOWARDS:
                size = (slope**2).sum(axis=1, keepdims=True)
                x = x - np.nan_to_num(value[:, None] * slope / np.where(size > 0.5, size, np.inf))
        bend = np.abs(ahead + behind - 2 * value[:, None]).max(axis=1) / h
        smooth = (np.abs(value) <= h) & (bend <= SMOOTH) & np.isfinite(normal).all(axis=1)
        off = np.where(smooth, np.linalg.norm(normal - slope, axis=1), 0.0)
        if np.count_nonzero(off > OFF) >= max(LEAST, SHARE * np.count_nonzero(smooth)):
            worst = off.argmax()
            given, there, place = (
                f"({', '.join(f'{a:.4g}' for a in np.round(vector, 9) + 0.0)})"
                for vector in (normal[worst], slope[worst], x[worst])
            )
            raise InputError(
                f"{type(self).__name__}: distance: the normal {given} at {place}, where "
                f"differences of the distances are {there}; accepted: unit normals out of the "
                "foundation, the slope of the signed distance",
                "shape-normals",
            )

    @abstractmethod
    def distance(self, points: Array) -> tuple[Array, Array]:
        """Return signed distances, positive outside, (n,), and outward unit normals, (n, d).

        Normals are those of the nearest points; NaN where there is none.
        """

    def ray(self, points: Array, rays: Array) -> Array:
        """Return how far the surface is along unit vectors, (n,). Infinite where it is never met.

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
        return GapFunction(static(value, "gap").numpy)

    direction = "body"
    is_shape = False

    def measure(self, points: Array, body_normal: Array) -> tuple[Array, Array]:
        """Return the body's normals and the gap at the points."""
        return body_normal, np.broadcast_to(self.gap(points), points.shape[:1]).astype(float)


def measured(
    obstacle: Obstacle, points: Array, normal: Array, comm: MPI.Intracomm, key: str
) -> tuple[Array, Array]:
    """Return the contact directions, (n, d), and gaps, (n,), at points of a body. Collective.

    Parameters
    ----------
    obstacle, points, normal
        As in `Obstacle.measure`.
    comm, key
        The ranks that ask together, and the name of the contact in messages.

    Raises
    ------
    InputError
        On all ranks, if the obstacle is none in this space, or a function of it fails on one.
    """
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
                if shape is not None:
                    shape.check_normals(points)
        except InputError as error:
            own = error.words.startswith(label)
            raise error.within("" if own else f"{label}: ") from error.__cause__
    return found
