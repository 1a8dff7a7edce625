"""Where to begin with a body that friction alone keeps from sliding: all that touches sticks.

Without friction, or with the bound of pressures that are not known yet, it would slide away, and
what is found then says nothing of where it presses.
"""

from __future__ import annotations

import numpy as np
from mpi4py import MPI

from contact.problem.kkt import residual_forces
from contact.problem.mobility import held_by_friction
from contact.problem.problem import ContactProblem
from contact.typing import Array

#: Force that a node can bear by friction then, over all loads.
STUCK = 10.0


def stuck_bound(problem: ContactProblem) -> Array | None:
    """Return friction bounds that no load exceeds, shape (n,) (stress). Collective.

    None where supports and the foundation hold the body without friction.
    """
    if not (problem.frictional and held_by_friction(problem)):
        return None
    weight = problem.interface.jump.weight
    return np.full_like(weight, STUCK * all_loads(problem)) / weight


def all_loads(problem: ContactProblem) -> float:
    """Return the sum of all forces that act at rest, without regard to sign. Collective."""
    body = problem.equilibrium
    residual = residual_forces(problem, problem.start())
    forces = np.abs(body.unbalanced(residual)) * body.shares.mechanical
    own = float(problem.comm.allreduce(forces[: body.owned].sum(), op=MPI.SUM))
    return own + float(forces[body.owned :].sum())
