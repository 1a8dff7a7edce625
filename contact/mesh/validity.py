"""Checks of the contents of a mesh file, and parts and regions of its cells, on one rank."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce

import numpy as np
import numpy.typing as npt

from contact.errors import InputError
from contact.mesh.cells import SHAPES, Shape, rule, single_facets, unique_rows
from contact.mesh.contents import (
    BODY,
    Contents,
    Ints,
    Kind,
    in_dolfinx_order,
    name_clash,
    with_one_shape,
)
from contact.mesh.domain import UNLESS
from contact.mesh.entities import combinations
from contact.mesh.geometry import determinant, inverse, jacobians
from contact.typing import Array

#: Least volume of a cell over (longest edge)^d: the signs of volumes tell whether cells overlap.
FLAT = 1e-10

#: Largest distance of nodes of degree 2 from those of straight edges, over their length (rounding).
STRAIGHT = 1e-5


@dataclass(frozen=True)
class Groups:
    """Named groups of cells or facets that may overlap.

    Attributes
    ----------
    names
        Names of the groups.
    rows
        Their nodes, each row once, shape (k, n).
    labels
        Position in ``sets`` of each row, shape (k,).
    sets
        Groups of the rows of a label, as positions in ``names``.
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
        Groups of facets by their corners, on the boundary or of `inside`.
    unusable, notes, space
        As in `Domain`.
    inside
        The unusable parts of facets inside of the body, which may be fixed, or electrodes.
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


def check(contents: Contents) -> Cells:
    """Check a mesh, and return it in the form in which it is distributed.

    Groups may overlap. A group of facets that are not all on the boundary of the body can be
    fixed, or an electrode, but nothing else; one without a cell is left out.

    Raises
    ------
    InputError
        For cells other than triangles or quadrilaterals in a plane z = const, or solids, of order 1
        or 2; for flat, folded or overlapping cells; and if no part is left.
    """
    given = contents.kinds
    dim = max((kind.dim for kind in given), default=0)
    for _, nodes in contents.blocks:
        if nodes.size and not 0 <= nodes.min() <= nodes.max() < len(contents.points):
            raise InputError("it has elements whose nodes it does not have", "mesh-file")
    contents = with_one_shape(contents)
    shape = _check_kinds([kind for kind in contents.kinds if kind.dim == dim], dim)
    points = np.asarray(contents.points, dtype=float)
    pairs = zip(contents.blocks, contents.kinds, strict=True)
    rows = np.concatenate([nodes for (_, nodes), kind in pairs if kind.dim == dim])
    rows = in_dolfinx_order(shape, points, rows)
    corners = rows[:, : shape.corners]
    curved = _curved(points, rows, shape)
    rows = rows if curved else corners
    number = _number(rows)
    first = np.unique(number, return_index=True)[1]
    notes = [*contents.notes]
    if first.size < len(rows) and not contents.repeats:
        notes.append(f"{len(rows) - first.size} cell(s) that stand twice in it count once")

    parts, left, without = _parts(contents, shape, corners[first])
    if left:
        notes.append(name_clash(left))
    if without:
        notes.append(f"sets of nodes that hold no facet of the boundary: {', '.join(without)}")

    regions, body = _regions(contents, dim, number)
    new = np.full(first.size, -1)
    new[body] = np.arange(body.size)
    labels, sets = combinations(body.size, [new[cells] for cells in regions.values()])
    rows = rows[first[body]]

    if curved and rows.shape[1] < len(shape.nodes(2)):
        points, rows = _filled(points, rows, shape)
        if dim == 3:
            notes.append(SERENDIPITY)
    if others := first.size - body.size:
        notes.append(f"{others} cell(s) in no physical group are no part of the body")
    # Nodes of the body only; others may be centres of circles.
    used = np.unique(rows)
    new = np.full(len(points), -1)
    new[used] = np.arange(used.size)
    points, rows = _flatten(points[used], dim), new[rows]
    parts = {name: new[facets][:, shape.facet.around] for name, facets in parts.items()}

    # Without a unit of length, so that no volume overflows or vanishes.
    unit = np.ptp(points, axis=0).max() or 1.0
    _check_volumes(shape, points[rows] / unit, unit)
    reasons, inside = _check_facets(shape, points / unit, rows[:, : shape.corners], parts)
    usable = {name: facets for name, facets in parts.items() if name not in reasons}
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
    second = any(kind.dim == dim and kind.order == 2 for kind in given)
    space = ({"degree": 2} if second else {}) | contents.space
    cells = Groups(tuple(regions), rows, labels, sets)
    kept = _join(usable | {name: parts[name] for name in inside})
    return Cells(shape, points, cells, kept, reasons, tuple(notes), inside, space)


def _check_kinds(kinds: Sequence[Kind], dim: int) -> Shape:
    """Return the one shape of the cells; refuse others, and orders above 2."""
    if dim < 2:
        raise InputError(
            "it has no triangles, quadrilaterals, tetrahedra or hexahedra (Gmsh saves the elements "
            "of physical groups alone, if there are any: the body needs a physical group, too)",
            "no-groups",
        )
    for kind in kinds:
        if Shape(kind.name) not in SHAPES or not kind.known:
            why = "another shape" if kind.order < 3 else "higher order"
            raise InputError(
                f"its cells include '{kind}', of {why}; accepted are triangles or quadrilaterals "
                "in 2-D, tetrahedra, hexahedra, prisms or pyramids in 3-D, of order 1 or 2",
                "cell-kinds",
            )
    return Shape(kinds[0].name)


def _regions(contents: Contents, dim: int, number: Ints) -> tuple[dict[str, Ints], Ints]:
    """Return regions and the whole body by the numbers of their cells."""
    starts: dict[int, int] = {}
    end = 0
    for b, ((_, nodes), kind) in enumerate(zip(contents.blocks, contents.kinds, strict=True)):
        if kind.dim == dim:
            starts[b] = end
            end += len(nodes)
    groups = {
        name: [starts[b] + own for b, own in group.items() if b in starts and len(own)]
        for name, group in contents.groups.items()
    }
    regions = {name: number[np.concatenate(own)] for name, own in groups.items() if own}
    body = np.unique(np.concatenate([number[:0], *regions.values()]))
    every = np.unique(number)
    if not regions or (body.size < every.size and not contents.by_groups):
        regions[BODY] = body = every
    return regions, body


def _parts(
    contents: Contents, shape: Shape, corners: Ints
) -> tuple[dict[str, Ints], list[str], list[str]]:
    """Return parts by their corners, names of surfaces and other sets, and names without facets."""
    of, left, without = shape.facet.corners, list[str](), list[str]()
    none = np.zeros((0, of), dtype=np.int64)
    parts = {name: v if v.shape[1] == of else none for name, v in contents.surfaces.items()}

    def add(name: str, facets: Ints) -> None:
        there = parts.setdefault(name, facets)
        if len(unique_rows(np.concatenate([there, facets]))) > len(unique_rows(there)):
            left.append(name)

    kinds = contents.kinds
    for name, group in contents.groups.items():
        sides = [
            contents.blocks[b][1][members][:, :of]
            for b, members in group.items()
            if kinds[b].name == shape.facet.name and len(members)
        ]
        if sides:
            add(name, np.concatenate(sides))
    if contents.nodes:
        facets = corners[:, shape.facet_corners[:, shape.facet.around]]
        outside = single_facets(facets.reshape(-1, of))
    for name, nodes in contents.nodes.items():
        found = outside[np.isin(outside, nodes).all(axis=1)]
        if len(found):
            add(name, found)
        else:
            without.append(name)
    return parts, left, without


def _curved(points: Array, cells: Ints, shape: Shape) -> bool:
    """Tell whether some cells, (m, k), have nodes of degree 2 off those of straight edges."""
    count = cells.shape[1]
    if count == shape.corners:
        return False
    corners = points[cells[:, : shape.corners]]
    straight = shape.lagrange(1, shape.nodes(2)[:count]) @ corners
    aside = np.linalg.norm(points[cells] - straight, axis=2)
    unit = np.ptp(corners, axis=1).max(axis=1)
    return not bool(np.all(aside.max(axis=1) <= STRAIGHT * unit))


def _filled(points: Array, cells: Ints, shape: Shape) -> tuple[Array, Ints]:
    """Return points and cells of degree 2 of serendipity cells, (m, k)."""
    rows = cells
    for _, ends, weights in shape.serendipity:
        number = _number(cells[:, ends].reshape(-1, ends.shape[1]))
        added = (weights[:, : cells.shape[1]] @ points[cells]).reshape(-1, points.shape[1])
        rows = np.column_stack([rows, len(points) + number.reshape(len(cells), -1)])
        points = np.concatenate([points, added[np.unique(number, return_index=True)[1]]])
    return points, rows


def _flatten(points: Array, dim: int) -> Array:
    """Return the coordinates, in 2-D without z."""
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
    """Return a number of each row, shape (n,), from 0, equal for rows of the same nodes."""
    rows = np.sort(rows, axis=1)
    order = np.lexsort(rows.T)
    new = np.any(rows[order][1:] != rows[order][:-1], axis=1)
    number = np.empty(len(rows), dtype=np.int64)
    number[order] = np.concatenate([[0], np.cumsum(new)])[: len(rows)]
    return number


def _join(groups: Mapping[str, Ints]) -> Groups:
    """Return overlapping groups of rows as `Groups`."""
    rows = np.vstack(list(groups.values()))
    number = _number(rows)
    first = np.unique(number, return_index=True)[1]
    ends = np.cumsum([len(group) for group in groups.values()])
    labels, sets = combinations(first.size, np.split(number, ends[:-1]))
    return Groups(tuple(groups), rows[first], labels, sets)


def _may_fold(shape: Shape, x: Array) -> npt.NDArray[np.bool_]:
    """Return which straight cells, (m, corners, d), may have det J <= 0 between their corners."""
    # J is a mean of those at the corners: det J > 0 everywhere if |J_m^-1 J_c - I| < 1 at these.
    middle = inverse(jacobians(shape, x, shape.middle))
    change = middle @ jacobians(shape, x, shape.nodes(1)) - np.eye(shape.dim)
    return np.asarray(~(np.linalg.norm(change, axis=(2, 3)).max(axis=1) < 1))


def _least_volume(shape: Shape, nodes: Array, at: Array) -> Array:
    """Return the least det J at points, times its sign at the first one, shape (m,)."""
    each = (determinant(jacobians(shape, nodes, point[None]))[:, 0] for point in at)
    first = next(each)  # point by point: all at once take kilobytes a cell
    return reduce(np.minimum, (volume * np.sign(first) for volume in each), np.abs(first))


def _check_volumes(shape: Shape, nodes: Array, unit: float) -> None:
    """Refuse flat and folded cells, given their nodes, (m, nodes, d), in a unit of length."""
    x = nodes[:, : shape.corners]

    def refuse(wrong: npt.NDArray[np.bool_], fault: str, identifier: str) -> None:
        if np.any(wrong):
            place = ", ".join(f"{v:g}" for v in x[wrong][0].mean(axis=0) * unit)
            words = f"it has {wrong.sum()} cell(s) {fault}, the first near ({place})"
            raise InputError(words, identifier)

    longest = np.linalg.norm(x[:, :, None] - x[:, None], axis=-1).max(axis=(1, 2))
    least = FLAT * longest**shape.dim
    volume = determinant(jacobians(shape, x, shape.nodes(1)))
    refuse(~(np.abs(volume).min(axis=1) > least), "of zero volume", "mesh-geometry")
    turned = np.abs(np.sign(volume).sum(axis=1)) < volume.shape[1]
    refuse(turned, "with a corner of 180 degrees or more", "folded-cells")
    curved = nodes.shape[1] > shape.corners
    suspect: npt.NDArray[np.bool_] = np.full(len(nodes), curved)
    if not curved and shape.dim == 3 and not shape.simplex:
        suspect = _may_fold(shape, x)
    # At the corners, between them, and where integrals are taken.
    at = np.concatenate([shape.nodes(2), rule(shape, 4)[0]])
    suspect[suspect] = ~(_least_volume(shape, nodes[suspect], at) > least[suspect])
    if curved:
        refuse(suspect, "that are folded by their curved edges", "folded-edges")
    refuse(suspect, "that are folded inside", "folded-cells")


def _check_facets(
    shape: Shape, points: Array, cells: Ints, parts: Mapping[str, Ints]
) -> tuple[dict[str, str], tuple[str, ...]]:
    """Return names that cannot be parts -> why, and those inside; refuse cells that overlap."""
    cell_facets = np.sort(cells[:, shape.facet_corners], axis=2)
    # The orientation of d corners of each facet, the same for both cells, with the cell's middle.
    corners = points[cell_facets[:, :, : shape.dim]]
    middles = points[cells].mean(axis=1)[:, None, None]
    inside = np.broadcast_to(middles, corners[:, :, :1].shape)
    edges = np.concatenate([corners[:, :, 1:], inside], axis=2) - corners[:, :, :1]
    sides = np.sign(np.linalg.det(edges))

    number = _number(np.vstack([cell_facets.reshape(-1, cell_facets.shape[2]), *parts.values()]))
    inner, outer = number[: sides.size], number[sides.size :]
    total = int(number.max()) + 1
    count = np.bincount(inner, minlength=total)
    # Two cells with a common facet must lie on either side of it.
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
