"""Nested meshes: a start on a mesh from the solution on a coarser one."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from contact.interface.multipliers import Multipliers
from contact.interface.projections import project_half_line
from contact.mesh.transfer import carry
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.typing import Array


def prolong(coarse: ContactProblem, state: State, fine: ContactProblem) -> State:
    """Carry a state of a coarse problem to a finer one. Collective."""
    body, before = fine.equilibrium, coarse.equilibrium
    x = carry(before.function(state.x), body.space).x.array.copy()
    if coarse.piezoelectric:
        x[coarse.dim :: body.block_size] *= before.phi_scale / body.phi_scale
    x = np.concatenate([x, before.motion(state.x)])
    forces = np.column_stack([state.forces.pressure, state.forces.friction])
    points = coarse.nodes.gather(coarse.nodes.points)
    values = _interpolate(points, coarse.nodes.gather(forces), fine.nodes.points)
    friction = np.einsum("nij,nj->ni", fine.nodes.tangent, values[:, 1:])
    multipliers = Multipliers(project_half_line(values[:, 0]), friction)
    return State(body.prescribe(x, fine.time), multipliers, fine.time)


def _interpolate(points: Array, values: Array, at: Array) -> Array:
    """Interpolate between the d nearest points, weighted by the inverse of the distance.

    On nested edges that is linear interpolation.
    """
    if at.shape[0] == 0:
        return np.zeros((0, values.shape[1]))
    distance, near = cKDTree(points).query(at, k=min(at.shape[1], len(points)))
    distance, near = distance.reshape(len(at), -1), near.reshape(len(at), -1)
    weight = 1 / np.maximum(distance, 1e-9 * distance.max(initial=1e-300))
    weight /= weight.sum(axis=1)[:, None]
    return np.asarray(np.einsum("nk,nkc->nc", weight, values[near]))
