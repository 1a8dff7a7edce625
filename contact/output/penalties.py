"""Whether what penalties give way by is small beside what a body does."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from contact.output.assumptions import Remark
from contact.output.solution import Solution
from contact.tolerances import LAWS_HOLD

#: Share of its bound below which friction lets nothing slip: the penalised one nears it slowly.
BELOW = 0.9


def giving_way(solution: Solution) -> Remark:
    """Say where penalties move contact nodes by much of the largest displacement. Collective.

    The residuals weigh penetrations and slips by E/length, or more. A flat body is stiffer by far:
    its displacements are those of the penalties where these are as small as the residuals ask for.
    Later steps are not looked at: what has slipped before stays.
    """
    problem = solution.problem
    if solution.method != "penalty" or problem.since is not None:
        return "", True
    size = np.linalg.norm(solution.friction, axis=1)
    held = size < BELOW * solution.friction_bound
    slip = np.linalg.norm(solution.slip[held], axis=1)
    depth = (solution.normal_displacement - problem.nodes.gap)[solution.pressure > 0]
    if problem.interface.law.layer is not None:
        depth = depth[:0]  # it gives way by itself
    deep, far = (
        problem.comm.allreduce(float(values.max(initial=0.0)), op=MPI.MAX)
        for values in (depth, slip)
    )
    largest = solution.max_displacement
    if max(deep, far) <= LAWS_HOLD * largest:
        return "", True
    what, key = ("touch penetrate", "contact") if deep > far else ("should stick slip", "slip")
    return (
        f"the penalties give way: nodes that {what} by up to {max(deep, far):.2g}, where "
        f"displacements reach {largest:.2g}; a smaller solver.eps_{key}, or another method, brings "
        "these nearer to what they are",
        False,
    )
