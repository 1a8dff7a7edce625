"""Cameras of figures in 3-D: parallel projections, and images of scenes by pyvista."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista
from matplotlib.axes import Axes

from contact.plot.run import Run
from contact.typing import Array

logger = logging.getLogger("contact.plots")

#: Cosine from which on a normal counts as that of a coordinate plane.
SNAPPED = 0.966


@dataclass(frozen=True)
class Camera:
    """A parallel projection.

    Attributes
    ----------
    right, up
        Unit vectors of the picture, shape (3,).
    low, high
        Corners of the picture along these, shape (2,).
    depth
        Where the scene is, along the direction to the eye.
    """

    right: Array
    up: Array
    low: Array
    high: Array
    depth: float

    @property
    def view(self) -> Array:
        """Direction from the scene to the eye, shape (3,)."""
        return np.asarray(np.cross(self.right, self.up), dtype=float)

    def flat(self, vectors: Array) -> Array:
        """Return points or vectors in the picture, shape (n, 2)."""
        return np.asarray(vectors @ np.array([self.right, self.up]).T)

    @property
    def extent(self) -> tuple[float, ...]:
        """Left, right, lower and upper end of the picture."""
        return (*np.array([self.low, self.high]).T.ravel(),)

    @staticmethod
    def of(view: Array, points: Array, margin: float = 0.04) -> Camera:
        """Return the camera that sees points, shape (n, 3), from a direction, z upwards."""
        view = view / np.linalg.norm(view)
        above = np.eye(3)[2 if abs(view[2]) < SNAPPED else 1]
        right = np.cross(above, view) / np.linalg.norm(np.cross(above, view))
        return Camera.along(right, np.cross(view, right), points, margin)

    @staticmethod
    def along(right: Array, up: Array, points: Array, margin: float) -> Camera:
        """Return the camera with these axes that sees points."""
        flat = points @ np.array([right, up]).T
        low, high = flat.min(axis=0), flat.max(axis=0)
        room = margin * float((high - low).max())
        middle = (points.min(axis=0) + points.max(axis=0)) / 2
        return Camera(right, up, low - room, high + room, float(middle @ np.cross(right, up)))

    def aim(self, plotter: Any) -> None:
        """Turn the camera of a plotter."""
        middle = (self.low + self.high) / 2
        focus = middle @ np.array([self.right, self.up]) + self.depth * self.view
        far = float(np.linalg.norm(plotter.bounds)) + 1.0
        plotter.enable_parallel_projection()
        plotter.camera.focal_point, plotter.camera.position = focus, focus + far * self.view
        plotter.camera.up, plotter.camera.parallel_scale = self.up, (self.high - self.low)[1] / 2
        plotter.renderer.ResetCameraClippingRange()


def rendered(
    add: Callable[[Any], None], cameras: Sequence[Camera], pixels: int = 1200, ground: str = "white"
) -> list[Array]:
    """Return images of a scene, with so many pixels on the longer side; none without a display.

    The scene is added to a ``pyvista.Plotter``, and seen by each camera.
    """
    if not os.environ.get("DISPLAY") and pyvista.vtk_version_info < (9, 4):
        try:
            pyvista.start_xvfb()
        except OSError:
            logger.warning("nothing is drawn in 3-D: VTK before 9.4 needs a display or Xvfb")
            return []
    plotter = pyvista.Plotter(off_screen=True)
    plotter.set_background(ground)
    add(plotter)
    found = []
    for camera in cameras:
        size = camera.high - camera.low
        plotter.window_size = [max(int(n), 2) for n in np.ceil(pixels * size / size.max())]
        camera.aim(plotter)
        found.append(np.asarray(plotter.screenshot(return_img=True)))
    plotter.close()
    return found


def triad(ax: Axes, camera: Camera) -> None:
    """Draw the directions of the coordinates into a corner."""
    inset = ax.inset_axes((-0.04, -0.1, 0.16, 0.16))
    inset.set(xlim=(-1.6, 1.6), ylim=(-1.6, 1.6), aspect="equal")
    inset.axis("off")
    for name, step in zip("xyz", camera.flat(np.eye(3)), strict=True):
        if np.linalg.norm(step) > 0.15:
            inset.plot(*np.transpose([[0, 0], step]), "k", lw=0.8)
            place = step + 0.45 * step / np.linalg.norm(step)
            inset.text(*place, f"${name}$", ha="center", va="center", fontsize=7)


def scale_bar(ax: Axes, camera: Camera, run: Run) -> None:
    """Draw the length of a round number, where axes have no coordinates."""
    wide = float((camera.high - camera.low)[0]) / 3
    power = 10.0 ** np.floor(np.log10(wide))
    length = power * max(k for k in (1, 2, 5) if k * power <= wide)
    ax.plot([0.05, 0.05 + length / (3 * wide)], [-0.05] * 2, "k", lw=2, transform=ax.transAxes,
            clip_on=False)  # fmt: skip
    words = f"{length:g} {run.units.length or ''}".rstrip()
    ax.text(0.05, -0.08, words, transform=ax.transAxes, va="top", fontsize=7)
