"""From the sections about rigid bodies and electrodes to what is said of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from contact.body.rigid import Electrode, Motion, Rigid, Timed
from contact.building.given import amplitude
from contact.case import file as sections
from contact.case.formula import Expression
from contact.case.rigid import NOTHING, Moving


def make_rigid(case: sections.Case, dim: int) -> tuple[Rigid, ...]:
    """Return the foundations and parts that move as rigid bodies."""
    foundations = [
        Rigid(contact.on, _motion(case, contact.rigid, dim), foundation=True)
        for _, contact in case.contacts
        if contact.rigid is not None
    ]
    return (*foundations, *(Rigid(part.on, _motion(case, part, dim)) for part in case.rigid))


def make_electrodes(case: sections.Case) -> tuple[Electrode, ...]:
    """Return the electrodes whose potential is unknown."""
    return tuple(
        Electrode(section.on, _timed(section.charge), amplitude(case, section.amplitude))
        for section in case.electrode
    )


def _motion(case: sections.Case, section: Moving, dim: int) -> Motion:
    turns, force = 2 * dim - 3, section.force or ()
    rotation = _given(section.turns, turns, np.pi / 180)
    return Motion(
        _given(section.displacement or (), dim),
        rotation,
        [_timed(value) for value in (*force, *(NOTHING,) * (dim - len(force)))],
        [_timed(value) for value in (*section.moments, *(NOTHING,) * (turns - 1))[:turns]],
        section.centre or (0.0,) * dim,
        amplitude(case, section.amplitude),
    )


def _given(values: Sequence[Expression | str], size: int, unit: float = 1.0) -> list[Timed | None]:
    """Return components, None for those that are free, and 0 where none are given."""
    known = [None if isinstance(value, str) else _timed(value, unit) for value in values]
    return [*known, *[0.0] * (size - len(known))]


def _timed(value: Expression, unit: float = 1.0) -> Timed:
    """Return a number, or a function of time."""
    if value.is_constant:
        return unit * value.value
    return lambda time: unit * value.number(time)
