"""A mesh and its boundary parts, by name.

Parts may overlap (the side ``top`` and a piece ``loaded`` of it), while a facet tag holds
one number. The tag of a facet is therefore a bit mask of the parts that it belongs to, and
a part is the set of masks that contain its bit.
"""

import difflib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import mesh as dmesh
from mpi4py import MPI

from contact.errors import InputError

#: Facet tags are 32-bit signed integers, one bit a part.
MAX_PARTS = 31

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

Marker = Callable[[npt.NDArray[np.float64]], npt.NDArray[np.bool_]]


@dataclass(frozen=True)
class Domain:
    """A mesh with named boundary parts.

    Creating one is collective.

    Attributes
    ----------
    mesh
        Mesh of triangles or tetrahedra with straight edges.
    facet_tags
        The exterior facets that this rank owns, each with the bit mask of its parts (0: in none).
    parts
        Name of a part -> the tag values, present on any rank, that contain the part. The same
        on all ranks.
    size
        Largest extent of the bounding box of the whole mesh (of a generated one: before its
        rotation, so that lengths derived from it do not depend on the rotation).
    """

    mesh: dmesh.Mesh
    facet_tags: dmesh.MeshTags
    parts: Mapping[str, tuple[int, ...]]
    size: float = field(init=False)

    def __post_init__(self) -> None:
        x = self.mesh.geometry.x
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        if x.shape[0] > 0:
            low, high = x.min(axis=0), x.max(axis=0)
        self.comm.Allreduce(MPI.IN_PLACE, low, MPI.MIN)
        self.comm.Allreduce(MPI.IN_PLACE, high, MPI.MAX)
        object.__setattr__(self, "size", float((high - low).max()))

    @property
    def comm(self) -> MPI.Intracomm:
        """Communicator of the mesh."""
        return self.mesh.comm

    @property
    def dim(self) -> int:
        """Space dimension, 2 or 3."""
        return self.mesh.geometry.dim

    @property
    def dx(self) -> ufl.Measure:
        """Measure over the cells."""
        return ufl.Measure("dx", domain=self.mesh)

    def tag_values(self, name: str) -> tuple[int, ...]:
        """Return the tag values that make up the part ``name``.

        Raises
        ------
        InputError
            If there is no such part; the message names the nearest one and lists all.
        """
        if name not in self.parts:
            near = difflib.get_close_matches(str(name), self.parts, n=1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise InputError(
                f"the mesh has no part {name!r}{hint} (its parts: {', '.join(sorted(self.parts))})"
            )
        return self.parts[name]

    def facets(self, name: str) -> npt.NDArray[np.int32]:
        """Local indices of the facets of part ``name`` that this rank owns, ascending."""
        chosen = np.isin(self.facet_tags.values, self.tag_values(name))
        return self.facet_tags.indices[chosen]

    def ds(self, name: str) -> ufl.Measure:
        """Measure over the facets of part ``name``."""
        return ufl.Measure(
            "ds",
            domain=self.mesh,
            subdomain_data=self.facet_tags,
            subdomain_id=self.tag_values(name),
        )


@dataclass(frozen=True)
class Piece:
    """A side of a generated mesh, or the piece of it between two grid positions.

    Attributes
    ----------
    side
        Name of the side.
    start, end
        Corners of the piece, in the coordinates before rotation that run along the side: one
        number for a rectangle, two for a box, in the order of the axes (``top``: x, y). None
        means the end of the side.
    """

    side: str
    start: float | Sequence[float] | None = None
    end: float | Sequence[float] | None = None


def tagged(
    mesh: dmesh.Mesh, facets: npt.NDArray[np.int32], marks: Mapping[str, npt.NDArray[np.bool_]]
) -> Domain:
    """Make a domain of a mesh and one mask over its exterior facets a part. Collective.

    Parameters
    ----------
    facets
        Exterior facets that this rank owns, shape (n,), ascending.
    marks
        Part -> mask of shape (n,); the same names in the same order on all ranks.
    """
    names = list(marks)
    if len(names) > MAX_PARTS:
        raise InputError(f"the mesh has {len(names)} boundary parts; at most {MAX_PARTS} can be")
    values = np.zeros(facets.size, dtype=np.int32)
    for bit, name in enumerate(names):
        values[marks[name]] |= 1 << bit
    present = mesh.comm.allgather(np.unique(values))
    masks = np.unique(np.concatenate(present)).tolist()
    parts = {name: tuple(m for m in masks if m >> bit & 1) for bit, name in enumerate(names)}
    empty = [name for name, tag_values in parts.items() if not tag_values]
    if empty:
        raise InputError(f"the part {empty[0]!r} contains no facet of the mesh's boundary")
    tags = dmesh.meshtags(mesh, mesh.topology.dim - 1, facets, values)
    tags.name = "parts"
    return Domain(mesh, tags, parts)


def exterior_facets(mesh: dmesh.Mesh) -> npt.NDArray[np.int32]:
    """Exterior facets that this rank owns, ascending. Collective."""
    tdim = mesh.topology.dim
    mesh.topology.create_entities(tdim - 1)
    mesh.topology.create_connectivity(tdim - 1, tdim)
    mesh.topology.create_connectivity(tdim - 1, 0)
    return np.sort(dmesh.exterior_facet_indices(mesh.topology))


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
    domain = _tag_grid(mesh, grid, chosen)
    _rotate(mesh, rotation, (0.0, 0.0, 1.0))
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
    mesh = dmesh.create_box(
        comm, grid[:2], list(cells), ghost_mode=dmesh.GhostMode.none
    )
    domain = _tag_grid(mesh, grid, chosen)
    _rotate(mesh, rotation, axis)
    return domain


# A grid is (low corner, high corner, cell size), each of shape (d,).
_Grid = tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float64]]
# A piece on the grid: axis, coordinate of the side, low and high corner along the other axes.
_Patch = tuple[int, float, npt.NDArray[np.float64], npt.NDArray[np.float64]]


def _grid(
    origin: Sequence[float], size: Sequence[float], cells: Sequence[int], dim: int
) -> _Grid:
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


def _patch(
    name: str, piece: Piece, grid: _Grid, sides: Mapping[str, tuple[int, int]]
) -> _Patch:
    if piece.side not in sides:
        raise InputError(
            f"mesh part {name!r}: unknown side {piece.side!r} (accepted: {', '.join(sides)})"
        )
    axis, end = sides[piece.side]
    along = [i for i in range(len(grid[0])) if i != axis]
    low, high, h = (values[along] for values in grid)
    start = _on_grid(name, "from", piece.start, low, (low, high, h))
    stop = _on_grid(name, "to", piece.end, high, (low, high, h))
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


def _tag_grid(mesh: dmesh.Mesh, grid: _Grid, parts: Mapping[str, list[_Patch]]) -> Domain:
    """Tag the facets by their midpoints, which lie well inside every patch or well outside."""
    facets = exterior_facets(mesh)
    middle = dmesh.compute_midpoints(mesh, mesh.topology.dim - 1, facets)[:, : len(grid[0])]
    marks = {}
    for name, patches in parts.items():
        marks[name] = np.zeros(facets.size, dtype=bool)
        for axis, level, start, stop in patches:
            along = np.delete(middle, axis, axis=1)
            marks[name] |= (
                (np.abs(middle[:, axis] - level) < 1e-3 * grid[2][axis])
                & np.all(along > start, axis=1)
                & np.all(along < stop, axis=1)
            )
    return tagged(mesh, facets, marks)


def _rotate(mesh: dmesh.Mesh, degrees: float, axis: Sequence[float]) -> None:
    """Turn the geometry about an axis through the origin (Rodrigues' formula)."""
    if degrees == 0.0:
        return
    a, b, c = np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    cross = np.array([[0.0, -c, b], [c, 0.0, -a], [-b, a, 0.0]])
    angle = np.deg2rad(degrees)
    turn = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    mesh.geometry.x[:] = mesh.geometry.x @ turn.T


def from_mesh(
    mesh: dmesh.Mesh, parts: Mapping[str, Marker | npt.NDArray[np.integer[Any]]]
) -> Domain:
    """Name parts of the boundary of a dolfinx mesh. Collective.

    Parameters
    ----------
    mesh
        Triangles or tetrahedra with straight edges.
    parts
        Name -> function of x, shape (3, n), that is true at all vertices of the part's facets;
        or the local indices of the facets. The same names on all ranks.

    Raises
    ------
    InputError
        For other meshes, a part without facets, or an interior facet in a part.
    """
    kinds = (dmesh.CellType.triangle, dmesh.CellType.tetrahedron)
    flat = mesh.topology.dim == mesh.geometry.dim and mesh.geometry.cmap.degree == 1
    if mesh.topology.cell_type not in kinds or not flat:
        raise InputError(
            "the mesh must consist of triangles in the plane or of tetrahedra, "
            "with straight edges (geometry of degree 1)"
        )
    facets = exterior_facets(mesh)
    fdim = mesh.topology.dim - 1
    owned = mesh.topology.index_map(fdim).size_local
    marks = {}
    for name, given in parts.items():
        if callable(given):
            chosen = dmesh.locate_entities_boundary(mesh, fdim, given)
        else:
            chosen = np.asarray(given, dtype=np.int32)
        chosen = chosen[chosen < owned]
        inside = int(np.count_nonzero(~np.isin(chosen, facets)))
        if mesh.comm.allreduce(inside) > 0:
            raise InputError(f"the part {name!r} contains interior facets of the mesh")
        marks[name] = np.isin(facets, chosen)
    return tagged(mesh, facets, marks)
