"""Working set of contact nodes, for bodies that touch at few: stops, tips, corners.

What bends over a gap mostly touches at one or two nodes, but without contact most of its nodes
penetrate: active sets of all that do cycle. Contact is therefore stated at the node of largest
penetration alone, and at one more in turn as long as others penetrate, as a dual active set method
adds the constraint that is violated most. Each of these problems is solved by Newton's method.

References
----------
Goldfarb and Idnani, A numerically stable dual method for solving strictly convex quadratic
programs, Math. Program. 27 (1983).
Nocedal and Wright, Numerical Optimization, Springer (2006), chapter 16: working sets.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from contact.methods.newton_step import Iterate
from contact.methods.report import Outcome
from contact.problem.protocols import Problem
from contact.ranks import summed
from contact.tolerances import NEGLIGIBLE
from contact.typing import Array

#: Note of its steps in the history.
WORKING_SET = "working set"

#: Most nodes of a working set, and most others that may penetrate once it has one: an interior
#: point takes fewer steps for more.
MOST, OTHERS = 4, 16


def working_set(
    problem: Problem,
    iterate: Iterate,
    solve: Callable[[Array, Iterate], tuple[Iterate, Outcome]],
) -> Iterate | None:
    """Return an iterate that penetrates nowhere; None where the working set grows. Collective.

    Parameters
    ----------
    problem
        The contact problem.
    iterate
        Equilibrium without contact.
    solve
        Newton's method with given gaps, shape (n,), infinite outside of the working set, from an
        iterate on.
    """
    interface, jump = problem.interface, problem.interface.jump
    inside = np.zeros(jump.gap.shape, dtype=bool)
    for _ in range(MOST):
        opening = interface.opening(jump.apply(iterate.state.x))
        deepest = jump.maximum(-opening)
        if deepest <= 0:
            return None
        inside |= opening <= -deepest
        iterate, outcome = solve(np.where(inside, jump.gap, np.inf), iterate)
        if not outcome.converged:
            return None
        opening = interface.opening(jump.apply(iterate.state.x))
        others = np.count_nonzero(~inside & (opening < -NEGLIGIBLE * deepest))
        found = int(summed(jump.comm, others))
        if found == 0:
            return iterate
        if found > OTHERS:
            return None
    return None
