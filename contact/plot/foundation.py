"""Rigid foundations in pictures of deformed bodies, and how far displacements are magnified.

A foundation is known by the gaps and directions of the contact nodes, in the files of a run.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyvista
from matplotlib.axes import Axes

from contact.model.obstacle import Shape
from contact.plot.contact import ends
from contact.plot.run import Run, linear, polygons
from contact.plot.style import BLUE, SKY
from contact.results.contact_nodes import Table
from contact.typing import Array

#: Overlap of bodies, over the diameter, that is not seen.
UNSEEN = 0.002
#: Largest height of a magnified profile, over the diameter.
SHALLOW = 0.1
#: Thickness of the hatching, and room for foundations beyond their least gap, over the diameter.
HATCHED, BEYOND = 0.03, 0.15
#: Room about the contact parts in which rigid shapes are drawn, over the size of these.
AROUND = 0.3
#: Points along each axis at which distances from rigid shapes are taken.
FINE = 60
#: Least width of a curved part over its length.
CURVED = 1e-6


@dataclass(frozen=True)
class Scaling:
    """The distances h + (s - 1) f at which a foundation is drawn beside displacements times s.

    With a constant f it keeps its shape, and is shifted to where the body first touches it. With
    f = h its profile is magnified too: of straight parts alone, for no magnified gap fits a plane
    to a magnified round body.
    """

    approach: Array  #: displacements of the body towards it, shape (n,)
    distance: Array  #: h, shape (n,)
    more: Array  #: f, shape (n,)
    largest: float  #: the scale up to which bodies do not overlap it visibly, and it is shallow


def scalings(run: Run, table: Table, box: Array | None) -> list[Scaling]:
    """Return how a foundation, or other body, may be drawn in a box, (2, d), the best first."""
    points = np.column_stack([table[axis] for axis in "xyz"[: len(run.axes)]])
    seen, diameter = np.ones(len(points), dtype=bool), run.diameter
    if box is not None:
        seen = np.all((points >= box[0]) & (points <= box[1]), axis=1)
        diameter = float(np.ptp(box, axis=0).max())
    approach, distance = table["u_n"], np.maximum(table["gap"], 0.0)
    profiles = [np.zeros_like(distance)]
    if np.all(table["rigid"]):
        approach, distance = approach + table["moved"], table["gap"] + table["moved"]
        touching = table["status"] != "open"
        nearest = distance[touching if touching.any() else slice(None)].min()
        profiles = [np.full_like(distance, nearest)]
        sizes = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
        if run.plane and sizes[-1] <= CURVED * sizes[0]:
            profiles.append(distance)
    found = []
    for more in profiles:
        closing = seen & (approach > more)
        room = (distance + UNSEEN * diameter - more)[closing] / (approach - more)[closing]
        height = float(np.ptp(more[seen])) if seen.any() else 0.0
        shallow = SHALLOW * diameter / height if height > 0 else np.inf
        largest = min(shallow, float(room.min(initial=np.inf)))
        found.append(Scaling(approach, distance, more, largest))
    return found


def magnification(run: Run, box: Array | None = None) -> float:
    """Return 1, 2 or 5 times a power of ten that makes displacements about 5 % of a diameter.

    At most as much as leaves bodies without overlap. Visible displacements stay as they are.
    """
    diameter = run.diameter if box is None else float(np.ptp(box, axis=0).max())
    largest = float(np.linalg.norm(run.body.point_data["displacement"], axis=1).max())
    if not 0 < largest < 0.02 * diameter:
        return 1.0
    wanted = 0.05 * diameter / largest
    for table in run.contacts:
        wanted = min(wanted, max(each.largest for each in scalings(run, table, box)))
    if wanted < 1:
        return 1.0
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * max(k for k in (1, 2, 5) if k * power <= wanted))


@dataclass(frozen=True)
class Profile:
    """A foundation as it is drawn beside a deformed body in 2-D."""

    points: Array  #: those that face the nodes of Gamma_3, shape (n, 2)
    normal: Array  #: directions from the nodes to them, shape (n, 2)
    gap: Array  #: their distances from the deformed body, shape (n,)

    def reach(self, box: Array) -> Array:
        """Return a box, shape (2, 2), that shows the foundation in front of the part in it too."""
        size = float(np.ptp(box, axis=0).max())
        body, room = self.points - self.gap[:, None] * self.normal, BEYOND * size
        least, most = box[0] - room * abs(self.normal), box[1] + room * abs(self.normal)
        seen = np.all((body >= least) & (body <= most), axis=1)
        if not seen.any():
            return box
        room += max(float(self.gap[seen].min()), 0.0)
        points, normal = self.points[seen], self.normal[seen]
        every = np.concatenate([points, points + HATCHED * size * normal])
        every = np.concatenate([np.clip(every, box[0] - room, box[1] + room), box])
        return np.array([every.min(axis=0), every.max(axis=0)])

    def draw(self, ax: Axes, thick: float) -> None:
        """Draw it with its hatching of some thickness."""
        ax.plot(*self.points.T, color="black", lw=0.5)
        band = np.concatenate([self.points, (self.points + thick * self.normal)[::-1]])
        ax.fill(*band.T, facecolor="none", edgecolor=BLUE, hatch="////", lw=0)


def profiles(run: Run, scale: float, places: Array, box: Array | None) -> list[Profile]:
    """Return the foundations of a run in 2-D that are near the points of the deformed body."""
    found = []
    for table in run.contacts:
        if not np.all(table["rigid"]):
            continue
        ways = scalings(run, table, box)
        way = next((each for each in ways if each.largest >= scale), ways[0])
        drawn = way.distance + (scale - 1) * way.more
        gap = drawn - scale * way.approach
        points = np.column_stack([table["x"], table["y"]])
        normal = np.column_stack([table["nu_x"], table["nu_y"]])
        across = normal.mean(axis=0) / (np.linalg.norm(normal.mean(axis=0)) or 1.0)
        if gap.min() > np.ptp(places @ across) > 0:  # the body would be a dot beside it
            continue
        # Held nodes beside the first and the last have their distances.
        first, last = ends(table, run.constrained)
        points = np.concatenate([first[None], points, last[None]])
        normal, drawn, gap = (np.concatenate([v[:1], v, v[-1:]]) for v in (normal, drawn, gap))
        found.append(Profile(points + drawn[:, None] * normal, normal, gap))
    return found


def foundation(run: Run, scale: float) -> Any:
    """Return rigid shapes in 3-D: known ones around the contact, of others facets moved by gaps."""
    skin = linear(run.surface)
    row, faces = np.asarray(skin["row"]), skin.regular_faces
    distance, gap = np.full((2, len(run.table["gap"])), np.nan)
    body = (skin.points + scale * skin["displacement"]).astype(float)
    known: list[Callable[[Array], Array]] = []
    placed = {
        entry: run.motions.get(entry, np.zeros(6))
        for entry in run.shapes
        if entry in run.motions or entry not in run.moving
    }
    drawn: set[int] = set()
    for table in run.contacts:
        entry = table["entry"][0]
        if not np.all(table["rigid"]):
            continue
        way = scalings(run, table, None)[0]
        more = (scale - 1) * way.more
        if entry in drawn:
            continue
        if entry in placed:
            shape, motion = run.shapes[entry], placed[entry]
            # One shape of several contacts has one surface.
            here = [k for k in placed if run.shapes[k] == shape and np.all(placed[k] == motion)]
            drawn.update(here)
            facets = body[faces[np.isin(skin["entry"], here)[faces].all(axis=1)]].mean(axis=1)
            known.append(_placed(shape, motion, table, more, facets, run.diameter))
        else:
            own = run.table["entry"] == entry
            distance[own] = way.distance + more
            gap[own] = distance[own] - scale * way.approach
    places = skin.points + np.where(row < 0, np.nan, distance[row])[:, None] * skin["normal"]
    found = facing(places[faces], gap[row][faces], run.diameter)
    if known:
        near = body[skin["rigid"] > 0]
        room = AROUND * np.ptp(near, axis=0).max()
        box = np.array([near.min(axis=0) - room, near.max(axis=0) + room])
    for distance_from in known:
        surface = _surface(distance_from, box)
        for other in known:
            if other is not distance_from and surface.n_cells:
                surface["other"] = other(surface.points)
                surface = surface.clip_scalar(scalars="other", value=0.0, invert=False)
        found = found.append_polydata(surface)
    return found


def _placed(
    shape: Shape, motion: Array, table: Table, more: Array, facets: Array, diameter: float
) -> Callable[[Array], Array]:
    """Return the distances from a moved shape that is drawn farther away by `more`, (n,)."""
    points = np.column_stack([table[axis] for axis in "xyz"])
    normal = np.column_stack([table[f"nu_{axis}"] for axis in "xyz"])
    lever = np.hstack([normal, np.cross(points, normal)])
    touching = table["status"] != "open"
    near = touching if touching.any() else slice(None)
    # By a translation, as far as the contact directions determine one.
    farther = np.linalg.lstsq(normal[near], more[near], rcond=1e-3)[0]
    motion = motion + np.concatenate([farther, np.zeros(3)])
    level = float(np.mean(table["moved"][near] + more[near] - lever[near] @ motion))

    def distance(places: Array) -> Array:
        back = places - motion[:3]
        return shape.distance(back - np.cross(motion[3:], back))[0] + level

    # A little behind the facets of the body, which are chords of a curved surface.
    level += float(np.clip(-np.nanmin(distance(facets)), 0.0, 0.01 * diameter))
    level += UNSEEN * diameter
    return distance


def _surface(distance: Callable[[Array], Array], box: Array) -> Any:
    """Return the surface in a box where a distance is 0: on a grid, then on one of that surface."""
    for _ in range(2):
        step = np.ptp(box, axis=0) / (FINE - 1)
        # Beside the round numbers: centres and axes of shapes have no distance.
        grid = pyvista.ImageData(dimensions=3 * [FINE], spacing=step, origin=box[0] + 1e-7 * step)
        grid["distance"] = distance(grid.points)
        found = grid.contour([0.0], scalars="distance", compute_scalars=False)
        if not found.n_points:
            break
        low, high = np.reshape(found.bounds, (3, 2)).T
        box = np.array([np.maximum(low - step, box[0]), np.minimum(high + step, box[1])])
    return found


def facing(corners: Array, gap: Array, diameter: float) -> Any:
    """Return facets by their corners, shape (n, k, 3), NaN for none, but those of large gaps."""
    known = np.isfinite(corners).all(axis=(1, 2)) & np.isfinite(gap).all(axis=1)
    shape = polygons(corners[known])
    if not shape.n_cells:
        return shape
    shape["gap"] = gap[known].ravel()
    room = BEYOND * diameter + max(float(shape["gap"].min()), 0.0)
    return shape.clean().clip_scalar(scalars="gap", value=room)


def add_foundation(plotter: Any, shape: Any) -> None:
    """Add a rigid shape, through which the body is seen, with its outline."""
    lit = {"ambient": 0.5, "diffuse": 0.5, "smooth_shading": True}
    plotter.add_mesh(shape, color=SKY, opacity=0.3, show_scalar_bar=False, **lit)
    plotter.add_silhouette(shape, color=BLUE, line_width=2.0)
    rim = shape.extract_feature_edges(60.0, manifold_edges=False)
    if rim.n_cells:  # none of a ball
        plotter.add_mesh(rim, color=BLUE, line_width=2.0)
