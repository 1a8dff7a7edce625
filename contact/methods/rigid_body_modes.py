"""Rigid-body modes of a problem's bodies: constrained by supports, by contact or by friction alone.

Where friction alone constrains a mode, a method cannot begin without friction, nor with the bound
of pressures that are not known yet: the linear system would be singular. All nodes in contact are
first taken for sticking.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from contact.mesh.entities import component_sums
from contact.problem.kkt import residual_forces
from contact.problem.problem import ContactProblem
from contact.problem.protocols import Problem
from contact.problem.rigid_modes import (
    constrained_by_friction,
    constrained_by_supports,
    constrained_undeformed,
)
from contact.tolerances import EPS
from contact.typing import Array

#: Force that a node can bear by friction then, over all loads.
STUCK = 10.0


@dataclass
class RigidBodyModes:
    """How the rigid-body modes are constrained; computed when first asked for. Collective.

    Parameters
    ----------
    problem
        The whole problem: of a condensed one the supports are not seen.
    """

    problem: ContactProblem

    @cached_property
    def constrained_by_supports(self) -> bool:
        """Whether the supports constrain all modes without contact."""
        return constrained_by_supports(self.problem)

    @cached_property
    def constrained_undeformed(self) -> bool:
        """Whether supports, and contact where it touches in the reference configuration, do."""
        return constrained_undeformed(self.problem)

    @cached_property
    def friction_alone(self) -> bool:
        """Whether a mode is constrained by friction alone."""
        return self.problem.frictional and constrained_by_friction(self.problem)

    def stuck_bound(self) -> Array | None:
        """Return friction bounds that no load exceeds, shape (n,) (stress). Collective.

        None where supports and the foundation restrain all modes without friction.
        """
        if not self.friction_alone:
            return None
        problem = self.problem
        weight = problem.interface.jump.weight
        loads = _loads(problem)
        borne, total = float(loads[_without_supports(problem)].sum()), float(loads.sum())
        # Loads on another body need not be borne, but where a body is squeezed by it alone.
        return np.full_like(weight, STUCK * (borne if borne > EPS * total else total)) / weight


def all_loads(problem: Problem) -> float:
    """Return the sum of the magnitudes of all loads at zero displacement. Collective."""
    return float(_loads(problem).sum())


def _loads(problem: Problem) -> Array:
    """Return these sums of each connected component, shape (k,). Collective."""
    body, of = problem.equilibrium, problem.equilibrium.component_norms
    residual = residual_forces(problem, problem.start())
    forces = np.abs(body.unbalanced(residual)) * of.mechanical
    own = np.repeat(of.component, body.block_size)
    found = component_sums(body.comm, own, forces[: body.owned], of.count)
    return found + np.bincount(of.behind, forces[body.owned :], of.count)


def _without_supports(problem: ContactProblem) -> NDArray[np.bool_]:
    """Return which connected components have no support at all, shape (k,). Collective."""
    body, of = problem.equilibrium, problem.equilibrium.component_norms
    supported = ~body.unsupported[:, : body.dim].all(axis=1)
    return component_sums(problem.comm, of.component, supported.astype(float), of.count) == 0
