"""From the sections about rigid bodies and electrodes to what is said of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from contact.body.rigid import Electrode, Motion, Rigid
from contact.case import file as sections
from contact.case.rigid import Moving


def make_rigid(case: sections.Case, dim: int) -> tuple[Rigid, ...]:
    """Return the foundations and parts that move as rigid bodies."""
    foundations = [
        Rigid(contact.on, _motion(contact.rigid, dim), foundation=True)
        for _, contact in case.contacts
        if contact.rigid is not None
    ]
    return (*foundations, *(Rigid(part.on, _motion(part, dim)) for part in case.rigid))


def make_electrodes(case: sections.Case) -> tuple[Electrode, ...]:
    """Return the electrodes whose potential is unknown."""
    return tuple(Electrode(section.on, section.charge) for section in case.electrode)


def _motion(section: Moving, dim: int) -> Motion:
    turns = 2 * dim - 3
    return Motion(
        _given(section.displacement or (), dim),
        [angle if angle is None else np.deg2rad(angle) for angle in _given(section.turns, turns)],
        section.force or (0.0,) * dim,
        (*section.moments, *(0.0,) * (turns - len(section.moments))),
        section.centre or (0.0,) * dim,
    )


def _given(values: Sequence[float | str], size: int) -> list[float | None]:
    """Return components, None for those that are free, and 0 where none are given."""
    known = [None if isinstance(value, str) else value for value in values]
    return [*known, *[0.0] * (size - len(known))]
