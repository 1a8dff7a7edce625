"""Sections of the case file about the body: mesh, space, material, supports and loads."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Field, Tag, model_validator

import meshes
from contact.case_types import (
    UNKNOWN,
    Accepted,
    Count,
    Formula,
    FormulaVector,
    Name,
    NonNegative,
    Number,
    Positive,
    Section,
    Switch,
    Text,
    Triple,
    Vector,
    Words,
    as_tuple,
    fault,
)

#: Dimension and names of the sides of the generators that need no recipe.
GENERATORS: Mapping[str, tuple[int, tuple[str, ...]]] = {
    "rectangle": (2, ("left", "right", "bottom", "top")),
    "box": (3, ("left", "right", "front", "back", "bottom", "top")),
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
    file: Text | None = Field(
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
    axis: Triple | None = Field(
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
            if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0:
                raise fault(key, value, "a number > 0")

    @model_validator(mode="after")
    def _check(self) -> Mesh:
        if (self.generator is None) == (self.file is None):
            given = "neither generator nor file" if self.file is None else "generator and file"
            raise fault("generator", Words(given), "one of generator and file")
        if self.axis is not None and not any(self.axis):
            raise fault("axis", self.axis, "a vector that is not zero")
        if self.diagonal is not None and self.generator != "rectangle":
            raise fault("diagonal", self.diagonal, "diagonal for a rectangle only")
        if self.dimension is not None:
            self._check_grid(self.dimension)
            return self
        for key in ("origin", "size", "cells", "parts"):
            if getattr(self, key):
                raise fault(key, getattr(self, key), f"{key} for a rectangle or box only")
        if self.generator is None and self.parameters:
            raise fault("parameters", self.parameters, "parameters of a recipe only")
        return self

    def _check_grid(self, dimension: int) -> None:
        if self.parameters:
            key = next(iter(self.parameters))
            raise fault(f"parameters.{key}", self.parameters[key], "parameters of a recipe only")
        for key in ("size", "cells", "origin"):
            value = getattr(self, key)
            if value is None:
                raise fault(key, Words("missing"), f"a list of {dimension} numbers")
            if len(value) != dimension:
                raise fault(key, value, f"a list of {dimension} numbers for a {self.generator}")
        for name, pieces in self.parts.items():
            if name in self.sides:
                raise fault(f"parts.{name}", name, "a name that no side has")
            for piece in (pieces,) if isinstance(pieces, Piece) else pieces:
                self._check_piece(f"parts.{name}", piece, dimension)

    def _check_piece(self, path: str, piece: Piece, dimension: int) -> None:
        if piece.side not in self.sides:
            raise fault(f"{path}.side", piece.side, ", ".join(self.sides))
        for key, given in (("from", piece.start), ("to", piece.stop)):
            if given is not None and isinstance(given, tuple) != (dimension == 3):
                raise fault(f"{path}.{key}", given, "a number" if dimension == 2 else "2 numbers")
        if piece.start is not None and piece.stop is not None:
            if not np.all(np.less(piece.start, piece.stop)):
                raise fault(f"{path}.to", piece.stop, "a position beyond from")


class Space(Section):
    """`[space]`: finite elements."""

    degree: Annotated[int, Field(ge=1, le=2), Accepted("1 or 2")] = Field(
        default=1,
        description="Degree of the Lagrange elements of the displacement and the potential.",
    )


def _matrix(rows: int, columns: int) -> Any:
    row = Annotated[tuple[Number, ...], Field(min_length=columns, max_length=columns), as_tuple]
    words = Accepted(f"a list of {rows} rows of {columns} numbers")
    return Annotated[tuple[row, ...], Field(min_length=rows, max_length=rows), as_tuple, words]


class Piezo(Section):
    """`[material.piezo]`: the law sigma = F eps + e^T grad(phi), D = e eps - beta grad(phi).

    A crystal of class 6mm poled along X3, by five constants, or full Voigt matrices. In the
    plane x and y stand for X2 and X3.
    """

    e31: Number | None = Field(
        default=None, description="Coupling e31 = e32 of class 6mm (charge/area)."
    )
    e33: Number | None = Field(default=None, description="Coupling e33 (charge/area).")
    e15: Number | None = Field(default=None, description="Coupling e15 = e24 (charge/area).")
    beta11: Positive | None = Field(
        default=None, description="Permittivity across the poling axis."
    )
    beta33: Positive | None = Field(default=None, description="Permittivity along the poling axis.")
    e: _matrix(3, 6) | None = Field(  # type: ignore[valid-type]
        None,
        description="Coupling matrix, columns 11, 22, 33, 23, 13, 12. With `beta`, instead "
        "of the five constants.",
    )
    beta: _matrix(3, 3) | None = Field(  # type: ignore[valid-type]
        None, description="Permittivity matrix, symmetric and positive definite."
    )
    poling: (
        Annotated[Number | Triple, Accepted("an angle in the plane, a list of 3 numbers in space")]
        | None
    ) = Field(
        default=None,
        description="Poling axis: angle (degrees) from x in the plane, a vector in space. "
        "Default: y in the plane, z in space.",
    )

    @property
    def voigt(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Coupling, shape (3, 6), and permittivity, shape (3, 3), poled along X3."""
        if self.e is not None:
            return np.array(self.e), np.array(self.beta)
        e = np.zeros((3, 6))
        e[2, :3] = self.e31, self.e31, self.e33
        e[0, 4] = e[1, 3] = self.e15
        return e, np.diag([self.beta11, self.beta11, self.beta33])

    @model_validator(mode="after")
    def _check(self) -> Piezo:
        short = ("e31", "e33", "e15", "beta11", "beta33")
        full = ("e", "beta")
        given = [key for key in (*short, *full) if getattr(self, key) is not None]
        if set(given) not in ({*short}, {*full}):
            accepted = f"either all of {', '.join(short)}, or e and beta"
            missing = [k for k in (full if set(given) & {*full} else short) if k not in given]
            raise fault(
                missing[0] if missing else given[0],
                Words(f"only {', '.join(given) or 'nothing'}" if missing else "both ways"),
                accepted,
            )
        beta = self.voigt[1]
        if not np.allclose(beta, beta.T, rtol=1e-10, atol=0):
            raise fault("beta", self.beta, "a symmetric matrix")
        if not np.linalg.eigvalsh(beta)[0] > 0:
            raise fault("beta", self.beta, "a positive definite matrix")
        if isinstance(self.poling, tuple) and not any(self.poling):
            raise fault("poling", self.poling, "a vector that is not zero")
        return self


class Material(Section):
    """`[material]`: isotropic Hencky material, sigma = k0 tr(eps) I + 2 g dev(eps)."""

    law: Literal["linear", "log"] = Field(
        default="linear",
        description="`linear`: g = mu1; `log`: (7.8), g = mu1 (s/t)(ln(t/s) + 1) "
        "beyond the yield strain s.",
    )
    young: Positive = Field(description="Young's modulus E (force/area).")
    poisson: Annotated[
        float, Field(gt=-1, lt=0.5), Accepted("a number between -1 and 0.5, both excluded")
    ] = Field(description="Poisson's ratio.")
    yield_strain: Positive | None = Field(
        default=None,
        description="Yield strain xi_0, a limit on |dev eps|. Required by `log`, of no "
        "effect on `linear`.",
    )
    argument: Literal["norm", "square"] = Field(
        default="norm",
        description="Argument of g: |dev eps|, or its square as printed in (7.8), which "
        "softens beyond e xi_0.",
    )
    g_min: NonNegative = Field(
        default=0.0, description="Floor of g in `log` (force/area); 0: none."
    )
    piezo: Piezo | None = Field(
        default=None,
        description="Piezoelectric constants, `[material.piezo]`. Absent: mechanical only.",
    )

    @model_validator(mode="after")
    def _check(self) -> Material:
        if self.law == "log" and self.yield_strain is None:
            raise fault("yield_strain", Words("missing"), 'a number > 0 with law = "log"')
        mu1 = self.young / (2 + 2 * self.poisson)
        if self.g_min > mu1:
            raise fault("g_min", self.g_min, f"at most the shear modulus {mu1:g}")
        return self


def _component(given: Any) -> str:
    return "free" if given == "free" else "Formula"


Component: TypeAlias = Annotated[
    Annotated[Formula, Tag("Formula")] | Annotated[Literal["free"], Tag("free")],
    Discriminator(_component),
]


class Fixed(Section):
    """`[[fixed]]`: prescribed displacement or potential on a part."""

    on: Name = Field(description="Part of the boundary.")
    displacement: (
        Annotated[
            tuple[Component, ...],
            Field(min_length=2, max_length=3),
            as_tuple,
            Accepted(
                "a list of 2 components in the plane, 3 in space, each a number, a formula "
                'or "free"'
            ),
        ]
        | None
    ) = Field(
        default=None,
        description='Displacement of the part; "free" for a component that is not fixed.',
    )
    potential: Formula | None = Field(default=None, description="Electric potential of the part.")

    @property
    def is_clamped(self) -> bool:
        """True if every component of the displacement is prescribed."""
        return self.displacement is not None and "free" not in self.displacement

    @model_validator(mode="after")
    def _check(self) -> Fixed:
        if self.potential is None and (
            self.displacement is None or all(c == "free" for c in self.displacement)
        ):
            raise fault(
                "displacement",
                self.displacement or Words("missing"),
                "a component that is fixed, or a potential",
            )
        return self


class Load(Section):
    """`[[load]]`: forces and charges on a part, or in the whole body."""

    on: Name | None = Field(default=None, description="Part of the boundary. This or `everywhere`.")
    everywhere: Switch = Field(default=False, description="`true`: in the whole body.")
    traction: FormulaVector | None = Field(default=None, description="Force per area of the part.")
    pressure: Formula | None = Field(
        default=None,
        description="Normal pressure p on the part: traction -p along the outward normal.",
    )
    charge: Formula | None = Field(default=None, description="Charge per area of the part.")
    body_force: FormulaVector | None = Field(default=None, description="Force per volume.")
    body_charge: Formula | None = Field(default=None, description="Charge per volume.")

    @model_validator(mode="after")
    def _check(self) -> Load:
        if (self.on is None) == (not self.everywhere):
            given = "neither" if self.on is None else "both"
            raise fault("on", Words(given), "one of on and everywhere = true")
        surface, volume = ("traction", "pressure", "charge"), ("body_force", "body_charge")
        right, wrong = (volume, surface) if self.everywhere else (surface, volume)
        place = "everywhere = true" if self.everywhere else "on"
        for key in wrong:
            if getattr(self, key) is not None:
                raise fault(
                    key, Words(f"together with {place}"), f"with {place}: {', '.join(right)}"
                )
        if all(getattr(self, key) is None for key in right):
            raise fault(right[0], Words("missing"), f"at least one of {', '.join(right)}")
        return self
