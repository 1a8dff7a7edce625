"""Continuation in the conductivity of the foundation.

A foundation that conducts well across a gap pins the potential of a node where it comes near and
lets it go where it leaves, so that the active set cycles. Where it conducts
little, the problem is nearly one of contact alone; from there the solutions are followed up to its
k_e, each one the initial guess of the next.

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

#: Factor by which the conductivity grows: at first, and at least.
FACTOR, LEAST_FACTOR = 1e3, 1.2

#: Smallest part of it: three of the first factors from the whole.
FIRST_PART = FACTOR**-3


def continuation(
    solve: Callable[[float, Iterate], tuple[Iterate, Outcome]], start: Iterate
) -> tuple[Iterate, Outcome] | None:
    """Let the foundation conduct more and more; None where that does not lead to the whole.

    Where Newton's method fails with hardly any conductivity too, that is not why.

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
