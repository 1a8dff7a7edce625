"""What is drawn of a deformed body, coloured by a field."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from contact.errors import InputError
from contact.output.field_files import body_share
from contact.output.figures.pixels import pixels
from contact.output.solved import Solved
from contact.output.table import held_points
from contact.output.vtu import VTU, Grid, gathered
from contact.typing import Array

Indices: TypeAlias = NDArray[np.integer[Any]]

#: Plane meshes with more cells are drawn as pixels.
MOST_CELLS = 150_000


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
    limits
        Values at which the colours end; None for those that suit this picture alone.
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
    limits: tuple[float, float] | None = None


def magnification(size: float, largest: float) -> float:
    """Return 1, 2 or 5 times a power of ten that makes displacements about 5 % of the body.

    Displacements that are visible anyway are drawn as they are.
    """
    if not 0 < largest < 0.02 * size:
        return 1.0
    wanted = 0.05 * size / largest
    power = 10.0 ** np.floor(np.log10(wanted))
    return float(power * max(k for k in (1, 2, 5) if k * power <= wanted))


def picture(solution: Solved, field: str, label: str) -> Picture | None:
    """Collect what is drawn on rank 0; None elsewhere. Collective.

    Parameters
    ----------
    solution
        The solution.
    field
        Name of a field, as `scalar` takes it.
    label
        Of the colours.
    """
    problem = solution.problem
    names = ("displacement", field, field.rpartition("_")[0])
    share = body_share(problem, solution.state, names)
    if not share.at_points.keys() & names[1:] and field != "displacement":
        share = body_share(problem, solution.state)  # for the message, which lists what there is
    body, held = gathered(problem.comm, share), held_points(problem)
    return None if body is None else drawn(body, held, field, label)


def drawn(body: VTU, held: Array, field: str, label: str, scale: float | None = None) -> Picture:
    """Make a picture of a body coloured by a field. On one rank.

    Parameters
    ----------
    body
        The body with its fields.
    held
        Nodes of Gamma_3 that are no contact nodes, shape (n, d).
    field
        Name of a field, as `scalar` takes it.
    label
        Of the colours.
    scale
        By which the displacement is multiplied; by default as `magnification` has it.
    """
    grid, d = body.grid, body.grid.dimension
    u = np.asarray(body.at_points["displacement"])[:, :d]
    points = grid.points[:, :d]
    cells, nodes = _triangles(grid)
    corners, moved = points[nodes], u[nodes]
    values, in_cells = scalar(body, field)
    colours = values[cells] if in_cells else values[nodes]
    used = np.unique(grid.corners)
    if scale is None:
        scale = magnification(extent(body), farthest(body))
    places = points[used] + scale * u[used]
    box = np.array([places.min(axis=0), places.max(axis=0)])
    outline = points[_boundary(grid.corners)] if d == 2 else np.empty((0, 2, 3))
    if d == 2 and len(cells) > MOST_CELLS:
        image = pixels(corners + scale * moved, colours, box)
        empty = np.empty((0, 3, d))
        return Picture(empty, empty, np.empty(0), outline, image, box, scale, label, held)
    return Picture(corners, moved, colours, outline, None, box, scale, label, held)


def extent(body: VTU) -> float:
    """Return the largest extent of a body at rest."""
    used = np.unique(body.grid.corners)
    return float(np.ptp(body.grid.points[used], axis=0).max())


def farthest(body: VTU) -> float:
    """Return the largest displacement of a corner."""
    used = np.unique(body.grid.corners)
    return float(np.linalg.norm(np.asarray(body.at_points["displacement"])[used], axis=1).max())


def scalar(body: VTU, field: str) -> tuple[Array, bool]:
    """Return a scalar field of a body, and whether its values are those of the cells.

    Derived fields are taken as they are in cells of degree 1, and averaged at the nodes of
    others. ``displacement``, ``stress``... are the lengths of these vectors and tensors, and
    ``displacement_y``, ``stress_xy``... their components.

    Raises
    ------
    InputError
        If the body has no such field.
    """
    name, _, component = field.rpartition("_")
    for whole, part in ((field, ""), (name, component)):
        linear = body.grid.cells.shape[1] == body.grid.dimension + 1
        in_cells = linear and f"{whole}_cell" in body.in_cells
        fields, key = (body.in_cells, f"{whole}_cell") if in_cells else (body.at_points, whole)
        if key not in fields or not set(part) <= set("xyz"):
            continue
        values = np.asarray(fields[key])
        if not part and values.ndim > 1:
            return np.asarray(np.linalg.norm(values, axis=1)), in_cells
        if not part:
            return values, in_cells
        if values.ndim > 1 and len(part) == (2 if values.shape[1] == 9 else 1):
            return values[:, int("".join(str("xyz".index(i)) for i in part), 3)], in_cells
    endings = {1: "", 2: "[_x, ...]", 3: "[_x, ...]", 9: "[_xx, ...]"}
    accepted = [
        f"{name}{endings.get(np.size(v) // len(v), '')}" for name, v in body.at_points.items()
    ]
    raise InputError(f"--field {field}: no such field; accepted: {', '.join(sorted(accepted))}")


def _triangles(grid: Grid) -> tuple[Indices, Indices]:
    """Return cells and three nodes of each: the cells in the plane, the surface in space."""
    if grid.dimension == 2:
        return np.arange(len(grid.cells)), grid.corners
    faces = _faces(grid.corners)
    chosen = _single(faces)
    return chosen % len(grid.cells), faces[chosen]


def _faces(corners: Indices) -> Indices:
    """Return the faces of simplices by their corners, the first of all, then the second..."""
    size = corners.shape[1]
    return np.concatenate([np.delete(corners, k, axis=1) for k in range(size)])


def _single(faces: Indices) -> Indices:
    """Return the places of the faces that occur once."""
    _, first, count = np.unique(
        np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True
    )
    return np.sort(first[count == 1])


def _boundary(corners: Indices) -> Indices:
    """Return the edges on the boundary of triangles, by their ends."""
    edges = _faces(corners)
    return edges[_single(edges)]


def widened(low: float, high: float) -> tuple[float, float]:
    """Return the ends of the colours: rounding of what is the same everywhere has none."""
    least = 1e-6 * max(abs(low), abs(high))
    return (low, high) if high - low > least else (low - 0.05 * abs(low), high + 0.05 * abs(high))
