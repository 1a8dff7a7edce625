"""Sections of the case file about the foundation: contact, friction and electric contact."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal, TypeAlias

from pydantic import Field, model_validator

from contact.case.formula import Expression
from contact.case.parts import Part
from contact.case.rigid import Rigid
from contact.case.shapes import Foundation
from contact.case.types import (
    AmplitudeName,
    Direction,
    NonNegative,
    NonNegativeFormula,
    Section,
    TimeFormula,
    Words,
    fault,
)
from contact.case.unions import one_of
from contact.mesh.together import meet
from contact.settings import Accepted, Positive, Switch
from forms.laws import Coulomb, FrictionLaw, SlipCoefficient


class Coefficient(Section):
    """A coefficient of friction. A new one is a section like that below, entered in `Mu`."""

    @abstractmethod
    def friction(self) -> FrictionLaw:
        """Return the friction law that has it."""


class SlipLaw(Coefficient):
    """`mu = { law = "slip", ... }`: coefficient a + b/(rho s + 2) at the slip s, (7.16)."""

    law: Literal["slip"] = Field(description="The slip-dependent law.")
    a: NonNegative = Field(default=0.5, description="Coefficient at large slip.")
    b: NonNegative = Field(default=0.2, description="Twice the excess at rest.")
    rho: NonNegative = Field(description="Decay rate (1/length).")

    def friction(self) -> Coulomb:
        """Return Coulomb's law."""
        return Coulomb(SlipCoefficient(self.a, self.b, self.rho))


if TYPE_CHECKING:
    Mu: TypeAlias = Expression | Coefficient
else:
    Mu = one_of("law", SlipLaw, formula=NonNegativeFormula)


class Friction(Section):
    """`[friction]`: friction on the contact parts that have none of their own. Absent: none."""

    law: Literal["none", "tresca", "coulomb"] = Field(
        default="none",
        description="`tresca`: fixed bound; `coulomb`: mu times the smoothed pressure.",
    )
    bound: NonNegativeFormula | None = Field(
        default=None, description="Bound S of the tangential stress. Tresca only, required there."
    )
    mu: Mu | None = Field(
        default=None, description="Coefficient of friction. Coulomb only, required there."
    )
    radius: NonNegative = Field(
        default=0.0,
        description="Radius of the smoothing operator R; 0: the pressure itself. Coulomb only.",
    )

    @model_validator(mode="after")
    def _check(self) -> Friction:
        owner = {"bound": "tresca", "mu": "coulomb"}
        for key, law in owner.items():
            value = getattr(self, key)
            if self.law == law and value is None:
                accepted = f'{key} with law = "{law}"'
                raise fault(key, Words("missing"), accepted)
            if self.law != law and value is not None:
                raise fault(key, Words(f'given with law = "{self.law}"'), f'law = "{law}"')
        if self.radius > 0 and self.law != "coulomb":
            raise fault("radius", self.radius, 'a radius with law = "coulomb" only')
        return self


class Electric(Section):
    """`[electric]`: a conductive foundation, D.nu = psi(u_nu - rho) phi_L(phi - phi_f)."""

    law: Literal["shifted", "perfect", "ramp"] = Field(
        default="shifted",
        description="psi: `shifted`, k_e clip(1 + delta (u_nu - rho), 0, 1); `perfect`, k_e in "
        "contact, (1.33); `ramp`, (1.34) as printed, zero where u_nu <= rho. `shifted` gives up "
        "(h~5)(d), psi = 0 for u_nu <= rho, with which no contact conducts.",
    )
    k_e: NonNegative = Field(description="Conductivity k_e of the foundation.")
    phi_f: TimeFormula = Field(
        default=Expression(0.0), description="Potential phi_F of the foundation."
    )
    amplitude: AmplitudeName | None = Field(
        default=None, description="Factor of phi_f as a function of time, see `[evolution]`."
    )
    delta: Positive | None = Field(
        default=None,
        description="Slope of psi (1/length), `shifted` and `ramp` only: psi rises within 1/delta "
        "of the gap. Default: 10 / H, H the volume of the body over the area of its contact part, "
        "or its size where that is smaller. A warning says where 1/delta is below two spacings of "
        "the contact nodes.",
    )
    limit: Positive | None = Field(
        default=None, description="Limit L of the truncation phi_L. Default: no truncation."
    )
    lagged: Switch = Field(
        default=False,
        description="`true`: the charge is taken from the previous outer iteration, as in "
        "Algorithm 4; converges for small k_e only; not with method `newton`.",
    )

    @model_validator(mode="after")
    def _check(self) -> Electric:
        if self.delta is not None and self.law == "perfect":
            raise fault("delta", self.delta, 'delta with law = "shifted" or "ramp"')
        return self


#: Constants of the compliant layer that the thesis does not give (section 8.1.2).
LAYER = {
    "layer": 0.0,
    "stiffness": 10.0,
    "limit": 0.1,
    "potential_factor": 2.0,
    "potential_range": 128.0,
}


class Contact(Section):
    """`[contact]`: where and on what the body may rest.

    Several contacts are a list of tables `[[contact]]`, each a foundation of its own. Their parts
    share no nodes.
    """

    on: Part = Field(
        description="Part of the boundary, or a list of parts, that may touch the foundation."
    )
    law: Literal["signorini", "compliance"] = Field(
        default="signorini",
        description="`signorini`: rigid foundation; `compliance`: with a compliant layer in front.",
    )
    against: Part | None = Field(
        default=None,
        description="Part of another body of the mesh, or a list of parts, that it may touch, "
        "instead of a foundation.",
    )
    gap: NonNegativeFormula | None = Field(
        default=None,
        description="Gap rho to the rigid foundation along the body's normal; with `against`, what "
        "is added to the distance between the meshes. Default: 0 without `foundation`.",
    )
    foundation: Foundation | None = Field(
        default=None, description="Rigid shape, instead of a gap: `[contact.foundation]`."
    )
    direction: Literal["foundation", "body", "axis"] = Field(
        default="foundation",
        description="Contact direction on a rigid shape: normal of the foundation or of the body, "
        "or along `axis`, as the closed forms of indentation take it; cones and edges need that. "
        "With a gap it is the body's.",
    )
    axis: Direction | None = Field(
        default=None,
        description='With `direction = "axis"`: that direction, from the body towards the '
        "foundation, of any length.",
    )
    overlap: Literal["refuse", "press"] = Field(
        default="refuse",
        description="A shape that cuts the body at rest: `refuse` it, or `press` it out, as in a "
        "press fit.",
    )
    rigid: Rigid | None = Field(
        default=None, description="Motion of the foundation: `[contact.rigid]`. Absent: at rest."
    )
    layer: (
        Annotated[float, Field(ge=0, allow_inf_nan=True), Accepted("a number >= 0, or inf")] | None
    ) = Field(
        default=None,
        description="Thickness of the layer: first touch at gap - layer; one thicker than the gap "
        "presses on the body at rest. `inf`: no rigid part, first touch at gap, law (1.27). "
        f"Compliance only, default {LAYER['layer']}.",
    )
    stiffness: NonNegative | None = Field(
        default=None, description=f"c_nu. Compliance only, default {LAYER['stiffness']}."
    )
    limit: (
        Annotated[float, Field(gt=0, allow_inf_nan=True), Accepted("a number > 0, or inf")] | None
    ) = Field(
        default=None,
        description="n_nu: depth at which the layer's pressure saturates; `inf`: never, (1.28). "
        f"Compliance only, default {LAYER['limit']}.",
    )
    potential_factor: Annotated[float, Field(ge=1), Accepted("a number >= 1")] | None = Field(
        default=None,
        description="alpha_nu: growth of the layer's stiffness with the potential difference; 1: "
        f"none. Compliance only, default {LAYER['potential_factor']}.",
    )
    potential_range: Positive | None = Field(
        default=None,
        description="Potential difference at which the growth ends. Compliance only, default "
        f"{LAYER['potential_range']}.",
    )
    lagged: Switch = Field(
        default=False,
        description="`true`: the layer's force is taken from the previous outer iteration, as in "
        "Algorithms 6 and 8; not with method `newton`.",
    )
    friction: Annotated[
        Friction | None, Accepted("a table; [friction] at the top level is for all contacts")
    ] = Field(default=None, description="Friction on this part. Default: that of `[friction]`.")
    electric: Electric | None = Field(
        default=None, description="Electric contact of this part. Default: that of `[electric]`."
    )

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, given: Any) -> Any:
        """Fill in the defaults that depend on other keys."""
        if not isinstance(given, Mapping):
            return given
        defaults: dict[str, Any] = dict(LAYER) if given.get("law") == "compliance" else {}
        if "foundation" not in given:
            defaults["gap"] = Expression(0.0)
        return {**defaults, **given}

    @model_validator(mode="after")
    def _check(self) -> Contact:
        if self.against is not None and self.foundation is not None:
            raise fault("against", Words("both against and foundation"), "one of them")
        if self.against is not None and self.rigid is not None:
            raise fault("rigid", Words("both against and rigid"), "one of them")
        if self.against is not None and meet(self.against, self.on):
            raise fault("against", self.against, "another part than `on`")
        if self.gap is not None and self.foundation is not None:
            raise fault("gap", Words("both gap and foundation"), "one of them")
        if (self.axis is None) != (self.direction != "axis"):
            given = Words("missing") if self.axis is None else self.axis
            accepted = 'a vector with direction = "axis", and with that alone'
            raise fault("axis", given, accepted)
        if self.axis is not None and self.foundation is None:
            raise fault("direction", self.direction, "axis with a foundation that is a shape")
        if self.overlap == "press" and self.foundation is None:
            raise fault("overlap", self.overlap, "press with a foundation that is a shape")
        for key in (*LAYER, "lagged") if self.law == "signorini" else ():
            value = getattr(self, key)
            if value is not None and value is not False:
                raise fault(key, value, f'{key} with law = "compliance" only')
        return self
