"""Whether contact holds a body so well that its place means anything."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from scipy import linalg

from contact.output.solution import Remark, Solution
from contact.problem.kkt import residual_forces
from contact.problem.rigid_modes import (
    Group,
    constrained_by_supports,
    described,
    groups,
    null_space,
)
from contact.tolerances import EPS
from contact.typing import Array

#: Share of the largest displacement by which what is left of the forces may move a body.
MOVED = 1e-3

#: Share of a motion's square from which on contact holds it: normals of a mesh are off by more than
#: the root of it, and hold what the true surface does not.
HELD = 1e-8

#: Largest pressure at the end of a step, over that of all steps, that is rounding of none.
NOTHING = 1e-12


def looseness(solution: Solution) -> Remark:
    """Say where nearly nothing resists a motion of a body that contact alone holds. Collective.

    A cylinder without friction rolls in its place against next to nothing, and wherever it has
    rolled to, its forces are in balance. Contact is taken to resist with c = E/length times areas:
    along the normal where bodies touch, along the surface where they stick, and across the friction
    where they slip.
    """
    problem, body = solution.problem, solution.problem.equilibrium
    touches = solution.status != "open"
    if not (solution.converged and problem.comm.allreduce(bool(touches.any()), op=MPI.LOR)):
        return "", True
    residual = body.unbalanced(residual_forces(problem, solution.state))
    left = float(np.linalg.norm(body.sizes(residual)[0]))
    whole = problem.interface.stiffness * problem.nodes.sum(np.ones_like(problem.nodes.weight))
    largest, kkt = solution.max_displacement, solution.outcome.kkt
    for group in groups(problem):
        free = null_space(group.supports)
        if free.shape[1] == 0:
            continue
        share, motion = _least_held(solution, group, free, touches)
        moved = left * _reach(group, motion) / (whole * max(share, EPS))
        if share < HELD or moved > MOVED * largest:
            words = described(motion[:, None] / np.linalg.norm(motion), group.names)
            return (
                f"contact resists a rigid motion ({words}) by next to nothing: the mesh decides "
                f"how far it goes, and {kkt.equilibrium:.1e} of the forces, which "
                f"are left, may move what is there by up to {moved:.2g}, where displacements reach "
                f"{largest:.2g}; friction, or a support against that motion, hold it",
                False,
            )
    return "", True


def adrift(solution: Solution) -> Remark:
    """Say that nothing held a body any more before the last step. Collective."""
    pressures = np.array([record.row["max_pressure"] for record in solution.steps])
    pressed = pressures > NOTHING * pressures.max(initial=0.0)
    # Before it has been pressed it is at rest.
    loose = np.flatnonzero(~pressed[:-1] & np.logical_or.accumulate(pressed)[:-1])
    if loose.size == 0 or constrained_by_supports(solution.problem):
        return "", True
    return (
        f"at t = {solution.steps[loose[0]].row['t']:g} nothing presses any more, and no support "
        "holds the body: where it is then is one of many places, and so is what comes after; a "
        "load that goes on pressing it, or a support, holds it",
        False,
    )


def _least_held(
    solution: Solution, group: Group, free: Array, touches: NDArray[np.bool_]
) -> tuple[float, Array]:
    """Return the free motion that contact holds least. Collective.

    Returns
    -------
    Which share of its square at all contact nodes is where it is held, and the motion, with a
    mean square of 1 there, shape (m,).
    """
    nodes = group.problem.nodes
    normal, tangential = group.normal @ free, group.tangential @ free
    resisted = tangential.copy()
    slips = touches & (solution.status == "slip")
    size = np.linalg.norm(solution.friction, axis=1)
    unit = solution.friction / np.where(size > 0, size, 1.0)[:, None]
    resisted[slips] -= np.einsum("ni,nj,njk->nik", unit, unit, tangential)[slips]
    resisted[~touches | (solution.friction_bound <= 0)] = 0.0
    whole = np.concatenate([normal[:, None, :], tangential], axis=1)
    resisting = np.concatenate([(normal * touches[:, None])[:, None, :], resisted], axis=1)
    sums = np.array([_products(nodes.weight, part) for part in (resisting, whole)])
    held, moved = nodes.comm.allreduce(sums, op=MPI.SUM)
    area = nodes.sum(np.ones_like(nodes.weight))
    values, motions = linalg.eigh(held / area, moved / area)
    return max(float(values[0]), 0.0), free @ motions[:, 0]


def _products(weight: Array, motions: Array) -> Array:
    """Return the weighted sums of products of motions at nodes, (n, d + 1, m), shape (m, m)."""
    return np.asarray(np.einsum("n,nik,nil->kl", weight, motions, motions))


def _reach(group: Group, motion: Array) -> float:
    """Return how far a motion moves a node at most. Collective."""
    body = group.problem.equilibrium
    moved = body.nodal(group.moved @ motion)[:, : body.dim]
    here = float(np.linalg.norm(moved, axis=1).max(initial=0.0))
    return float(group.problem.comm.allreduce(here, op=MPI.MAX))
