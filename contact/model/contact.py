"""A contact: a part that may touch a foundation or another body, and the laws between them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, TypeAlias

import numpy as np
from annotated_types import Predicate
from pydantic import Discriminator, Field, Tag, WithJsonSchema, model_validator

from contact.arguments import expect, one_of
from contact.errors import shown
from contact.mesh.domain import Domain
from contact.model.fields import Static
from contact.model.formula import ZERO, Expression
from contact.model.foundation import Conductor, Electric, Layer
from contact.model.friction import Friction
from contact.model.messages import either
from contact.model.obstacle import SHAPES, GapFunction, Obstacle, Shape
from contact.model.rigid import Motion, Rigid
from contact.model.section import Described, Direction, Part, StaticValue
from contact.settings import (
    Accepted,
    NonNegative,
    OrOwn,
    Positive,
    ReadWith,
    Switch,
    Words,
    fault,
)
from contact.typing import Array
from forms.laws import Compliance, PotentialFactor

#: A table, by the name of its shape, or an object with `measure`.
if TYPE_CHECKING:
    Foundation: TypeAlias = Obstacle
else:
    Foundation = Annotated[
        Annotated[
            reduce(or_, (Annotated[kind, Tag(f":{kind.shape}")] for kind in SHAPES)),
            Discriminator(lambda given: isinstance(given, Mapping) and f":{given.get('shape')}"),
        ]
        | Obstacle,
        OrOwn(lambda given: hasattr(given, "measure")),
        Accepted(
            f"a table with shape = {either(shown(kind.shape) for kind in SHAPES)}",
            "shape",
        ),
    ]

NAME = "a printable text of one line without blanks at its ends"

#: Of the layer; the thesis does not give its constants (section 8.1.2).
COMPLIANT = ReadWith("law", "compliance")

#: Of a number that may be infinite: JSON has no such number, and editors pass null for it.
INFINITE = ["number", "null"]


class Contact(Described):
    """`[contact]`: a part of the body that may touch a foundation or another body.

    Several contacts are a list of tables `[[contact]]`, each a foundation of its own. Their parts
    share no nodes.

    Examples
    --------
    In Python a gap may stand for the foundation, ``press=True`` for ``overlap="press"``, and
    ``conductor`` for ``electric``; a thickness or a `Layer` means the compliant law.

    >>> Contact(["left", "right"], gap=0.01).on
    'left+right'
    >>> Contact("bottom", -0.01, press=True).overlap
    'press'
    """

    on: Part
    """Part of the boundary, or a list of parts, that may touch the foundation."""
    name: (
        Annotated[str, Field(pattern=r"^\S(.*\S)?$"), Predicate(str.isprintable), Accepted(NAME)]
        | None
    ) = None
    """Name of its results: `contacts` of the summary, and columns of tables. Default: that of its
    part; a single contact without a name has no columns of its own."""
    law: Literal["signorini", "compliance"] = "signorini"
    """`signorini`: rigid foundation; `compliance`: with a compliant layer in front."""
    against: Part | None = None
    """Part of another body of the mesh, or a list of parts, that it may touch, instead of a
    foundation."""
    gap: StaticValue | None = None
    """Gap rho to the rigid foundation along the body's normal; with `against`, added to the
    distance between the meshes. Below 0 it is an interference. Default: 0 without `foundation`."""
    foundation: Foundation | None = None
    """Rigid shape, instead of a gap: `[contact.foundation]`."""
    direction: Literal["foundation", "body", "axis"] = "foundation"
    """Contact direction on a rigid shape: normal of the foundation or of the body, or along
    `axis`, as the closed forms of indentation take it; cones and edges need that. With a gap it
    is the body's."""
    axis: Annotated[Direction | None, ReadWith("direction", "axis", required=True)] = None
    """That direction, from the body towards the foundation, of any length."""
    overlap: Literal["refuse", "press"] = "refuse"
    """Meshes of two bodies that overlap in the reference configuration, or a shape that cuts the
    body: `refuse` that, or `press` it out as an interference."""
    rigid: Motion | None = None
    """Motion of the foundation: `[contact.rigid]`. Absent: it is fixed."""
    layer: Annotated[
        Annotated[float, Field(ge=0, allow_inf_nan=True)] | Layer | None,
        OrOwn(lambda given: isinstance(given, Layer | None)),
        COMPLIANT,
        Accepted("a number >= 0, or inf"),
        WithJsonSchema({"type": INFINITE, "minimum": 0}),
    ] = 0.0
    """Thickness of the layer, which is touched at gap - layer. A layer thicker than the gap presses
    on the undeformed body. `inf`: no rigid part, touched at gap."""
    stiffness: Annotated[NonNegative, COMPLIANT] = 10.0
    """c_nu, stiffness of the layer (force/volume)."""
    limit: Annotated[
        float,
        Field(gt=0, allow_inf_nan=True),
        COMPLIANT,
        Accepted("a number > 0, or inf"),
        WithJsonSchema({"type": INFINITE, "exclusiveMinimum": 0}),
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
    electric: Annotated[Electric | Conductor, OrOwn(Conductor), Accepted("a table")] | None = None
    """Electric contact of this part. Default: that of `[electric]`."""

    def __init__(
        self,
        on: str | Sequence[str],
        foundation: Obstacle | Static | None = None,
        layer: Layer | float | None = None,
        friction: Friction | None = None,
        conductor: Conductor | Electric | None = None,
        press: bool = False,
        against: str | Sequence[str] | None = None,
        gap: Static | None = None,
        name: str | None = None,
        *,
        electric: Electric | Conductor | None = None,
        rigid: Motion | None = None,
        law: Literal["signorini", "compliance"] | None = None,
        direction: Literal["foundation", "body", "axis"] = "foundation",
        axis: Sequence[float] | Array | None = None,
        overlap: Literal["refuse", "press"] = "refuse",
        stiffness: float = 10.0,
        limit: float = 0.1,
        potential_factor: float = 2.0,
        potential_range: float = 128.0,
        lagged: bool = False,
    ) -> None:
        expect("Contact: press", press, "True or False", isinstance(press, bool | np.bool_))
        fits = isinstance(layer, Layer | float | int | None)
        expect("Contact: layer", layer, "Layer(...), a thickness, or None", fits)
        expect("Contact: conductor", conductor, "this, or electric", None in (conductor, electric))
        electric = conductor if electric is None else electric
        check_laws("Contact", friction, electric)
        if not hasattr(foundation, "measure"):
            gap, foundation = one_of("Contact", foundation=foundation, gap=gap), None
        if isinstance(gap, float) and np.isinf(gap):  # which is no value of a field
            gap, foundation = None, GapFunction.of(gap)
        super().__init__(
            on=on,
            name=name,
            law=law or ("signorini" if layer is None else "compliance"),
            against=against,
            gap=gap,
            foundation=foundation,
            direction=direction,
            axis=axis,
            overlap="press" if press else overlap,
            rigid=rigid,
            layer=0.0 if layer is None else layer,
            stiffness=stiffness,
            limit=limit,
            potential_factor=potential_factor,
            potential_range=potential_range,
            lagged=lagged,
            friction=friction,
            electric=electric,
        )

    @model_validator(mode="before")
    @classmethod
    def _fill_in(cls, given: Any) -> Any:
        """Fill in the gap of a contact without a shape."""
        if isinstance(given, Mapping) and given.get("foundation") is given.get("gap") is None:
            return {**given, "gap": ZERO}
        return given

    @model_validator(mode="after")
    def _check(self) -> Self:
        self.require(not isinstance(self.rigid, Rigid), "rigid", "Motion(...)")
        shape = None if self.foundation is None or not self.foundation.is_shape else self.foundation
        given = {"against": self.against, "foundation": shape, "rigid": self.rigid, "gap": self.gap}
        for one, other in (("against", "foundation"), ("against", "rigid"), ("gap", "foundation")):
            if given[one] is not None and given[other] is not None:
                key = other if other == "rigid" else one
                raise fault(key, Words(f"both {one} and {other}"), "one of them", "exclusive-keys")
        fits = self.direction == "foundation" or isinstance(shape, Shape | None)
        self.require(fits, "direction", "that of a Shape; others have their own")
        fits = self.foundation is not None or self.axis is None
        self.require(fits, "direction", "axis with a foundation that is a shape")
        none = isinstance(self.gap, Expression) and self.gap.is_constant and self.gap.value >= 0
        fits = self.overlap == "refuse" or self.against is not None or not none
        accepted = "press with against, a foundation that is a shape, or a gap below 0"
        self.require(fits, "overlap", accepted)
        return self

    @property
    def press(self) -> bool:
        """Whether an overlap with the undeformed body is an interference."""
        return self.overlap == "press"

    @property
    def label(self) -> str:
        """Name of its results."""
        return self.name or self.on

    @property
    def conductor(self) -> Conductor | None:
        """The law of the electric contact, where it is given or filled in."""
        return self.electric if isinstance(self.electric, Conductor) else None

    def filled(
        self, domain: Domain, friction: Friction | None, electric: Electric | Conductor | None
    ) -> Contact:
        """Return the contact with objects in all places, for a problem. Collective.

        The given friction and conductor are taken where the contact has none of its own.
        """
        electric = self.electric or electric
        if isinstance(electric, Electric):
            electric = electric.conductor(domain, self.on)
        filled = {
            "foundation": self.obstacle,
            "friction": self.friction or friction or Friction(),
            "electric": electric,
        }
        if self.law == "compliance":
            filled["layer"] = self.compliant_layer
        done = {"gap": None, "direction": "foundation", "axis": None}
        return self.model_copy(update=filled | done)

    @property
    def obstacle(self) -> Obstacle:
        """The rigid foundation, or the gap, as contact nodes see it."""
        if self.foundation is None:
            assert self.gap is not None  # filled in
            return GapFunction.of(self.gap)
        if self.direction == "foundation":  # or the shape's own
            return self.foundation
        assert isinstance(self.foundation, Shape)  # checked
        return replace(self.foundation, direction=self.direction, along=self.axis or ())

    @property
    def compliant_layer(self) -> Layer | None:
        """The layer in front of the rigid foundation; None without one."""
        if isinstance(self.layer, Layer | None) or self.law == "signorini":
            return self.layer if isinstance(self.layer, Layer) else None
        factor = PotentialFactor(self.stiffness, self.potential_factor, self.potential_range)
        return Layer(self.layer, Compliance(self.limit), factor, self.lagged)


def check_laws(name: str, friction: object, electric: object) -> None:
    """Refuse objects that are no friction, or no electric contact."""
    fits = isinstance(friction, Friction | None)
    expect(f"{name}: friction", friction, "Friction(mu=...), or None", fits)
    fits = isinstance(electric, Electric | Conductor | None)
    expect(f"{name}: conductor", electric, "Electric(k_e=...), Conductor(...), or None", fits)
