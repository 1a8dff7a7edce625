"""Checks of a mesh given as arrays, before it is distributed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from contact.errors import InputError
from contact.mesh.domain import BODY
from contact.mesh.entities import combinations
from contact.mesh.extraction import Ints, Model
from contact.typing import Array

#: A cell is degenerate if its volume is below this times (longest edge)^d. Gmsh's qualities, which
#: need its model, would not do: the signs of the volumes say whether cells overlap.
FLAT = 1e-10


@dataclass(frozen=True)
class Groups:
    """Named groups of simplices that may overlap.

    Attributes
    ----------
    names
        Names of the groups.
    rows
        Vertices of the simplices, no two the same, shape (k, n).
    labels
        Which of the ``sets`` holds the groups that a simplex belongs to, shape (k,).
    sets
        Positions in ``names``.
    """

    names: tuple[str, ...]
    rows: Ints
    labels: npt.NDArray[np.int32]
    sets: tuple[tuple[int, ...], ...]

    def without_simplices(self) -> Groups:
        """Return the names alone, for ranks that read nothing."""
        return replace(self, rows=self.rows[:0], labels=self.labels[:0])


@dataclass(frozen=True)
class Cells:
    """A checked mesh.

    Attributes
    ----------
    points
        Coordinates, shape (n, d).
    regions
        Groups of cells; their rows, shape (m, d + 1), are all cells of the mesh.
    parts
        Groups of facets on its boundary.
    unusable, notes
        As in `Domain`.
    """

    points: Array
    regions: Groups
    parts: Groups
    unusable: dict[str, str]
    notes: tuple[str, ...]

    def without_simplices(self) -> Cells:
        """Return the names alone, for ranks that read nothing."""
        regions, parts = self.regions.without_simplices(), self.parts.without_simplices()
        return replace(self, points=self.points[:0], regions=regions, parts=parts)


def check_model(model: Model) -> Cells:
    """Check a mesh and bring it into the form in which it is distributed.

    The body consists of the cells in physical groups, or of all cells where no group has any.
    Groups may overlap. A group of facets that are not all on the boundary of the body cannot be
    a part and is set aside.

    Raises
    ------
    InputError
        For other meshes than of straight-sided triangles in a plane z = const or of tetrahedra,
        for cells without volume or that overlap, and if no part is left.
    """
    dim = model.dim
    _check_kinds(model.kinds, dim)
    order = np.argsort(model.tags)
    tags, points = model.tags[order], model.points[order]
    if np.any(tags[1:] == tags[:-1]):
        raise InputError("it has several nodes of one number")
    regions = _join(
        {name: _places(tags, nodes) for name, nodes in model.regions.items() if len(nodes)}
        or {BODY: _places(tags, model.cells)}
    )
    notes = []
    if left := len(_first_of_each(model.cells)) - len(regions.rows):
        notes.append(f"{left} cell(s) in no physical group are no part of the body")
    # The nodes of the body alone; others may be centres of circles.
    used = np.unique(regions.rows)
    new = np.full(tags.size, -1)
    new[used] = np.arange(used.size)
    points = _flatten(points[used], dim)
    cells = new[regions.rows]

    parts = {name: new[_places(tags, nodes)] for name, nodes in model.parts.items()}
    reasons = _check_cells(points, cells, parts)
    usable = {name: rows for name, rows in parts.items() if name not in reasons}
    if not usable:
        entities = "curves" if dim == 2 else "surfaces"
        first = next(iter(reasons.values()), None)
        raise InputError(first or f"it has no physical groups of {entities}: no part has a name")
    notes += [f"ignored: {reason}" for reason in reasons.values()]
    return Cells(points, replace(regions, rows=cells), _join(usable), reasons, tuple(notes))


def _check_kinds(kinds: Sequence[tuple[str, int, int]], dim: int) -> None:
    if dim < 2:
        raise InputError(
            "it has no triangles or tetrahedra (Gmsh saves the elements of physical groups "
            "alone, if there are any: the body needs a physical group, too)"
        )
    for label, kind_dim, order in kinds:
        if kind_dim == dim and label not in ("Triangle 3", "Tetrahedron 4"):
            why = "curved geometry" if order > 1 else "another shape"
            raise InputError(
                f"its cells include {label!r}, of {why}; accepted are straight-sided "
                "triangles or tetrahedra (Mesh.ElementOrder = 1, no recombination)"
            )


def _places(tags: Ints, nodes: Ints) -> Ints:
    """Return the positions of nodes in the ascending tags."""
    places = np.minimum(np.searchsorted(tags, nodes), max(tags.size - 1, 0))
    if tags.size == 0 or np.any(tags[places] != nodes):
        raise InputError("it has elements whose nodes it does not have")
    return places


def _flatten(points: Array, dim: int) -> Array:
    """Return the coordinates in 2-D or in 3-D."""
    extent = np.ptp(points, axis=0)
    if not np.all(np.isfinite(extent)):
        raise InputError("it has nodes whose coordinates are no numbers, or too large")
    if dim == 2 and extent[2] > 1e-9 * extent.max():
        raise InputError(
            "it is a surface in 3-D; accepted are meshes of tetrahedra (the volume needs a "
            "physical group) and plane meshes with z = const"
        )
    return np.ascontiguousarray(points[:, :dim])


def _first_of_each(rows: Ints) -> Ints:
    """Return the index of the first simplex of each distinct one, shape (k,)."""
    return np.unique(_number(rows), return_index=True)[1]


def _number(rows: Ints) -> Ints:
    """Return the number of each simplex, shape (n,), equal for equal ones: 0, 1, 2, ..."""
    rows = np.sort(rows, axis=1)
    order = np.lexsort(rows.T)
    new = np.any(rows[order][1:] != rows[order][:-1], axis=1)
    number = np.empty(len(rows), dtype=np.int64)
    number[order] = np.concatenate([[0], np.cumsum(new)])[: len(rows)]
    return number


def _join(groups: Mapping[str, Ints]) -> Groups:
    """Make one list of simplices of groups that may share some, or name some twice."""
    rows = np.vstack(list(groups.values()))
    number = _number(rows)
    first = np.unique(number, return_index=True)[1]
    ends = np.cumsum([len(group) for group in groups.values()])
    labels, sets = combinations(first.size, np.split(number, ends[:-1]))
    return Groups(tuple(groups), rows[first], labels, sets)


def _check_cells(points: Array, cells: Ints, parts: Mapping[str, Ints]) -> dict[str, str]:
    """Check cells, and which groups of facets cannot be parts of the boundary.

    Parameters
    ----------
    points, cells
        Coordinates, shape (n, d), and vertices, shape (m, d + 1).
    parts
        Name -> vertices of facets, shape (k, d), -1 for a node of no cell.

    Returns
    -------
    Name of each group that cannot be a part -> the reason.

    Raises
    ------
    InputError
        For cells without volume or that overlap.
    """
    n = cells.shape[1]
    # Without a unit of length, so that no volume overflows or vanishes.
    unit = np.ptp(points, axis=0).max() or 1.0
    # Facet i of a cell lies opposite its vertex i.
    others = np.array([[j for j in range(n) if j != i] for i in range(n)])
    cell_facets = np.sort(cells[:, others], axis=2)
    corners = points[cell_facets] / unit
    apex = points[cells] / unit
    edges = np.concatenate([corners[:, :, 1:], apex[:, :, None]], axis=2) - corners[:, :, :1]
    volume = np.linalg.det(edges)
    longest = np.linalg.norm(edges, axis=-1).max(axis=(1, 2))
    flat = ~(np.abs(volume).min(axis=1) > FLAT * longest ** points.shape[1])
    if np.any(flat):
        middle = ", ".join(f"{v:g}" for v in points[cells[flat][0]].mean(axis=0))
        raise InputError(f"it has {flat.sum()} cell(s) of zero volume, the first near ({middle})")

    number = _number(np.vstack([cell_facets.reshape(-1, n - 1), *parts.values()]))
    inner, outer = number[: cells.size], number[cells.size :]
    total = int(number.max()) + 1
    count = np.bincount(inner, minlength=total)
    # Two cells that share a facet must lie on either side of it.
    side = np.bincount(inner, weights=np.sign(volume).ravel(), minlength=total)
    wrong = (count > 2) | ((count == 2) & (side != 0.0))
    if np.any(wrong):
        raise InputError(f"its cells overlap (inverted cells) at {wrong.sum()} facet(s)")

    reasons = {}
    ends = np.cumsum([len(facets) for facets in parts.values()])
    for name, members in zip(parts, np.split(outer, ends), strict=False):
        neighbours = count[members]
        if not neighbours.size:
            reasons[name] = f"the physical group {name!r} has no facets"
        elif np.any(neighbours == 0):
            reasons[name] = f"the physical group {name!r} has facets that bound no cell"
        elif np.any(neighbours == 2):
            reasons[name] = (
                f"the physical group {name!r} has {np.count_nonzero(neighbours == 2)} interior "
                "facet(s); a part must lie on the boundary of the body"
            )
    return reasons
