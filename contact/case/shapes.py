"""Rigid shapes of the case file: those of `contact.interface.obstacle`, and two that are read."""

from __future__ import annotations

from functools import partial
from typing import Annotated, ClassVar, Literal, TypeAlias

import numpy as np
from pydantic import Field

from contact.case.formula import Expression
from contact.case.section import File, Formula, FromTable, Section
from contact.errors import InputError
from contact.interface import obstacle
from contact.interface.obstacle import Shape
from contact.interface.obstacle.triangles import read_stl
from contact.settings import Accepted
from contact.typing import Array


class Distance(Section):
    """`foundation = { shape = "distance", ... }`: any rigid shape by a formula."""

    only: ClassVar[int | None] = None

    shape: Literal["distance"]
    """A body where a formula is negative."""
    distance: Formula
    """Signed distance, positive outside. Where its slope is not 1 it is divided by that."""

    def build(self) -> Shape:
        """Return the shape itself."""
        return obstacle.Level(partial(_quiet, self.distance))


class Surface(Section):
    """`foundation = { shape = "surface", ... }`: rigid surface of triangles, in 3-D."""

    only: ClassVar[int | None] = 3

    shape: Literal["surface"]
    """A surface of an STL file."""
    file: Annotated[File, Accepted("an STL file")]
    """STL file, binary or text, its normals towards the body. Relative to the case file."""

    def build(self) -> Shape:
        """Read the shape."""
        return obstacle.Triangles(read_stl(self.file))


def _quiet(expression: Expression, points: Array) -> Array:
    """Return values at points of shape (n, d), NaN for none: ranks ask at points of their own."""
    try:
        return expression.numpy(points)
    except InputError:
        return np.full(len(points), np.nan)


#: A further shape is a dataclass in `contact.interface.obstacle` with its name as `shape`.
Foundation: TypeAlias = Annotated[
    Annotated[obstacle.Plane, FromTable]
    | Annotated[obstacle.Sphere, FromTable]
    | Annotated[obstacle.Cylinder, FromTable]
    | Annotated[obstacle.Cone, FromTable]
    | Annotated[obstacle.Paraboloid, FromTable]
    | Annotated[obstacle.Punch, FromTable]
    | Distance
    | Surface,
    Field(discriminator="shape"),
]
