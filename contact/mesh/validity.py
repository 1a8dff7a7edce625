"""Checks of a mesh given as arrays, before it is distributed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce

import numpy as np
import numpy.typing as npt

from contact.errors import InputError
from contact.mesh.cells import SHAPES, Shape, proper, rule
from contact.mesh.domain import UNLESS
from contact.mesh.entities import combinations
from contact.mesh.extraction import BODY, Ints, Model
from contact.mesh.geometry import determinant, inverse, jacobians
from contact.typing import Array

#: A cell is degenerate if its volume is below this times (longest edge)^d. Gmsh's qualities, which
#: need its model, would not do: the signs of the volumes say whether cells overlap.
FLAT = 1e-10

#: Halvings of a hexahedron after which its Jacobian, still undecided, is nearly zero somewhere.
HALVINGS = 6

#: Nodes of degree 2 this near to where straight edges have them, over these, are there (rounding).
STRAIGHT = 1e-5


@dataclass(frozen=True)
class Groups:
    """Named groups of cells or facets that may overlap.

    Attributes
    ----------
    names
        Names of the groups.
    rows
        Their corners, no two the same, shape (k, n).
    labels
        Which of the ``sets`` holds the groups that a row belongs to, shape (k,).
    sets
        Positions in ``names``.
    """

    names: tuple[str, ...]
    rows: Ints
    labels: npt.NDArray[np.int32]
    sets: tuple[tuple[int, ...], ...]

    def without_rows(self) -> Groups:
        """Return the names alone, for ranks that read nothing."""
        return replace(self, rows=self.rows[:0], labels=self.labels[:0])


@dataclass(frozen=True)
class Cells:
    """A checked mesh.

    Attributes
    ----------
    shape
        Of the cells.
    points
        Coordinates, shape (n, d).
    regions
        Groups of cells; their rows, shape (m, k), are all cells of the mesh by the nodes of the
        Lagrange element of degree 1, or of degree 2 where some are curved.
    parts
        Groups of facets on its boundary.
    unusable, notes
        As in `Domain`.
    inside
        Which of the parts have facets inside of the body; these are unusable too, but for supports.
    space
        As of a `Model`.
    """

    shape: Shape
    points: Array
    regions: Groups
    parts: Groups
    unusable: dict[str, str]
    notes: tuple[str, ...]
    inside: tuple[str, ...] = ()
    space: Mapping[str, int | str] = field(default_factory=dict)

    def without_rows(self) -> Cells:
        """Return the names alone, for ranks that read nothing."""
        regions, parts = self.regions.without_rows(), self.parts.without_rows()
        return replace(self, points=self.points[:0], regions=regions, parts=parts)


#: Note on curved hexahedra of 20 nodes.
SERENDIPITY = (
    "the middles of curved faces are interpolated from their edges: pressures may scatter where "
    "faces are distorted, and do not with 27 nodes a cell (in Gmsh Mesh.SecondOrderIncomplete = 0)"
)


def check_model(model: Model) -> Cells:
    """Check a mesh and bring it into the form in which it is distributed.

    The body consists of the cells in physical groups, or of all cells where no group has any.
    Groups may overlap. A group of facets that are not all on the boundary of the body can be
    fixed, or an electrode, but is no part of the boundary; one without a cell is set aside.

    Raises
    ------
    InputError
        For other meshes than of triangles or quadrilaterals in a plane z = const, or of tetrahedra
        or hexahedra, of order 1 or 2, for cells without volume or that overlap, and if no part is
        left.
    """
    dim = model.dim
    shape = _check_kinds(model.kinds, dim)
    order = np.argsort(model.tags)
    tags, points = model.tags[order], model.points[order]
    if np.any(tags[1:] == tags[:-1]):
        raise InputError("it has several nodes of one number", "mesh-file")
    first = _placed(shape.nodes(1), model.places)
    every = _places(tags, model.cells)
    curved = _curved(points, every, model.places, shape, first)
    kept = _placed(shape.nodes(2), model.places) if curved else first
    regions = _join(
        {name: _places(tags, nodes)[:, kept] for name, nodes in model.regions.items() if len(nodes)}
        or {BODY: every[:, kept]}
    )
    if np.any(kept < 0):
        points, rows = _filled(points, regions.rows, shape, kept)
        regions = replace(regions, rows=rows)
    notes = [*model.notes]
    if dim == 3 and np.any(kept < 0):
        notes.append(SERENDIPITY)
    if left := len(np.unique(_number(every[:, first]))) - len(regions.rows):
        notes.append(f"{left} cell(s) in no physical group are no part of the body")
    # The nodes of the body alone; others may be centres of circles.
    used = np.unique(regions.rows)
    new = np.full(len(points), -1)
    new[used] = np.arange(used.size)
    points = _flatten(points[used], dim)
    cells = new[regions.rows]

    around = shape.facet.around
    parts = {name: new[_places(tags, nodes)][:, around] for name, nodes in model.parts.items()}
    reasons, inside = _check_cells(shape, points, cells, parts)
    usable = {name: rows for name, rows in parts.items() if name not in reasons}
    if not usable:
        if reasons:
            raise InputError(next(iter(reasons.values())), "part-facets")
        entities = "curves" if dim == 2 else "surfaces"
        raise InputError(
            f"it has no physical groups of {entities}, nor sets or tags of facets or nodes: no "
            "part has a name",
            "no-groups",
        )
    notes += [
        reason if name in inside else f"ignored: {reason}" for name, reason in reasons.items()
    ]
    kept_parts = _join(usable | {name: parts[name] for name in inside})
    regions = replace(regions, rows=cells)
    space = model.space
    return Cells(shape, points, regions, kept_parts, reasons, tuple(notes), inside, space)


def _check_kinds(kinds: Sequence[tuple[str, int, int]], dim: int) -> Shape:
    """Return the shape of the cells, which must have one, and nodes up to degree 2."""
    if dim < 2:
        raise InputError(
            "it has no triangles, quadrilaterals, tetrahedra or hexahedra (Gmsh saves the elements "
            "of physical groups alone, if there are any: the body needs a physical group, too)",
            "no-groups",
        )
    labels = [(label, order) for label, kind_dim, order in kinds if kind_dim == dim]
    for label, order in labels:
        if label.split()[0].lower() not in {shape.name for shape in SHAPES} or order > 2:
            why = "another shape" if order < 3 else f"order {order}"
            raise InputError(
                f"its cells include {label!r}, of {why}; accepted are triangles or quadrilaterals "
                "in 2-D, tetrahedra, hexahedra, prisms or pyramids in 3-D, of order 1 or 2",
                "cell-kinds",
            )
    return Shape(labels[0][0].split()[0].lower())


def _placed(nodes: Array, places: Array) -> Ints:
    """Return which nodes of a cell of a file are those of an element, -1 for none, (k,)."""
    distance = np.linalg.norm(nodes[:, None] - places, axis=2)
    return np.where(distance.min(axis=1) < 0.1, distance.argmin(axis=1), -1)


def _curved(points: Array, cells: Ints, places: Array, shape: Shape, first: Ints) -> bool:
    """Tell whether some nodes of cells are not where straight edges have them.

    Parameters
    ----------
    points, cells
        Coordinates, shape (n, 3), and nodes, shape (m, k).
    places, shape, first
        The nodes of a cell in the reference cell, its shape, and which of them are its corners.
    """
    if len(places) == shape.corners:
        return False
    corners = points[cells[:, first]]
    aside = np.linalg.norm(points[cells] - shape.lagrange(1, places) @ corners, axis=2)
    unit = np.ptp(corners, axis=1).max(axis=1)
    return not bool(np.all(aside.max(axis=1) <= STRAIGHT * unit))


def _filled(points: Array, cells: Ints, shape: Shape, kept: Ints) -> tuple[Array, Ints]:
    """Return serendipity cells as those of degree 2, with the points added to them.

    Parameters
    ----------
    points, cells
        Coordinates, and nodes of cells, shape (m, k); where there is none in `kept` any.
    shape, kept
        The shape of the cells, and which nodes there are, -1 for none.
    """
    rows = cells.copy()
    for nodes, ends, weights in shape.serendipity:
        if kept[nodes[0]] < 0:
            corners = cells[:, ends].reshape(-1, ends.shape[1])
            number = _number(corners)
            added = (weights @ points[cells]).reshape(-1, 3)
            rows[:, nodes] = len(points) + number.reshape(len(cells), -1)
            points = np.concatenate([points, added[np.unique(number, return_index=True)[1]]])
    return points, rows


def _places(tags: Ints, nodes: Ints) -> Ints:
    """Return the positions of nodes in the ascending tags."""
    places = np.minimum(np.searchsorted(tags, nodes), max(tags.size - 1, 0))
    if tags.size == 0 or np.any(tags[places] != nodes):
        raise InputError("it has elements whose nodes it does not have", "mesh-file")
    return places


def _flatten(points: Array, dim: int) -> Array:
    """Return the coordinates in 2-D or in 3-D."""
    extent = np.ptp(points, axis=0)
    if not np.all(np.isfinite(extent)):
        raise InputError("it has nodes whose coordinates are no numbers, or too large", "mesh-file")
    if dim == 2 and extent[2] > 1e-9 * extent.max():
        raise InputError(
            "it is a surface in 3-D; accepted are meshes of tetrahedra (the volume needs a "
            "physical group) and plane meshes with z = const",
            "surface-mesh",
        )
    return np.ascontiguousarray(points[:, :dim])


def _number(rows: Ints) -> Ints:
    """Return the number of each row, shape (n,), equal for equal ones: 0, 1, 2, ..."""
    rows = np.sort(rows, axis=1)
    order = np.lexsort(rows.T)
    new = np.any(rows[order][1:] != rows[order][:-1], axis=1)
    number = np.empty(len(rows), dtype=np.int64)
    number[order] = np.concatenate([[0], np.cumsum(new)])[: len(rows)]
    return number


def _join(groups: Mapping[str, Ints]) -> Groups:
    """Make one list of the rows of groups that may share some, or name some twice."""
    rows = np.vstack(list(groups.values()))
    number = _number(rows)
    first = np.unique(number, return_index=True)[1]
    ends = np.cumsum([len(group) for group in groups.values()])
    labels, sets = combinations(first.size, np.split(number, ends[:-1]))
    return Groups(tuple(groups), rows[first], labels, sets)


def _first(wrong: npt.NDArray[np.bool_], corners: Array) -> str:
    """Return where the first wrong cell is, given the corners of all, shape (m, corners, d)."""
    return "(" + ", ".join(f"{v:g}" for v in corners[wrong][0].mean(axis=0)) + ")"


def _may_fold(shape: Shape, x: Array) -> npt.NDArray[np.bool_]:
    """Return which straight cells may be folded inside though they are not at their corners.

    The Jacobian matrix is affine along each coordinate of the reference cell: everywhere it is a
    mean of those at the corners. Where these are nearer to that in the middle than it is to a
    singular one, none between is singular.

    Parameters
    ----------
    shape, x
        Of the cells, and their corners, shape (m, corners, d).
    """
    middle = inverse(jacobians(shape, x, shape.middle))
    change = middle @ jacobians(shape, x, shape.nodes(1)) - np.eye(shape.dim)
    return np.asarray(~(np.linalg.norm(change, axis=(2, 3)).max(axis=1) < 1))


def _folded(shape: Shape, x: Array, limit: Array) -> npt.NDArray[np.bool_]:
    """Return which straight hexahedra have a Jacobian below a limit anywhere, or nearly.

    The Jacobian is of degree 2 along each coordinate: it lies between its Bezier coefficients, and
    has those of corners there. In between the cell is halved (Johnen, Remacle and Geuzaine,
    Geometrical validity of curvilinear finite elements, J. Comput. Phys. 233, 2013).

    Parameters
    ----------
    shape, x, limit
        Of the cells, their corners, shape (m, corners, d), and least Jacobians, (m,).
    """
    halves = np.array([[[4, 0, 0], [2, 2, 0], [1, 2, 1]], [[1, 2, 1], [0, 2, 2], [0, 0, 4]]]) / 4
    to_bezier = np.array([[1.0, 0.0, 0.0], [-0.5, 2.0, -0.5], [0.0, 0.0, 1.0]])
    at = np.moveaxis(np.indices((3, 3, 3)) / 2, 0, -1).reshape(-1, 3)
    values = determinant(jacobians(shape, x, at)).reshape(-1, 3, 3, 3)
    values *= np.sign(values[:, :1, :1, :1])
    pieces = np.einsum("ia,jb,kc,mabc->mijk", *[to_bezier] * 3, values)
    of, found = np.arange(len(x)), np.zeros(len(x), dtype=bool)
    for _ in range(HALVINGS):
        found[of[(pieces[:, ::2, ::2, ::2].min(axis=(1, 2, 3)) <= limit[of])]] = True
        open_ = (pieces.min(axis=(1, 2, 3)) <= limit[of]) & ~found[of]
        pieces = np.einsum("xia,yjb,zkc,mabc->mxyzijk", *[halves] * 3, pieces[open_])
        pieces, of = pieces.reshape(-1, 3, 3, 3), np.repeat(of[open_], 8)
    found[of] = True
    return found


def _least_volume(shape: Shape, nodes: Array) -> Array:
    """Return the least Jacobian of curved cells over its sign at the first corner, shape (m,).

    At the corners, between them, and where integrals are taken.

    Parameters
    ----------
    shape, nodes
        Of the cells, and their nodes, shape (m, k, d).
    """
    at = np.concatenate([shape.nodes(2), rule(shape, 4)[0]])
    each = (determinant(jacobians(shape, nodes, point[None]))[:, 0] for point in at)
    first = next(each)  # one at a time, for all at once take kilobytes a cell
    return reduce(np.minimum, (volume * np.sign(first) for volume in each), np.abs(first))


def _check_cells(
    shape: Shape, points: Array, cells: Ints, parts: Mapping[str, Ints]
) -> tuple[dict[str, str], tuple[str, ...]]:
    """Check cells, and which groups of facets cannot be parts of the boundary.

    Parameters
    ----------
    shape, points, cells
        Of the cells, coordinates, shape (n, d), and nodes, shape (m, k), corners first.
    parts
        Name -> corners of facets, -1 for a node of no cell.

    Returns
    -------
    Name of each group that cannot be a part -> the reason; and those inside of the body.

    Raises
    ------
    InputError
        For cells without volume or that overlap.
    """
    # Without a unit of length, so that no volume overflows or vanishes.
    unit = np.ptp(points, axis=0).max() or 1.0
    nodes, cells = points[cells] / unit, cells[:, : shape.corners]
    x = nodes[:, : shape.corners]
    longest = np.linalg.norm(x[:, :, None] - x[:, None], axis=-1).max(axis=(1, 2))
    volume = determinant(jacobians(shape, x, shape.nodes(1)))
    flat = ~(np.abs(volume).min(axis=1) > FLAT * longest ** points.shape[1])
    collapsed = flat & ~proper(cells)
    if not shape.simplex and np.any(collapsed):
        raise InputError(
            f"it has {collapsed.sum()} cell(s) with one node at several corners, the first near "
            f"{_first(collapsed, x * unit)}; accepted: {shape.plural} with nodes of their own",
            "collapsed-cells",
        )
    if np.any(flat):
        where = _first(flat, x * unit)
        raise InputError(
            f"it has {flat.sum()} cell(s) of zero volume, the first near {where}", "mesh-geometry"
        )
    folded = np.abs(np.sign(volume).sum(axis=1)) < volume.shape[1]
    if np.any(folded):
        raise InputError(
            f"it has {folded.sum()} cell(s) with a corner of 180 degrees or more, the first near "
            f"{_first(folded, x * unit)}",
            "folded-cells",
        )
    curved = nodes.shape[1] > shape.corners
    bent = np.full(len(cells), curved)
    limit = FLAT * longest ** points.shape[1]
    if curved:
        bent[:] = ~(_least_volume(shape, nodes) > limit)
    elif shape.dim == 3 and not shape.simplex:
        bent[:] = _may_fold(shape, x)
        bent[bent] = _folded(shape, x[bent], limit[bent])
    if np.any(bent) and curved:
        raise InputError(
            f"it has {bent.sum()} cell(s) that are folded by their curved edges, the first near "
            f"{_first(bent, x * unit)}",
            "folded-edges",
        )
    if np.any(bent):
        raise InputError(
            f"it has {bent.sum()} cell(s) that are folded inside, the first near "
            f"{_first(bent, x * unit)}",
            "folded-cells",
        )

    cell_facets = np.sort(cells[:, shape.facet_corners], axis=2)
    # Three corners of a facet, two in 2-D, the same for both of its cells, and one inside.
    corners = points[cell_facets[:, :, : points.shape[1]]] / unit
    inside = np.broadcast_to(x.mean(axis=1)[:, None, None], corners[:, :, :1].shape)
    edges = np.concatenate([corners[:, :, 1:], inside], axis=2) - corners[:, :, :1]
    sides = np.sign(np.linalg.det(edges))

    number = _number(np.vstack([cell_facets.reshape(-1, cell_facets.shape[2]), *parts.values()]))
    inner, outer = number[: sides.size], number[sides.size :]
    total = int(number.max()) + 1
    count = np.bincount(inner, minlength=total)
    # Two cells that share a facet must lie on either side of it.
    side = np.bincount(inner, weights=sides.ravel(), minlength=total)
    wrong = (count > 2) | ((count == 2) & (side != 0.0))
    if np.any(wrong):
        raise InputError(
            f"its cells overlap (inverted cells) at {wrong.sum()} facet(s)", "mesh-geometry"
        )

    reasons: dict[str, str] = {}
    within: list[str] = []
    ends = np.cumsum([len(facets) for facets in parts.values()])
    for name, members in zip(parts, np.split(outer, ends), strict=False):
        neighbours = count[members]
        if not neighbours.size:
            reasons[name] = f"the physical group {name!r} has no facets"
        elif np.any(neighbours == 0):
            reasons[name] = f"the physical group {name!r} has facets that bound no cell"
        elif np.any(neighbours == 2):
            within.append(name)
            reasons[name] = (
                f"the physical group {name!r} has {np.count_nonzero(neighbours == 2)} interior "
                f"facet(s); a part must lie on the boundary of the body{UNLESS}"
            )
    return reasons, tuple(within)
