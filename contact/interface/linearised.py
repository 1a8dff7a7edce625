"""Contact and friction laws, linearised node by node for Newton's method.

A node in contact pushes with p + gamma (u_nu - rho), a sticking one with
lambda + gamma u_tau, a sliding one with its friction bound along the slip. With gamma far
above the stiffness of the body these are the linearised conditions u_nu = rho and u_tau = 0,
and their residuals fall by that ratio in every step.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from contact.problem.problem import ContactProblem
from contact.problem.state import Multipliers, total_pressure
from contact.typing import Array

#: What a contact node does: a friction state, plus CLOSED where it touches. A smoothed
#: pressure and Tresca's law bound the friction of open nodes too.
FREE, SLIDES, STICKS, CLOSED = 0, 1, 2, 4

#: Part of a node's own stiffness that a falling friction coefficient may take away, and how much
#: more in each further step in which no node changes its status.
SOFTENING, MORE_SOFTENING = 0.25, 0.05


@dataclass(frozen=True)
class Moduli:
    """Stiffnesses (stress/length) that the linearised laws need.

    Attributes
    ----------
    status
        c of the complementarity functions p + c (u_nu - rho) and lambda + c u_tau.
    nodal
        Of the body against a displacement of one contact node, about E'/h.
    gamma
        Of the condensed constraints, far above the others.
    """

    status: float
    nodal: float
    gamma: float


@dataclass(frozen=True)
class LinearisedContact:
    """Contact forces at an iterate and their derivative.

    Attributes
    ----------
    forces
        Multipliers, to be put into the residual.
    blocks
        Derivative by the nodal unknowns, shape (n, block size, block size), without weights.
    status
        FREE, SLIDES or STICKS, plus CLOSED, shape (n,).
    settled
        Whether no node of any rank has changed its status.
    """

    forces: Multipliers
    blocks: Array
    status: NDArray[np.int8]
    settled: bool


def touching(problem: ContactProblem, nodal: Array, pressure: Array, c: float) -> NDArray[np.bool_]:
    """Tell which nodes the rigid part presses, p + c (u_nu - rho) > 0, shape (n,)."""
    trace = problem.trace
    return np.asarray(pressure + c * (trace.normal_component(nodal) - trace.gap) > 0)


def node_status(
    problem: ContactProblem, nodal: Array, forces: Multipliers, bound: Array, c: float
) -> NDArray[np.int8]:
    """Return the states of the nodes at nodal unknowns, contact forces and bounds."""
    closed = touching(problem, nodal, forces.pressure, c)
    tangential = problem.trace.tangential_component(nodal)
    size = np.linalg.norm(forces.friction + c * tangential, axis=1)
    state = np.where(size <= bound, STICKS, SLIDES)
    state[(bound <= 0) & ~closed] = FREE
    return (state * problem.frictional + CLOSED * closed).astype(np.int8)


def linearise(
    problem: ContactProblem,
    nodal: Array,
    forces: Multipliers,
    moduli: Moduli,
    before: NDArray[np.int8] | None,
    frozen_bound: Array | None = None,
    softening: float = SOFTENING,
) -> LinearisedContact:
    """Linearise the contact laws at an iterate. Collective.

    Parameters
    ----------
    problem, nodal, forces
        The problem, its iterate at the contact nodes and the contact forces.
    moduli
        Stiffnesses.
    before
        Status in the step before; None in the first one, where closed nodes stick.
    frozen_bound
        A given friction bound: Tresca's law instead of Coulomb's.
    softening
        Part of a node's own stiffness that a falling friction coefficient may take away.
    """
    trace, d, c = problem.trace, problem.dim, moduli.status
    p, lam, n = forces.pressure, forces.friction, trace.normal
    opening = trace.normal_component(nodal) - trace.gap
    slip = trace.tangential_component(nodal)
    length = np.linalg.norm(slip, axis=1)
    total = total_pressure(problem, nodal, forces)
    bound = problem.friction_bound(total, length) if frozen_bound is None else frozen_bound
    bound = np.asarray(bound, dtype=float)
    trial = lam + c * slip
    size = np.linalg.norm(trial, axis=1)

    if before is None:
        touches = opening >= -1e-12 * problem.domain.size
        status = touches.astype(np.int8) * (CLOSED + STICKS * problem.frictional)
    else:
        status = node_status(problem, nodal, forces, bound, c)
        # Friction that pushes a sliding node along: it has to stop before it can turn back.
        pushed = (before & SLIDES > 0) & (np.einsum("ni,ni->n", lam, slip) < 0)
        status[pushed & (status & SLIDES > 0)] ^= SLIDES | STICKS
    closed, sticks, slides = (status & flag > 0 for flag in (CLOSED, STICKS, SLIDES))
    changed = before is None or not np.array_equal(status, before)
    settled = problem.comm.allreduce(int(changed), op=MPI.SUM) == 0
    if frozen_bound is None and not settled and before is not None:
        bound = np.where(slides, _foreseen_bound(problem, total, length, size, moduli), bound)

    pressure = np.where(closed, p + moduli.gamma * opening, 0.0)
    blocks = np.zeros((p.size, trace.block_size, trace.block_size))
    slope = np.where(closed, moduli.gamma, 0.0)[:, None] * n
    blocks[:, :d, :d] = n[:, :, None] * slope[:, None, :]
    friction = np.zeros_like(lam)
    if problem.frictional:
        friction[sticks] = (lam + moduli.gamma * slip)[sticks]
        blocks[sticks, :d, :d] += moduli.gamma * trace.tangent[sticks]

        along = trial / np.maximum(size, 1e-300)[:, None]
        across = trace.tangent - along[:, :, None] * along[:, None, :]
        # Across z = lambda + c u_tau the new multiplier is s/|u_tau| times the new slip:
        # lambda = s z/|z|, linearised in u and lambda and solved for the latter.
        turning = np.minimum(bound * c / np.maximum(size - bound, 1e-300), moduli.gamma)
        sliding = turning[:, None, None] * across
        friction[slides] = (bound[:, None] * along + np.einsum("nij,nj->ni", sliding, slip))[slides]
        if frozen_bound is None:
            limit = softening * moduli.nodal if settled else None
            rate = _bound_gradient(problem, total, slip, length, limit)
            ahead, follows = _follow_pressure(
                problem, nodal, length, slope, opening, moduli, closed
            )
            friction[slides] += (ahead[:, None] * along)[slides]
            rate = rate + follows
            blocks[slides, :d, :] += along[slides, :, None] * rate[slides, None, :]
        blocks[slides, :d, :d] += sliding[slides]
    return LinearisedContact(Multipliers(pressure, friction), blocks, status, settled)


def _foreseen_bound(
    problem: ContactProblem, total: Array, length: Array, size: Array, moduli: Moduli
) -> Array:
    """Return the bound that a node which lets go will slide on, shape (n,).

    Its coefficient falls on the way: foreseen, this saves steps for each node that the sliding
    zone gains. With neighbours that slide along it is about half as stiff as alone.
    """
    bound = np.asarray(problem.friction_bound(total, length), dtype=float)
    for _ in range(5):
        ahead = np.maximum(length, (size - bound) / (0.5 * moduli.nodal))
        bound = np.asarray(problem.friction_bound(total, ahead), dtype=float)
    return bound


def _bound_gradient(
    problem: ContactProblem, total: Array, slip: Array, length: Array, limit: float | None
) -> Array:
    """Return the derivative of mu(|u_tau|) R p by the slip, shape (n, block size).

    Taken only when the sliding zone has settled, and limited: where friction falls faster
    than the node's own stiffness, the linearised node would snap.
    """
    gradient = np.zeros((length.size, problem.block_size))
    coefficient = problem.friction.coefficient
    if coefficient is None or limit is None:
        return gradient
    smooth = np.maximum(problem.smoothing(total), 0.0)
    fall = np.maximum(coefficient.derivative(length) * smooth, -limit)
    direction = slip / np.maximum(length, 1e-300)[:, None]
    gradient[:, : problem.dim] = fall[:, None] * direction
    return gradient


def _follow_pressure(
    problem: ContactProblem,
    nodal: Array,
    length: Array,
    slope: Array,
    opening: Array,
    moduli: Moduli,
    closed: NDArray[np.bool_],
) -> tuple[Array, Array]:
    """Return how the bound follows the pressure of this very step: change and gradient.

    A smoothed pressure (R other than the identity) couples all nodes within the radius and
    would fill the matrix: it is lagged.
    """
    coefficient = problem.friction.coefficient
    gradient = np.zeros((length.size, problem.block_size))
    if coefficient is None or problem.friction.radius > 0:
        return np.zeros_like(length), gradient
    mu = coefficient(length)
    gradient[:, : problem.dim] = mu[:, None] * slope
    gradient += mu[:, None] * problem.response.layer_gradient(nodal)
    return np.where(closed, mu * moduli.gamma * opening, 0.0), gradient
