"""Nested meshes: a start on a mesh from the solution on a coarser one."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from contact.body.transfer import carry
from contact.interface.projections import project_half_line
from contact.problem.problem import ContactProblem
from contact.problem.state import Multipliers
from contact.typing import Array


def prolong(coarse: ContactProblem, forces: Multipliers, fine: ContactProblem) -> Multipliers:
    """Put a coarse solution into a finer problem; return its contact forces. Collective."""
    fine.x.x.array[:] = carry(coarse.x, fine.space).x.array
    if coarse.piezoelectric:
        potential = fine.x.x.array[coarse.dim :: coarse.block_size]
        potential *= coarse.phi_scale / fine.phi_scale
    fine.apply_load(1.0)
    gathered = coarse.trace.gather(np.column_stack([forces.pressure, forces.friction]))
    values = _interpolate(coarse.trace.gather(coarse.trace.points), gathered, fine.trace.points)
    friction = np.einsum("nij,nj->ni", fine.trace.tangent, values[:, 1:])
    return Multipliers(project_half_line(values[:, 0]), friction)


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
