"""What a contact node does: the one definition of its status."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.typing import Array

#: A friction state, plus CLOSED where the rigid part touches. A smoothed pressure and Tresca's
#: law bound the friction of open nodes too.
FREE, SLIDES, STICKS, CLOSED = 0, 1, 2, 4


def touching(pressure: Array, opening: Array, c: float, rounding: float = 0.0) -> NDArray[np.bool_]:
    """Tell where the rigid part presses: p + c (u_nu - rho) > 0, shape (n,).

    Parameters
    ----------
    pressure
        Multiplier of the unilateral constraint, shape (n,).
    opening
        u_nu - rho, shape (n,).
    c
        Weighs displacements against stresses (stress/length).
    rounding
        A stress that counts as none.
    """
    return np.greater(pressure + c * opening, rounding)


def node_status(
    closed: NDArray[np.bool_],
    friction: Array,
    slip: Array,
    bound: Array,
    c: float,
    rounding: float = 0.0,
) -> NDArray[np.int8]:
    """Return the states of nodes with friction: |lambda_f + c u_tau| <= s sticks, shape (n,).

    Parameters
    ----------
    closed
        Where the rigid part presses, shape (n,).
    friction, slip
        lambda_f and what slips in the step, shape (n, d).
    bound
        Friction bound s, shape (n,).
    c, rounding
        As in `touching`.
    """
    size = np.linalg.norm(friction + c * slip, axis=1)
    state = np.where(size <= bound + rounding, STICKS, SLIDES)
    state[(bound <= 0) & ~closed] = FREE
    return (state + CLOSED * closed).astype(np.int8)
