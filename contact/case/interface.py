"""Sections of the case file about Gamma_3: shapes, contact, friction and electric contact."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Annotated, Any, Literal, Self, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from contact.interface.law import Conductor
from contact.interface.layer import Layer
from contact.mesh.domain import Domain
from contact.mesh.geometry import area, volume
from contact.mesh.parts import meet
from contact.model import obstacle
from contact.model.fields import steady
from contact.model.formula import Expression, as_number
from contact.model.friction import Friction
from contact.model.messages import Words, fault
from contact.model.obstacle import GapFunction, Obstacle
from contact.model.rigid import Motion
from contact.model.section import (
    AmplitudeName,
    Direction,
    Formula,
    FromTable,
    Part,
    Section,
    TimeFormula,
)
from contact.settings import Accepted, NonNegative, Positive, ReadWith, Switch
from forms import laws

#: A further shape is a dataclass in `contact.model.obstacle` with its name as `shape`.
Foundation: TypeAlias = Annotated[
    Annotated[obstacle.Plane, FromTable]
    | Annotated[obstacle.Sphere, FromTable]
    | Annotated[obstacle.Cylinder, FromTable]
    | Annotated[obstacle.Cone, FromTable]
    | Annotated[obstacle.Paraboloid, FromTable]
    | Annotated[obstacle.Punch, FromTable]
    | Annotated[obstacle.Level, FromTable]
    | Annotated[obstacle.Heights, FromTable]
    | Annotated[obstacle.Triangles, FromTable],
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
        return replace(self.foundation, direction=self.direction, along=self.axis or ())

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
