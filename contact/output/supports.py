"""What the supports exert on the body, part by part."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from contact.mesh.together import members
from contact.problem.kkt import residual_forces
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.typing import Array


@dataclass(frozen=True)
class Support:
    """What a part with prescribed displacements exerts on the body.

    Attributes
    ----------
    force
        Shape (d,).
    moment
        About the origin of coordinates, of the points at rest: shape (1,) in the plane, about
        z, and (3,) in space.
    """

    force: Array
    moment: Array


def moment(points: Array, forces: Array, revolved: bool = False) -> Array:
    """Return the moment of forces at points, both of shape (n, d), about the origin.

    Over the full turn of a body of revolution moments cancel.
    """
    if revolved:
        return np.zeros(1)
    if points.shape[1] == 3:
        return np.cross(points, forces).sum(axis=0)
    return np.array([np.sum(points[:, 0] * forces[:, 1] - points[:, 1] * forces[:, 0])])


def supports(problem: ContactProblem, state: State) -> Mapping[str, Support]:
    """Return the supports by part. Collective.

    They are the residuals of the discrete equations, and balance with loads and contact to the
    tolerance of the solver. A component of a node on two parts counts for the one that stands
    first.
    """
    body, d, comm = problem.equilibrium, problem.dim, problem.comm
    residual = body.nodal(residual_forces(problem, state))[:, :d]
    points = body.space.tabulate_dof_coordinates()[: len(residual), :d]
    left = ~body.unsupported[:, :d]
    totals: dict[str, Array] = {}
    for fixed in problem.body.fixed:
        if fixed.displacement is None:
            continue
        held = np.array([component is not None for component in fixed.displacement])
        for part in members(fixed.on):
            facets = problem.domain.facets(part)
            nodes = fem.locate_dofs_topological(body.space, d - 1, facets)
            nodes = nodes[nodes < len(residual)]
            forces = np.where(left[nodes] & held, residual[nodes], 0.0)
            left[nodes] &= ~held
            whole = problem.domain.resultant(forces.sum(axis=0))
            local = np.concatenate([whole, moment(points[nodes], forces, problem.domain.revolved)])
            totals[part] = totals.get(part, 0.0) + comm.allreduce(local, op=MPI.SUM)
    return {part: Support(total[:d], total[d:]) for part, total in totals.items()}
