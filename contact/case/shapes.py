"""Sections of the case file about rigid shapes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, ClassVar, Literal, Self, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from contact.case.formula import Expression
from contact.case.messages import fault
from contact.case.section import Direction, File, Formula, NonNegative, Section, Vector
from contact.errors import InputError
from contact.interface import obstacle
from contact.interface.obstacle import Obstacle
from contact.interface.obstacle.stl import read_stl
from contact.settings import Accepted, Positive, Switch
from contact.typing import Array


class Shape(Section):
    """A rigid shape. A new one is a section like those below, added to `Foundation`."""

    #: The only dimension in which there is the shape, if it is not both.
    only: ClassVar[int | None] = None
    #: The shape itself, a class with the keys of the section as its arguments.
    made: ClassVar[Callable[..., Obstacle]]

    @model_validator(mode="after")
    def _check_vectors(self) -> Self:
        vectors = [(key, value) for key, value in self if isinstance(value, tuple)]
        for key, vector in vectors:
            if len(vector) != len(vectors[0][1]):
                raise fault(key, vector, f"{len(vectors[0][1])} numbers, as {vectors[0][0]} has")
        return self

    def obstacle(self, direction: str, along: tuple[float, ...]) -> Obstacle:
        """Return the shape itself, for a contact direction, and the axis where that is "axis"."""
        values = {key: value for key, value in self if key != "shape"}
        return type(self).made(**values, direction=direction, along=along)


class Plane(Shape):
    """`foundation = { shape = "plane", ... }`: rigid half space."""

    made = obstacle.Plane
    shape: Literal["plane"]
    """A plane."""
    point: Vector
    """A point of the plane."""
    normal: Direction
    """Normal towards the body, of any length."""


class Sphere(Shape):
    """`foundation = { shape = "sphere", ... }`: rigid sphere, in 2-D a circle."""

    made = obstacle.Sphere
    shape: Literal["sphere"]
    """A sphere or circle."""
    centre: Vector
    """Centre."""
    radius: Positive
    """Radius."""
    inside: Switch = False
    """`true`: the body lies inside the sphere."""


class Cylinder(Shape):
    """`foundation = { shape = "cylinder", ... }`: rigid cylinder without ends, or a bore."""

    made = obstacle.Cylinder
    shape: Literal["cylinder"]
    """A cylinder; in 2-D a strip."""
    point: Vector
    """A point of its axis."""
    axis: Direction
    """Its axis, of any length."""
    radius: Positive
    """Radius."""
    inside: Switch = False
    """`true`: the body lies in the bore."""


class Cone(Shape):
    """`foundation = { shape = "cone", ... }`: rigid cone, in 2-D a wedge."""

    made = obstacle.Cone
    shape: Literal["cone"]
    """A cone."""
    apex: Vector
    """Its tip."""
    axis: Direction
    """From the tip into the cone, of any length."""
    half_angle: Annotated[
        float, Field(gt=0, lt=90), Accepted("an angle between 0 and 90 degrees, both excluded")
    ]
    """Between axis and side (degrees)."""


class Paraboloid(Shape):
    """`foundation = { shape = "paraboloid", ... }`: rigid paraboloid, in 2-D a parabola."""

    made = obstacle.Paraboloid
    shape: Literal["paraboloid"]
    """A paraboloid h = r^2/(2 R)."""
    apex: Vector
    """Its tip."""
    axis: Direction
    """From the tip into the paraboloid, of any length."""
    radius: Positive
    """Radius of curvature R at the tip."""


class Punch(Shape):
    """`foundation = { shape = "punch", ... }`: rigid flat punch, in 2-D a rectangle."""

    made = obstacle.Punch
    shape: Literal["punch"]
    """A cylinder with a flat face."""
    centre: Vector
    """Centre of the face."""
    axis: Direction
    """From the face into the punch, of any length."""
    radius: Positive
    """Radius of the punch."""
    edge_radius: NonNegative = 0.0
    """Radius by which the edge is rounded; 0: sharp."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.edge_radius > self.radius:
            raise fault("edge_radius", self.edge_radius, f"at most the radius, {self.radius:g}")
        return self


class Distance(Shape):
    """`foundation = { shape = "distance", ... }`: any rigid shape by a formula."""

    shape: Literal["distance"]
    """A body where a formula is negative."""
    distance: Formula
    """Signed distance, positive outside. Where its slope is not 1 it is divided by that."""

    def obstacle(self, direction: str, along: tuple[float, ...]) -> obstacle.Level:
        """Return the shape."""
        return obstacle.Level(_Quiet(self.distance), direction=direction, along=along)


class Surface(Shape):
    """`foundation = { shape = "surface", ... }`: rigid surface of triangles, in 3-D."""

    only = 3
    shape: Literal["surface"]
    """A surface of an STL file."""
    file: Annotated[File, Accepted("an STL file")]
    """STL file, binary or text, its normals towards the body. Relative to the case file."""

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


Foundation: TypeAlias = Annotated[
    Plane | Sphere | Cylinder | Cone | Paraboloid | Punch | Distance | Surface,
    Field(discriminator="shape"),
]
