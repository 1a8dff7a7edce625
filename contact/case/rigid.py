"""Sections of the case file about what moves as a rigid body, and about electrodes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Discriminator, Field, Tag, model_validator

from contact.case.types import Name, Number, Section, Vector, Words, as_tuple, fault
from contact.settings import Accepted


def _kind(given: Any) -> str:
    return "free" if given == "free" else "Number"


Free: TypeAlias = Annotated[
    Annotated[Number, Tag("Number")] | Annotated[Literal["free"], Tag("free")],
    Discriminator(_kind),
    Accepted('a number or "free"'),
]
Frees: TypeAlias = Annotated[
    tuple[Free, ...],
    Field(min_length=2, max_length=3),
    as_tuple,
    Accepted('a list of 2 components in the plane, 3 in space, each a number or "free"'),
]


def _shape(given: Any) -> str:
    return "list" if isinstance(given, list | tuple) else "one"


Turn: TypeAlias = Annotated[
    Annotated[Free, Tag("one")] | Annotated[Frees, Tag("list")],
    Discriminator(_shape),
    Accepted('an angle (degrees) or "free" in the plane, a list of 3 of them in space'),
]
Moment: TypeAlias = Annotated[
    Annotated[Number, Tag("one")] | Annotated[Vector, Tag("list")],
    Discriminator(_shape),
    Accepted("a number in the plane, a list of 3 numbers in space"),
]


class Moving(Section):
    """What is said of a rigid motion: each component is given, or free under a given force."""

    displacement: Frees | None = Field(
        default=None,
        description='Displacement; `"free"` for a component that its force determines. Default: 0.',
    )
    force: Vector | None = Field(
        default=None,
        description="Force on the free components of the displacement. Default: 0.",
    )
    rotation: Turn = Field(
        default=0.0, description='Rotation about `centre` (degrees, small), or `"free"`.'
    )
    moment: Moment = Field(default=0.0, description="Moment about `centre` on a free rotation.")
    centre: Vector | None = Field(
        default=None, description="Centre of rotation. Required where something turns."
    )

    @property
    def turns(self) -> tuple[float | str, ...]:
        """The rotation, as a list."""
        return self.rotation if isinstance(self.rotation, tuple) else (self.rotation,)

    @property
    def moments(self) -> tuple[float, ...]:
        """The moment, as a list."""
        return self.moment if isinstance(self.moment, tuple) else (self.moment,)

    @model_validator(mode="after")
    def _check(self) -> Moving:
        moves = self.displacement or ()
        for k, force in enumerate(self.force or ()):
            free = k < len(moves) and moves[k] == "free"
            if force != 0 and not free:
                raise fault(f"force.{k}", force, 'a force where the displacement is "free"')
        for k, moment in enumerate(self.moments):
            if moment != 0 and (k >= len(self.turns) or self.turns[k] != "free"):
                key = f"moment.{k}" if isinstance(self.moment, tuple) else "moment"
                raise fault(key, moment, 'a moment where the rotation is "free"')
        if self.centre is None and any(turn != 0 for turn in self.turns):
            raise fault("centre", Words("missing"), "a point about which it turns")
        return self

    def vectors(self) -> Iterator[tuple[str, tuple[Any, ...] | None]]:
        """Give the keys that have as many components as space."""
        for key in ("displacement", "force", "centre"):
            yield key, getattr(self, key)

    def check_dimension(self, key: str, dimension: int) -> None:
        """Raise a fault if a rotation is none of the plane, or of space."""
        for name in ("rotation", "moment"):
            value = getattr(self, name)
            if isinstance(value, tuple):
                fits = dimension == 3 and len(value) == 3
            else:
                fits = dimension == 2 or value == 0
            if not fits:
                accepted = "one angle or moment in the plane, a list of 3 in space"
                raise fault(f"{key}.{name}", value, accepted)


class Rigid(Moving):
    """`[contact.rigid]`: the foundation moves as a rigid body. Absent: it is at rest."""


class RigidPart(Moving):
    """`[[rigid]]`: a part that moves as a rigid body, such as a plate that loads the body."""

    on: Name = Field(description="Part of the boundary.")


class Electrode(Section):
    """`[[electrode]]`: a part with one unknown potential, whose charge is given."""

    on: Name = Field(description="Part of the boundary.")
    charge: Number = Field(default=0.0, description="Its charge; 0: open circuit.")
