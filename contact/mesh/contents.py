"""Contents of a mesh file of any format, and its cells brought to one shape."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import linear_sum_assignment

from contact.errors import InputError
from contact.mesh.cells import SHAPES, Shape, joined_facets, simplices, uncollapsed
from contact.typing import Array

Ints = npt.NDArray[np.int64]

#: The region of a mesh without named regions.
BODY = "body"

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
TAGS = (":physical", ":ref", ":index", "_tags")
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
    """The contents of a mesh file.

    Attributes
    ----------
    points
        Coordinates of the nodes, shape (n, 3).
    blocks
        Name of a shape, as meshio or basix has it, and elements by their nodes: corners in VTK's
        order, those between them in the order of the program.
    groups
        Name -> number of a block -> its elements in the group.
    nodes
        Name -> the nodes of a set.
    surfaces
        Name -> facets by their corners, around them.
    notes
        Its other contents, one sentence each.
    space
        Keys of a case's ``[space]`` for which its elements were made: degree, kinematics.
    repeats
        Whether cells stand in it once for each of their groups.
    by_groups
        Whether cells in no group are no part of the body.
    """

    points: Any
    blocks: Sequence[tuple[str, Ints]]
    groups: dict[str, dict[int, Ints]] = field(default_factory=dict)
    nodes: dict[str, Ints] = field(default_factory=dict)
    surfaces: dict[str, Ints] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    space: dict[str, int | str] = field(default_factory=dict)
    repeats: bool = False
    by_groups: bool = False

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
        """Add the sets of whole numbers of nodes."""
        for name, _, members in _by_number(key, [values]):
            self.nodes[name] = np.union1d(self.nodes.get(name, members), members)


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


def name_clash(names: Sequence[str]) -> str:
    """Return the note on sets of nodes that are left out for a surface of the same name."""
    return f"sets left out, as a surface of other facets has their name: {', '.join(names)}"


def with_one_shape(contents: Contents) -> Contents:
    """Return contents with cells of one of `SHAPES`: others, or several, are cut into simplices.

    Unknown cells, and those of higher order, are left for `validity` to refuse.
    """
    kinds = contents.kinds
    dim = max((kind.dim for kind in kinds), default=0)
    cells = list(dict.fromkeys(kind for kind in kinds if kind.dim == dim))
    if dim < 2 or not all(kind.known for kind in cells):
        return contents
    collapsed = sum(
        int(np.count_nonzero(~uncollapsed(rows[:, : kind.corners])))
        for kind, (_, rows) in zip(kinds, contents.blocks, strict=True)
        if kind.dim == dim and kind.corners > dim + 1
    )
    if not collapsed and len(cells) == 1 and Shape(cells[0].name) in SHAPES:
        return contents
    found = " beside ".join(repr(str(kind)) for kind in cells)
    if collapsed:
        found += f", {collapsed} of them with one node at several corners"
    shape = "triangles" if dim == 2 else "tetrahedra"
    note = f"its cells, {found}, become {shape}: a mesh has cells of one kind"
    if any(kind.order > 1 for kind in cells):
        note = (
            f"its cells, {found}, become {shape} with straight edges: a mesh has cells of one "
            "kind, and curved edges in files of one kind alone"
        )
    return _cut(contents, kinds, dim, note)


def _cut(contents: Contents, kinds: Sequence[Kind], dim: int, note: str) -> Contents:
    """Return the contents of a file with its cells and their facets cut into simplices."""
    blocks: list[tuple[str, Ints]] = list(contents.blocks)
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

    Programs number the nodes between corners differently: of hexahedra Exodus has the vertical
    edges before the upper ones, Abaqus the middle before the faces, MED the lower face first. The
    order of a file is the one with the least distance of all nodes from the middles of straight
    edges, and then from the interpolated nodes in faces and cells: an assignment problem.
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
