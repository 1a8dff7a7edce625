"""Grids of a rectangle or a box, with sides and pieces of sides as parts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh
from mpi4py import MPI

from contact.errors import InputError
from contact.mesh.domain import Domain, exterior_facets, rotate, with_names

#: Sides of the generators: name -> (axis, end), end 0 at the lower coordinate.
RECTANGLE_SIDES = {"left": (0, 0), "right": (0, 1), "bottom": (1, 0), "top": (1, 1)}
BOX_SIDES = {
    "left": (0, 0),
    "right": (0, 1),
    "front": (1, 0),
    "back": (1, 1),
    "bottom": (2, 0),
    "top": (2, 1),
}


@dataclass(frozen=True)
class Piece:
    """A side of a generated mesh, or the piece of it between two grid positions.

    Attributes
    ----------
    side
        Name of the side.
    start, stop
        Corners of the piece, in the coordinates before rotation that run along the side: one
        number for a rectangle, two for a box, in the order of the axes (``top``: x, y). None
        means the end of the side.
    """

    side: str
    start: float | Sequence[float] | None = None
    stop: float | Sequence[float] | None = None


def rectangle(
    comm: MPI.Intracomm,
    origin: Sequence[float],
    size: Sequence[float],
    cells: Sequence[int],
    parts: Mapping[str, Piece | Sequence[Piece]] | None = None,
    diagonal: str = "right",
    rotation: float = 0.0,
) -> Domain:
    """Make a rectangle of triangles with the parts ``left``, ``right``, ``bottom``, ``top``.

    Parameters
    ----------
    origin
        Lower left corner before rotation.
    size, cells
        Width and height; number of squares along them.
    parts
        Further parts: a piece of a side, or several.
    diagonal
        How a square is cut: ``right``, ``left``, ``crossed``, ``left_right`` or ``right_left``.
    rotation
        Degrees, counter-clockwise about the point (0, 0).

    Raises
    ------
    InputError
        On wrong sizes or pieces; the ends of a piece must be grid positions.
    """
    grid = _grid(origin, size, cells, 2)
    kinds = dmesh.DiagonalType.__members__
    if diagonal not in kinds:
        raise InputError(f"mesh diagonal {diagonal!r} is unknown (accepted: {', '.join(kinds)})")
    chosen = _boxes(grid, RECTANGLE_SIDES, parts or {})
    mesh = dmesh.create_rectangle(
        comm,
        grid[:2],
        list(cells),
        ghost_mode=dmesh.GhostMode.none,
        diagonal=kinds[diagonal],
    )
    domain = _name_grid(mesh, grid, chosen)
    rotate(mesh, rotation, (0.0, 0.0, 1.0))
    return domain


def box(
    comm: MPI.Intracomm,
    origin: Sequence[float],
    size: Sequence[float],
    cells: Sequence[int],
    parts: Mapping[str, Piece | Sequence[Piece]] | None = None,
    rotation: float = 0.0,
    axis: Sequence[float] = (0.0, 1.0, 0.0),
) -> Domain:
    """Make a box of tetrahedra; its parts are ``left`` ... ``top``.

    ``left`` and ``right`` bound x, ``front`` and ``back`` y, ``bottom`` and ``top`` z.
    The arguments are those of `rectangle`; ``rotation`` (degrees, right-handed) is about
    ``axis`` through the point (0, 0, 0).

    Raises
    ------
    InputError
        On wrong sizes or pieces; the corners of a piece must be grid positions.
    """
    grid = _grid(origin, size, cells, 3)
    if np.shape(axis) != (3,) or not np.linalg.norm(axis) > 0.0:
        raise InputError(f"mesh axis must be 3 numbers, not all zero; given: {axis}")
    chosen = _boxes(grid, BOX_SIDES, parts or {})
    mesh = dmesh.create_box(comm, grid[:2], list(cells), ghost_mode=dmesh.GhostMode.none)
    domain = _name_grid(mesh, grid, chosen)
    rotate(mesh, rotation, axis)
    return domain


# A grid is (low corner, high corner, cell size), each of shape (d,).
_Grid = tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float64]]
# A piece on the grid: axis, coordinate of the side, low and high corner along the other axes.
_Patch = tuple[int, float, npt.NDArray[np.float64], npt.NDArray[np.float64]]


def _grid(origin: Sequence[float], size: Sequence[float], cells: Sequence[int], dim: int) -> _Grid:
    for key, given in (("origin", origin), ("size", size), ("cells", cells)):
        if np.shape(given) != (dim,):
            raise InputError(f"mesh {key} must be {dim} numbers; given: {given}")
    if min(size) <= 0:
        raise InputError(f"mesh size must be positive; given: {list(size)}")
    if min(cells) < 1 or any(n != int(n) for n in cells):
        raise InputError(f"mesh cells must be positive whole numbers; given: {list(cells)}")
    low = np.asarray(origin, dtype=np.float64)
    extent = np.asarray(size, dtype=np.float64)
    return low, low + extent, extent / np.asarray(cells)


def _boxes(
    grid: _Grid,
    sides: Mapping[str, tuple[int, int]],
    parts: Mapping[str, Piece | Sequence[Piece]],
) -> dict[str, list[_Patch]]:
    """Turn the sides and the extra parts into patches of the grid's boundary."""
    pieces: dict[str, Sequence[Piece]] = {side: [Piece(side)] for side in sides}
    for name, given in parts.items():
        if name in sides:
            raise InputError(f"mesh part {name!r} is a side already; choose another name")
        pieces[name] = [given] if isinstance(given, Piece) else list(given)
    return {name: [_patch(name, p, grid, sides) for p in ps] for name, ps in pieces.items()}


def _patch(name: str, piece: Piece, grid: _Grid, sides: Mapping[str, tuple[int, int]]) -> _Patch:
    if piece.side not in sides:
        raise InputError(
            f"mesh part {name!r}: unknown side {piece.side!r} (accepted: {', '.join(sides)})"
        )
    axis, end = sides[piece.side]
    along = [i for i in range(len(grid[0])) if i != axis]
    low, high, h = (values[along] for values in grid)
    start = _on_grid(name, "from", piece.start, low, (low, high, h))
    stop = _on_grid(name, "to", piece.stop, high, (low, high, h))
    if np.any(stop - start < 0.5 * h):
        raise InputError(
            f"mesh part {name!r}: to must lie beyond from; given: from {start.tolist()} "
            f"to {stop.tolist()}"
        )
    return axis, float(grid[end][axis]), start, stop


def _on_grid(
    name: str,
    key: str,
    given: float | Sequence[float] | None,
    default: npt.NDArray[np.float64],
    along: _Grid,
) -> npt.NDArray[np.float64]:
    """Return a corner of a piece, which must be a grid position on the side."""
    if given is None:
        return default
    low, high, h = along
    point = np.atleast_1d(np.asarray(given, dtype=np.float64))
    if point.shape != low.shape:
        raise InputError(
            f"mesh part {name!r}: {key} must be {low.size} number(s) along the side; given: {given}"
        )
    step = (point - low) / h
    count = np.rint((high - low) / h)
    below, above = np.clip(np.floor(step), 0, count), np.clip(np.ceil(step), 0, count)
    nearest = np.clip(np.rint(step), 0, count)
    # Relative to the cell size, so that decimal fractions such as 0.1 + 0.2 pass.
    if np.any(np.abs(step - nearest) > 1e-6):
        i = int(np.argmax(np.abs(step - nearest)))
        options = sorted({float(low[i] + k * h[i]) for k in (below[i], above[i])})
        raise InputError(
            f"mesh part {name!r}: {key} = {point[i]:g} is no grid position of its side "
            f"(nearest: {', '.join(f'{v:g}' for v in options)})"
        )
    return low + nearest * h


def _name_grid(mesh: dmesh.Mesh, grid: _Grid, parts: Mapping[str, list[_Patch]]) -> Domain:
    """Choose the facets by their midpoints, which lie well inside every patch or well outside."""
    facets = exterior_facets(mesh)
    middle = dmesh.compute_midpoints(mesh, mesh.topology.dim - 1, facets)[:, : len(grid[0])]
    chosen = {}
    for name, patches in parts.items():
        inside = np.zeros(facets.size, dtype=bool)
        for axis, level, start, stop in patches:
            along = np.delete(middle, axis, axis=1)
            inside |= (
                (np.abs(middle[:, axis] - level) < 1e-3 * grid[2][axis])
                & np.all(along > start, axis=1)
                & np.all(along < stop, axis=1)
            )
        chosen[name] = facets[inside]
    return with_names(mesh, chosen, {})
