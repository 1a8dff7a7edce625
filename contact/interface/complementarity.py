"""Complementarity (NCP) functions of contact and friction: residuals, generalised derivative.

With projections onto the admissible forces, a half line and a disc, the laws are equations,

    p - max(0, p - c (gap - u_nu)) = 0,     lambda_f - proj_s(lambda_f + c u_tau) = 0,

with the initial gap (rho in the pages) and the opening gap - u_nu (the normal gap g_N).
Their pieces are those of the active set (`contact.interface.active_set`). `interface_residuals`
evaluates them; `linearise` takes a step of the semismooth Newton method on them, node by node.
There a node in contact pushes with p - gamma (gap - u_nu), a sticking one with
lambda_f + gamma u_tau, a slipping one with its friction bound along the slip: with gamma far above
the stiffness of the body these are the linearised conditions u_nu = gap and u_tau = 0, and their
residuals fall by that ratio in every step.

References
----------
Alart and Curnier, Comput. Methods Appl. Mech. Engrg. 92 (1991) 353.
Hueeber, Stadler and Wohlmuth, SIAM J. Sci. Comput. 30 (2008) 572.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contact.interface.active_set import ActiveSet
from contact.interface.interface import Interface
from contact.interface.multipliers import Multipliers
from contact.interface.nodes import unit_vectors
from contact.ranks import summed
from contact.tolerances import EPS
from contact.typing import Array


def project_half_line(z: Array) -> Array:
    """Return max(0, z): the projection onto admissible pressures, (3.43) of the thesis."""
    return np.maximum(z, 0.0)


def project_disc(z: Array, radius: Array) -> Array:
    """Return the projection of tangential vectors onto discs |.| <= radius.

    Parameters
    ----------
    z
        Vectors, shape (..., n, d).
    radius
        Friction bounds s >= 0, shape (n,).
    """
    length = np.linalg.norm(z, axis=-1)
    bound = np.broadcast_to(radius, length.shape)
    beyond = length > bound
    scale = np.ones_like(length)
    scale[beyond] = bound[beyond] / length[beyond]
    return z * scale[..., None]


def disc_derivative(z: Array, radius: Array, directions: Array) -> Array:
    """Return the derivatives of `project_disc` along directions.

    Parameters
    ----------
    z, radius
        Vectors, shape (n, d), and radii, shape (n,).
    directions
        Shape (n, d, k).

    Returns
    -------
    Shape (n, d, k); on the rim that of the inside.
    """
    length = np.linalg.norm(z, axis=1)
    beyond = length > radius
    unit = z[beyond] / length[beyond, None]
    outside = directions[beyond]
    radial = np.einsum("ni,nik->nk", unit, outside)
    outside = outside - unit[:, :, None] * radial[:, None, :]
    result = directions.copy()
    result[beyond] = (radius[beyond] / length[beyond])[:, None, None] * outside
    return result


def interface_residuals(
    interface: Interface,
    nodal: Array,
    forces: Multipliers,
    bound: Array,
    rounding: Array | float = 0.0,
) -> tuple[Array, Array]:
    """Return the relative contact and friction residuals at nodal unknowns. Collective.

    Those of each connected component are relative to its pressures; the `worst` are returned,
    with their rounding floors, both of shape (2,).

    Parameters
    ----------
    interface, nodal, forces, bound
        The laws, unknowns and contact forces at the nodes, and the friction bound, shape (n,).
    rounding
        Norm of pressures in L2(Gamma_3) that nothing can tell from zero, of each component.
    """
    # Closing a gap at one node takes a stress of E/h: where the body is that long only because its
    # cells are stretched, E/diameter hides errors of the pressure far above the tolerance.
    c = interface.elongation * interface.stiffness
    opening = interface.opening(nodal)
    contact = forces.pressure - project_half_line(forces.pressure - c * opening)
    # Friction along the normal violates the law wherever a node sticks or slips.
    trial = interface.jump.tangential_component(forces.friction) + c * interface.slip(nodal)
    friction = forces.friction - project_disc(trial, bound)
    friction[np.isnan(bound)] = np.nan  # no comparison with NaN is true
    # Where next to nothing presses, rounding is compared with the stress that closing would take,
    # but not of gaps far wider than nodes move: these say nothing of the loads.
    before = np.linalg.norm(interface.friction.history.jump, axis=1)
    now = np.linalg.norm(nodal[:, : interface.dim], axis=1)
    way = np.maximum(now, before)
    closing = interface.stiffness * interface.norms(
        np.minimum(np.minimum(np.abs(opening), way), interface.diameter)
    )
    pressed = interface.norms(interface.pressure(nodal, forces))
    # Where nothing presses, nodes may have moved until they just touch: gaps are rounding too.
    moved = interface.norms(np.full_like(way, interface.rounding(nodal)))
    covered = interface.stiffness * interface.norms(np.minimum(now, interface.diameter))
    closing = np.where(pressed <= moved, np.maximum(closing, covered), closing)
    scale = np.maximum(pressed, 1e-4 * closing)
    scale = np.maximum(scale, EPS * scale.max())
    norms = np.array([interface.norms(contact), interface.norms(friction)])
    scale = np.where(scale > 0, scale, 1.0)
    return worst(norms / scale, np.broadcast_to(rounding / scale, norms.shape))


def worst(residuals: Array, floors: Array) -> tuple[Array, Array]:
    """Return the largest residual of each row, and its rounding floor.

    It is the largest of those above their floors, which alone decide whether a state is accepted,
    and the largest of all where none is.
    """
    above = np.where(residuals <= floors, -1.0, residuals)
    some = (above >= 0) | np.isnan(above)
    chosen = np.where(some.any(axis=1, keepdims=True), above, residuals)
    columns = np.argmax(chosen, axis=1)[:, None]  # NaN counts as the largest
    return (
        np.take_along_axis(residuals, columns, axis=1)[:, 0],
        np.take_along_axis(floors, columns, axis=1)[:, 0],
    )


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
        Augmentation parameter: of the eliminated constraints, far above the others.
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
    active_set
        The state of each node in this step.
    unchanged
        Whether that is the one of the step before, on all ranks.
    """

    forces: Multipliers
    blocks: Array
    active_set: ActiveSet
    unchanged: bool


@np.errstate(over="ignore", invalid="ignore")  # of a body that flies away
def linearise(
    interface: Interface,
    nodal: Array,
    forces: Multipliers,
    parameters: ComplementarityParameters,
    before: ActiveSet | None,
    softening: float = np.inf,
) -> LinearisedContact:
    """Linearise the complementarity functions at an iterate. Collective.

    Parameters
    ----------
    interface, nodal, forces
        The contact nodes with their laws, the unknowns there, and the contact forces.
    parameters
        Of the complementarity functions.
    before
        The active set of the step before; None in the first one, where closed nodes stick.
    softening
        Part of a node's own stiffness that a falling friction coefficient may take away: with its
        neighbours, which slide along, a node is less stiff than alone.
    """
    jump, frictional, c = interface.jump, interface.friction.acts, parameters.c
    p, lam, n, d = forces.pressure, forces.friction, jump.normal, jump.dim
    opening, slip = interface.opening(nodal), interface.slip(nodal)
    length = np.linalg.norm(slip, axis=1)
    total = interface.pressure(nodal, forces)
    bound = interface.friction.bound(total, length)
    if before is None:
        active = ActiveSet.without_slip(opening <= 1e-12 * interface.diameter, frictional)
    else:
        lam = at_bound(before, lam, slip, bound)
        known = Multipliers(p, lam)
        active = interface.active_set(nodal, known, bound, c).stopped(before, lam, slip)
    trial = lam + c * slip
    norm = np.linalg.norm(trial, axis=1)
    closed, sticks, slips = active.closed, active.sticks, active.slips
    changed = before is None or not active.same(before)
    unchanged = float(summed(interface.comm, changed)) == 0

    pressure = np.where(closed, p - parameters.gamma * opening, 0.0)
    blocks = np.zeros((p.size, jump.block_size, jump.block_size))
    slope = np.where(closed, parameters.gamma, 0.0)[:, None] * n
    blocks[:, :d, :d] = n[:, :, None] * slope[:, None, :]
    friction = np.zeros_like(lam)
    if frictional:
        friction[sticks] = (lam + parameters.gamma * slip)[sticks]
        blocks[sticks, :d, :d] += parameters.gamma * jump.tangent[sticks]

        along = trial / np.maximum(norm, 1e-300)[:, None]
        across = jump.tangent - along[:, :, None] * along[:, None, :]
        # Across z = lambda + c u_tau the new multiplier is s/|u_tau| times the new slip:
        # lambda = s z/|z|, linearised in u and lambda and solved for the latter.
        least = np.maximum(bound * c / parameters.gamma, 1e-300)  # turning is at most gamma
        turning = bound * c / np.maximum(norm - bound, least)
        sliding = turning[:, None, None] * across
        friction[slips] = (bound[:, None] * along + np.einsum("nij,nj->ni", sliding, slip))[slips]
        limit = softening * parameters.nodal_stiffness if unchanged else None
        rate = _bound_gradient(interface, total, slip, length, limit)
        # The bound follows the pressure of this very step.
        by_pressure = interface.friction.by_pressure(total, length)
        ahead = -by_pressure * parameters.gamma * np.where(closed, opening, 0.0)
        rate[:, :d] += by_pressure[:, None] * slope
        rate += by_pressure[:, None] * interface.law.layer_gradient(nodal)
        friction[slips] += (ahead[:, None] * along)[slips]
        blocks[slips, :d, :] += along[slips, :, None] * rate[slips, None, :]
        blocks[slips, :d, :d] += sliding[slips]
    return LinearisedContact(Multipliers(pressure, friction), blocks, active, unchanged)


def at_bound(before: ActiveSet, friction: Array, slip: Array, bound: Array) -> Array:
    """Return friction, at its bound where nodes go on slipping against it, shape (n, d).

    The linearised bound of a coefficient that falls with the slip may be far below that of the new
    slip. A node would stick by it, be released for the same reason as before, and so on.
    """
    norm = np.linalg.norm(friction, axis=1)
    slides = (
        before.slips & (np.einsum("ni,ni->n", friction, slip) > 0) & (norm < bound) & (norm > 0)
    )
    scale = np.where(slides, bound / np.where(slides, norm, 1.0), 1.0)
    return friction * scale[:, None]


def _bound_gradient(
    interface: Interface, total: Array, slip: Array, length: Array, limit: float | None
) -> Array:
    """Return the derivative of the friction bound by the slip, shape (n, block size).

    Taken only when the slip zone is that of the step before, and limited: where friction falls
    faster than the node's own stiffness, the linearised node would snap.
    """
    gradient = np.zeros((length.size, interface.jump.block_size))
    if limit is None:
        return gradient
    fall = np.maximum(interface.friction.by_slip(total, length), -limit)
    gradient[:, : interface.dim] = fall[:, None] * unit_vectors(slip)
    return gradient
