"""Where to begin with a body that friction alone keeps from sliding: all that touches sticks.

Without friction, or with the bound of pressures that are not known yet, it would slide away, and
what is found then says nothing of where it presses.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from contact.mesh.pieces import sums
from contact.problem.kkt import residual_forces
from contact.problem.mobility import held_by_friction
from contact.problem.problem import ContactProblem
from contact.tolerances import EPS
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
    loads = _loads(problem)
    borne, total = float(loads[_loose(problem)].sum()), float(loads.sum())
    # What bends another body need not be borne, but where a body is squeezed by it alone.
    return np.full_like(weight, STUCK * (borne if borne > EPS * total else total)) / weight


def all_loads(problem: ContactProblem) -> float:
    """Return the sum of all forces that act at rest, without regard to sign. Collective."""
    return float(_loads(problem).sum())


def _loads(problem: ContactProblem) -> Array:
    """Return these sums of each piece of the body, shape (k,). Collective."""
    body, shares = problem.equilibrium, problem.equilibrium.shares
    residual = residual_forces(problem, problem.start())
    forces = np.abs(body.unbalanced(residual)) * shares.mechanical
    own = np.repeat(shares.piece, body.block_size)
    found = sums(problem.comm, own, forces[: body.owned], shares.count)
    return found + np.bincount(shares.behind, forces[body.owned :], shares.count)


def _loose(problem: ContactProblem) -> NDArray[np.bool_]:
    """Return which pieces no support holds anywhere, shape (k,). Collective."""
    body, shares = problem.equilibrium, problem.equilibrium.shares
    supported = ~body.unsupported[:, : body.dim].all(axis=1)
    return sums(problem.comm, shares.piece, supported.astype(float), shares.count) == 0
