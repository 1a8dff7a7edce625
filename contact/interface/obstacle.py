"""Rigid foundations: a plane, a circle or sphere, or a gap given as a function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from contact.typing import Array


class Obstacle(Protocol):
    """A rigid obstacle, seen from the contact nodes.

    A new shape is a class with these four.
    """

    @property
    def direction(self) -> str:
        """Whose normal the contact direction is: "foundation" or "body"."""

    @property
    def is_shape(self) -> bool:
        """Whether the gaps are those of a body in space, which the mesh must not cut at rest.

        Gaps that are given as such are what was asked for.
        """

    def chord_depth(self, length: float) -> float:
        """Return how deep straight facets reach into the obstacle that their corners touch.

        Parameters
        ----------
        length
            Longest edge of the facets.
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


@dataclass(frozen=True)
class GapFunction:
    """A gap given along the body's own normal.

    Parameters
    ----------
    gap
        Function of points of shape (n, d) that returns the gap, shape (n,) (length).
    """

    gap: Callable[[Array], Array]

    direction = "body"
    is_shape = False

    def chord_depth(self, length: float) -> float:
        """Return 0: given gaps are not those of a shape."""
        return 0.0

    def measure(self, points: Array, body_normal: Array) -> tuple[Array, Array]:
        """Return the body's normals and the gap at the points."""
        return body_normal, np.broadcast_to(self.gap(points), points.shape[:1]).astype(float)


@dataclass(frozen=True)
class Plane:
    """A half space: the foundation lies below the plane through `point`.

    Parameters
    ----------
    point, normal
        A point of the plane and its normal towards the body, length d.
    direction
        "foundation": contact along the plane's normal (default); "body": along the body's.
    """

    point: tuple[float, ...]
    normal: tuple[float, ...]
    direction: str = "foundation"

    is_shape = True

    def chord_depth(self, length: float) -> float:
        """Return 0: chords of a plane lie in it."""
        return 0.0

    def measure(self, points: Array, body_normal: Array) -> tuple[Array, Array]:
        """Return contact directions and gaps."""
        normal = np.asarray(self.normal) / np.linalg.norm(self.normal)
        distance = (points - np.asarray(self.point)) @ normal
        if self.direction == "foundation":
            return np.broadcast_to(-normal, points.shape).copy(), distance
        return body_normal, _along_ray(distance, -body_normal @ normal)


@dataclass(frozen=True)
class Sphere:
    """A rigid ball (`inside` false), or the outside of a ball that holds the body (true).

    Parameters
    ----------
    centre, radius
        Centre, length d, and radius > 0 (a circle in 2-D).
    inside
        Whether the body lies inside the sphere.
    direction
        "foundation": contact along the sphere's radius (default); "body": along the body's
        normal.
    """

    centre: tuple[float, ...]
    radius: float
    inside: bool = False
    direction: str = "foundation"

    is_shape = True

    def measure(self, points: Array, body_normal: Array) -> tuple[Array, Array]:
        """Return contact directions and gaps."""
        offset = points - np.asarray(self.centre)
        distance = np.linalg.norm(offset, axis=1)
        outward = 1.0 if self.inside else -1.0
        if self.direction == "foundation":
            # The centre itself has none: NaN, which `find_nodes` refuses on all ranks together.
            known = distance > 1e-12 * self.radius
            radial = offset / np.where(known, distance, np.nan)[:, None]
            return outward * radial, outward * (self.radius - distance)
        # The ray x + t nu meets the sphere where |offset + t nu| = radius.
        along = np.einsum("ni,ni->n", offset, body_normal)
        root = along**2 + self.radius**2 - distance**2
        gap = -along + outward * np.sqrt(np.maximum(root, 0.0))
        # A ray that misses the ball, or leads away from it, never touches it.
        away = (along > 0) & (distance > self.radius) & (not self.inside)
        return body_normal, np.where((root >= 0) & ~away, gap, np.inf)

    def chord_depth(self, length: float) -> float:
        """Return how deep straight facets reach into a ball that their corners touch.

        Parameters
        ----------
        length
            Longest edge of the facets.
        """
        if self.inside:
            return 0.0
        # A facet lies in a ball of this radius (Jung's theorem). Facets of a curve that are
        # longer than its radius do not represent it.
        dim = len(self.centre)
        sine = min(length / self.radius * np.sqrt((dim - 1) / (2 * dim)), 0.5)
        return float(self.radius * sine**2 / (1 + np.sqrt(1 - sine**2)))


def _along_ray(distance: Array, cosine: Array) -> Array:
    """Return the distance along a ray; infinite where it does not lead to the foundation."""
    facing = cosine > 1e-6
    return np.where(facing, distance / np.where(facing, cosine, 1.0), np.inf)
