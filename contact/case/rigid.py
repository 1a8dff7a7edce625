"""Sections of the case file about rigid motions and electrodes, and their checks."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import Discriminator, Field, Tag, model_validator

from contact.case.formula import Expression
from contact.case.parts import Part
from contact.case.types import (
    AmplitudeName,
    Section,
    TimeFormula,
    Vector,
    Words,
    as_given,
    as_tuple,
    fault,
)
from contact.mesh.together import meet
from contact.settings import Accepted

#: `contact.case.file.Case`, whose checks these are.
Case: TypeAlias = Any


def _kind(given: Any) -> str:
    return "free" if given == "free" else "TimeFormula"


def _shape(given: Any) -> str:
    return "list" if isinstance(given, list | tuple) else "one"


Free: TypeAlias = Annotated[
    Annotated[TimeFormula, Tag("TimeFormula")] | Annotated[Literal["free"], Tag("free")],
    Discriminator(_kind),
    Accepted('a number, a formula in t or "free"'),
]
Frees: TypeAlias = Annotated[
    tuple[Free, ...],
    Field(min_length=2, max_length=3),
    as_tuple,
    Accepted(
        'a list of 2 components in the plane, 3 in space, each a number, a formula in t or "free"'
    ),
]
Forces: TypeAlias = Annotated[
    tuple[TimeFormula, ...],
    Field(min_length=2, max_length=3),
    as_tuple,
    Accepted("a list of 2 numbers or formulas in t in the plane, 3 in space"),
]
Turn: TypeAlias = Annotated[
    Annotated[Free, Tag("one")] | Annotated[Frees, Tag("list")],
    Discriminator(_shape),
    Accepted('in the plane an angle, a formula in t or "free", in space a list of 3 of these'),
]
Moment: TypeAlias = Annotated[
    Annotated[TimeFormula, Tag("one")] | Annotated[Forces, Tag("list")],
    Discriminator(_shape),
    Accepted("in the plane a number or a formula in t, in space a list of 3 of these"),
]

NOTHING = Expression(0.0)


class Moving(Section):
    """What is said of a rigid motion: each component is given, or free under a given force."""

    displacement: Frees | None = Field(
        default=None,
        description='Displacement; `"free"` for a component that its force determines. Default: 0.',
    )
    force: Forces | None = Field(
        default=None,
        description="Force on the free components of the displacement. Default: 0.",
    )
    rotation: Turn = Field(
        default=NOTHING, description='Rotation about `centre` (degrees, small), or `"free"`.'
    )
    moment: Moment = Field(default=NOTHING, description="Moment about `centre` on a free rotation.")
    centre: Vector | None = Field(
        default=None, description="Centre of rotation. Required where something turns."
    )

    amplitude: AmplitudeName | None = Field(
        default=None,
        description="Factor of all of these as a function of time, see `[evolution]`.",
    )

    @property
    def turns(self) -> tuple[Expression | str, ...]:
        """The rotation, as a list."""
        return self.rotation if isinstance(self.rotation, tuple) else (self.rotation,)

    @property
    def moments(self) -> tuple[Expression, ...]:
        """The moment, as a list."""
        return self.moment if isinstance(self.moment, tuple) else (self.moment,)

    @model_validator(mode="after")
    def _check(self) -> Moving:
        moves = self.displacement or ()
        for k, force in enumerate(self.force or ()):
            free = k < len(moves) and moves[k] == "free"
            if force != NOTHING and not free:
                raise fault(
                    f"force.{k}", as_given(force), 'a force where the displacement is "free"'
                )
        for k, moment in enumerate(self.moments):
            if moment != NOTHING and (k >= len(self.turns) or self.turns[k] != "free"):
                key = f"moment.{k}" if isinstance(self.moment, tuple) else "moment"
                raise fault(key, as_given(moment), 'a moment where the rotation is "free"')
        if self.centre is None and any(turn != NOTHING for turn in self.turns):
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
                fits = dimension == 2 or value == NOTHING
            if not fits:
                accepted = "one angle or moment in the plane, a list of 3 in space"
                raise fault(f"{key}.{name}", as_given(value), accepted)


class Rigid(Moving):
    """`[contact.rigid]`: the foundation moves as a rigid body. Absent: it is at rest."""


class RigidPart(Moving):
    """`[[rigid]]`: a part that moves as a rigid body, such as a plate that loads the body."""

    on: Part = Field(description="Part of the boundary, or a list of parts.")


class Electrode(Section):
    """`[[electrode]]`: a part with one unknown potential, whose charge is given."""

    on: Part = Field(description="Part of the boundary, or a list of parts.")
    charge: TimeFormula = Field(default=NOTHING, description="Its charge; 0: open circuit.")
    amplitude: AmplitudeName | None = Field(
        default=None, description="Factor of the charge as a function of time, see `[evolution]`."
    )


def moving(case: Case) -> Iterator[tuple[str, Moving]]:
    """Give the sections about rigid motions, with their keys."""
    for path, contact in case.contacts:
        if contact.rigid is not None:
            yield f"{path}.rigid", contact.rigid
    for i, part in enumerate(case.rigid):
        yield f"rigid.{i}", part


def check_moving(case: Case) -> None:
    """Raise a fault if a part is rigid or an electrode twice, or an electrode has no field."""
    touched = [contact.on for _, contact in case.contacts]
    for i, part in enumerate(case.rigid):
        if any(meet(part.on, other) for other in touched):
            raise fault(f"rigid.{i}.on", part.on, "a part beside the contact part")
    if case.space.kinematics == "axisymmetric":
        for path, motion in moving(case):
            _check_along_axis(path, motion)
    for key in ("rigid", "electrode"):
        parts = [section.on for section in getattr(case, key)]
        for i, on in enumerate(parts):
            if any(meet(on, other) for other in parts[:i]):
                raise fault(f"{key}.{i}.on", on, f"a part that no other [[{key}]] has")
    if case.electrode and not any(material.piezoelectric for _, material in case.materials):
        raise fault("electrode", Words("given"), "electric quantities with [material.piezo] only")
    held = [fixed.on for fixed in case.fixed if fixed.potential is not None]
    for i, section in enumerate(case.electrode):
        if any(meet(section.on, other) for other in held):
            raise fault(f"electrode.{i}.on", section.on, "a part whose potential is not fixed")


def _check_along_axis(path: str, section: Moving) -> None:
    """Raise a fault if something moves otherwise than along the axis of a body of revolution."""
    across = (section.displacement or (NOTHING,))[0]
    if across != NOTHING:
        accepted = "0 across the axis of a body of revolution"
        raise fault(f"{path}.displacement.0", as_given(across), accepted)
    if any(turn != NOTHING for turn in section.turns):
        raise fault(f"{path}.rotation", Words("given"), "no rotation of a body of revolution")
