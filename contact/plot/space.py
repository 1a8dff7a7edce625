"""Figures in 3-D by pyvista: the body from where its contact is seen, and close-ups of that."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pyvista
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, Normalize, to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from scipy.spatial import KDTree
from vtkmodules.vtkCommonCore import vtkLogger

from contact import _compat
from contact.plot.foundation import add_foundation, foundation, magnification
from contact.plot.run import Run, linear, polygons
from contact.plot.style import BLUE, NARROW, ORANGE, SKY, ZONES, Look, colour_bar, page_width, sheet
from contact.results.quantity import STATUS
from contact.typing import Array

logger = logging.getLogger("contact.plots")

if not os.environ.get("DISPLAY"):  # VTK would warn of it, and draws all the same
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)

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
    inset = ax.inset_axes((0.0, -0.1, 0.16, 0.16))
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


#: Colours of a body without a field, and of nodes that are no contact nodes.
PLAIN, UNKNOWN = "#DADADA", "#FFFFFF"
#: Direction from which bodies are seen, of those that see the contact alike.
USUAL = np.array([1.0, -1.6, 0.9]) / np.linalg.norm([1.0, -1.6, 0.9])
#: Angles from the mean normal of the contact to the eye (degrees), the best first.
TILTS = 55.0, 25.0
#: Share of the contact zone that is seen at least; bodies that hide more are cut open.
SEEN = 0.3
#: Smallest resultant of the unit normals of a contact zone that has a side, per area.
SIDED = 0.3
#: Room about a contact zone in close-ups, over its size.
ROOM = 0.35
#: Contact zones below this part of the body are marked on it.
SMALL = 0.1
#: Facets up to which the mesh is drawn.
FACETS = 8000


def areas(run: Run, skin: Any) -> Array:
    """Return the area vectors of the triangles of a contact part, out of the body.

    Against a rigid shape the contact direction may point into the body; against another body the
    facets of both may be in one place.
    """
    faces, cells = skin.regular_faces, run.body.cell_centers().points
    a, b, c = np.moveaxis(skin.points[faces], 1, 0)
    across = np.cross(b - a, c - a).astype(float) / 2
    out = (a + b + c) / 3 - cells[KDTree(cells).query((a + b + c) / 3)[1]]
    rigid = skin["rigid"][faces].max(axis=1) > 0
    out = np.where(rigid[:, None], out, np.nansum(skin["normal"][faces], axis=1))
    return np.where(np.einsum("ni,ni->n", across, out) < 0, -1.0, 1.0)[:, None] * across


@dataclass(frozen=True)
class Zone:
    """Where a run is in contact; all of the contact part where it is open.

    Attributes
    ----------
    corners, area
        The triangles that touch, shape (n, 3, 3), and their area vectors, shape (n, 3).
    normal
        The mean normal of a side of it, shape (3,), that of an axis if it is nearly so.
    sides
        1, or -1 too where it is seen from both sides of the normal alone.
    """

    corners: Array
    area: Array
    normal: Array
    sides: tuple[int, ...]

    @property
    def points(self) -> Array:
        """The corners, shape (3 n, 3)."""
        return self.corners.reshape(-1, 3)

    @staticmethod
    def of(run: Run) -> Zone:
        """Return the zone of a run."""
        skin = linear(run.surface)
        faces, area = skin.regular_faces, areas(run, skin)
        touching = (skin["status"] > STATUS["open"])[faces].any(axis=1)
        if not touching.any():
            touching[:] = True
        corners, pressure = skin.points[faces][touching], skin["pressure"][faces][touching]
        area = area[touching]
        size = np.linalg.norm(area, axis=1)
        normal = area.sum(axis=0)
        if np.linalg.norm(normal) < SIDED * size.sum():  # around a shaft, or between two plates
            normal = area[np.argmax(np.nan_to_num(pressure).sum(axis=1))]
        normal = normal / np.linalg.norm(normal)
        if abs(normal).max() > SNAPPED:
            normal = np.where(abs(normal) > SNAPPED, np.sign(normal), 0.0)
        behind = area @ normal < -0.1 * size
        both = size[behind].sum() > 0.02 * size.sum()
        return Zone(np.asarray(corners, dtype=float), area, normal, (1, -1) if both else (1,))


def chosen_view(run: Run, skin: Any, zone: Zone) -> tuple[Array, bool] | None:
    """Return the direction from which a body is seen, and whether it is cut open; None undrawn.

    That from which most of the contact zone is seen, tilted from its mean normal; where bodies
    hide it from all sides, one along which it is cut.
    """
    e1 = np.linalg.svd(zone.normal[None])[2][1]
    e2, turns = np.cross(zone.normal, e1), np.arange(0.0, 2 * np.pi, np.pi / 4)

    def turned(angle: float) -> Array:
        return np.cos(turns + angle)[:, None] * e1 + np.sin(turns + angle)[:, None] * e2

    # Oblique: along an axis of a box two of its edges would be one line.
    ring, oblique, tilts = turned(0.0), turned(np.pi / 8), np.radians(TILTS)
    views = np.concatenate([np.cos(t) * zone.normal + np.sin(t) * oblique for t in tilts])
    size = np.linalg.norm(zone.area, axis=1)[:, None, None]
    lifted = zone.corners + 1e-3 * np.sqrt(size.sum()) * zone.area[:, None] / size

    def add(plotter: Any) -> None:
        plotter.add_mesh(skin, color="black", lighting=False)
        plotter.add_mesh(polygons(lifted), color="white", lighting=False)

    cameras = [Camera.of(view, zone.points) for view in views]
    images = rendered(add, cameras, 100, "black")
    if not images:
        return None
    lit = np.array([(image[..., 0] > 127).mean() for image in images])
    lit = lit * [np.prod(camera.high - camera.low) for camera in cameras]
    shares = lit / np.maximum(zone.area @ views.T, 0.0).sum(axis=0)
    if shares.max() >= SEEN:
        preferred = np.minimum(shares, 0.8) - 0.1 * (np.arange(len(views)) >= len(turns))
        return views[np.argmax(preferred + 0.2 * views @ USUAL)], False
    centre, points = zone.points.mean(axis=0), np.asarray(skin.points)
    removed = ((points - centre) @ ring.T > 0).mean(axis=0)
    return ring[np.argmin(removed - 0.1 * ring @ USUAL)], True


@dataclass(frozen=True)
class Scene:
    """A deformed body in 3-D, as windows and figures show it.

    Attributes
    ----------
    body
        The grid of the deformed body.
    colours
        Arguments of ``add_mesh`` for its colours.
    zone, painted
        The contact zone, and the touching facets of the deformed part, drawn on the body.
    norm
        The range of the pressures on that.
    foundation
        Rigid shapes, drawn translucent.
    """

    body: Any
    colours: dict[str, Any]
    zone: Zone
    painted: Any = None
    norm: Normalize = field(default_factory=Normalize)
    foundation: Any = None

    @staticmethod
    def of(run: Run) -> Scene:
        """Return a plain body with its contact pressure, whose range is that of all nodes."""
        scale = magnification(run)
        part = linear(run.surface.warp_by_vector("displacement", factor=scale))
        touched = (part["status"] > STATUS["open"])[part.regular_faces].any(axis=1)
        painted = pyvista.PolyData.from_regular_faces(part.points, part.regular_faces[touched])
        painted["pressure"] = np.nan_to_num(part["pressure"])
        body = run.body.warp_by_vector("displacement", factor=scale)
        norm = Normalize(0.0, float(np.max(run.table["pressure"], initial=0.0)) or 1.0)
        painted = painted if touched.any() else None
        shapes = foundation(run, scale)
        return Scene(body, {"color": PLAIN}, Zone.of(run), painted, norm, shapes)

    @property
    def shades(self) -> dict[str, Any]:
        """Arguments of ``add_mesh`` for the pressure."""
        ends = [self.norm.vmin, self.norm.vmax]
        return {"scalars": "pressure", "cmap": "viridis", "clim": ends, "lighting": False}

    def add(self, plotter: Any, view: Array | None = None, cut: bool = False) -> None:
        """Add the body to a plotter, cut open across the direction to the eye."""
        grid = self.body
        if cut:
            grid = grid.clip(normal=view, origin=self.zone.points.mean(axis=0))
        skin = _compat.surface(grid)
        faint = {"show_edges": skin.n_cells < FACETS, "line_width": 0.5, "edge_opacity": 0.2}
        lit = {"ambient": 0.6, "diffuse": 0.45, "smooth_shading": True, "split_sharp_edges": True}
        lines = {"manifold_edges": False, "non_manifold_edges": False}
        edges = skin.extract_feature_edges(40.0, **lines)
        if edges.n_cells:
            plotter.add_mesh(edges, color="black", line_width=2.5)
        if self.foundation is not None and self.foundation.n_cells:
            add_foundation(plotter, self.foundation)
        # The bar of colours is that of the mesh that is added last.
        plotter.add_mesh(skin, show_scalar_bar=False, **lit, **faint, **self.colours)
        if self.painted is not None:
            size = float(np.linalg.norm(np.ptp(skin.points, axis=0)))
            away = self.zone.normal if view is None else view
            lifted = self.painted.translate(2e-3 * size * away)
            plotter.add_mesh(lifted, show_scalar_bar=False, **self.shades)

    def window(self, label: str) -> Any:
        """Return a plotter that shows the scene in a window to turn it in, or in a notebook."""
        plotter = pyvista.Plotter(title="contact")
        plotter.set_background("white")
        self.add(plotter)
        plotter.add_scalar_bar(label, color="black", n_labels=5)
        plotter.add_axes(color="black")
        Camera.of(self.zone.normal + USUAL, np.asarray(self.body.points)).aim(plotter)
        return plotter


def show_body(ax: Axes, run: Run, scene: Scene, view: Any, box: Array) -> Camera | None:
    """Draw the scene in a box into axes, from a direction or where contact is seen."""
    given = (np.asarray(view, dtype=float) / np.linalg.norm(view), False) if view else None
    found = given or chosen_view(run, linear(run.body), scene.zone)
    if found is None:
        return None
    towards, cut = found
    eye = towards + 0.35 * scene.zone.normal if cut else towards
    corners = np.array([box[list(which), range(3)] for which in np.ndindex(2, 2, 2)])
    shape = scene.foundation
    points = corners if shape is None else np.concatenate([corners, shape.points])
    camera = Camera.of(eye, points)
    images = rendered(lambda plotter: scene.add(plotter, towards, cut), [camera])
    if not images:
        return None
    ax.imshow(images[0], extent=camera.extent, interpolation="antialiased")
    ax.axis("off")
    triad(ax, camera)
    flat = camera.flat(scene.zone.points)
    if np.ptp(flat, axis=0).max() < SMALL * (camera.high - camera.low).max():
        ring = {"markersize": 16, "markerfacecolor": "none", "color": ORANGE, "clip_on": False}
        ax.plot(*flat.mean(axis=0), "o", **ring)
    return camera


def contact_figure(run: Run, look: Look) -> Figure | None:
    """Draw the body where it is in contact, pressure, status and friction; None undrawn."""
    scene, table = Scene.of(run), run.table
    zone, norm = scene.zone, scene.norm
    touching = bool(np.any(table["status"] != "open"))
    box = np.reshape(scene.body.bounds, (3, 2)).T
    frictional, narrow = bool(np.any(table["bound"] > 0)), page_width() < NARROW
    others = [] if run.opposite is None else [run.opposite]
    rows, columns = 2 + len(others), len(zone.sides)
    words = [""] if columns == 1 else [" (front)", " (back)"]
    shades = scene.shades | {"nan_color": ZONES["open"][0]}
    figure = sheet(2.1 if narrow else 0.7 if rows == 2 else 0.95)
    figure.set_layout_engine("constrained")
    grid = (
        figure.add_gridspec(1 + rows, columns, height_ratios=[1.6] + rows * [1.0])
        if narrow
        else figure.add_gridspec(rows, 1 + columns, width_ratios=[1.5] + columns * [1.0])
    )
    whole = figure.add_subplot(grid[0, :] if narrow else grid[:, 0])
    if show_body(whole, run, scene, look.view, box) is None:
        return None
    whole.set_title("pressure on the body" if touching else "no contact", fontsize="medium")
    axes = []
    for k, (side, which) in enumerate(zip(zone.sides, words, strict=True)):
        camera = close_camera(run, zone, side)
        front = seen(run, run.surface, side * zone.normal, camera)
        meshes = [front, *(seen(run, other, None, camera) for other in others)]
        titles = ["contact pressure", *["pressure on the other side"] * len(others), "status"]
        titles = [title + which for title in titles]
        panels = [
            figure.add_subplot(grid[1 + r, k] if narrow else grid[r, 1 + k]) for r in range(rows)
        ]
        for panel, mesh in zip(panels, meshes, strict=False):
            _shown(panel, camera, mesh, **shades)
        _show_status(panels[-1], front, camera)
        longest = _show_friction(panels[-1], front, camera) if frictional else 0.0
        if longest:
            unit = f" {run.units.stress}" if run.units.stress else ""
            titles[-1] = f"status, friction{which}\nlongest arrow {longest:.3g}{unit}"
        for panel, title in zip(panels, titles, strict=True):
            panel.set_title(title, fontsize="medium")
            _frame(panel, camera, run, last=panel is panels[-1])
        axes += panels
    if touching:
        label = run.units.label(r"$-\sigma_\nu$", "stress")
        label += f", peak {norm.vmax:.4g}"
        colour_bar(figure, [whole, *axes], norm, "viridis", label)
    columns = 2 if narrow else 4
    figure.legend(handles=_legend(run, frictional), ncols=columns, loc="outside lower center")
    return figure


def _legend(run: Run, frictional: bool) -> list[Patch]:
    """Return the legend of the status with the numbers of contact nodes."""
    words = {zone: label for zone, (_, label) in ZONES.items()}
    if not frictional:
        words = {"slip": "in contact", "open": "open"}
    found = []
    for zone, label in words.items():
        count = np.count_nonzero(run.table["status"] == zone)
        found.append(Patch(color=ZONES[zone][0], label=f"{label}: {count} nodes"))
    if np.any(run.table["rigid"]):
        found.append(Patch(facecolor=to_rgba(SKY, 0.3), edgecolor=BLUE, label="foundation"))
    return found


def close_camera(run: Run, zone: Zone, side: int) -> Camera:
    """Return the camera of a close-up: in coordinate planes the first axis runs to the right."""
    places = np.asarray(run.surface.points, dtype=float)
    if abs(zone.normal).max() == 1:
        right, up = np.delete(np.eye(3), np.argmax(abs(zone.normal)), axis=0)
    else:
        made = Camera.of(side * zone.normal, places)
        right, up = made.right, made.up
    flat = places @ np.array([right, up]).T
    extent = float(np.ptp(flat, axis=0).max())
    touches = (zone.area @ zone.normal) * side > 0
    own = zone.corners[touches].reshape(-1, 3) if touches.any() else zone.points
    size = float(np.ptp(own @ np.array([right, up]).T, axis=0).max())
    camera = Camera.along(right, up, own, 0.0)
    room = ROOM * size
    low = np.maximum(camera.low - room, flat.min(axis=0) - 0.12 * extent)
    high = np.minimum(camera.high + room, flat.max(axis=0) + 0.12 * extent)
    return Camera(right, up, low, high, camera.depth)


def seen(run: Run, grid: Any, towards: Array | None, camera: Camera) -> Any:
    """Return the triangles of a contact part near the scene of a camera.

    Those alone that face a direction, if one is given.
    """
    skin = linear(grid)
    faces = np.asarray(skin.regular_faces)
    centres = skin.points[faces].mean(axis=1)
    room = camera.high - camera.low
    there = np.all(abs(camera.flat(centres) - (camera.low + camera.high) / 2) < room, axis=1)
    there &= abs(centres @ camera.view - camera.depth) < room.max()
    if towards is not None:
        there &= areas(run, skin) @ towards > 0
    front = pyvista.PolyData.from_regular_faces(skin.points, faces[there])
    front.point_data.update(skin.point_data)
    return front


def _shown(ax: Axes, camera: Camera, mesh: Any, **colours: Any) -> None:
    """Draw a mesh with colours as they are."""

    def add(plotter: Any) -> None:
        if mesh.n_cells:
            plotter.add_mesh(mesh, show_scalar_bar=False, **{"lighting": False, **colours})

    (image,) = rendered(add, [camera], 800)
    ax.imshow(image, extent=camera.extent, interpolation="antialiased")


def _show_status(ax: Axes, front: Any, camera: Camera) -> None:
    """Colour the share of each node of triangles by its status."""
    corners = front.points[front.regular_faces]
    middle = np.broadcast_to(corners.mean(axis=1, keepdims=True), corners.shape)
    after, before = (np.roll(corners, k, axis=1) for k in (-1, 1))
    quads = np.stack([corners, (corners + after) / 2, middle, (corners + before) / 2], axis=2)
    mesh = polygons(quads.reshape(-1, 4, 3))
    order = np.argsort([STATUS[zone] for zone in ZONES])
    status = front["status"][front.regular_faces].ravel().astype(int)
    known = status >= STATUS["open"]  # nodes that are held are no contact nodes
    mesh.cell_data["zone"] = np.where(known, order[np.maximum(status, 0)], len(ZONES))
    listed = ListedColormap([*(colour for colour, _ in ZONES.values()), UNKNOWN])
    _shown(ax, camera, mesh, scalars="zone", cmap=listed, clim=[-0.5, len(ZONES) + 0.5])


def _show_friction(ax: Axes, front: Any, camera: Camera) -> float:
    """Draw friction as arrows; return the stress of the longest, 0 without any."""
    nodes = np.unique(front.regular_faces)
    flat = camera.flat(front.points[nodes])
    traction, normal = (np.nan_to_num(front[name][nodes]) for name in ("traction", "normal"))
    along = traction - np.einsum("ni,ni->n", traction, normal)[:, None] * normal
    size = np.linalg.norm(along, axis=1)
    size[np.any((flat < camera.low) | (flat > camera.high), axis=1)] = 0.0
    # Rounding of the pressures is no friction.
    rounding = 1e-9 * np.linalg.norm(traction, axis=1).max(initial=0.0)
    acting = np.flatnonzero(size > max(1e-6 * size.max(initial=0.0), rounding))
    if not acting.size:
        return 0.0
    # The first of each cell of a grid of 14 x 14 cells.
    extent = float((camera.high - camera.low).max())
    cells = np.floor(14 * (flat[acting] - camera.low) / extent)
    chosen = acting[np.unique(cells, axis=0, return_index=True)[1]]
    most = float(size[chosen].max())
    exact = {"angles": "xy", "scale_units": "xy", "scale": most / (0.12 * extent)}
    steps = camera.flat(along[chosen])
    ax.quiver(*flat[chosen].T, *steps.T, color="black", width=0.008, **exact)
    return most


def _frame(ax: Axes, camera: Camera, run: Run, last: bool) -> None:
    """Label a close-up: coordinates in coordinate planes, else a length."""
    ax.set(xlim=camera.extent[:2], ylim=camera.extent[2:])
    ax.set_aspect("equal")
    if abs(camera.view).max() == 1:
        names = ["xyz"[int(np.argmax(axis))] for axis in (camera.right, camera.up)]
        ax.set_ylabel(run.units.label(f"${names[1]}$", "length"))
        if last:
            ax.set_xlabel(run.units.label(f"${names[0]}$", "length"))
        else:
            ax.tick_params(labelbottom=False)
        return
    ax.set(xticks=[], yticks=[])
    if last:
        scale_bar(ax, camera, run)
    else:
        triad(ax, camera)
