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

from contact.interface.interface import Interface
from contact.interface.multipliers import Multipliers
from contact.interface.status import CLOSED, SLIDES, STICKS
from contact.typing import Array

#: Part of a node's own stiffness that a falling friction coefficient may take away: with its
#: neighbours, which slide along, a node is less stiff than alone.
SOFTENING = 0.25


@dataclass(frozen=True)
class ComplementarityParameters:
    """Parameters of the complementarity functions and of their linearisation (stress/length).

    Attributes
    ----------
    c
        Weighs displacements against stresses in the functions, and thereby in the active set.
    nodal_stiffness
        Of the body against a displacement of one contact node, about E'/h.
    gamma
        Of the condensed constraints, far above the others.
    """

    c: float
    nodal_stiffness: float
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


def linearise(
    interface: Interface,
    nodal: Array,
    forces: Multipliers,
    parameters: ComplementarityParameters,
    before: NDArray[np.int8] | None,
    frozen_bound: Array | None = None,
    softening: float = SOFTENING,
) -> LinearisedContact:
    """Linearise the contact laws at an iterate. Collective.

    Parameters
    ----------
    interface, nodal, forces
        The contact nodes with their laws, the unknowns there, and the contact forces.
    parameters
        Of the complementarity functions.
    before
        Status in the step before; None in the first one, where closed nodes stick.
    frozen_bound
        A given friction bound: Tresca's law instead of Coulomb's.
    softening
        Part of a node's own stiffness that a falling friction coefficient may take away.
    """
    jump, frictional, c = interface.jump, interface.friction.acts, parameters.c
    p, lam, n, d = forces.pressure, forces.friction, jump.normal, jump.dim
    opening, slip = interface.opening(nodal), interface.slip(nodal)
    length = np.linalg.norm(slip, axis=1)
    total = interface.pressure(nodal, forces)
    bound = interface.friction.bound(total, length) if frozen_bound is None else frozen_bound
    trial = lam + c * slip
    size = np.linalg.norm(trial, axis=1)

    if before is None:
        touches = opening >= -1e-12 * interface.size
        status = touches.astype(np.int8) * (CLOSED + STICKS * frictional)
    else:
        status = interface.status(nodal, forces, bound, c)
        # Friction that pushes a sliding node along: it has to stop before it can turn back.
        pushed = (before & SLIDES > 0) & (np.einsum("ni,ni->n", lam, slip) < 0)
        status[pushed & (status & SLIDES > 0)] ^= SLIDES | STICKS
    closed, sticks, slides = (status & flag > 0 for flag in (CLOSED, STICKS, SLIDES))
    changed = before is None or not np.array_equal(status, before)
    settled = interface.comm.allreduce(int(changed), op=MPI.SUM) == 0
    if frozen_bound is None and not settled and before is not None:
        bound = np.where(slides, _foreseen_bound(interface, total, length, size, parameters), bound)

    pressure = np.where(closed, p + parameters.gamma * opening, 0.0)
    blocks = np.zeros((p.size, jump.block_size, jump.block_size))
    slope = np.where(closed, parameters.gamma, 0.0)[:, None] * n
    blocks[:, :d, :d] = n[:, :, None] * slope[:, None, :]
    friction = np.zeros_like(lam)
    if frictional:
        friction[sticks] = (lam + parameters.gamma * slip)[sticks]
        blocks[sticks, :d, :d] += parameters.gamma * jump.tangent[sticks]

        along = trial / np.maximum(size, 1e-300)[:, None]
        across = jump.tangent - along[:, :, None] * along[:, None, :]
        # Across z = lambda + c u_tau the new multiplier is s/|u_tau| times the new slip:
        # lambda = s z/|z|, linearised in u and lambda and solved for the latter.
        least = np.maximum(bound * c / parameters.gamma, 1e-300)  # turning is at most gamma
        turning = bound * c / np.maximum(size - bound, least)
        sliding = turning[:, None, None] * across
        friction[slides] = (bound[:, None] * along + np.einsum("nij,nj->ni", sliding, slip))[slides]
        if frozen_bound is None:
            limit = softening * parameters.nodal_stiffness if settled else None
            rate = _bound_gradient(interface, total, slip, length, limit)
            ahead, follows = _follow_pressure(
                interface, nodal, total, length, slope, opening, parameters, closed
            )
            friction[slides] += (ahead[:, None] * along)[slides]
            rate = rate + follows
            blocks[slides, :d, :] += along[slides, :, None] * rate[slides, None, :]
        blocks[slides, :d, :d] += sliding[slides]
    return LinearisedContact(Multipliers(pressure, friction), blocks, status, settled)


def _foreseen_bound(
    interface: Interface,
    total: Array,
    length: Array,
    size: Array,
    parameters: ComplementarityParameters,
) -> Array:
    """Return the bound that a node which lets go will slide on, shape (n,).

    Its coefficient falls on the way: foreseen, this saves steps for each node that the sliding
    zone gains. With neighbours that slide along it is about half as stiff as alone.
    """
    bound = interface.friction.bound(total, length)
    for _ in range(5):
        ahead = np.maximum(length, (size - bound) / (0.5 * parameters.nodal_stiffness))
        bound = interface.friction.bound(total, ahead)
    return bound


def _bound_gradient(
    interface: Interface, total: Array, slip: Array, length: Array, limit: float | None
) -> Array:
    """Return the derivative of the friction bound by the slip, shape (n, block size).

    Taken only when the sliding zone has settled, and limited: where friction falls faster
    than the node's own stiffness, the linearised node would snap.
    """
    gradient = np.zeros((length.size, interface.jump.block_size))
    if limit is None:
        return gradient
    fall = np.maximum(interface.friction.by_slip(total, length), -limit)
    direction = slip / np.maximum(length, 1e-300)[:, None]
    gradient[:, : interface.dim] = fall[:, None] * direction
    return gradient


def _follow_pressure(
    interface: Interface,
    nodal: Array,
    total: Array,
    length: Array,
    slope: Array,
    opening: Array,
    parameters: ComplementarityParameters,
    closed: NDArray[np.bool_],
) -> tuple[Array, Array]:
    """Return how the bound follows the pressure of this very step: change and gradient."""
    rate = interface.friction.by_pressure(total, length)
    gradient = np.zeros((length.size, interface.jump.block_size))
    gradient[:, : interface.dim] = rate[:, None] * slope
    gradient += rate[:, None] * interface.response.layer_gradient(nodal)
    return np.where(closed, rate * parameters.gamma * opening, 0.0), gradient
