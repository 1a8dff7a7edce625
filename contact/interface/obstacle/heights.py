"""A rigid surface by its heights over a line or a plane, as profilometers measure it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from contact.arguments import expect
from contact.interface.obstacle.protocol import Shape
from contact.tolerances import NEGLIGIBLE
from contact.typing import Array


@dataclass(frozen=True, eq=False)
class Heights(Shape):
    """A body below, or above, heights along the last axis: cubic splines through given points.

    Beyond the outermost points the surface goes on level, and a hole between points is bridged:
    contact there is told (`output.foundations`). Distances are those along the last axis times the
    cosine of the slope: exact on the surface, and nearly so close to it; along an axis or the
    body's normals gaps are exact.

    Parameters
    ----------
    places
        Coordinates of the points along the other axes, ascending: shape (n,) in the plane, and
        (n,), (m,) in 3-D.
    heights
        Shape (n,), or (n, m).
    above
        Whether the rigid body lies above the heights, not below.
    """

    places: tuple[Array, ...]
    heights: Array
    above: bool = False

    def __post_init__(self) -> None:
        """Refuse heights that are no grid."""
        super().__post_init__()
        sizes, words = tuple(map(np.size, self.places)), "two places or more a direction"
        expect("Heights: places", sizes, words, len(sizes) in (1, 2) and min(sizes) > 1)
        rising = all(np.all(np.diff(axis) > 0) for axis in self.places)
        expect("Heights: places", "others", "ascending numbers", rising)
        shape = np.shape(self.heights)
        expect("Heights: heights", f"the shape {shape}", f"{sizes}", shape == sizes)
        known = bool(np.isfinite(self.heights).all())
        expect("Heights: heights", "some that are no numbers", "a number at each place", known)

    @property
    def only(self) -> int:  # type: ignore[override]
        """The dimension of space."""
        return len(self.places) + 1

    @cached_property
    def _spline(self) -> Any:
        from scipy import interpolate

        degrees = [min(3, axis.size - 1) for axis in self.places]  # cubic, of few points less
        if len(self.places) == 1:
            return interpolate.make_interp_spline(*self.places, self.heights, degrees[0])
        kx, ky = degrees
        return interpolate.RectBivariateSpline(*self.places, self.heights, kx=kx, ky=ky)

    def _surface(self, points: Array) -> tuple[Array, Array]:
        """Return heights, (n,), and their slopes, (n, d - 1), below points."""
        across = points[:, :-1].T
        least, most = (np.array([axis[end] for axis in self.places]) for end in (0, -1))
        inside = np.clip(across, least[:, None], most[:, None])
        beyond = inside != across
        if len(self.places) == 1:
            height = self._spline(inside[0])
            slopes = [self._spline(inside[0], 1)]
        else:
            height = self._spline.ev(*inside)
            slopes = [self._spline.ev(*inside, dx=1), self._spline.ev(*inside, dy=1)]
        return height, np.where(beyond, 0.0, slopes).T

    @cached_property
    def gaps(self) -> tuple[Array, ...]:
        """Intervals along each axis that have no heights, shape (n, 2): infinite ones at its ends.

        Within it these are longer than both beside them together. They begin and end half a spacing
        beyond the last place, as an image has its places in the middle of its pixels.
        """
        found = []
        for axis in map(np.asarray, self.places):
            steps = np.diff(axis)
            half = (0.5 + NEGLIGIBLE) * steps
            wide = 1 + np.flatnonzero(steps[1:-1] > 2 * (half[:-2] + half[2:]))
            begin = np.append(-np.inf, axis[wide] + half[wide - 1])
            end = np.append(axis[0] - half[0], axis[wide + 1] - half[wide + 1])
            last = [axis[-1] + half[-1], np.inf]
            found.append(np.vstack([np.column_stack([begin, end]), last]))
        return tuple(found)

    def unknown(self, points: Array) -> NDArray[np.bool_]:
        """Tell which points lie in one of the `gaps` of an axis, shape (n,)."""
        found = np.zeros(len(points), dtype=bool)
        for k, gaps in enumerate(self.gaps):
            at = points[:, k, None]
            found |= ((at > gaps[:, 0]) & (at < gaps[:, 1])).any(axis=1)
        return found

    def distance(self, points: Array) -> tuple[Array, Array]:
        """Return distances and normals."""
        height, slope = self._surface(points)
        normal = np.column_stack([-slope, np.ones(len(points))])
        length = np.linalg.norm(normal, axis=1)
        side = -1.0 if self.above else 1.0
        return side * (points[:, -1] - height) / length, side * normal / length[:, None]
