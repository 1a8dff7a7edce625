"""The deformed body, coloured: what is drawn of it, and the drawing of plane bodies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from dolfinx import mesh as dmesh
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from mpi4py import MPI
from numpy.typing import NDArray

from contact import _compat
from contact.mesh.domain import Domain, exterior_facets
from contact.output.fields import DerivedFields, linear
from contact.output.figures.contact import BLUE, ends
from contact.output.solution import Solution
from contact.output.table import Table, held_points
from contact.typing import Array

Indices: TypeAlias = NDArray[np.integer[Any]]

#: Plane meshes with more cells are drawn as pixels, this many along the body.
MOST_CELLS, PIXELS = 150_000, 1600


@dataclass(frozen=True)
class Picture:
    """What is drawn of a deformed body.

    Attributes
    ----------
    corners
        Corners of triangles in their places at rest, shape (n, 3, d).
    displacement
        Displacement of the corners, shape (n, 3, d).
    values
        Values to colour by, one a triangle or one a corner, shape (n,) or (n, 3).
    outline
        Edges of a plane body at rest, shape (m, 2, 2).
    image
        Instead of triangles, for a large plane mesh: means in pixels, NaN outside the body.
    box
        Lower and upper corner of the deformed body as drawn, shape (2, d).
    scale
        By which the displacement is multiplied in the drawing.
    label
        Of the colours.
    held
        Nodes of Gamma_3 that are no contact nodes, shape (n, d).
    """

    corners: Array
    displacement: Array
    values: Array
    outline: Array
    image: Array | None
    box: Array
    scale: float
    label: str
    held: Array


def magnification(size: float, largest: float) -> float:
    """Return 1, 2 or 5 times a power of ten that makes displacements about 5 % of the body.

    Displacements that are visible anyway are drawn as they are.
    """
    if not 0 < largest < 0.02 * size:
        return 1.0
    wanted = 0.05 * size / largest
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * max(k for k in (1, 2, 5) if k * power <= wanted))


def picture(solution: Solution, field: str, label: str) -> Picture | None:
    """Collect what is drawn on rank 0; None elsewhere. Collective.

    Parameters
    ----------
    solution
        The solution.
    field
        "potential", or a scalar field of `DerivedFields`.
    label
        Of the colours.
    """
    problem, d = solution.problem, solution.problem.dim
    domain, comm = problem.domain, problem.comm
    u = linear(solution.displacement)
    if field == "potential":
        assert solution.potential is not None
        values = linear(solution.potential)
    else:
        values = DerivedFields(problem.equilibrium, solution.state.x).cells()[field]
    cells, places = _triangles(domain)
    x = domain.mesh.geometry.x[_compat.geometry_dofmap(domain.mesh)]
    corners = np.take_along_axis(x[cells][:, :, :d], places[:, :, None], axis=1)
    nodes = np.take_along_axis(u.function_space.dofmap.list[cells], places, axis=1)
    moved = u.x.array.reshape(-1, d)[nodes]
    dofs = values.function_space.dofmap.list[cells]
    # One value for P1, else one a corner.
    colours = values.x.array[dofs[:, 0] if dofs.shape[1] == 1 else _take(dofs, places)]
    largest = comm.allreduce(float(np.linalg.norm(moved, axis=-1).max(initial=0.0)), op=MPI.MAX)
    scale = magnification(domain.size, largest)
    drawn = corners + scale * moved
    low = drawn.min(axis=(0, 1), initial=np.inf)
    high = drawn.max(axis=(0, 1), initial=-np.inf)
    comm.Allreduce(MPI.IN_PLACE, low, MPI.MIN)
    comm.Allreduce(MPI.IN_PLACE, high, MPI.MAX)
    box = np.array([low, high])
    outline, held = _outline(domain), held_points(problem)
    if d == 2 and comm.allreduce(len(cells), op=MPI.SUM) > MOST_CELLS:
        image = _pixels(comm, drawn, colours, box)
        empty = np.empty((0, 3, d))
        made = Picture(empty, empty, np.empty(0), outline, image, box, scale, label, held)
        return made if comm.rank == 0 else None
    gathered = [comm.gather(array) for array in (corners, moved, colours)]
    if comm.rank > 0:
        return None
    corners, moved, colours = (np.concatenate(arrays) for arrays in gathered if arrays is not None)
    return Picture(corners, moved, colours, outline, None, box, scale, label, held)


def _take(dofs: Indices, places: Indices) -> Indices:
    return np.take_along_axis(dofs, places, axis=1)


def _triangles(domain: Domain) -> tuple[Indices, Indices]:
    """Return cells and three corners of each: the cells in the plane, the surface in space."""
    mesh, d = domain.mesh, domain.dim
    if d == 2:
        cells = np.arange(mesh.topology.index_map(2).size_local)
        return cells, np.broadcast_to([0, 1, 2], (cells.size, 3))
    facets = exterior_facets(mesh)
    mesh.topology.create_connectivity(2, 3)
    mesh.topology.create_connectivity(3, 2)
    to_cell, to_facet = mesh.topology.connectivity(2, 3), mesh.topology.connectivity(3, 2)
    cells = to_cell.array[to_cell.offsets[facets]]
    opposite = np.argmax(to_facet.array.reshape(-1, 4)[cells] == facets[:, None], axis=1)
    # Facet i of a tetrahedron lies opposite to its corner i.
    others = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])
    return cells, others[opposite]


def _outline(domain: Domain) -> Array:
    """Return the boundary edges of a plane mesh, from all ranks; nothing in space."""
    mesh = domain.mesh
    if domain.dim == 3:
        return np.empty((0, 2, 3))
    facets = exterior_facets(mesh)
    ends = np.empty((0, 2), dtype=np.int32)
    if facets.size > 0:  # dolfinx divides by their number
        ends = dmesh.entities_to_geometry(mesh, 1, facets)
    return np.concatenate(domain.comm.allgather(mesh.geometry.x[ends][:, :, :2]))


def _pixels(comm: MPI.Intracomm, drawn: Array, colours: Array, box: Array) -> Array:
    """Return the means over pixels, NaN outside the body: no rank holds the whole mesh."""
    extent = box[1] - box[0]
    shape = np.maximum(np.rint(PIXELS * extent / extent.max()).astype(int), 1)
    corners = (drawn - box[0]) / extent * shape
    values = np.broadcast_to(colours[:, None], (len(drawn), 3)) if colours.ndim == 1 else colours
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0)
    # Sample each triangle so densely that no pixel inside the body is missed.
    level = np.ceil(np.log2(np.maximum(2 * longest, 1))).astype(int)
    sums = np.zeros((2, shape.prod()))
    for k in np.unique(level):
        barycentric = _samples(2**k)
        for cells in np.array_split(np.flatnonzero(level == k), 1 + len(level) * 4**k // 10**7):
            points = np.floor(np.einsum("sc,ncd->nsd", barycentric, corners[cells])).astype(int)
            flat = np.ravel_multi_index(tuple(np.clip(points, 0, shape - 1).T), tuple(shape))
            weights = (barycentric @ values[cells].T).ravel()
            sums[0] += np.bincount(flat.ravel(), weights, shape.prod())
            sums[1] += np.bincount(flat.ravel(), minlength=shape.prod())
    comm.Allreduce(MPI.IN_PLACE, sums)
    with np.errstate(invalid="ignore"):
        return np.asarray((sums[0] / sums[1]).reshape(shape).T)


def _samples(n: int) -> Array:
    """Return the centres of the n^2 equal parts of a triangle, in barycentric coordinates."""
    i, j = (index.ravel() for index in np.indices((n, n)))
    up, down = i + j < n, i + j < n - 1
    first = np.concatenate([i[up] + 1 / 3, i[down] + 2 / 3]) / n
    second = np.concatenate([j[up] + 1 / 3, j[down] + 2 / 3]) / n
    return np.column_stack([first, second, 1 - first - second])


def draw_plane(picture: Picture, table: Table, title: str = "") -> Figure:
    """Draw a plane body over its outline at rest and the foundation."""
    width, height = picture.box[1] - picture.box[0]
    figure = Figure(figsize=(6.3, float(np.clip(5.8 * height / width, 1.2, 5.5)) + 1.4))
    ax = figure.subplots()
    drawn = picture.corners + picture.scale * picture.displacement
    if picture.image is not None:
        (left, low), (right, top) = picture.box
        shown = ax.imshow(picture.image, extent=(left, right, low, top), origin="lower")
    elif picture.values.ndim == 1:
        shown = ax.add_collection(PolyCollection(list(drawn), array=picture.values, lw=0))
        # Smoothed edges of neighbours would let the background shine through.
        shown.set_antialiased(False)
    else:
        points = drawn.reshape(-1, 2)
        triangles = np.arange(len(points)).reshape(-1, 3)
        values = picture.values.ravel()
        shown = ax.tripcolor(*points.T, triangles, values, shading="gouraud")
    shown.set_cmap("viridis")
    rest = {"colors": "black", "lw": 0.5, "ls": (0, (6, 4))}
    ax.add_collection(LineCollection(list(picture.outline), **rest))
    _foundation(ax, table, picture.scale, ends(table, picture.held))
    figure.colorbar(shown, ax=ax, location="bottom", label=picture.label, aspect=40, shrink=0.8)
    ax.set_aspect("equal")
    ax.use_sticky_edges = False
    ax.margins(0.02)
    ax.autoscale_view()
    ax.set_xlabel("$x$ (mesh units)")
    ax.set_ylabel("$y$ (mesh units)")
    ax.set_title(with_scale(title, picture.scale), fontsize=9)
    return figure


def _foundation(ax: Axes, table: Table, scale: float, edges: Array) -> None:
    """Draw the foundation as far as it faces Gamma_3, moved as the displacements are scaled."""
    points = np.column_stack([table["x"], table["y"]])
    normal, gap = np.column_stack([table["nu_x"], table["nu_y"]]), table["gap"]
    points = np.concatenate([edges[:1], points, edges[1:]])
    normal = np.concatenate([normal[:1], normal, normal[-1:]])
    gap = np.concatenate([gap[:1], gap, gap[-1:]])
    surface = points + scale * gap[:, None] * normal
    ax.plot(*surface.T, color="black", lw=1.0)
    thick = 0.03 * np.ptp(points, axis=0).max()
    band = np.concatenate([surface, (surface + thick * normal)[::-1]])
    ax.fill(*band.T, facecolor="none", edgecolor=BLUE, hatch="////", lw=0)


def with_scale(title: str, scale: float) -> str:
    """Return a title that says by what displacements are multiplied."""
    times = rf"displacements $\times$ {scale:g}" if scale != 1 else "displacements to scale"
    return f"{title} ({times})" if title else times
