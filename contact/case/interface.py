"""Sections of the case file about Gamma_3: shapes, contact, friction and electric contact."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from contact.arguments import expect, naming
from contact.case.data import read_data
from contact.errors import InputError
from contact.interface import obstacle
from contact.interface.law import Conductor
from contact.interface.layer import Layer
from contact.interface.obstacle import GapFunction, Obstacle, Shape
from contact.interface.obstacle.triangles import read_stl
from contact.mesh.domain import Domain
from contact.mesh.geometry import area, volume
from contact.mesh.together import meet
from contact.model.fields import steady
from contact.model.formula import Expression, as_number
from contact.model.friction import Friction
from contact.model.messages import Words, fault
from contact.model.rigid import Motion
from contact.model.section import (
    AmplitudeName,
    Direction,
    File,
    Formula,
    FromTable,
    Part,
    Section,
    TimeFormula,
)
from contact.settings import Accepted, NonNegative, Positive, ReadWith, Switch
from contact.typing import Array
from forms import laws


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


class HeightMap(Section):
    """`foundation = { shape = "heights", ... }`: a measured surface, by its heights."""

    only: ClassVar[int | None] = None

    shape: Literal["heights"]
    """A body below heights along the last axis, smooth between them (cubic splines)."""
    file: Annotated[File, Accepted("a CSV file, or a .npy file with an array of heights")]
    """CSV file with a row of names and the columns x, y (3-D: x, y, z, at all points of a grid); or
    a NumPy array of heights, an image for instance. Relative to the case file. A warning tells the
    share of the contact that lies beyond them, or in a hole."""
    spacing: Annotated[
        list[Positive] | None, Accepted("distances > 0, one per direction of the array")
    ] = None
    """Distances of the points of an array: along its first axis, which is x, and in 3-D along its
    second, y. Required for an array."""
    origin: Annotated[list[float] | None, Accepted("numbers, one per direction of the array")] = (
        None
    )
    """Place of the first point of an array. Default: zeros."""
    above: Switch = False
    """Whether the rigid body lies above the heights, and the elastic one below."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        for key in ("spacing", "origin"):
            if getattr(self, key) is not None and not self._is_array:
                accepted = "that of a .npy file alone: the rows of a CSV file have their places"
                raise fault(key, getattr(self, key), accepted)
        return self

    @property
    def _is_array(self) -> bool:
        return self.file.endswith(".npy")

    def build(self) -> Shape:
        """Read the heights."""
        places, heights = self._array() if self._is_array else self._columns()
        with naming(self.file):
            return obstacle.Heights(places, heights, above=self.above)

    def _array(self) -> tuple[tuple[Array, ...], Array]:
        try:
            heights = np.asarray(np.load(self.file), dtype=float)
        except (OSError, ValueError, EOFError) as error:
            raise InputError(
                f"{self.file}: {error}; accepted: a NumPy array of heights", "heights"
            ) from None
        spacing, origin = self.spacing or [], self.origin or [0.0] * heights.ndim
        one = f"{heights.ndim} numbers, one per direction of the array"
        for key, given in (("spacing", spacing), ("origin", origin)):
            expect(f"foundation.{key}", given, one, len(given) == heights.ndim)
        steps = zip(origin, spacing, heights.shape, strict=True)
        return tuple(first + step * np.arange(n) for first, step, n in steps), heights

    def _columns(self) -> tuple[tuple[Array, ...], Array]:
        columns = read_data(self.file)
        names = [name for name in "xyz" if name in columns]
        accepted = "columns x, y in the plane, x, y, z in 3-D"
        expect(self.file, f"columns {', '.join(columns)}", accepted, len(names) > 1)
        *across, heights = (columns[name] for name in names)
        order = np.lexsort(across[::-1])
        places = tuple(np.unique(values) for values in across)
        shape = tuple(axis.size for axis in places)
        made = f"the grid of {' by '.join(map(str, shape))} points that their coordinates make"
        if math.prod(shape) > 4 * len(heights):  # scattered points
            raise InputError(
                f"{self.file}: {len(heights)} points of {made}; accepted: each point of a grid "
                "once",
                "heights",
            )
        grid = np.stack(np.meshgrid(*places, indexing="ij"), axis=-1).reshape(-1, len(across))
        given = np.column_stack(across)[order]
        if given.shape != grid.shape or np.any(given != grid):
            known, counts = np.unique(given, axis=0, return_counts=True)
            twice = known[counts > 1]
            missing = {*map(tuple, grid.tolist())} - {*map(tuple, known.tolist())}
            one = twice[0].tolist() if twice.size else min(missing)
            where = f"({', '.join(f'{x:g}' for x in one)})"
            said = f"{where} stands twice" if twice.size else f"no height at {where}"
            raise InputError(
                f"{self.file}: {said}, of {made}; accepted: each point of a grid once", "heights"
            )
        return places, heights[order].reshape(shape)


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
    | HeightMap
    | Surface,
    Field(discriminator="shape"),
]


#: `contact.case.file.Case`, of which these are sections.
Case: TypeAlias = Any

#: Width of the ramp of psi over the height of the body.
RAMP = 0.1

#: Of the layer; the thesis does not give its constants (section 8.1.2).
COMPLIANT = ReadWith("law", "compliance")


#: Of a number that may be infinite: JSON has no such number, and editors pass null for it.
INFINITE: dict[str, Any] = {
    "allow_inf_nan": True,
    "json_schema_extra": {"type": ["number", "null"]},
}


class Electric(Section):
    """`[electric]`: a conductive foundation, D.nu = psi(u_nu - rho) phi_L(phi - phi_f)."""

    law: Literal["shifted", "perfect", "ramp"] = "shifted"
    """psi: `shifted`, k_e clip(1 + delta (u_nu - rho), 0, 1); `perfect`, k_e in contact; `ramp`, as
    the thesis has it, zero where u_nu <= rho, with which no contact conducts."""
    k_e: NonNegative
    """k_e of the foundation: a capacitance per area, for D.nu is a charge."""
    phi_f: TimeFormula = Expression(0.0)
    """Potential phi_F of the foundation."""
    amplitude: AmplitudeName | None = None
    """Factor of phi_f as a function of time, see `[evolution]`. Without one phi_f is constant."""
    delta: Annotated[Positive | None, ReadWith("law", ("shifted", "ramp"))] = None
    """Slope of psi (1/length): psi rises within 1/delta of the gap. Default: 10 / H, H the volume
    of the body over the area of its contact part, or its diameter where that is smaller. A
    warning says where 1/delta is below two spacings of the contact nodes."""
    limit: Positive | None = None
    """Limit L of the truncation phi_L. Default: no truncation."""
    lagged: Switch = False
    """`true`: the charge is taken from the previous outer iteration, as in Algorithm 4; converges
    for small k_e only; not with method `newton`."""

    def build(self, case: Case, domain: Domain, part: str) -> Conductor:
        """Return the conductor itself, in front of a part of a mesh. Collective."""
        psi: laws.Conductivity
        if self.law == "perfect":
            psi = laws.PerfectConductivity(self.k_e)
        else:
            slope = self.delta or 1 / conduction_ramp(domain, part)
            kind = {"shifted": laws.ShiftedConductivity, "ramp": laws.RampConductivity}[self.law]
            psi = kind(self.k_e, slope)
        truncation = laws.Truncation(np.inf if self.limit is None else self.limit)
        phi_f = as_number(self.phi_f)
        if isinstance(phi_f, float) and self.amplitude is None:
            return Conductor(psi, phi_f, truncation, self.lagged)
        # A foundation has its potential from the beginning.
        named = None if self.amplitude is None else case.amplitude(self.amplitude)
        factor, number = named or steady, self.phi_f.number

        def phi_f_at(time: float) -> float:
            """Return the potential of the foundation at a time."""
            return float(factor(time) * number(time))

        return Conductor(psi, phi_f_at(0.0), truncation, self.lagged, phi_f_at)


class Contact(Section):
    """`[contact]`: a part of the body that may touch a foundation or another body.

    Several contacts are a list of tables `[[contact]]`, each a foundation of its own. Their parts
    share no nodes.
    """

    on: Part
    """Part of the boundary, or a list of parts, that may touch the foundation."""
    name: Annotated[str, Field(min_length=1), Accepted("a text")] | None = None
    """Name of its results, `contacts` of the summary. Default: that of its part."""
    law: Literal["signorini", "compliance"] = "signorini"
    """`signorini`: rigid foundation; `compliance`: with a compliant layer in front."""
    against: Part | None = None
    """Part of another body of the mesh, or a list of parts, that it may touch, instead of a
    foundation."""
    gap: Formula | None = None
    """Gap rho to the rigid foundation along the body's normal; with `against`, added to the
    distance between the meshes. Below 0 it is an interference. Default: 0 without `foundation`."""
    foundation: Foundation | None = None
    """Rigid shape, instead of a gap: `[contact.foundation]`."""
    direction: Literal["foundation", "body", "axis"] = "foundation"
    """Contact direction on a rigid shape: normal of the foundation or of the body, or along
    `axis`, as the closed forms of indentation take it; cones and edges need that. With a gap it
    is the body's."""
    axis: Direction | None = None
    """With `direction = "axis"`: that direction, from the body towards the foundation, of any
    length."""
    overlap: Literal["refuse", "press"] = "refuse"
    """Meshes of two bodies that overlap in the reference configuration, or a shape that cuts the
    body: `refuse` that, or `press` it out as an interference."""
    rigid: Motion | None = None
    """Motion of the foundation: `[contact.rigid]`. Absent: it is fixed."""
    layer: Annotated[
        float, Field(ge=0, **INFINITE), COMPLIANT, Accepted("a number >= 0, or inf")
    ] = 0.0
    """Thickness of the layer, which is touched at gap - layer. A layer thicker than the gap presses
    on the undeformed body. `inf`: no rigid part, touched at gap."""
    stiffness: Annotated[NonNegative, COMPLIANT] = 10.0
    """c_nu, stiffness of the layer (force/volume)."""
    limit: Annotated[
        float, Field(gt=0, **INFINITE), COMPLIANT, Accepted("a number > 0, or inf")
    ] = 0.1
    """n_nu: depth at which the layer's pressure saturates; `inf`: never."""
    potential_factor: Annotated[float, Field(ge=1), COMPLIANT, Accepted("a number >= 1")] = 2.0
    """alpha_nu: growth of the layer's stiffness with the potential difference; 1: none."""
    potential_range: Annotated[Positive, COMPLIANT] = 128.0
    """Potential difference at which the growth ends."""
    lagged: Annotated[Switch, COMPLIANT] = False
    """`true`: the layer's force is taken from the previous outer iteration, as in Algorithms 6
    and 8; not with method `newton`."""
    friction: Annotated[
        Friction | None, Accepted("a table; [friction] at the top level is for all contacts")
    ] = None
    """Friction on this part. Default: that of `[friction]`."""
    electric: Electric | None = None
    """Electric contact of this part. Default: that of `[electric]`."""

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, given: Any) -> Any:
        """Fill in the gap of a contact without a shape."""
        if isinstance(given, Mapping) and "foundation" not in given:
            return {"gap": Expression(0.0), **given}
        return given

    @model_validator(mode="after")
    def _check(self) -> Self:
        pairs = (("against", "foundation"), ("against", "rigid"), ("gap", "foundation"))
        for one, other in pairs:
            if getattr(self, one) is not None and getattr(self, other) is not None:
                key = other if other == "rigid" else one
                raise fault(key, Words(f"both {one} and {other}"), "one of them", "exclusive-keys")
        if self.against is not None and meet(self.against, self.on):
            raise fault("against", self.against, "another part than `on`")
        if (self.axis is None) != (self.direction != "axis"):
            given = Words("missing") if self.axis is None else self.axis
            accepted = 'a vector with direction = "axis", and with that alone'
            raise fault("axis", given, accepted)
        if self.foundation is None:
            if self.axis is not None:
                raise fault("direction", self.direction, "axis with a foundation that is a shape")
            gap, none = self.gap, self.against is None
            none &= gap is not None and gap.is_constant and gap.value >= 0
            if self.overlap == "press" and none:
                accepted = "press with against, a foundation that is a shape, or a gap below 0"
                raise fault("overlap", self.overlap, accepted)
        return self

    def obstacle(self) -> Obstacle:
        """Return the rigid foundation itself."""
        if self.foundation is None:
            assert self.gap is not None  # filled in
            return GapFunction.of(self.gap)
        given = self.foundation
        shape = given.build() if isinstance(given, Section) else given
        return replace(shape, direction=self.direction, along=self.axis or ())

    def compliant_layer(self) -> Layer | None:
        """Return the layer in front of the rigid foundation; None without one."""
        if self.law == "signorini":
            return None
        factor = laws.PotentialFactor(self.stiffness, self.potential_factor, self.potential_range)
        return Layer(self.layer, laws.Compliance(self.limit), factor, self.lagged)


def conduction_ramp(domain: Domain, part: str) -> float:
    """Return how far in front of a foundation it conducts by default (length). Collective.

    A tenth of the body's height over its contact part: of a length of the problem, so that
    refined meshes resolve it and solutions have a limit. A fixed small number of the thesis's
    delta means a wide ramp too.
    """
    height = volume(domain) / area(domain, part)
    return RAMP * min(height, domain.size)
