"""Rigid parts and foundations: how they move, and their forces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    AfterValidator,
    PlainSerializer,
    ValidationInfo,
    model_validator,
)

from contact.arguments import OfTime, expect
from contact.model.fields import Factor, GivenAmplitude, GivenTimed, amplitude_of
from contact.model.formula import ZERO, Expression, as_number
from contact.model.section import (
    Described,
    Either,
    FactorOfTime,
    FewTimed,
    Free,
    Part,
    Timed,
    Vector,
    in_python,
)
from contact.settings import Accepted, Words, fault
from contact.typing import Array

#: A component of a motion.
FreeTimed: TypeAlias = Annotated[Free[Timed], Accepted('a number, a formula in t or "free"')]

#: A component as it is given.
GivenFree: TypeAlias = GivenTimed | Literal["free"] | None

#: Components as they are given, or one.
Given: TypeAlias = GivenFree | Sequence[GivenFree] | Array

Components: TypeAlias = Annotated[
    FewTimed[FreeTimed],
    Accepted('a list of 2 components in 2-D, 3 in 3-D, each a number, a formula in t or "free"'),
]
Forces: TypeAlias = Annotated[
    FewTimed[Timed], Accepted("a list of 2 numbers or formulas in t in 2-D, 3 in 3-D")
]
#: Prefix of a formula in degrees that is in radians.
DEGREES = "pi/180*("


def _in_radians(given: Any, info: ValidationInfo) -> Any:
    """Return a rotation in radians: a table has degrees."""
    if isinstance(given, tuple):
        return tuple(_in_radians(value, info) for value in given)
    if in_python(info) or not isinstance(given, Expression):
        return given
    if given.is_constant:
        return Expression(np.pi / 180 * given.value)
    return type(given)(f"{DEGREES}{given.source})")


def _in_degrees(given: Any) -> Any:
    """Return a rotation as a table has it."""
    if isinstance(given, tuple):
        return [_in_degrees(value) for value in given]
    if not isinstance(given, Expression):
        return given
    if given.is_constant:  # 15 digits, for which both conversions together are exact
        return float(f"{given.value / (np.pi / 180):.15g}")
    source = str(given.source)
    if source.startswith(DEGREES):
        return source.removeprefix(DEGREES).removesuffix(")")
    return f"180/pi*({source})"


Rotation: TypeAlias = Annotated[
    Either[FreeTimed, Components],
    AfterValidator(_in_radians),
    PlainSerializer(_in_degrees),
    Accepted('in 2-D an angle, a formula in t or "free", in 3-D a list of 3 of these'),
]
Moment: TypeAlias = Annotated[
    Either[Timed, Forces],
    Accepted("in 2-D a number or a formula in t, in 3-D a list of 3 of these"),
]


class Motion(Described):
    """`[contact.rigid]`: the foundation moves as a rigid body. Absent: it is fixed.

    Each component is given, or free under a given force. A plate that sinks in under a force, and
    does not turn, is ``Motion([0.0, "free"], force=[0.0, -3.0])``; one that tilts about (1, 1) as
    well ``Motion([0.0, "free"], "free", force=[0.0, -3.0], centre=[1.0, 1.0])``.
    """

    displacement: Components | None = None
    """Displacement; `"free"` for a component that its force determines. Default: 0."""
    force: Forces | None = None
    """Force on the free components of the displacement. Default: 0."""
    rotation: Rotation = ZERO
    """Rotation about `centre` (in a case file degrees, in Python radians; small), or `"free"`."""
    moment: Moment = ZERO
    """Moment about `centre` on a free rotation."""
    centre: Vector | None = None
    """Centre of rotation. Required where something turns."""
    amplitude: FactorOfTime | None = None
    """Factor of all of these as a function of time, see `[evolution]`."""

    def __init__(
        self,
        displacement: Sequence[GivenFree] | Array = (),
        rotation: Given = (),
        force: Sequence[GivenTimed] | Array = (),
        moment: GivenTimed | Sequence[GivenTimed] | Array = (),
        centre: Sequence[float] | Array = (),
        amplitude: GivenAmplitude | None = None,
    ) -> None:
        keys: dict[str, Any] = {
            "displacement": displacement,
            "rotation": "free" if rotation is None else rotation,
            "force": force,
            "moment": moment,
            "centre": centre,
        }
        lists = list | tuple | np.ndarray
        given = {k: v for k, v in keys.items() if not isinstance(v, lists) or len(v)}
        for key in {"rotation", "moment"} & {*given}:  # in 2-D of one component
            value = given[key]
            given[key] = value[0] if isinstance(value, lists) and len(value) == 1 else value
        super().__init__(**given, amplitude=amplitude)

    @model_validator(mode="after")
    def _check(self) -> Self:
        moves = {"force": self.displacement or (), "moment": self.turns}
        acting = {"force": self.force or (), "moment": self.moments}
        for key, forces in acting.items():
            for k, force in enumerate(forces):
                if force != ZERO and moves[key][k : k + 1] != ("free",):
                    path = f"{key}.{k}" if len(forces) > 1 else key
                    name = "rotation" if key == "moment" else "displacement"
                    self.require(False, path, f'a {key} where the {name} is "free"')
        vectors = (self.displacement, self.force, self.centre)
        if 2 in {len(vector) for vector in vectors if vector is not None}:
            self.check_dimension(2)
        fits = self.centre is not None or all(turn == ZERO for turn in self.turns)
        self.require(fits, "centre", "a point about which it turns")
        return self

    @property
    def turns(self) -> tuple[Expression | OfTime | str, ...]:
        """The rotation, as a list."""
        return self.rotation if isinstance(self.rotation, tuple) else (self.rotation,)

    @property
    def moments(self) -> tuple[Expression | OfTime, ...]:
        """The moment, as a list."""
        return self.moment if isinstance(self.moment, tuple) else (self.moment,)

    def check_dimension(self, dimension: int) -> None:
        """Raise a fault if a rotation is none of the space."""
        for key in ("rotation", "moment"):
            value = getattr(self, key)
            fits = isinstance(value, tuple) == (dimension == 3) or value == ZERO
            if not fits or (isinstance(value, tuple) and len(value) != 3):
                accepted = "one angle or moment in 2-D, a list of 3 in 3-D"
                given = f"a list of {len(value)}" if isinstance(value, tuple) else "one"
                raise fault(key, Words(f"given {given}"), accepted)

    @property
    def off_axis(self) -> str | None:
        """The first key by which it leaves the axis of a body of revolution; None if it stays."""
        if (self.displacement or (ZERO,))[0] != ZERO:
            return "displacement.0"
        return "rotation" if any(turn != ZERO for turn in self.turns) else None

    def filled(self, dim: int) -> Self:
        """Return the motion with all components of a body in 2-D or 3-D."""

        def every(given: tuple[Any, ...], size: int) -> tuple[Any, ...]:
            return (*given, *[ZERO] * (size - len(given)))

        components = {
            "displacement": every(self.displacement or (), dim),
            "force": every(self.force or (), dim),
            "centre": self.centre or (0.0,) * dim,
        }
        if dim == 3:
            components |= {"rotation": every(self.turns, 3), "moment": every(self.moments, 3)}
        return self.model_copy(update=components)

    @property
    def forces(self) -> tuple[Expression | OfTime, ...]:
        """Force and moment."""
        return (*(self.force or ()), *self.moments)

    @property
    def values(self) -> tuple[float | OfTime | None, ...]:
        """Displacement and rotation in radians, None for free components."""
        given = (*(self.displacement or ()), *self.turns)
        return tuple(None if isinstance(value, str) else as_number(value) for value in given)


class Rigid(Motion):
    """`[[rigid]]`: a part that moves as a rigid body, such as a plate that loads the body.

    Examples
    --------
    For ``Body(law, fixed, rigid=plate)``:

    >>> plate = Rigid("top", displacement=[0.0, "free"], force=[0.0, -3.0])
    >>> same = Rigid("top", Motion([0.0, "free"], force=[0.0, -3.0]))
    """

    on: Part
    """Part of the boundary, or a list of parts."""

    def __init__(
        self,
        on: str | Sequence[str],
        motion: Motion | None = None,
        *,
        displacement: Sequence[GivenFree] | Array = (),
        rotation: Given = (),
        force: Sequence[GivenTimed] | Array = (),
        moment: GivenTimed | Sequence[GivenTimed] | Array = (),
        centre: Sequence[float] | Array = (),
        amplitude: GivenAmplitude | None = None,
    ) -> None:
        own = Motion(displacement, rotation, force, moment, centre, amplitude)
        fits = motion is None or (isinstance(motion, Motion) and own == Motion())
        expect("Rigid: motion", motion, "Motion(...), or its components", fits)
        Described.__init__(self, on=on, **dict(motion or own))


def numbers_at(
    values: Sequence[float | OfTime | Expression | None],
    given: Factor | str | None,
    time: float,
    beside: Sequence[float | OfTime | Expression | None] = (),
) -> Array:
    """Return values at a time, 0 for None, times their amplitude; `beside`: others of the entry."""
    known = any("t" in getattr(value, "names", ()) for value in (*values, *beside))
    numbers = [
        value.number(time) if isinstance(value, Expression | OfTime) else value or 0.0
        for value in values
    ]
    return amplitude_of(given, known)(time) * np.array(numbers)


def rigid_motions(points: NDArray[np.floating], revolved: bool = False) -> Array:
    """Return translations, then rotations, at points (n, d): (n, d, 3 or 6 or 1)."""
    n, d = points.shape
    motions = np.zeros((n, d, 3 if d == 2 else 6))
    motions[:, np.arange(d), np.arange(d)] = 1.0
    for k, (i, j) in enumerate([(0, 1)] if d == 2 else [(1, 2), (2, 0), (0, 1)]):
        motions[:, i, d + k], motions[:, j, d + k] = -points[:, j], points[:, i]
    return motions[:, :, 1:2] if revolved else motions
