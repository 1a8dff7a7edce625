"""Figures in 3-D by pyvista: the body from where its contact is seen, and close-ups of that."""

from __future__ import annotations

import atexit
import ctypes
import logging
import os
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pyvista
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, Normalize, to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray
from scipy.spatial import KDTree
from vtkmodules.vtkCommonCore import vtkLogger

from contact import _compat
from contact.errors import counted
from contact.plot.contact import TOUCHING, patches
from contact.plot.foundation import add_foundation, foundation
from contact.plot.run import Run, linear, polygons
from contact.plot.style import BLUE, NARROW, ORANGE, SKY, ZONES, Look, colour_bar, page_width, sheet
from contact.results.quantity import STATUS
from contact.typing import Array

logger = logging.getLogger("contact.plots")

#: Cosine from which on a normal counts as that of a coordinate plane.
SNAPPED = 0.966


@dataclass(frozen=True)
class Camera:
    """A parallel projection."""

    right: Array  #: unit vector of the picture, shape (3,)
    up: Array  #: likewise
    low: Array  #: corner of the picture along these, shape (2,)
    high: Array  #: likewise

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
    def of(view: Array, points: Array, margin: float = 0.04, above: Array | None = None) -> Camera:
        """Return the camera that sees points, shape (n, 3), from a direction, z upwards."""
        view = view / np.linalg.norm(view)
        if above is None:
            above = np.eye(3)[2 if abs(view[2]) < SNAPPED else 1]
        right = np.cross(above, view) / np.linalg.norm(np.cross(above, view))
        up = np.cross(view, right)
        flat = points @ np.array([right, up]).T
        room = margin * float(np.ptp(flat, axis=0).max())
        return Camera(right, up, flat.min(axis=0) - room, flat.max(axis=0) + room)

    def aim(self, plotter: Any) -> None:
        """Turn the camera of a plotter."""
        focus = (self.low + self.high) / 2 @ np.array([self.right, self.up])
        far = 1e3 * float(np.linalg.norm(plotter.bounds))  # outlines are those seen from there
        plotter.enable_parallel_projection()
        plotter.camera.focal_point, plotter.camera.position = focus, focus + far * self.view
        plotter.camera.up, plotter.camera.parallel_scale = self.up, (self.high - self.low)[1] / 2
        plotter.renderer.ResetCameraClippingRange()


def has_display() -> bool:
    """Return whether the X server of DISPLAY answers; of a session that has ended it does not."""
    try:
        xlib = ctypes.CDLL("libX11.so.6")
    except OSError:  # macOS, or without X11
        return bool(os.environ.get("DISPLAY"))
    xlib.XOpenDisplay.restype = ctypes.c_void_p
    display = xlib.XOpenDisplay(None)
    if display:
        xlib.XCloseDisplay(ctypes.c_void_p(display))
    return bool(display)


def drawable() -> bool:
    """Return whether scenes can be rendered here; warn if not."""
    if has_display():
        return True
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)  # VTK would warn of it, and draws
    if _compat.vtk_needs_display() and not start_display():
        logger.warning("nothing is drawn in 3-D: VTK before 9.4 needs a display or Xvfb")
        return False
    return True


def start_display() -> bool:
    """Start an X server without a screen, until this program ends; return whether it answers."""
    # That of pyvista has the number of any other one, and stays.
    reader, writer = os.pipe()
    size = ["-screen", "0", "1920x1440x24", "-nolisten", "tcp"]
    command = ["Xvfb", f":{1000 + os.getpid() % 50000}", "-displayfd", str(writer), *size]
    try:
        quiet = subprocess.DEVNULL
        server = subprocess.Popen(command, pass_fds=[writer], stdout=quiet, stderr=quiet)
    except OSError:
        return False
    finally:
        os.close(writer)
    atexit.register(server.terminate)
    with os.fdopen(reader) as ready:  # its number, or the end of one that does not start
        number = ready.readline().strip()
    os.environ["DISPLAY"] = f":{number}"
    return bool(number)


def render(ax: Axes, camera: Camera, add: Callable[[Any], None], pixels: int = 1600) -> None:
    """Draw a scene, which is added to a ``pyvista.Plotter``, as a camera sees it."""
    size = np.ceil(pixels * (camera.high - camera.low) / np.max(camera.high - camera.low))
    plotter = pyvista.Plotter(off_screen=True, window_size=[max(int(n), 2) for n in size])
    plotter.set_background("white")
    add(plotter)
    camera.aim(plotter)
    ax.imshow(plotter.screenshot(return_img=True), extent=camera.extent)
    plotter.close()


def triad(ax: Axes, camera: Camera, corner: tuple[float, float], share: float) -> None:
    """Draw the coordinate axes in a square at a corner, of a share of the longer side."""
    size = camera.high - camera.low
    inset = ax.inset_axes((*corner, *(share * size.max() / size)))
    inset.set(xlim=(-1.6, 1.6), ylim=(-1.6, 1.6), aspect="equal")
    inset.axis("off")
    for name, step in zip("xyz", camera.flat(np.eye(3)), strict=True):
        if np.linalg.norm(step) > 0.15:
            inset.plot(*np.transpose([[0, 0], step]), "k", lw=0.8)
            place = step + 0.45 * step / np.linalg.norm(step)
            inset.text(*place, f"${name}$", ha="center", va="center", fontsize=7)


#: Colours of a body without a field, and of nodes that are no contact nodes.
PLAIN, UNKNOWN = "#DADADA", "#FFFFFF"
#: Direction from which bodies are seen, of those that see the contact alike.
USUAL = np.array([1.0, -1.6, 0.9]) / np.linalg.norm([1.0, -1.6, 0.9])
#: Angles from the mean normal of the contact to the eye (degrees), the best first.
TILTS = 55.0, 25.0
#: Share of the contact zone that is seen at least; bodies that hide more are translucent.
SEEN = 0.3
#: Share of a contact zone that a body of its own has at least: cells near by may be another's.
OWN = 0.2
#: Facets from which it is asked whether they are seen.
RAYS = 40
#: Smallest resultant of the unit normals of a contact zone that has a side, per area.
SIDED = 0.3
#: Most contacts that have close-ups of their own.
CLOSE = 2
#: Room about a contact zone in close-ups, over its size.
ROOM = 0.25
#: Contact zones below this part of the body are marked on it.
SMALL = 0.1
#: How far painted facets lie in front of the body, over its diameter.
LIFTED = 1e-3
#: Facets up to which the mesh is drawn.
FACETS = 8000


def areas(run: Run, skin: Any) -> Array:
    """Return the area vectors of the triangles of a contact part, out of the body, (n, 3)."""
    # Against a rigid shape the contact direction may point into the body; against another body the
    # facets of both may be in one place.
    faces, cells = skin.regular_faces, run.body.cell_centers().points
    a, b, c = np.moveaxis(skin.points[faces], 1, 0)
    across = np.cross(b - a, c - a).astype(float) / 2
    out = (a + b + c) / 3 - cells[KDTree(cells).query((a + b + c) / 3)[1]]
    rigid = skin["rigid"][faces].max(axis=1) > 0
    out = np.where(rigid[:, None], out, np.nansum(skin["normal"][faces], axis=1))
    return np.where(np.einsum("ni,ni->n", across, out) < 0, -1.0, 1.0)[:, None] * across


@dataclass(frozen=True)
class Zone:
    """Where a run is in contact; all of the contact part where it is open."""

    entries: Array  #: numbers of its contacts
    corners: Array  #: the triangles that touch, shape (n, 3, 3)
    area: Array  #: their area vectors, shape (n, 3)
    displacement: Array  #: at the corners, shape (n, 3, 3)
    pressure: Array  #: at the corners, shape (n, 3), nan at nodes that supports hold
    normal: Array  #: mean normal of a side of it, shape (3,), that of an axis if it is nearly so

    @property
    def points(self) -> Array:
        """The corners, shape (3 n, 3)."""
        return self.corners.reshape(-1, 3)

    @staticmethod
    def of(run: Run, entries: Array) -> Zone:
        """Return the zone of some contacts of a run."""
        skin = linear(run.surface)
        own = np.isin(skin["entry"], entries)[skin.regular_faces].all(axis=1)
        touching = own & (skin["status"] > STATUS["open"])[skin.regular_faces].any(axis=1)
        chosen = touching if touching.any() else own
        faces, area = skin.regular_faces[chosen], areas(run, skin)[chosen]
        corners, moved = np.array([skin.points, skin["displacement"]], dtype=float)[:, faces]
        pressure = np.asarray(skin["pressure"])[faces]
        size = np.linalg.norm(area, axis=1)
        normal = area.sum(axis=0)
        if np.linalg.norm(normal) < SIDED * size.sum():  # around a shaft, or between two plates
            force = np.nan_to_num(pressure).mean(axis=1)
            normal = area.T @ force
            if np.linalg.norm(normal) <= 0.1 * (size @ force):  # alike on all sides
                normal = np.eye(3)[np.argmax(abs(area).sum(axis=0).round(6))]
        normal = normal / np.linalg.norm(normal)
        if abs(normal).max() > SNAPPED:
            normal = np.where(abs(normal) > SNAPPED, np.sign(normal), 0.0)
        return Zone(np.unique(entries), corners, area, moved, pressure, normal)


class Sight(NamedTuple):
    """How a body is seen."""

    eye: Array  #: direction to the eye, shape (3,)
    clear: NDArray[np.bool_]  #: which cells are translucent, shape (n,)
    words: str = ""  #: on it, for titles
    cut: tuple[Array, Array] | None = None  #: normal and a point of the plane of a cut


def chosen_sight(run: Run, zone: Zone, cut: bool = False) -> Sight:
    """Return the direction from which most of a zone is seen, aslant to its mean normal.

    Bodies without a part of the zone are translucent, and so is the body with it if it hides the
    zone from all sides. With `cut` all are cut open instead.
    """
    size = np.linalg.norm(zone.area, axis=1)[:, None]
    places, out = zone.corners.mean(axis=1), zone.area / size
    cells, bodies = run.body.cell_centers().points, run.body.connectivity().cell_data["RegionId"]
    inside = KDTree(cells).query(places - np.sqrt(size) / 2 * out)[1]
    share = np.bincount(bodies[inside], size.ravel(), bodies.max() + 1) / size.sum()
    other = share[bodies] < OWN
    e1 = np.linalg.svd(zone.normal[None])[2][1]
    # Oblique: along an axis of a box two of its edges would be one line.
    turns = np.arange(0.0, 2 * np.pi, np.pi / 4) + np.pi / 8
    ring = np.outer(np.cos(turns), e1) + np.outer(np.sin(turns), np.cross(zone.normal, e1))
    tilts = np.radians(TILTS)
    views = np.concatenate([np.cos(t) * zone.normal + np.sin(t) * ring for t in tilts])
    skin = linear(run.body.extract_cells(~other))
    some = np.unique(np.linspace(0, len(zone.area) - 1, RAYS).astype(int))
    front = np.maximum(zone.area[some] @ views.T, 0.0)
    starts = (places + LIFTED * run.diameter * out)[some]
    free = [
        [not skin.ray_trace(x, x + skin.length * view)[1].size for view in views] for x in starts
    ]
    shares = (front * free).sum(axis=0) / front.sum(axis=0)
    preferred = np.minimum(shares, 0.8) - 0.1 * (np.arange(len(views)) >= len(turns))
    eye, hidden = views[np.argmax(preferred + 0.2 * views @ USUAL)], shares.max() < SEEN
    if cut:
        return section(run, zone) if hidden or other.any() else Sight(eye, other)
    if hidden:
        return Sight(eye, np.ones_like(other), "the body translucent")
    return Sight(eye, other, "the other body translucent" if other.any() else "")


def section(run: Run, zone: Zone) -> Sight:
    """Return the sight of a body cut open through its zone, by a plane across one of the axes."""
    # The plane contains the normal of the zone. Where the zone ends at a face of the body, as at a
    # plane of symmetry, nothing is cut away.
    axes = np.eye(3) - np.outer(zone.normal, zone.normal)
    size = np.linalg.norm(axes, axis=1)
    axes = axes[size > 0.5] / size[size > 0.5, None]
    axes = np.concatenate([axes, -axes])
    along, own = run.body.points @ axes.T, zone.points @ axes.T
    middle = (zone.points.min(axis=0) + zone.points.max(axis=0)) / 2
    at_face = own.max(axis=0) + LIFTED * run.diameter > along.max(axis=0)
    removed = np.where(at_face, 0.0, (along > middle @ axes.T).mean(axis=0))
    k = int(np.argmin(removed - 0.1 * axes @ USUAL))
    above = np.copysign(1.0, zone.normal @ USUAL) * zone.normal
    eye = axes[k] + 0.4 * (above + np.cross(above, axes[k]))
    words, cut = ("", None) if at_face[k] else ("cut open", (axes[k], middle))
    return Sight(eye, np.zeros(run.body.n_cells, dtype=bool), words, cut)


@dataclass(frozen=True)
class Scene:
    """A deformed body in 3-D, as windows and figures show it."""

    body: Any  #: its grid
    zone: Zone  #: where it is in contact
    foundation: Any  #: rigid shapes, drawn translucent
    colours: Mapping[str, Any]  #: arguments of ``add_mesh`` for the colours of a field
    painted: bool = False  #: whether the field is the pressure, on the zone of a plain body

    @staticmethod
    def of(run: Run) -> Scene:
        """Return a plain body with its contact pressure, whose range is that of all nodes."""
        ends = [0.0, float(np.max(run.table["pressure"], initial=0.0)) or 1.0]
        shades = {"scalars": "pressure", "cmap": "viridis", "clim": ends, "lighting": False}
        body, zone = run.body.warp_by_vector("displacement"), Zone.of(run, run.table["entry"])
        return Scene(body, zone, foundation(run, 1.0), shades, painted=True)

    def add(self, plotter: Any, sight: Sight | None = None) -> None:
        """Add the body to a plotter."""
        grid, look = self.body, {"color": PLAIN} if self.painted else self.colours
        if sight is not None and sight.cut is not None:
            grid = grid.clip(*sight.cut)
        elif sight is not None and sight.clear.any():
            _add_body(plotter, grid.extract_cells(sight.clear), color=PLAIN, opacity=0.25)
            grid = grid.extract_cells(~sight.clear)
        if self.foundation.n_cells:
            add_foundation(plotter, self.foundation)
        # The bar of colours is that of the mesh that is added last.
        if grid.n_cells:
            _add_body(plotter, grid, **look)
        zone = self.zone
        known = np.isfinite(zone.pressure).all(axis=1)
        if self.painted and zone.pressure[known].any():  # a little in front of the body
            size = float(np.ptp(self.body.points, axis=0).max())
            out = zone.area / np.linalg.norm(zone.area, axis=1)[:, None]
            moved = zone.corners + zone.displacement + LIFTED * size * out[:, None]
            mesh = polygons(moved[known])
            mesh["pressure"] = zone.pressure[known].ravel()
            plotter.add_mesh(mesh, show_scalar_bar=False, **self.colours)

    def window(self, label: str) -> Any:
        """Return a plotter that shows the scene in a window to turn it in, or in a notebook."""
        plotter = pyvista.Plotter(title="contact")
        plotter.set_background("white")
        self.add(plotter)
        plotter.add_scalar_bar(label, color="black", n_labels=5)
        plotter.add_axes(color="black")
        Camera.of(self.zone.normal + USUAL, np.asarray(self.body.points)).aim(plotter)
        plotter.reset_camera(render=False)  # all of it, as wide as the window may be
        return plotter


def _add_body(plotter: Any, grid: Any, **look: Any) -> None:
    """Add the surface of a grid, smooth, with its edges and a faint mesh."""
    skin = _compat.surface(grid)
    faint = {"show_edges": skin.n_cells < FACETS, "line_width": 0.5, "edge_opacity": 0.2}
    lit = {"ambient": 0.6, "diffuse": 0.45, "smooth_shading": True, "split_sharp_edges": True}
    edges = skin.extract_feature_edges(40.0, manifold_edges=False, non_manifold_edges=False)
    if edges.n_cells:
        plotter.add_mesh(edges, color="black", line_width=2.5)
    plotter.add_mesh(skin, show_scalar_bar=False, **lit, **faint, **look)


def show_body(ax: Axes, run: Run, scene: Scene, view: Any) -> tuple[Camera, str]:
    """Draw the scene, from a direction or where contact is seen; return camera and words on it."""
    sight = chosen_sight(run, scene.zone, cut=not scene.painted)
    if view:
        sight = Sight(np.asarray(view, dtype=float), sight.clear, sight.words * (sight.cut is None))
    camera = Camera.of(sight.eye, np.concatenate([scene.body.points, scene.foundation.points]))
    render(ax, camera, lambda plotter: scene.add(plotter, sight))
    ax.axis("off")
    triad(ax, camera, (0.0, -0.16), 0.2)
    flat = camera.flat(scene.zone.points)
    if scene.painted and np.ptp(flat, axis=0).max() < SMALL * (camera.high - camera.low).max():
        ring = {"markersize": 16, "markerfacecolor": "none", "color": ORANGE, "clip_on": False}
        ax.plot(*flat.mean(axis=0), "o", **ring)
    return camera, sight.words


def contact_figure(run: Run, look: Look) -> Figure:
    """Draw the body where it is in contact, pressure, status and friction."""
    scene, table = Scene.of(run), run.table
    touching = bool(np.any(table["status"] != "open"))
    frictional, narrow = bool(np.any(table["bound"] > 0)), page_width() < NARROW
    others = [] if run.opposite is None else [run.opposite]
    closes = close_ups(run, scene.zone)
    rows, columns = 2 + len(others), len(closes)
    shades = {**scene.colours, "nan_color": UNKNOWN}
    figure = sheet(2.1 if narrow else 0.7 if rows == 2 else 0.95)
    figure.set_layout_engine("constrained")
    grid = (
        figure.add_gridspec(1 + rows, columns, height_ratios=[1.6] + rows * [1.0])
        if narrow
        else figure.add_gridspec(rows, 1 + columns, width_ratios=[1.5] + columns * [1.0])
    )
    whole = figure.add_subplot(grid[0, :] if narrow else grid[:, 0])
    camera, words = show_body(whole, run, scene, look.view)
    title = "pressure on the body" if touching else "no contact"
    whole.set_title("\n".join([title, words]).strip(), fontsize="medium")
    axes = []
    for k, (zone, side, name) in enumerate(closes):
        close = close_camera(zone, side, camera)
        front = seen(run, run.surface, zone, side * zone.normal)
        meshes = [front, *(other_side(run, other, zone) for other in others)]
        titles = ["contact pressure", *["on the other side"] * len(others), "status"]
        panels = [
            figure.add_subplot(grid[1 + r, k] if narrow else grid[r, 1 + k]) for r in range(rows)
        ]
        for panel, mesh in zip(panels, meshes, strict=False):
            _shown(panel, close, mesh, **shades)
        _show_status(panels[-1], front, close)
        longest = _show_friction(panels[-1], front, close) if frictional else 0.0
        if longest:
            unit = f" {run.units.stress}" if run.units.stress else ""
            titles[-1] = f"status, friction\nlongest arrow {float(f'{longest:.3g}'):g}{unit}"
        titles[0] = "\n".join([name, titles[0]]).strip()
        for panel, text in zip(panels, titles, strict=True):
            panel.set_title(text, fontsize="medium" if columns == 1 else "small")
            _frame(panel, close, run, last=panel is panels[-1])
        axes += panels
    if touching:
        label = run.units.label(r"$-\sigma_\nu$", "stress")
        norm = Normalize(*scene.colours["clim"])
        colour_bar(figure, [whole, *axes], norm, "viridis", f"{label}, peak {norm.vmax:.4g}")
    columns = 2 if narrow else 4
    figure.legend(
        handles=_legend(run, scene, frictional), ncols=columns, loc="outside lower center"
    )
    return figure


def _legend(run: Run, scene: Scene, frictional: bool) -> list[Patch]:
    """Return the legend of the status with the numbers of contact nodes."""
    found = patches(frictional)
    for patch, zone in zip(found, ZONES if frictional else TOUCHING, strict=True):
        count = np.count_nonzero(run.table["status"] == zone)
        patch.set_label(f"{patch.get_label()}: {counted(count, 'node')}")
    if scene.foundation.n_cells:
        found.append(Patch(facecolor=to_rgba(SKY, 0.3), edgecolor=BLUE, label="foundation"))
    return found


def close_ups(run: Run, zone: Zone) -> list[tuple[Zone, int, str]]:
    """Return the zones of close-ups, 1 or -1 for their front or back, and their names."""
    # A few contacts have one each; more have one together, or two if much of the zone is seen from
    # behind its normal alone.
    touching = np.unique(run.table["entry"][run.table["status"] != "open"])
    if 1 < len(touching) <= CLOSE:
        parts = [table for table in run.contacts if table["entry"][0] in touching]
        return [(Zone.of(run, part["entry"]), 1, run.names[part["entry"][0]]) for part in parts]
    size = np.linalg.norm(zone.area, axis=1)
    behind = zone.area @ zone.normal < -0.1 * size
    if size[behind].sum() <= 0.02 * size.sum():
        return [(zone, 1, "")]
    return [(zone, 1, "front"), (zone, -1, "back")]


def close_camera(zone: Zone, side: int, whole: Camera) -> Camera:
    """Return the camera of a close-up: along the normal, upwards as the whole, or an axis, is."""
    along = side * float(whole.up @ zone.normal)
    above = whole.up - side * along * zone.normal
    if np.linalg.norm(above) < 0.3:  # the body is seen edge-on: as its camera would turn
        above = -np.copysign(1.0, along) * whole.view
    if abs(zone.normal).max() == 1:
        k = int(np.argmax(abs(above)))
        above = np.sign(above[k]) * np.eye(3)[k]
    facing = (zone.area @ zone.normal) * side > 0
    return Camera.of(side * zone.normal, zone.corners[facing].reshape(-1, 3), ROOM, above)


def seen(run: Run, grid: Any, zone: Zone, towards: Array | None = None) -> Any:
    """Return the triangles of a contact part around a zone, or those that face a direction."""
    skin = linear(grid)
    faces, low, high = skin.regular_faces, zone.points.min(axis=0), zone.points.max(axis=0)
    away = abs(skin.points[faces].mean(axis=1) - (low + high) / 2) - (high - low) / 2
    there = away.max(axis=1) < max(high - low)
    if towards is not None:
        there &= areas(run, skin) @ towards > 0
    front = pyvista.PolyData.from_regular_faces(skin.points, faces[there])
    front.point_data.update(skin.point_data)
    return front


def other_side(run: Run, grid: Any, zone: Zone) -> Any:
    """Return the triangles of the other side around a zone, with the pressure of its contacts."""
    front = seen(run, grid, zone)
    own = np.isin(front["entry"], zone.entries)
    # Contacts against the same part have a copy of it each.
    copies = np.unique(front.points, axis=0, return_inverse=True)[1].ravel()
    whole = np.bincount(copies, np.where(own, front["pressure"], 0.0))
    front["pressure"] = whole[copies]
    return front


def _shown(ax: Axes, camera: Camera, mesh: Any, **colours: Any) -> None:
    """Draw a mesh with colours as they are."""

    def add(plotter: Any) -> None:
        if mesh.n_cells:
            plotter.add_mesh(mesh, show_scalar_bar=False, **{"lighting": False, **colours})

    render(ax, camera, add, 800)


def _show_status(ax: Axes, front: Any, camera: Camera) -> None:
    """Colour the share of each node of triangles by its status."""
    corners = front.points[front.regular_faces]
    middle = np.broadcast_to(corners.mean(axis=1, keepdims=True), corners.shape)
    after, before = (np.roll(corners, k, axis=1) for k in (-1, 1))
    quads = np.stack([corners, (corners + after) / 2, middle, (corners + before) / 2], axis=2)
    mesh = polygons(quads.reshape(-1, 4, 3))
    order = np.argsort([STATUS[zone] for zone in ZONES])
    status = front["status"][front.regular_faces].ravel().astype(int)
    known = status >= STATUS["open"]  # nodes that are constrained are no contact nodes
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
    rounding_stress = 1e-9 * np.linalg.norm(traction, axis=1).max(initial=0.0)
    acting = np.flatnonzero(size > max(1e-6 * size.max(initial=0.0), rounding_stress))
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
    """Label a close-up: coordinates in coordinate planes, else lengths beside their directions."""
    ax.set(xlim=camera.extent[:2], ylim=camera.extent[2:])
    ax.set_aspect("equal")
    plane = abs(camera.view).max() == 1
    for axis, along in ((ax.xaxis, camera.right), (ax.yaxis, camera.up)):
        name = f"${'xyz'[abs(along).argmax()]}$" if plane else "length"
        sign = along.sum() if plane else 1.0  # of an axis that is seen from behind
        axis.set_major_formatter(lambda value, _, sign=sign: f"${sign * value + 0.0:g}$")
        axis.set_label_text(run.units.label(name, "length"))
    if not last:
        ax.set_xlabel("")
        ax.tick_params(labelbottom=False)
    elif not plane:
        triad(ax, camera, (-0.6, -0.6), 0.4)
