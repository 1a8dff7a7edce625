"""Sections of the case file about the body: elements, supports and loads."""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Discriminator, Field, Tag, model_validator

from contact.case.parts import Part
from contact.case.types import (
    AmplitudeName,
    Formula,
    FormulaVector,
    Section,
    Words,
    as_tuple,
    fault,
)
from contact.settings import Accepted, Switch


class Space(Section):
    """`[space]`: finite elements, and what the mesh stands for."""

    degree: Annotated[int, Field(ge=1, le=2), Accepted("1 or 2")] = Field(
        default=1,
        description="Degree of the Lagrange elements of the displacement and the potential.",
    )
    kinematics: Literal["plane_strain", "axisymmetric"] = Field(
        default="plane_strain",
        description="What a mesh in the plane stands for: a body in plane strain, or the half "
        "plane of a body of revolution, x the radius and y the axis. There displacements are "
        "0 across the axis without being asked for, and loads, forces and charges are those of the "
        "full turn.",
    )


def _component(given: Any) -> str:
    return "free" if given == "free" else "Formula"


Component: TypeAlias = Annotated[
    Annotated[Formula, Tag("Formula")] | Annotated[Literal["free"], Tag("free")],
    Discriminator(_component),
]


class Fixed(Section):
    """`[[fixed]]`: prescribed displacement or potential on a part."""

    on: Part = Field(description="Part of the boundary, or a list of parts.")
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
    amplitude: AmplitudeName | None = Field(
        default=None,
        description="Factor of all that is prescribed as a function of time, see `[evolution]`.",
    )

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

    on: Part | None = Field(
        default=None,
        description="Part of the boundary, or a list of parts, beside the contact part. This or "
        "`everywhere`.",
    )
    everywhere: Switch = Field(default=False, description="`true`: in the whole body.")
    traction: FormulaVector | None = Field(default=None, description="Force per area of the part.")
    pressure: Formula | None = Field(
        default=None,
        description="Normal pressure p on the part: traction -p along the outward normal.",
    )
    charge: Formula | None = Field(default=None, description="Charge per area of the part.")
    body_force: FormulaVector | None = Field(default=None, description="Force per volume.")
    body_charge: Formula | None = Field(default=None, description="Charge per volume.")
    amplitude: AmplitudeName | None = Field(
        default=None,
        description="Factor of all of these as a function of time, see `[evolution]`.",
    )

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
