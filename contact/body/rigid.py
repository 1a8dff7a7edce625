"""Rigid parts and electrodes: how they move, and their forces and charges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from contact.arguments import OfTime, expect, fill
from contact.body.fields import Amplitude, GivenAmplitude, amplitude_of, own_amplitude
from contact.errors import InputError
from contact.mesh.together import part
from contact.typing import Array

#: A number, which grows with an amplitude, or a function of time.
Timed: TypeAlias = float | Amplitude

#: The same, or a component that is determined by its force.
FreeTimed: TypeAlias = Timed | Literal["free"] | None

#: Components as they are given, or one.
Given: TypeAlias = FreeTimed | Sequence[FreeTimed] | Array


def _timed(name: str, value: Timed | None) -> Timed | None:
    """Return a value that is named where it is a function of time and fails."""
    return OfTime(value, name) if callable(value) else value


def numbers_at(values: Sequence[Timed | None], given: Amplitude | None, time: float) -> Array:
    """Return values at a time, 0 for None: times an amplitude, as `amplitude_of` has it."""
    known = any(callable(value) for value in values)
    factor = amplitude_of(given, known)(time)
    numbers = [value(time) if callable(value) else (value or 0.0) for value in values]
    return factor * np.array(numbers)


def _listed(given: Given) -> tuple[FreeTimed, ...]:
    """Return a vector's components, or the one component."""
    every = tuple(given) if isinstance(given, list | tuple | np.ndarray) else (given,)
    return cast(tuple[FreeTimed, ...], every)


def _components(name: str, given: Given, size: int, free: bool = False) -> tuple[Timed | None, ...]:
    """Return components, None for those that are free, and 0 where none are given."""
    found: list[Timed | None] = []
    accepted = "a number" if size == 1 else f"a list of {size}: numbers"
    accepted += ' or functions of time, or None or "free"' if free else " or functions of time"
    every = _listed(given)
    for value in every:
        unset = value is None or (isinstance(value, str) and value == "free")
        number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
        fits = number and np.isfinite(cast(float, value))
        expect(name, given, accepted, (unset and free) or fits or callable(value))
        key = f"{name}.{len(found)}"
        given_one = float(cast(float, value)) if number else _timed(key, cast(Amplitude, value))
        found.append(None if unset else given_one)
    expect(name, given, accepted, len(every) in (0, size))
    return tuple(found) or (0.0,) * size


@dataclass(frozen=True)
class Motion:
    """The motion of a rigid body: each component is given, or free under a given force.

    A plate that sinks in under a force, and does not turn: ``Motion([0.0, None], force=[0.0,
    -3.0])``; one that tilts about (1, 1) as well: ``Motion([0.0, None], None, force=[0.0, -3.0],
    centre=[1.0, 1.0])``.

    Parameters
    ----------
    displacement
        A list with one value per component (length), each a number or a function of time; None
        or "free" for one that its force determines. Default: 0.
    rotation
        Rotation about the centre (radians), likewise: one angle in 2-D, a list of three in 3-D.
    force, moment
        Force on the free components (of the full turn for a body of revolution, per unit of depth
        for a plane body), and moment; lists as above. Default: 0.
    centre
        Centre of rotation, about which moments are taken (length), shape (d,); required where
        something turns.
    amplitude
        Function of time that multiplies all of them; by default numbers grow from 0 at time 0 to
        all at time 1, and stay; "constant": they always act.

    Raises
    ------
    InputError
        If a value is nothing of these, a force acts on a component that is not free, or the
        centre is missing.
    """

    displacement: tuple[Timed | None, ...]
    rotation: tuple[Timed | None, ...]
    force: tuple[Timed, ...]
    moment: tuple[Timed, ...]
    centre: tuple[float, ...]
    amplitude: Amplitude | None

    def __init__(
        self,
        displacement: Sequence[FreeTimed] | Array = (),
        rotation: Given = (),
        force: Sequence[Timed] | Array = (),
        moment: Timed | Sequence[Timed] | Array = (),
        centre: Sequence[float] | Array = (),
        amplitude: GivenAmplitude | None = None,
    ) -> None:
        d = _dimension(
            {"displacement": displacement, "force": force, "centre": centre},
            {"rotation": rotation, "moment": moment},
        )
        moves = {
            "displacement": _components("Motion: displacement", displacement, d, free=True),
            "rotation": _components("Motion: rotation", rotation, 2 * d - 3, free=True),
        }
        acting = {
            "force": _components("Motion: force", force, d),
            "moment": _components("Motion: moment", moment, 2 * d - 3),
        }
        for (key, on), (name, given) in zip(acting.items(), moves.items(), strict=True):
            for one, move in zip(on, given, strict=True):
                fits = move is None or one == 0.0
                expect(f"Motion: {key}", on, f"a {key} where {name} is None", fits)
        turns = any(turn != 0.0 for turn in moves["rotation"])
        accepted = f"a point about which it turns, a list of {d} numbers"
        fixed = not any(callable(x) or x is None for x in _listed(centre))
        expect("Motion: centre", centre, accepted, fixed and (len(centre) or not turns))
        middle = _components("Motion: centre", centre, d)
        fill(self, **moves, **acting, centre=middle, amplitude=own_amplitude("Motion", amplitude))


def _dimension(vectors: dict[str, Given], turns: dict[str, Given]) -> int:
    """Return the dimension of the vectors, and turns, of a motion that are given."""
    for name, given in vectors.items():
        size = len(_listed(given))
        accepted = "a list with an entry a component, 2 in 2-D and 3 in 3-D"
        expect(f"Motion: {name}", given, accepted, size in (0, 2, 3))
        if size:
            return size
    sizes = [len(_listed(given)) for given in turns.values()]
    expect("Motion", "nothing", "a displacement, a rotation or a force", any(sizes))
    return 3 if 3 in sizes else 2


@dataclass(frozen=True)
class Rigid:
    """A part that moves as a rigid body, or a list of parts, or a foundation in front of it.

    A plate on the top of a body, under a force:

    >>> plate = Rigid("top", Motion([0.0, None], force=[0.0, -3.0]))

    It is given to the body by ``Body(law, fixed, rigid=plate)``; ``Rigid("bottom", motion,
    foundation=True)`` is the foundation in front of the contact part ``bottom``.

    Parameters
    ----------
    on
        Name of the part, or a list of names.
    motion
        How it moves.
    foundation
        Whether it is the foundation in front of the part, and not the part itself.

    Raises
    ------
    InputError
        If `on` is no name, or `motion` none.
    """

    on: str
    motion: Motion
    foundation: bool

    def __init__(self, on: str | Sequence[str], motion: Motion, foundation: bool = False) -> None:
        fill(self, on=part(on), motion=motion, foundation=foundation)
        expect("Rigid: motion", motion, "Motion(...)", isinstance(motion, Motion))

    name = "rigid"

    @property
    def values(self) -> tuple[Timed | None, ...]:
        """Displacement and rotation."""
        return (*self.motion.displacement, *self.motion.rotation)

    @property
    def forces(self) -> tuple[Timed | None, ...]:
        """Force and moment."""
        return (*self.motion.force, *self.motion.moment)

    @property
    def amplitude(self) -> Amplitude | None:
        """That of the motion."""
        return self.motion.amplitude


@dataclass(frozen=True)
class Electrode:
    """A part, or a list of parts, with one unknown potential, and its charge.

    Parameters
    ----------
    on
        Name of the part, or a list of names.
    charge
        The charge on it (of the full turn for a body of revolution, per unit of depth for a plane
        body), a number or a function of time.
    amplitude
        Function of time that multiplies it, or "constant"; by default it grows from 0 at time 0 to
        all at time 1.

    Raises
    ------
    InputError
        If `on` is no name, or the amplitude no function.

    Examples
    --------
    >>> Electrode(["left", "right"], charge=1e-6).on
    'left+right'
    """

    on: str
    charge: Timed
    amplitude: Amplitude | None

    def __init__(
        self,
        on: str | Sequence[str],
        charge: Timed = 0.0,
        amplitude: GivenAmplitude | None = None,
    ) -> None:
        fill(self, on=part(on), charge=_timed("Electrode: charge", charge))
        fill(self, amplitude=own_amplitude("Electrode", amplitude))

    name = "electrode"
    values = (None,)

    @property
    def forces(self) -> tuple[Timed | None, ...]:
        """The charge."""
        return (self.charge,)


@dataclass(frozen=True)
class Bolt:
    """A cut through a body whose sides are drawn together: a bolt, or an anchor, that is tightened.

    Parameters
    ----------
    on
        Name of a part inside of the body, all facets of a plane section.
    force
        The section force (tension > 0), a number or a function of time: of the full turn for a
        body of revolution, per unit of depth for a plane body.
    shortening
        Instead of it the length by which the sides are drawn together, likewise.
    amplitude
        Function of time that multiplies it, or "constant"; by default it grows from 0 to all at
        time 1.

    Raises
    ------
    InputError
        If both or neither are given, `on` is no name, or the amplitude no function.
    """

    on: str
    force: Timed | None
    shortening: Timed | None
    amplitude: Amplitude | None

    def __init__(
        self,
        on: str | Sequence[str],
        force: Timed | None = None,
        shortening: Timed | None = None,
        amplitude: GivenAmplitude | None = None,
    ) -> None:
        fill(self, on=part(on), force=_timed("Bolt: force", force))
        fill(self, shortening=_timed("Bolt: shortening", shortening))
        fill(self, amplitude=own_amplitude("Bolt", amplitude))
        if (self.force is None) == (self.shortening is None):
            raise InputError(f"Bolt on {self.on!r}: accepted: one of force and shortening", "bolt")

    name = "bolt"

    @property
    def values(self) -> tuple[Timed | None, ...]:
        """The shortening."""
        return (self.shortening,)

    @property
    def forces(self) -> tuple[Timed | None, ...]:
        """The section force."""
        return (self.force,)


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
