"""Sections of the case file about rigid shapes."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from contact.case.formula import Expression
from contact.case.types import Direction, File, Formula, NonNegative, Section, Vector, fault
from contact.case.unions import one_of
from contact.errors import InputError
from contact.interface import obstacle
from contact.interface.obstacle import Obstacle
from contact.interface.obstacle.stl import read_stl
from contact.settings import Accepted, Positive, Switch
from contact.typing import Array


class Shape(Section):
    """A rigid shape. A new one is a section like those below, entered in `Foundation`."""

    #: The only dimension in which there is the shape, if it is not both.
    only: ClassVar[int | None] = None

    @property
    def vectors(self) -> dict[str, tuple[float, ...]]:
        """The keys that hold a point or a direction: each has as many numbers as space."""
        return {key: value for key, value in self if isinstance(value, tuple)}

    @model_validator(mode="after")
    def _check_vectors(self) -> Shape:
        first = next(iter(self.vectors.items()), None)
        for key, vector in self.vectors.items():
            if first is not None and len(vector) != len(first[1]):
                raise fault(key, vector, f"{len(first[1])} numbers, as {first[0]} has")
        return self

    #: What it stands for, made of the section's values by their names.
    made: ClassVar[Callable[..., Obstacle]]

    def obstacle(self, direction: str, along: tuple[float, ...]) -> Obstacle:
        """Return the shape itself, for a contact direction, and the axis where that is "axis"."""
        values = {key: value for key, value in self if key != "shape"}
        return type(self).made(**values, direction=direction, along=along)


class Plane(Shape):
    """`foundation = { shape = "plane", ... }`: rigid half space."""

    made = obstacle.Plane
    shape: Literal["plane"] = Field(description="A plane.")
    point: Vector = Field(description="A point of the plane.")
    normal: Direction = Field(description="Normal towards the body, of any length.")


class Sphere(Shape):
    """`foundation = { shape = "sphere", ... }`: rigid sphere, in the plane a circle."""

    made = obstacle.Sphere
    shape: Literal["sphere"] = Field(description="A sphere or circle.")
    centre: Vector = Field(description="Centre.")
    radius: Positive = Field(description="Radius.")
    inside: Switch = Field(default=False, description="`true`: the body lies inside the sphere.")


class Cylinder(Shape):
    """`foundation = { shape = "cylinder", ... }`: rigid cylinder without ends, or a bore."""

    made = obstacle.Cylinder
    shape: Literal["cylinder"] = Field(description="A cylinder; in the plane a strip.")
    point: Vector = Field(description="A point of its axis.")
    axis: Direction = Field(description="Its axis, of any length.")
    radius: Positive = Field(description="Radius.")
    inside: Switch = Field(default=False, description="`true`: the body lies in the bore.")


class Cone(Shape):
    """`foundation = { shape = "cone", ... }`: rigid cone, in the plane a wedge."""

    made = obstacle.Cone
    shape: Literal["cone"] = Field(description="A cone.")
    apex: Vector = Field(description="Its tip.")
    axis: Direction = Field(description="From the tip into the cone, of any length.")
    half_angle: Annotated[
        float, Field(gt=0, lt=90), Accepted("an angle between 0 and 90 degrees, both excluded")
    ] = Field(description="Between axis and side (degrees).")


class Paraboloid(Shape):
    """`foundation = { shape = "paraboloid", ... }`: rigid paraboloid, in the plane a parabola."""

    made = obstacle.Paraboloid
    shape: Literal["paraboloid"] = Field(description="A paraboloid h = r^2/(2 R).")
    apex: Vector = Field(description="Its tip.")
    axis: Direction = Field(description="From the tip into the paraboloid, of any length.")
    radius: Positive = Field(description="Radius of curvature R at the tip.")


class Punch(Shape):
    """`foundation = { shape = "punch", ... }`: rigid flat punch, in the plane a rectangle."""

    made = obstacle.Punch
    shape: Literal["punch"] = Field(description="A cylinder with a flat face.")
    centre: Vector = Field(description="Centre of the face.")
    axis: Direction = Field(description="From the face into the punch, of any length.")
    radius: Positive = Field(description="Radius of the punch.")
    edge_radius: NonNegative = Field(
        default=0.0, description="Radius by which the edge is rounded; 0: sharp."
    )

    @model_validator(mode="after")
    def _check(self) -> Punch:
        if self.edge_radius > self.radius:
            raise fault("edge_radius", self.edge_radius, f"at most the radius, {self.radius:g}")
        return self


class Distance(Shape):
    """`foundation = { shape = "distance", ... }`: any rigid shape by a formula."""

    shape: Literal["distance"] = Field(description="Where a formula is negative.")
    distance: Formula = Field(
        description="Signed distance, positive outside. Where its slope is not 1 it is divided by "
        "that."
    )

    def obstacle(self, direction: str, along: tuple[float, ...]) -> obstacle.Level:
        """Return the shape."""
        return obstacle.Level(_Quiet(self.distance), direction=direction, along=along)


class Surface(Shape):
    """`foundation = { shape = "surface", ... }`: rigid surface of triangles, in space."""

    only = 3

    shape: Literal["surface"] = Field(description="A surface of an STL file.")
    file: Annotated[File, Accepted("an STL file")] = Field(
        description="STL file, binary or text, its normals towards the body. Relative to the case "
        "file."
    )

    def obstacle(self, direction: str, along: tuple[float, ...]) -> obstacle.Triangles:
        """Read the surface."""
        return obstacle.Triangles(read_stl(self.file), direction=direction, along=along)


class _Quiet:
    """A formula that is NaN where it has no value: ranks ask it at points of their own."""

    def __init__(self, expression: Expression) -> None:
        self._expression = expression

    def __call__(self, points: Array) -> Array:
        """Return the values at points of shape (n, d)."""
        try:
            return self._expression.numpy(points)
        except InputError:
            return np.full(len(points), np.nan)


if TYPE_CHECKING:
    Foundation: TypeAlias = Shape
else:
    Foundation = one_of(
        "shape", Plane, Sphere, Cylinder, Cone, Paraboloid, Punch, Distance, Surface
    )
