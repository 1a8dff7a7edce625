"""Contents of a mesh file of any format, checked: cells of one shape, parts and regions.

On one rank.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

from contact.errors import InputError
from contact.mesh.cells import (
    SHAPES,
    Shape,
    joined_facets,
    rule,
    simplices,
    single_facets,
    uncollapsed,
)
from contact.mesh.domain import BODY, UNLESS
from contact.mesh.entities import combinations
from contact.mesh.geometry import determinant, jacobians
from contact.typing import Array

Ints = npt.NDArray[np.int64]


#: Cells at a time: their Jacobians at all points take kilobytes each.
CHUNK = 1000

#: Names of shapes in meshio that are not those of basix.
NAMES = {"line": "interval", "quad": "quadrilateral", "tetra": "tetrahedron", "wedge": "prism"}

#: Dimension, corners, and numbers of nodes of second order of elements by their names in basix.
ELEMENTS: dict[str, tuple[int, int, tuple[int, ...]]] = {
    "vertex": (0, 1, ()),
    "point": (0, 1, ()),
    "interval": (1, 2, (3,)),
    "triangle": (2, 3, (6,)),
    "quadrilateral": (2, 4, (8, 9)),
    "tetrahedron": (3, 4, (10,)),
    "pyramid": (3, 5, (13, 14)),
    "prism": (3, 6, (15, 18)),
    "hexahedron": (3, 8, (20, 27)),
}


#: Endings of the names of arrays of tags, whose groups go by the number alone; arrays of no groups.
TAGS = (":physical", ":ref", ":index", ":tag", ":material", "_tags")
INNER = {"gmsh:geometrical", "gmsh:bounding_entities", "GlobalElementId", "GlobalNodeId"}


@dataclass(frozen=True)
class Kind:
    """A type of elements: a shape by its name in basix, or an unknown one, and nodes."""

    name: str
    nodes: int

    @staticmethod
    def of(name: str, nodes: int) -> Kind:
        """Return the type of a name of meshio or basix, with or without digits at its end."""
        stem = name.rstrip("0123456789")
        found = NAMES.get(stem, stem)
        return Kind(found if found in ELEMENTS else name, nodes)

    @staticmethod
    def of_meshio(name: str) -> Kind:
        """Return the type of a name of meshio, whose digits are its nodes if it is not straight."""
        stem = name.rstrip("0123456789")
        return Kind.of(name, int(name[len(stem) :] or ELEMENTS[NAMES.get(stem, stem)][1]))

    def __str__(self) -> str:
        """Return its name and number of nodes, as Gmsh writes them."""
        return f"{self.name.capitalize()} {self.nodes}" if self.name in ELEMENTS else self.name

    @property
    def known(self) -> bool:
        """Whether it has a shape of basix and the order 1 or 2."""
        return self.name in ELEMENTS and self.order < 3

    @property
    def dim(self) -> int:
        """Its dimension; 3 for unknown ones."""
        return ELEMENTS[self.name][0] if self.name in ELEMENTS else 3

    @property
    def corners(self) -> int:
        """Number of corners."""
        return ELEMENTS[self.name][1]

    @property
    def order(self) -> int:
        """Order of its geometry; 3 stands for all above 2."""
        _, corners, second = ELEMENTS.get(self.name, (3, self.nodes, ()))
        return 1 if self.nodes == corners else 2 if self.nodes in second else 3


@dataclass
class Contents:
    """The contents of a mesh file."""

    points: Any  #: coordinates of the nodes, shape (n, 3)
    #: Name of a shape, as meshio or basix has it, and elements by their nodes: corners in VTK's
    #: order, those between them in the order of the program.
    blocks: list[tuple[str, Ints]]
    #: Name -> number of a block -> its elements in the group.
    groups: dict[str, dict[int, Ints]] = field(default_factory=dict)
    nodes: dict[str, Ints] = field(default_factory=dict)  #: name -> nodes of a set
    #: Name -> facets by their corners, around them.
    surfaces: dict[str, Ints] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)  #: its other contents, one sentence each
    #: Keys of a case's ``[space]`` for which its elements were made: degree, kinematics.
    space: dict[str, int | str] = field(default_factory=dict)
    by_groups: bool = False  #: whether cells in no group are no part of the body

    @property
    def kinds(self) -> list[Kind]:
        """The type of the elements of each block."""
        return [Kind.of(name, nodes.shape[1]) for name, nodes in self.blocks]

    def add_groups(self, key: str, arrays: Sequence[Array], first: int = 0) -> None:
        """Add the groups of whole numbers of elements, an array each block from `first` on."""
        for name, block, members in _by_number(key, arrays):
            group = self.groups.setdefault(name, {})
            group[first + block] = np.union1d(group.get(first + block, members), members)

    def add_nodes(self, key: str, values: Array) -> None:
        """Add the sets of whole numbers of nodes; references of Medit's nodes are no sets."""
        for name, _, members in _by_number(key, [values]) if key != "medit:ref" else ():
            self.nodes[name] = np.union1d(self.nodes.get(name, members), members)


def in_space(points: Array) -> Array:
    """Return points, (n, 1 to 3), with three coordinates."""
    found = np.zeros((len(points), 3))
    found[:, : np.shape(points)[1]] = points
    return found


def decoded(given: bytes) -> str:
    """Return a text of a file, in UTF-8 or else Latin-1."""
    try:
        return given.decode("utf-8-sig")
    except UnicodeDecodeError:
        return given.decode("latin-1")


def _by_number(key: str, arrays: Sequence[Array]) -> Iterator[tuple[str, int, Ints]]:
    """Yield the groups of positive whole numbers: name, block and members."""
    whole = [np.asarray(array) for array in arrays]
    if key in INNER or any(v.dtype.kind not in "iub" or v.ndim != 1 for v in whole):
        return
    several, names = key.split("-"), {}
    if len(several) > 1 and max(v.max(initial=0) for v in whole) == len(several) - 1:
        # Sets that meshio has written as one array, -1 for none, with their names in the key.
        names, whole = dict(enumerate(several, 1)), [v + 1 for v in whole]
    before = "" if key.endswith(TAGS) else f"{key} "
    for block, values in enumerate(whole):
        for number in map(int, np.unique(values[values > 0])):
            yield names.get(number, f"{before}{number}"), block, np.flatnonzero(values == number)


def with_one_shape(contents: Contents) -> Contents:
    """Return contents with cells of one of `SHAPES`: others, or several, are cut into simplices."""
    kinds = contents.kinds
    dim = max((kind.dim for kind in kinds), default=0)
    cells = list(dict.fromkeys(kind for kind in kinds if kind.dim == dim))
    if dim < 2 or not all(kind.known for kind in cells):
        return contents  # which `check` refuses
    alone = len(cells) == 1 and Shape(cells[0].name) in SHAPES
    if alone and all(
        uncollapsed(rows[:, : kind.corners]).all()
        for kind, (_, rows) in zip(kinds, contents.blocks, strict=True)
        if kind.dim == dim and kind.corners > dim + 1
    ):
        return contents
    found = " beside ".join(repr(str(kind)) for kind in cells)
    shape = "triangles" if dim == 2 else "tetrahedra"
    note = f"its cells, {found}, become {shape} with straight edges: a mesh has cells of one kind"
    return _cut(contents, kinds, dim, note)


def _cut(contents: Contents, kinds: Sequence[Kind], dim: int, note: str) -> Contents:
    """Return the contents of a file with its cells and their facets cut into simplices."""
    blocks = [*contents.blocks]
    groups: dict[str, dict[int, Ints]] = {name: {} for name in contents.groups}
    for b, (kind, (_, nodes)) in enumerate(zip(kinds, contents.blocks, strict=True)):
        count = np.ones(len(nodes), dtype=np.int64)
        if kind.dim >= dim - 1 and kind.known:
            made = simplices(nodes[:, : kind.corners], kind.dim)
            # A collapsed cell loses its flat simplices; a simplex of the file must not be flat.
            full = uncollapsed(made.reshape(-1, kind.dim + 1)).reshape(made.shape[:2])
            full |= made.shape[1] == 1
            count = full.sum(axis=1)
            if kind.dim == dim and not count.all():
                raise InputError(
                    f"it has {np.sum(count == 0)} cell(s) of zero volume", "mesh-geometry"
                )
            blocks[b] = {1: "interval", 2: "triangle", 3: "tetrahedron"}[kind.dim], made[full]
        for name, members in contents.groups.items():
            if b in members:
                chosen = np.zeros(len(nodes), dtype=bool)
                chosen[members[b]] = True
                groups[name][b] = np.flatnonzero(np.repeat(chosen, count))
    surfaces = {
        name: joined_facets([simplices(faces, dim - 1).reshape(-1, dim)]) if len(faces) else faces
        for name, faces in contents.surfaces.items()
    }
    notes = [*contents.notes, note]
    return replace(contents, blocks=blocks, groups=groups, surfaces=surfaces, notes=notes)


def in_dolfinx_order(shape: Shape, points: Array, rows: Ints) -> Ints:
    """Return cells with their nodes in the order of dolfinx, as far as serendipity cells have them.

    Programs number the nodes between corners differently. The order of a file is the one with the
    least distance of all nodes from the middles of straight edges, and then from the interpolated
    nodes in faces and cells: an assignment problem.
    """
    count = rows.shape[1]
    second = count > shape.corners
    columns = np.argsort(shape.vtk(1 + second)[1][:count])
    ordered = rows[:, columns]
    if not second or not len(rows):
        return ordered
    edges = shape.corners + np.arange(len(shape.edges))
    straight = np.zeros((len(edges), count))
    straight[:, : shape.corners] = shape.lagrange(1, shape.nodes(2)[edges])
    expected = [(edges, straight)]
    if shape.serendipity and count == len(shape.nodes(2)):
        inner, _, told = map(list, zip(*shape.serendipity, strict=True))
        expected.append((np.concatenate(inner), np.concatenate(told)))
    for nodes, weights in expected:
        known = np.flatnonzero(np.any(weights != 0, axis=0))
        at = points[ordered[:, known]]
        size = np.ptp(at, axis=1).max(axis=1)[:, None, None]
        middle = at.mean(axis=1, keepdims=True)
        places = weights[:, known] @ (at - middle) / size
        given = (points[ordered[:, nodes]] - middle) / size
        # The terms of the squared distances that depend on the order.
        costs = -np.einsum("cid,cjd->ij", places, given)
        ordered[:, nodes] = ordered[:, nodes[linear_sum_assignment(costs)[1]]]
    return ordered


#: Least volume of a cell over (longest edge)^d: the signs of volumes tell whether cells overlap.
FLAT = 1e-10

#: Largest distance of nodes of degree 2 from those of straight edges, over their length (rounding).
STRAIGHT = 1e-5


@dataclass(frozen=True)
class Groups:
    """Named groups of cells or facets that may overlap."""

    names: tuple[str, ...]
    rows: Ints  #: their nodes, each row once, shape (k, n)
    labels: npt.NDArray[np.int32]  #: position in ``sets`` of each row, shape (k,)
    sets: tuple[tuple[int, ...], ...]  #: groups of the rows of a label, as positions in ``names``

    def without_rows(self) -> Groups:
        """Return the names alone, for ranks that read nothing."""
        return replace(self, rows=self.rows[:0], labels=self.labels[:0])


@dataclass(frozen=True)
class Cells:
    """A checked mesh; `unusable`, `notes` and `space` are those of `Domain`."""

    shape: Shape
    points: Array  #: coordinates, shape (n, d)
    #: Groups of cells; their rows, shape (m, k), are all cells of the mesh by the nodes of the
    #: Lagrange element of degree 1, or of degree 2 where some are curved.
    regions: Groups
    parts: Groups  #: groups of facets by their corners, on the boundary or of `inside`
    unusable: dict[str, str]
    notes: tuple[str, ...]
    #: The unusable parts of facets inside of the body, which may be fixed, or electrodes.
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

    Refuses cells other than triangles or quadrilaterals in a plane z = const, or solids, of order 1
    or 2; flat, folded and overlapping cells; and meshes of which no part is left.
    """
    given, empty = contents.kinds, _empty_groups(contents)
    dim = max((kind.dim for kind in given), default=0)
    for _, nodes in contents.blocks:
        if nodes.size and not 0 <= nodes.min() <= nodes.max() < len(contents.points):
            raise InputError("it has elements whose nodes it does not have", "mesh-file")
    contents = with_one_shape(contents)
    shape = _check_kinds([kind for kind in contents.kinds if kind.dim == dim], dim)
    points = np.asarray(contents.points, dtype=float)
    pairs = zip(contents.blocks, contents.kinds, strict=True)
    every = np.concatenate([nodes for (_, nodes), kind in pairs if kind.dim == dim])
    every = in_dolfinx_order(shape, points, every)
    every = every if _curved(points, every, shape) else every[:, : shape.corners]
    number = _number(every)
    first = np.unique(number, return_index=True)[1]
    parts = _parts(contents, shape, every[first, : shape.corners])
    regions, body = _regions(contents, dim, number)
    new = np.full(first.size, -1)
    new[body] = np.arange(body.size)
    labels, sets = combinations(body.size, [new[cells] for cells in regions.values()])
    rows, notes = every[first[body]], [*contents.notes]

    if shape.corners < rows.shape[1] < len(shape.nodes(2)):
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
    _check_named(usable, reasons, dim)
    reasons |= {name: reason for name, reason in empty.items() if name not in parts}
    notes += [
        reason if name in inside else f"ignored: {reason}" for name, reason in reasons.items()
    ]
    second = any(kind.dim == dim and kind.order == 2 for kind in given)
    space = ({"degree": 2} if second else {}) | contents.space
    cells = Groups(tuple(regions), rows, labels, sets)
    kept = _join(usable | {name: parts[name] for name in inside})
    return Cells(shape, points, cells, kept, reasons, tuple(notes), inside, space)


def _empty_groups(contents: Contents) -> dict[str, str]:
    """Return the groups without elements that are no sets either, and the message of each."""
    empty = [name for name, group in contents.groups.items() if not any(map(len, group.values()))]
    others = contents.nodes.keys() | contents.surfaces.keys()
    return {
        name: f"the physical group {name!r} has no elements" for name in empty if name not in others
    }


def _check_named(usable: Mapping[str, Ints], reasons: Mapping[str, str], dim: int) -> None:
    """Refuse a mesh no part of which has a name."""
    if usable:
        return
    if reasons:
        raise InputError(next(iter(reasons.values())), "part-facets")
    entities = "curves" if dim == 2 else "surfaces"
    raise InputError(
        f"it has no physical groups of {entities}, nor sets or tags of facets or nodes: no "
        "part has a name",
        "no-groups",
    )


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


def _parts(contents: Contents, shape: Shape, corners: Ints) -> dict[str, Ints]:
    """Return parts by their corners: surfaces, then sets of facets and of nodes, by new names."""
    of, kinds = shape.facet.corners, contents.kinds
    none = np.zeros((0, of), dtype=np.int64)
    parts = {name: v if v.shape[1] == of else none for name, v in contents.surfaces.items()}
    for name, group in contents.groups.items():
        sides = [
            contents.blocks[b][1][members][:, :of]
            for b, members in group.items()
            if kinds[b].name == shape.facet.name and len(members)
        ]
        if sides:
            parts.setdefault(name, np.concatenate(sides))
    if contents.nodes:
        facets = corners[:, shape.facet_corners[:, shape.facet.around]]
        outside = single_facets(facets.reshape(-1, of))
    for name, nodes in contents.nodes.items():
        found = outside[np.isin(outside, nodes).all(axis=1)]
        if len(found):
            parts.setdefault(name, found)
    return parts


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


def _least_volume(shape: Shape, nodes: Array, at: Array) -> Array:
    """Return the least det J at points, times its sign at the first one, shape (m,)."""
    least = []
    for some in np.array_split(nodes, len(nodes) // CHUNK + 1):
        volume = determinant(jacobians(shape, some, at))
        least.append((volume * np.sign(volume[:, :1])).min(axis=1))
    return np.concatenate(least)


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
    if not curved and (shape.dim == 2 or shape.simplex):
        return  # det J is least at a corner
    # At the corners, between them, and where integrals are taken.
    at = np.concatenate([shape.nodes(2), rule(shape, 4)[0]])
    folded = ~(_least_volume(shape, nodes, at) > least)
    if curved:
        refuse(folded, "that are folded by their curved edges", "folded-edges")
    refuse(folded, "that are folded inside", "folded-cells")


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
