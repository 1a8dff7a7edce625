"""Section of the case file about the mesh."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from pydantic import Discriminator, Field, PrivateAttr, Tag, model_validator

import meshes
from contact.case.types import (
    UNKNOWN,
    File,
    Name,
    Number,
    Section,
    Triple,
    Vector,
    Words,
    as_tuple,
    fault,
    not_zero,
)
from contact.mesh import grid
from contact.settings import Accepted, Count, Positive

#: Dimension and names of the sides of the generators that need no recipe.
GENERATORS: Mapping[str, tuple[int, tuple[str, ...]]] = {
    name: (len(sides) // 2, tuple(sides)) for name, sides in grid.SIDES.items()
}

#: Keys of `[mesh]` that go with every generator and file.
COMMON = ("generator", "file", "rotation", "axis", "refine")

Along: TypeAlias = Annotated[
    Number | Annotated[tuple[Number, ...], Field(min_length=2, max_length=2), as_tuple],
    Accepted("a number in the plane, a list of 2 numbers in space"),
]


class Piece(Section):
    """`[mesh.parts.NAME]`: a side of a rectangle or box, or a piece of it."""

    side: Name = Field(
        description="Side of the generator: `left`, `right`, `bottom`, `top`; "
        "of a box also `front`, `back`."
    )
    start: Along | None = Field(
        default=None,
        alias="from",
        description="Where the piece starts, in the coordinates that run "
        "along the side before rotation (of a box in the order x, y, z). Absent: at its end.",
    )
    stop: Along | None = Field(
        default=None,
        alias="to",
        description="Where the piece ends. Both are positions of the grid.",
    )

    @property
    def on_grid(self) -> grid.Piece:
        """The piece as the grid takes it."""
        return grid.Piece(self.side, self.start, self.stop)


def _piece_kind(given: Any) -> str:
    return "pieces" if isinstance(given, list | tuple) else "Piece"


Pieces: TypeAlias = Annotated[
    Annotated[Piece, Tag("Piece")]
    | Annotated[tuple[Piece, ...], Field(min_length=1), as_tuple, Tag("pieces")],
    Discriminator(_piece_kind),
    Accepted("a table with side, from, to, or a list of them"),
]


class Mesh(Section):
    """`[mesh]`: a generator with its parameters, or a Gmsh file."""

    generator: (
        Annotated[str, Accepted('"rectangle", "box" or the name of a mesh recipe')] | None
    ) = Field(default=None, description="What makes the mesh. This or `file`.")
    file: Annotated[File, Accepted("a Gmsh file (.msh)")] | None = Field(
        default=None,
        description="Gmsh file (.msh); its named physical groups are the parts. Relative "
        "to the case file.",
    )
    origin: Vector | None = Field(
        default=None, description="Lower left corner of a rectangle or box. Default: zeros."
    )
    size: (
        Annotated[
            tuple[Positive, ...],
            Field(min_length=2, max_length=3),
            as_tuple,
            Accepted("a list of 2 numbers > 0 for a rectangle, 3 for a box"),
        ]
        | None
    ) = Field(default=None, description="Edge lengths of a rectangle or box; required there.")
    cells: (
        Annotated[
            tuple[Count, ...],
            Field(min_length=2, max_length=3),
            as_tuple,
            Accepted("a list of 2 whole numbers >= 1 for a rectangle, 3 for a box"),
        ]
        | None
    ) = Field(
        default=None,
        description="Squares or cubes along the edges; required for a rectangle or box.",
    )
    diagonal: Literal["right", "left", "crossed", "left_right", "right_left"] | None = Field(
        default=None,
        description='How a rectangle\'s squares are cut into triangles; there "right" by default.',
    )
    rotation: Number = Field(
        default=0.0,
        description="Angle (degrees) by which the mesh is turned about the origin of "
        "coordinates, counter-clockwise; in space about `axis`.",
    )
    axis: Annotated[Triple, not_zero] | None = Field(
        default=None, description="Axis of the rotation in space. Default: y, `[0, 1, 0]`."
    )
    refine: Annotated[int, Field(ge=0, le=10), Accepted("a whole number from 0 to 10")] = Field(
        default=0, description="Uniform refinements of the mesh after it is made or read."
    )
    parts: dict[Name, Pieces] = Field(
        default={}, description="Further parts of a rectangle or box by name: `[mesh.parts.NAME]`."
    )
    parameters: dict[Name, Number] = Field(
        default={}, description="Parameters of a recipe. They may stand in `[mesh]` itself."
    )

    _absent: bool = PrivateAttr(False)

    @staticmethod
    def absent() -> Mesh:
        """Return what stands where a domain made in Python is to take the place of `[mesh]`."""
        made = Mesh.model_construct()
        made._absent = True
        return made

    @property
    def dimension(self) -> int | None:
        """Space dimension; None if only the mesh itself can tell."""
        return GENERATORS.get(self.generator or "", (None, ()))[0]

    @property
    def sides(self) -> tuple[str, ...]:
        """Sides of a rectangle or box; none for other meshes."""
        return GENERATORS.get(self.generator or "", (None, ()))[1]

    @model_validator(mode="before")
    @classmethod
    def _gather_parameters(cls, given: Any) -> Any:
        """Move the keys of a recipe into `parameters`, and fill in the defaults of a grid."""
        if not isinstance(given, Mapping) or not isinstance(given.get("generator"), str):
            return given
        if given["generator"] in GENERATORS:
            dimension, _ = GENERATORS[given["generator"]]
            defaults: dict[str, Any] = {"origin": (0.0,) * dimension}
            if given["generator"] == "rectangle":
                defaults["diagonal"] = "right"
            return {**defaults, **given}
        inner = given.get("parameters", {})
        if not isinstance(inner, Mapping):
            return given
        kept = {key: given[key] for key in given if key in COMMON}
        moved = {key: given[key] for key in given if key not in (*COMMON, "parameters")}
        parameters = {**inner, **moved}
        cls._check_recipe(given["generator"], parameters)
        return {**kept, "parameters": parameters}

    @staticmethod
    def _check_recipe(name: str, parameters: Mapping[str, Any]) -> None:
        if name not in meshes.RECIPES:
            raise fault("generator", name, ", ".join((*GENERATORS, *meshes.RECIPES)))
        accepted = meshes.parameters(name)
        for key, value in parameters.items():
            if key not in accepted:
                raise fault(key, UNKNOWN, ", ".join((*COMMON, *accepted)))
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not number or not 0 < value < np.inf:
                raise fault(key, value, "a number > 0")

    @model_validator(mode="after")
    def _check(self) -> Mesh:
        if self._absent:
            return self
        if (self.generator is None) == (self.file is None):
            given = "neither generator nor file" if self.file is None else "generator and file"
            raise fault("generator", Words(given), "one of generator and file")
        if self.diagonal is not None and self.generator != "rectangle":
            raise fault("diagonal", self.diagonal, "diagonal for a rectangle only")
        if self.generator is not None and self.sides:
            self._check_grid(self.generator)
            return self
        for key in ("origin", "size", "cells", "parts"):
            if getattr(self, key):
                raise fault(key, getattr(self, key), f"{key} for a rectangle or box only")
        if self.generator is None and self.parameters:
            raise fault("parameters", self.parameters, "parameters of a recipe only")
        return self

    @property
    def pieces(self) -> dict[str, grid.Piece | list[grid.Piece]]:
        """The further parts of a rectangle or box."""
        return {
            name: [piece.on_grid for piece in given] if isinstance(given, tuple) else given.on_grid
            for name, given in self.parts.items()
        }

    def _check_grid(self, generator: str) -> None:
        if self.parameters:
            key = next(iter(self.parameters))
            raise fault(f"parameters.{key}", self.parameters[key], "parameters of a recipe only")
        for key in ("size", "cells"):
            if getattr(self, key) is None:
                raise fault(key, Words("missing"), f"a list of {self.dimension} numbers")
        assert self.origin is not None  # filled in before
        assert self.size is not None
        assert self.cells is not None
        try:
            grid.plan(generator, self.origin, self.size, self.cells, self.pieces)
        except grid.GridError as error:
            raise fault(error.key, error.given, error.accepted) from None
