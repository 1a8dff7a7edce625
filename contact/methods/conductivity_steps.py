"""The road in steps of conductivity: a foundation that conducts well does so little by little.

What conducts well across a gap pins the potential of a node where it comes near and lets it go
where it leaves, so that the body bends to and fro from step to step. Where it conducts little, the
problem is nearly one of contact alone; from there the solutions are followed up to its k_e.
"""

from __future__ import annotations

from collections.abc import Callable

from contact.methods.loop import NewtonLoop
from contact.methods.report import Outcome
from contact.methods.step import Iterate

#: What the history says of this road.
CONDUCTIVITY = "conductivity"

#: Part of the conductivity that is nearly none, and by what a part grows: first, and at least.
FIRST_PART, FACTOR, LEAST_FACTOR = 1e-9, 1e3, 1.2

#: From here on it is the whole.
ALMOST = 0.9


def conductivity_steps(
    conducting: Callable[[float], NewtonLoop], start: Iterate
) -> tuple[Iterate, Outcome] | None:
    """Let the foundation conduct more and more; None where that does not lead to the whole.

    Where Newton's loop fails with hardly any conductivity too, that is not why.

    Parameters
    ----------
    conducting
        Returns Newton's loop on the problem with a part of the conductivity.
    start
        Where from.
    """
    iterate, reached, part, factor = start, 0.0, FIRST_PART, FACTOR
    while factor > LEAST_FACTOR:
        loop = conducting(part)
        tried, outcome = loop.run(iterate, CONDUCTIVITY)
        if outcome.converged and part == 1.0:
            return tried, outcome
        if outcome.converged:
            iterate, reached = tried, part
        elif reached == 0:
            break
        else:
            factor = factor**0.5
        if loop.search.left <= 0:
            break
        part = reached * factor
        part = part if part < ALMOST else 1.0
    return None
