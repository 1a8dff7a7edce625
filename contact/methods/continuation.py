"""Continuation in the conductivity of the foundation.

A foundation of high conductivity fixes the potential of a node that comes near and releases it
where the node leaves, so that the active set cycles. With a small part of the conductivity k_e the
problem is nearly one of contact alone; the part is raised to 1, and each solution is the initial
guess of the next problem. (Continuation in the load is `contact.methods.load_stepping`.)

References
----------
Allgower and Georg, Introduction to Numerical Continuation Methods, SIAM (2003).
"""

from __future__ import annotations

from collections.abc import Callable

from contact.methods.newton_step import Iterate
from contact.methods.report import Outcome

#: Note of its steps in the history.
CONTINUATION = "continuation"

#: Factor by which the conductivity grows: the first, and the least one that is tried.
FACTOR, LEAST_FACTOR = 1e3, 1.2

#: First part of the conductivity: three of the first factors below the whole.
FIRST_PART = FACTOR**-3


def continuation(
    solve: Callable[[float, Iterate], tuple[Iterate, Outcome]], start: Iterate
) -> tuple[Iterate, Outcome] | None:
    """Return the solution with the whole conductivity; None where continuation fails.

    After a part that fails the square root of the factor is tried. Where the first part fails the
    conductivity is not the cause, and no other is tried.

    Parameters
    ----------
    solve
        Solves the problem with a part of the conductivity, from an iterate.
    start
        Initial guess of the first problem.
    """
    iterate, reached, part, factor = start, 0.0, FIRST_PART, FACTOR
    while factor > LEAST_FACTOR:
        tried, outcome = solve(part, iterate)
        if outcome.converged and part == 1.0:
            return tried, outcome
        if outcome.converged:
            iterate, reached = tried, part
        elif reached == 0:
            break
        else:
            factor = factor**0.5
        part = reached * factor
        part = part if part * LEAST_FACTOR < 1 else 1.0
    return None
