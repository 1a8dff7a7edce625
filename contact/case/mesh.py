"""Section of the case file about the mesh, and the domain that it describes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import partial
from typing import Annotated, Any, Literal, Self, TypeAlias

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from pydantic import Field, model_validator

import meshes
from contact.errors import InputError, shown
from contact.mesh import grid
from contact.mesh.cells import SHAPES, Shape
from contact.mesh.domain import Domain, Marker, cells_in, facets_inside, with_further_names
from contact.mesh.grid import rotate
from contact.mesh.reader import ACCEPTED, from_file, from_generator
from contact.mesh.transfer import check_adaptable, refined
from contact.methods.signals import killed_on_signal
from contact.model.fields import Field as Given
from contact.model.messages import either, unknown
from contact.model.section import (
    Axis,
    Either,
    Few,
    File,
    Name,
    OneOrSome,
    Section,
    StaticValue,
    Vector,
    as_tuple,
)
from contact.ranks import on_all_ranks
from contact.settings import Accepted, Count, Number, Positive, ReadWith, fault
from contact.typing import Array
from meshes.grading import memory

#: Keys of `[mesh]` that go with every generator and file.
COMMON = tuple("generator file cell order rotation axis refine adapt inside regions".split())

#: Generators that take lists of sizes and cells.
GRIDS = ("rectangle", "box")

#: Bytes that making the mesh takes for a cell, without any unknowns (seen: 235 to 345).
CELL_MEMORY = 200

Pair: TypeAlias = Annotated[tuple[Number, ...], Field(min_length=2, max_length=2), as_tuple]
Along: TypeAlias = Annotated[
    Either[Number, Pair], Accepted("a number in 2-D, a list of 2 numbers in 3-D")
]


class Piece(Section):
    """`[mesh.parts.NAME]`: a side of a rectangle or box, or a piece of it."""

    side: Name
    """Side of the generator: `left`, `right`, `bottom`, `top`; of a box also `front`, `back`."""
    start: Along | None = Field(default=None, alias="from")
    """Where the piece starts, in the coordinates that run along the side before rotation (of a
    box in the order x, y, z). Absent: at its end."""
    stop: Along | None = Field(default=None, alias="to")
    """Where the piece ends. Both are positions of the grid."""


Pieces: TypeAlias = Annotated[
    OneOrSome[Piece], Accepted("a table with side, from, to, or a list of them")
]


class Adapt(Section):
    """`[mesh.adapt]`: the mesh is refined where the error is, and the case solved again.

    Refinement ends when the estimated error, or the number of unknowns, is reached. New nodes of
    curved boundaries lie on curves through the vertices.
    """

    error: Annotated[float, Field(gt=0, lt=1), Accepted("a number between 0 and 1")] | None = None
    """Largest estimated relative error in the energy norm, `error` of the summary."""
    max_unknowns: Count = 200_000
    """No mesh with more unknowns is solved, the first one excepted."""
    fraction: Annotated[float, Field(gt=0, le=1), Accepted("a number above 0, up to 1")] = 0.5
    """Share of the square of the error that the refined cells have (Dörfler's). With 1 meshes are
    uniform, and from the third one on the summary has `intervals`."""


def cut_about_axis(given: Any) -> Any:
    """Cut squares at an axis by both diagonals: `scripts.studies.pressure_on_axis` says why."""
    if not isinstance(given, Mapping):
        return given
    mesh, space = given.get("mesh"), given.get("space")
    if not isinstance(mesh, Mapping) or not isinstance(space, Mapping):
        return given
    origin = mesh.get("origin", [0.0])
    on_axis = not (isinstance(origin, list | tuple) and origin and origin[0])
    revolved = space.get("kinematics") == "axisymmetric" and space.get("degree", 1) == 1
    if mesh.get("generator") != "rectangle" or not (revolved and on_axis):
        return given
    return {**given, "mesh": {"diagonal": "crossed", **mesh}}


class Mesh(Section):
    """`[mesh]`: a generator with its parameters, or a file."""

    generator: (
        Annotated[str, Accepted('"rectangle", "box" or the name of a parametric mesh generator')]
        | None
    ) = None
    """Generator of the mesh. This or `file`."""
    file: Annotated[File, Accepted(ACCEPTED)] | None = None
    """Mesh file; its named sets, those of Gmsh physical groups, are the parts and regions. Relative
    to the case file."""
    origin: Annotated[Vector | None, ReadWith("generator", GRIDS)] = None
    """Lower left corner. Default: zeros."""
    size: Annotated[
        Annotated[Few[Positive], Accepted("a list of 2 numbers > 0 for a rectangle, 3 for a box")]
        | None,
        ReadWith("generator", GRIDS, required=True),
    ] = None
    """Edge lengths."""
    cells: Annotated[
        Annotated[
            Few[Count],
            Accepted("a list of 2 whole numbers from 1 to 10000000 for a rectangle, 3 for a box"),
        ]
        | None,
        ReadWith("generator", GRIDS, required=True),
    ] = None
    """Squares or cubes along the edges."""
    diagonal: Annotated[
        Literal["right", "left", "crossed", "left_right", "right_left"] | None,
        ReadWith("generator", "rectangle"),
    ] = None
    """How squares are cut into triangles. Default: "right", and "crossed" in a body of revolution
    of degree 1 that reaches its axis."""
    cell: Annotated[
        Literal["triangle", "quadrilateral", "tetrahedron", "hexahedron"] | None,
        ReadWith("generator"),
    ] = None
    """Shape of the cells of a generator: in 2-D "triangle" or "quadrilateral", in 3-D "tetrahedron"
    or "hexahedron". Default: the first of them."""
    order: Annotated[int, Field(ge=1, le=2), Accepted("1 or 2")] = 1
    """Order of the cells of a parametric mesh generator: those of 2 are curved where the body is
    round."""
    rotation: Number = 0.0
    """Angle (degrees) by which the mesh is turned about the origin of coordinates,
    counter-clockwise; in 3-D about `axis`."""
    axis: Axis | None = None
    """Axis of the rotation in 3-D. Default: y, `[0, 1, 0]`."""
    refine: Annotated[int, Field(ge=0, le=10), Accepted("a whole number from 0 to 10")] = 0
    """Uniform refinements of the mesh after it is made or read."""
    adapt: Adapt | None = None
    """Adaptive refinement, `[mesh.adapt]`. Default: none."""
    parts: Annotated[dict[Name, Pieces], ReadWith("generator", GRIDS)] = Field(default={})
    """Further parts by name: `[mesh.parts.NAME]`."""
    inside: dict[Name, StaticValue] = Field(default={})
    """Parts inside of the body by name, of any mesh: the facets at all of whose corners a formula
    is not 0, such as `middle = "abs(y - 0.5) < 1e-6"`, in the coordinates before rotation.
    `[[fixed]]`, `[[electrode]]`, `[[rigid]]` and `[[bolt]]` may name them: an electrode between two
    layers."""
    regions: dict[Name, StaticValue] = Field(default={})
    """Further regions by name, of any mesh: the cells in whose middle a formula is not 0, likewise.
    `[[material]]` names them."""
    parameters: dict[Name, Number] = Field(default={})
    """Parameters of another generator. They may stand in `[mesh]` itself."""

    @property
    def sides(self) -> tuple[str, ...]:
        """Sides of a rectangle or box; none for other meshes."""
        return tuple(grid.SIDES.get(self.generator or "", ()))

    @property
    def shape(self) -> Shape | None:
        """Shape of the cells; None if only the mesh itself can tell."""
        name = self.cell or grid.CELLS.get(self.generator or "", (None,))[0]
        return None if name is None else Shape(name)

    @model_validator(mode="before")
    @classmethod
    def _gather_parameters(cls, given: Any) -> Any:
        """Move the keys of a generator into `parameters`; fill in the defaults of a grid."""
        if not isinstance(given, Mapping) or not isinstance(given.get("generator"), str):
            return given
        if given["generator"] in grid.SIDES:
            flat = given["generator"] == "rectangle"
            defaults = (
                {"origin": (0.0, 0.0), "diagonal": "right"} if flat else {"origin": (0.0,) * 3}
            )
            return {**defaults, **given}
        inner = given.get("parameters", {})
        if not isinstance(inner, Mapping):
            return given
        kept = {key: given[key] for key in given if key in COMMON}
        moved = {key: given[key] for key in given if key not in (*COMMON, "parameters")}
        _check_parameters(given["generator"], {**inner, **moved})
        return {**kept, "parameters": {**inner, **moved}}

    @model_validator(mode="after")
    def _check(self) -> Self:
        self.require_either(("generator",), ("file",))
        known = grid.CELLS.get(self.generator or "", tuple(shape.name for shape in SHAPES))
        fits = self.cell is None or self.cell in known
        self.require(fits, "cell", " or ".join(f'"{name}"' for name in known))
        others = "generators other than rectangle and box"
        parametric = self.file is None and not self.sides
        self.require(parametric or self.order == 1, "order", f"order 2 of {others}")
        self.require(parametric or not self.parameters, "parameters", f"those of {others}")
        if self.sides:
            assert self.generator is not None
            try:
                grid.plan(self.generator, *self._grid)
            except grid.GridError as error:
                raise fault(error.key, error.given, error.accepted) from None
        return self

    @property
    def _grid(self) -> tuple[Any, Any, Any, Any]:
        return self.origin, self.size, self.cells, self.parts

    def build(self, comm: MPI.Intracomm) -> Domain:
        """Make the mesh with its parts. Collective."""
        read = None if self.sides else self._read(comm)
        dim = len(self.sides) // 2 if read is None else read.dim
        cells = self._planned if read is None else read.mesh.topology.index_map(dim).size_global
        _check_memory(comm, cells * 2 ** (dim * self.refine))
        domain = self._named(self._made(comm) if read is None else read)
        axis = self.axis or (0.0, 1.0, 0.0)
        rotate(domain.mesh, self.rotation, axis if domain.dim == 3 else (0.0, 0.0, 1.0))
        for _ in range(self.refine):
            domain = refined(domain)
        if self.adapt is not None:
            check_adaptable(domain.mesh)
        return domain

    def _named(self, domain: Domain) -> Domain:
        """Return a domain with the names of `inside` and `regions`. Collective."""
        for key, known in (("inside", domain.names), ("regions", tuple(domain.regions))):
            for name in getattr(self, key):
                if name in known:
                    accepted = f"a name that the mesh has not: {', '.join(known)} are there"
                    raise InputError(
                        f"mesh.{key}.{name}: given again; accepted: {accepted}", "part-facets"
                    )

        def markers(key: str) -> Iterator[tuple[str, Marker]]:
            for name, formula in getattr(self, key).items():
                yield name, partial(marked, formula, f"mesh.{key}.{name}")

        def marked(formula: Given, label: str, x: Array) -> NDArray[np.bool_]:
            try:
                return formula.numpy(x[: domain.dim].T) != 0
            except InputError as error:
                raise error.within(f"{label}: ") from None

        mesh = domain.mesh
        with on_all_ranks(domain.comm):  # a formula may have no value on one of them
            facets = {name: facets_inside(mesh, marker) for name, marker in markers("inside")}
            cells = {name: cells_in(mesh, marker) for name, marker in markers("regions")}
        return with_further_names(domain, facets, cells)

    @property
    def _planned(self) -> int:
        """Number of cells of a rectangle or box."""
        assert self.shape is not None
        triangles = 4 if self.diagonal == "crossed" else 2
        each = {2: triangles, 3: 6}[len(self.sides) // 2] if self.shape.simplex else 1
        return each * math.prod(self.cells or ())

    def _made(self, comm: MPI.Intracomm) -> Domain:
        """Return the rectangle or box. Collective."""
        assert self.shape is not None
        if self.generator == "box":
            return grid.box(comm, *self._grid, cell=self.shape.name)
        diagonal = self.diagonal or "right"
        return grid.rectangle(comm, *self._grid, diagonal=diagonal, cell=self.shape.name)

    def _read(self, comm: MPI.Intracomm) -> Domain:
        """Return the mesh of a file, or of another generator. Collective."""
        if self.file is not None:
            return from_file(comm, self.file)
        assert self.generator is not None
        with killed_on_signal():
            return from_generator(comm, self.generator, self.cell, self.order, **self.parameters)


def _check_memory(comm: MPI.Intracomm, cells: int) -> None:
    """Refuse a mesh that certainly does not fit into the memory. Collective."""
    least, needed = comm.allreduce(memory(), op=MPI.MIN), cells * CELL_MEMORY / comm.size
    if needed > least:
        raise InputError(
            f"mesh: {cells:.3g} cells take more memory, {needed / 1e9:.3g} GB a rank, than there "
            f"is, {least / 1e9:.3g} GB; accepted: fewer cells (mesh.cells, mesh.refine), or more "
            "ranks on more machines",
            "mesh-memory",
        )


def _check_parameters(name: str, parameters: Mapping[str, Any]) -> None:
    if name not in meshes.GENERATORS:
        raise fault("generator", name, either(map(shown, (*grid.SIDES, *meshes.GENERATORS))))
    accepted = meshes.parameters(name)
    for key, value in parameters.items():
        if key not in accepted:
            raise unknown(key, (*COMMON, *accepted))
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if not number or not 0 < value < np.inf:
            raise fault(key, value, "a number > 0")
