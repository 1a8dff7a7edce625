"""Sections of the case file about rigid bodies and electrodes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Self, TypeAlias

import numpy as np
from pydantic import Tag, model_validator

from contact.body import rigid
from contact.case.formula import Expression, as_number
from contact.case.messages import Words, fault
from contact.case.section import (
    AmplitudeName,
    Part,
    Section,
    TimeComponent,
    TimeFormula,
    Vector,
    as_given,
    as_tuple,
    few,
    one_or_many,
)
from contact.settings import SPATIAL, Accepted

#: `contact.case.file.Case`, of which these are sections.
Case: TypeAlias = Any

ZERO = Expression(0.0)

Components: TypeAlias = Annotated[
    tuple[TimeComponent, ...],
    few,
    as_tuple,
    SPATIAL,
    Accepted('a list of 2 components in 2-D, 3 in 3-D, each a number, a formula in t or "free"'),
]
Forces: TypeAlias = Annotated[
    tuple[TimeFormula, ...],
    few,
    as_tuple,
    SPATIAL,
    Accepted("a list of 2 numbers or formulas in t in 2-D, 3 in 3-D"),
]
Rotation: TypeAlias = Annotated[
    Annotated[TimeComponent, Tag("one")] | Annotated[Components, Tag("many")],
    one_or_many,
    Accepted('in 2-D an angle, a formula in t or "free", in 3-D a list of 3 of these'),
]
Moment: TypeAlias = Annotated[
    Annotated[TimeFormula, Tag("one")] | Annotated[Forces, Tag("many")],
    one_or_many,
    Accepted("in 2-D a number or a formula in t, in 3-D a list of 3 of these"),
]


class Moving(Section):
    """A rigid-body motion: each component is given, or free under a given force."""

    displacement: Components | None = None
    """Displacement; `"free"` for a component that its force determines. Default: 0."""
    force: Forces | None = None
    """Force on the free components of the displacement. Default: 0."""
    rotation: Rotation = ZERO
    """Rotation about `centre` (degrees, small), or `"free"`."""
    moment: Moment = ZERO
    """Moment about `centre` on a free rotation."""
    centre: Vector | None = None
    """Centre of rotation. Required where something turns."""
    amplitude: AmplitudeName | None = None
    """Factor of all of these as a function of time, see `[evolution]`."""

    @property
    def turns(self) -> tuple[Expression | str, ...]:
        """The rotation, as a list."""
        return self.rotation if isinstance(self.rotation, tuple) else (self.rotation,)

    @property
    def moments(self) -> tuple[Expression, ...]:
        """The moment, as a list."""
        return self.moment if isinstance(self.moment, tuple) else (self.moment,)

    @model_validator(mode="after")
    def _check(self) -> Self:
        _check_free("force", self.force or (), self.displacement or (), "displacement")
        _check_free("moment", self.moments, self.turns, "rotation")
        if self.centre is None and any(turn != ZERO for turn in self.turns):
            raise fault("centre", Words("missing"), "a point about which it turns")
        return self

    def check_dimension(self, key: str, dimension: int) -> None:
        """Raise a fault if a rotation is none of the space."""
        for name in ("rotation", "moment"):
            value = getattr(self, name)
            if isinstance(value, tuple):
                fits = dimension == 3 and len(value) == 3
            else:
                fits = dimension == 2 or value == ZERO
            if not fits:
                accepted = "one angle or moment in 2-D, a list of 3 in 3-D"
                raise fault(f"{key}.{name}", as_given(value), accepted)

    def check_along_axis(self, key: str) -> None:
        """Raise a fault if a motion leaves the axis of a body of revolution."""
        across = (self.displacement or (ZERO,))[0]
        if across != ZERO:
            accepted = "0 across the axis of a body of revolution"
            raise fault(f"{key}.displacement.0", as_given(across), accepted)
        if any(turn != ZERO for turn in self.turns):
            raise fault(f"{key}.rotation", Words("given"), "no rotation of a body of revolution")

    def motion(self, case: Case, dim: int) -> rigid.Motion:
        """Return the motion itself, of a body in 2-D or 3-D."""
        turns = 2 * dim - 3
        return rigid.Motion(
            _components(self.displacement or (), dim),
            _components(self.turns, turns, np.pi / 180),
            _components(self.force or (), dim),
            _components(self.moments, turns),
            self.centre or (0.0,) * dim,
            case.amplitude(self.amplitude),
        )


class Rigid(Moving):
    """`[contact.rigid]`: the foundation moves as a rigid body. Absent: it is fixed."""


class RigidPart(Moving):
    """`[[rigid]]`: a part that moves as a rigid body, such as a plate that loads the body."""

    on: Part
    """Part of the boundary, or a list of parts."""


class Electrode(Section):
    """`[[electrode]]`: a part with one unknown potential, whose charge is given."""

    on: Part
    """Part of the boundary, or a list of parts."""
    charge: TimeFormula = ZERO
    """Its charge; 0: open circuit."""
    amplitude: AmplitudeName | None = None
    """Factor of the charge as a function of time, see `[evolution]`."""

    def build(self, case: Case) -> rigid.Electrode:
        """Return the electrode itself."""
        return rigid.Electrode(self.on, as_number(self.charge), case.amplitude(self.amplitude))


def _check_free(
    key: str, forces: Sequence[Expression], moves: Sequence[Expression | str], name: str
) -> None:
    """Raise a fault if a force acts on a component that is not free."""
    for k, force in enumerate(forces):
        if force != ZERO and moves[k : k + 1] != ("free",):
            path = f"{key}.{k}" if len(forces) > 1 else key
            raise fault(path, as_given(force), f'a {key} where the {name} is "free"')


def _components(values: Sequence[Expression | str], size: int, unit: float = 1.0) -> list[Any]:
    """Return components, None for those that are free, and 0 where none are given."""
    known = [None if isinstance(value, str) else as_number(value, unit) for value in values]
    return [*known, *[0.0] * (size - len(known))][:size]
