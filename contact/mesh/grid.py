"""Grids of a rectangle or a box, with sides and pieces of sides as parts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scipy.spatial.transform import Rotation

from contact.errors import InputError, shown
from contact.mesh.domain import Domain, with_names
from contact.mesh.entities import exterior_facets


def rotate(mesh: dmesh.Mesh, degrees: float, axis: Sequence[float] = (0.0, 1.0, 0.0)) -> None:
    """Turn a mesh in place about an axis through the origin."""
    if degrees != 0.0:
        way = degrees * np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
        turn = Rotation.from_rotvec(way, degrees=True).as_matrix()
        mesh.geometry.x[:] = mesh.geometry.x @ turn.T


#: Shortest edge of a rectangle or box that dolfinx takes for one.
SHORTEST = float(np.finfo(np.float64).eps)

#: Most that a cell may be stretched: far beyond use, and rounding leaves the rest some digits.
STRETCHED = 1e6

#: Generator -> its shapes of cells, the usual one first.
CELLS = {"rectangle": ("triangle", "quadrilateral"), "box": ("tetrahedron", "hexahedron")}

#: Generator -> its sides: name -> (axis, end), end 0 at the lower coordinate.
SIDES = {
    "rectangle": {"left": (0, 0), "right": (0, 1), "bottom": (1, 0), "top": (1, 1)},
    "box": {
        **{"left": (0, 0), "right": (0, 1), "front": (1, 0), "back": (1, 1)},
        **{"bottom": (2, 0), "top": (2, 1)},
    },
}


class GridError(InputError):
    """A wrong key of ``[mesh]``, with the given value, and the accepted ones in words."""

    def __init__(self, key: str, given: Any, accepted: str) -> None:
        super().__init__(f"mesh.{key}: given {given}; accepted: {accepted}", "value")
        self.args = key, given, accepted  # by which it is copied to other ranks
        self.key, self.given, self.accepted = key, given, accepted


@dataclass(frozen=True)
class Piece:
    """A side of a generated mesh, or the piece of it between two grid positions."""

    side: str  #: its name
    #: Corners of the piece, in the coordinates before rotation that run along the side: one number
    #: for a rectangle, two for a box, in the order of the axes (``top``: x, y); None for its end.
    start: float | Sequence[float] | None = None
    stop: float | Sequence[float] | None = None  #: likewise


def rectangle(
    comm: MPI.Intracomm,
    origin: Sequence[float],
    size: Sequence[float],
    cells: Sequence[int],
    parts: Mapping[str, Piece | Sequence[Piece]] | None = None,
    diagonal: str = "right",
    rotation: float = 0.0,
    cell: str = "triangle",
) -> Domain:
    """Make a rectangle with the parts ``left``, ``right``, ``bottom``, ``top``.

    Parameters
    ----------
    origin
        Lower left corner before rotation.
    size, cells
        Width and height; number of squares along them.
    parts
        Further parts: a piece of a side, or several.
    diagonal
        How a square is cut: ``right``, ``left``, ``crossed``, ``left_right`` or ``right_left``. Of
        a body of revolution at degree 1 take ``crossed``: pressures next to the axis are better.
    rotation
        Degrees, counter-clockwise about the point (0, 0).
    cell
        ``triangle``, or ``quadrilateral``: squares as they are.

    Raises
    ------
    InputError
        On wrong sizes or pieces; the ends of a piece must be grid positions.
    """
    grid, chosen = plan("rectangle", origin, size, cells, parts or {})
    kinds = dmesh.DiagonalType.__members__
    if diagonal not in kinds:
        raise InputError(
            f"mesh diagonal {diagonal!r} is unknown (accepted: {', '.join(kinds)})", "generator"
        )
    mesh = dmesh.create_rectangle(
        comm,
        grid[:2],
        list(cells),
        cell_type=_cell_type("rectangle", cell),
        diagonal=kinds[diagonal],
        ghost_mode=dmesh.GhostMode.none,
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
    cell: str = "tetrahedron",
) -> Domain:
    """Make a box of tetrahedra or of hexahedra (``cell``); its parts are ``left`` ... ``top``.

    ``left`` and ``right`` bound x, ``front`` and ``back`` y, ``bottom`` and ``top`` z.
    The arguments are those of `rectangle`; ``rotation`` (degrees, right-handed) is about
    ``axis`` through the point (0, 0, 0).

    Raises
    ------
    InputError
        On wrong sizes or pieces; the corners of a piece must be grid positions.
    """
    grid, chosen = plan("box", origin, size, cells, parts or {})
    if np.shape(axis) != (3,) or not np.linalg.norm(axis) > 0.0:
        raise InputError(f"mesh axis must be 3 numbers, not all zero; given: {axis}", "generator")
    kind = _cell_type("box", cell)
    mesh = dmesh.create_box(
        comm, grid[:2], list(cells), cell_type=kind, ghost_mode=dmesh.GhostMode.none
    )
    domain = _name_grid(mesh, grid, chosen)
    rotate(mesh, rotation, axis)
    return domain


def _cell_type(kind: str, cell: str) -> dmesh.CellType:
    if cell not in CELLS[kind]:
        raise GridError("cell", repr(cell), " or ".join(map(repr, CELLS[kind])))
    return dmesh.CellType[cell]


# A grid is (low corner, high corner, cell size), each of shape (d,).
_Grid = tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float64]]
# A piece on the grid: axis, coordinate of the side, low and high corner along the other axes.
_Patch = tuple[int, float, npt.NDArray[np.float64], npt.NDArray[np.float64]]


def plan(
    kind: str,
    origin: Sequence[float],
    size: Sequence[float],
    cells: Sequence[int],
    parts: Mapping[str, Piece | Sequence[Piece]],
) -> tuple[_Grid, dict[str, list[_Patch]]]:
    """Check the arguments of `rectangle` or `box`; return the grid and the patches of parts."""
    sides = SIDES[kind]
    dim = len(sides) // 2
    for key, given in (("origin", origin), ("size", size), ("cells", cells)):
        if np.shape(given) != (dim,):
            raise GridError(key, given, f"a list of {dim} numbers for a {kind}")
    if not min(size) > 0:
        raise GridError("size", size, "positive numbers")
    if min(cells) < 1 or any(n != int(n) for n in cells):
        raise GridError("cells", cells, "positive whole numbers")
    low = np.asarray(origin, dtype=np.float64)
    extent = np.asarray(size, dtype=np.float64)
    grid = low, low + extent, extent / np.asarray(cells)
    if not np.all(grid[1] - grid[0] > SHORTEST) or np.max(grid[2]) > STRETCHED * np.min(grid[2]):
        accepted = (
            f"sizes above {SHORTEST:.2g}, also beside the origin, and cells of which no edge is "
            f"more than {STRETCHED:g} times as long as another"
        )
        raise GridError("size", list(size), accepted)
    patches = {side: [_patch("", Piece(side), grid, sides)] for side in sides}
    for name, pieces in parts.items():
        key = f"parts.{name}"
        if name in sides:
            raise GridError(key, name, "a name that no side has")
        if isinstance(pieces, Sequence):
            patches[name] = [_patch(f"{key}.{i}", p, grid, sides) for i, p in enumerate(pieces)]
        else:
            patches[name] = [_patch(key, pieces, grid, sides)]
    return grid, patches


def _patch(key: str, piece: Piece, grid: _Grid, sides: Mapping[str, tuple[int, int]]) -> _Patch:
    if piece.side not in sides:
        raise GridError(f"{key}.side", piece.side, ", ".join(map(shown, sides)))
    axis, end = sides[piece.side]
    along = [i for i in range(len(grid[0])) if i != axis]
    low, high, h = (values[along] for values in grid)
    start = _on_grid(f"{key}.from", piece.start, low, (low, high, h))
    stop = _on_grid(f"{key}.to", piece.stop, high, (low, high, h))
    if np.any(stop - start < 0.5 * h):
        given = high.tolist() if piece.stop is None else piece.stop
        raise GridError(f"{key}.to", given, "a position beyond from")
    return axis, float(grid[end][axis]), start, stop


def _on_grid(
    key: str,
    given: float | Sequence[float] | None,
    default: npt.NDArray[np.float64],
    along: _Grid,
) -> npt.NDArray[np.float64]:
    """Return a corner of a piece, which must be a grid position on the side."""
    if given is None:
        return default
    low, high, h = along
    # A number in the plane, a list of two in 3-D.
    if np.shape(given) != (() if low.size == 1 else low.shape):
        accepted = "a number" if low.size == 1 else f"a list of {low.size} numbers"
        raise GridError(key, given, accepted)
    point = np.atleast_1d(np.asarray(given, dtype=np.float64))
    step = (point - low) / h
    nearest = np.clip(np.rint(step), 0, np.rint((high - low) / h))
    # Relative to the cell size, so that decimal fractions such as 0.1 + 0.2 pass.
    if np.any(np.abs(step - nearest) > 1e-6):
        near = ", ".join(f"{v:g}" for v in low + nearest * h)
        raise GridError(key, given, f"positions of the grid on its side (nearest: {near})")
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
