"""Rigid parts and electrodes: how they move, and their forces and charges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from contact.arguments import OfTime, expect
from contact.body.fields import Amplitude, amplitude_of, own_amplitude
from contact.errors import InputError
from contact.mesh.together import part
from contact.typing import Array

#: A number, which grows with an amplitude, or a function of time.
Timed: TypeAlias = float | Amplitude


def _timed(name: str, value: Timed | None) -> Timed | None:
    """Return a value that is named where it is a function of time and fails."""
    return OfTime(value, name) if callable(value) else value


def _at(values: Sequence[Timed | None], given: Amplitude | None, time: float) -> Array:
    """Return values at a time, 0 for None: times an amplitude, as `amplitude_of` has it."""
    known = any(callable(value) for value in values)
    factor = amplitude_of(given, known)(time)
    numbers = [value(time) if callable(value) else (value or 0.0) for value in values]
    return factor * np.array(numbers)


@dataclass(frozen=True)
class Motion:
    """The motion of a rigid body; a component that is None is free.

    Attributes
    ----------
    displacement
        Components of the displacement, length d.
    rotation
        Rotation about the centre (radians): one angle in 2-D, three in 3-D.
    force, moment
        Those of the free components, as long as the two above.
    centre
        Centre of rotation, about which moments are taken.
    amplitude
        Function of time that multiplies all of them; by default
        numbers grow from 0 at time 0 to all at time 1, and stay; "constant": they always act.
    """

    displacement: Sequence[Timed | None]
    rotation: Sequence[Timed | None]
    force: Sequence[Timed]
    moment: Sequence[Timed]
    centre: Sequence[float]
    amplitude: Amplitude | None = None

    def __post_init__(self) -> None:
        """Let functions of time be named where they fail."""
        for name in ("displacement", "rotation", "force", "moment"):
            values = [_timed(f"Motion: {name}.{i}", v) for i, v in enumerate(getattr(self, name))]
            object.__setattr__(self, name, tuple(values))
        object.__setattr__(self, "amplitude", own_amplitude("Motion", self.amplitude))


@dataclass(frozen=True)
class Rigid:
    """A part that moves as a rigid body, or a list of parts, or a foundation in front of it."""

    on: Any
    motion: Motion
    foundation: bool = False

    def __post_init__(self) -> None:
        """Make one name of several."""
        object.__setattr__(self, "on", part(self.on))
        expect("Rigid: motion", self.motion, "Motion(...)", isinstance(self.motion, Motion))

    name = "rigid"

    @property
    def values(self) -> tuple[Timed | None, ...]:
        """Displacement and rotation."""
        return (*self.motion.displacement, *self.motion.rotation)

    @property
    def forces(self) -> tuple[Timed | None, ...]:
        """Force and moment."""
        return (*self.motion.force, *self.motion.moment)

    def at(self, values: Sequence[Timed | None], time: float) -> Array:
        """Return some of these at a time."""
        return _at(values, self.motion.amplitude, time)


@dataclass(frozen=True)
class Electrode:
    """A part, or a list of parts, with one unknown potential, and its charge."""

    on: Any
    charge: Timed = 0.0
    amplitude: Amplitude | None = None

    def __post_init__(self) -> None:
        """Make one name of several."""
        object.__setattr__(self, "on", part(self.on))
        object.__setattr__(self, "charge", _timed("Electrode: charge", self.charge))
        object.__setattr__(self, "amplitude", own_amplitude("Electrode", self.amplitude))

    name = "electrode"
    values = (None,)

    @property
    def forces(self) -> tuple[Timed | None, ...]:
        """The charge."""
        return (self.charge,)

    def at(self, values: Sequence[Timed | None], time: float) -> Array:
        """Return some of these at a time."""
        return _at(values, self.amplitude, time)


@dataclass(frozen=True)
class Bolt:
    """A cut through a body whose sides are drawn together: a bolt, or an anchor, that is tightened.

    Parameters
    ----------
    on
        Name of a part inside of the body, all facets of a plane section.
    force
        The section force (tension > 0), a number or a function of time; of a body of revolution
        that of the full turn, of a plane one by unit thickness.
    shortening
        Instead of it the length by which the sides are drawn together, likewise.
    amplitude
        Function of time that multiplies it; by default it grows from 0 to all at time 1.

    Raises
    ------
    InputError
        If both or neither are given.
    """

    on: Any
    force: Timed | None = None
    shortening: Timed | None = None
    amplitude: Amplitude | None = None

    def __post_init__(self) -> None:
        """Let functions of time be named where they fail."""
        object.__setattr__(self, "on", part(self.on))
        for name in ("force", "shortening"):
            object.__setattr__(self, name, _timed(f"Bolt: {name}", getattr(self, name)))
        object.__setattr__(self, "amplitude", own_amplitude("Bolt", self.amplitude))
        if (self.force is None) == (self.shortening is None):
            raise InputError(f"Bolt on {self.on!r}: accepted: one of force and shortening")

    name = "bolt"

    @property
    def values(self) -> tuple[Timed | None, ...]:
        """The shortening."""
        return (self.shortening,)

    @property
    def forces(self) -> tuple[Timed | None, ...]:
        """The section force."""
        return (self.force,)

    def at(self, values: Sequence[Timed | None], time: float) -> Array:
        """Return some of these at a time."""
        return _at(values, self.amplitude, time)


def rigid_motions(points: NDArray[np.floating], revolved: bool = False) -> Array:
    """Return the rigid motions at points of shape (n, d): shape (n, d, 3 or 6).

    Translations come first, then rotations: about z in 2-D, about x, y and z in 3-D.
    A body of revolution has one, along its axis: shape (n, 2, 1).
    """
    n, d = points.shape
    motions = np.zeros((n, d, 3 if d == 2 else 6))
    motions[:, np.arange(d), np.arange(d)] = 1.0
    for k, (i, j) in enumerate([(0, 1)] if d == 2 else [(1, 2), (2, 0), (0, 1)]):
        motions[:, i, d + k], motions[:, j, d + k] = -points[:, j], points[:, i]
    return motions[:, :, 1:2] if revolved else motions
