"""Working set of contact nodes, for bodies that touch at one node or two: at stops, tips, corners.

A body that bends over a gap mostly touches at one node, but without contact most of its nodes
penetrate: active sets of all these cycle. Contact is therefore stated at the node of largest
penetration alone, and at one more in turn while others penetrate, as a dual active set method
adds the constraint that is violated most. Each of these problems is solved by Newton's method.
Where one more node does not halve the number of those that penetrate, the working set is given up:
an interior point then takes fewer steps.

References
----------
Goldfarb and Idnani, A numerically stable dual method for solving strictly convex quadratic
programs, Math. Program. 27 (1983).
Nocedal and Wright, Numerical Optimization, Springer (2006), chapter 16: working sets.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from contact.interface.interface import Interface
from contact.methods.newton_step import Iterate
from contact.methods.report import Outcome
from contact.methods.stagnation import PROGRESS
from contact.problem.protocols import Problem
from contact.problem.state import State
from contact.ranks import summed
from contact.typing import Array

#: Note of its steps in the history.
WORKING_SET = "working set"


def working_set(
    problem: Problem,
    iterate: Iterate,
    solve: Callable[[Array, Iterate], tuple[Iterate, Outcome]],
) -> Iterate | None:
    """Return an iterate that penetrates nowhere; None where this takes many nodes. Collective.

    Parameters
    ----------
    problem
        The contact problem.
    iterate
        After a linear solve without contact.
    solve
        Newton's method with given gaps, shape (n,), infinite outside of the working set, from an
        iterate on.
    """
    interface, jump = problem.interface, problem.interface.jump
    inside = np.zeros(jump.gap.shape, dtype=bool)
    deepest, count = _penetrating(interface, iterate.state, inside)
    while count > 0:
        opening = interface.opening(jump.apply(iterate.state.x))
        inside |= opening <= -deepest
        iterate, outcome = solve(np.where(inside, jump.gap, np.inf), iterate)
        before = count
        deepest, count = _penetrating(interface, iterate.state, inside)
        if not outcome.converged or count > PROGRESS * before:
            return None
    return iterate


def _penetrating(
    interface: Interface, state: State, inside: NDArray[np.bool_]
) -> tuple[float, int]:
    """Return the largest penetration of other nodes (length), and how many do. Collective."""
    nodal = interface.jump.apply(state.x)
    depth = np.where(inside, 0.0, -interface.opening(nodal))
    deepest = interface.jump.maximum(depth)
    rounding = interface.rounding(nodal) / interface.stiffness
    count = int(summed(interface.comm, np.count_nonzero(depth > rounding)))
    return deepest, count
