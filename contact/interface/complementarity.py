"""Complementarity (NCP) functions of contact and friction: residuals, generalised derivative.

With projections onto the admissible forces, a half line and a disc, the laws are equations,

    p - max(0, p + c (u_nu - rho)) = 0,     lambda_f - proj_s(lambda_f + c u_tau) = 0,

(17) of docs/algorithms.md, with the gap rho of the constraint (`Interface.gap`) and the normal gap
g_N = rho - u_nu. Their pieces are those of the active set (18) (`ActiveSet`). `interface_residuals`
evaluates them. `linearise` linearises them node by node for a step of the semismooth Newton method:

    p+ = p + gamma (u_nu+ - rho)               closed, (19a); 0 where open
    lambda_f+ = lambda_f + gamma u_tau+        stick, (19b)
    lambda_f+ = s+ e + theta Q u_tau+          slip, (19c), with the linearised bound s+ (19d)

These are lambda+ = lambda^0 + B T dx (19) with the increment dx of the step, the `multipliers`
lambda^0 at dx = 0 and the `blocks` B of `LinearisedContact`. With gamma far above the stiffness of
the body (19a) and (19b) are nearly u_nu = rho and u_tau = 0, and their residuals fall by that
ratio in every step.

References
----------
Alart and Curnier, Comput. Methods Appl. Mech. Engrg. 92 (1991) 353.
Hueeber, Stadler and Wohlmuth, SIAM J. Sci. Comput. 30 (2008) 572.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from contact.interface.interface import Interface
from contact.interface.multipliers import ActiveSet, Multipliers
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


def interface_residuals(
    interface: Interface,
    nodal: Array,
    multipliers: Multipliers,
    bound: Array,
    rounding: Array | float = 0.0,
) -> tuple[Array, Array]:
    """Return the relative contact and friction residuals and their floors, (2,). Collective.

    The `worst` of the connected components, each relative to max(|p|, 1e-4 c_0 |g|), norms in
    L2(Gamma_3): g is |g_N|, at most the displacement of the node and the diameter.

    Parameters
    ----------
    interface, nodal, multipliers, bound
        The laws, unknowns and multipliers at the nodes, and the friction bound, shape (n,).
    rounding
        Rounding of the pressures of each component, in L2(Gamma_3).
    """
    # Closing a gap at one node takes a stress of E/h: with stretched cells E/diameter would hide
    # errors of the pressure far above the tolerance.
    c = interface.elongation * interface.c_0
    normal_gap = interface.normal_gap(nodal)
    contact = multipliers.pressure - project_half_line(multipliers.pressure - c * normal_gap)
    # Friction along the normal violates the law wherever a node sticks or slips.
    trial = interface.nodes.tangential_component(multipliers.friction) + c * interface.slip(nodal)
    friction = multipliers.friction - project_disc(trial, bound)
    friction[np.isnan(bound)] = np.nan  # no comparison with NaN is true
    # Beside small pressures the reference is the stress that closes the gaps, up to the motion of
    # the nodes: wider gaps say nothing of the loads.
    before = np.linalg.norm(interface.friction.history.jump, axis=1)
    now = np.linalg.norm(nodal[:, : interface.dim], axis=1)
    way = np.maximum(now, before)
    closing = interface.c_0 * interface.norms(
        np.minimum(np.minimum(np.abs(normal_gap), way), interface.size)
    )
    pressed = interface.norms(interface.pressure(nodal, multipliers))
    # Without pressure nodes may just touch: their gaps are rounding too.
    moved = interface.norms(np.full_like(way, interface.rounding(nodal)))
    covered = interface.c_0 * interface.norms(np.minimum(now, interface.size))
    closing = np.where(pressed <= moved, np.maximum(closing, covered), closing)
    scale = np.maximum(pressed, 1e-4 * closing)
    scale = np.maximum(scale, EPS * scale.max())
    norms = np.array([interface.norms(contact), interface.norms(friction)])
    scale = np.where(scale > 0, scale, 1.0)
    return worst(norms / scale, np.broadcast_to(rounding / scale, norms.shape))


def worst(residuals: Array, floors: Array) -> tuple[Array, Array]:
    """Return the largest residual of each row, above its floor if any is, and its floor."""
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
        Complementarity parameter of the functions and of the active set.
    nodal_stiffness
        Stiffness of the body at one contact node, about E'/h.
    gamma
        Augmentation parameter of the eliminated constraints, far above the others.
    """

    c: float
    nodal_stiffness: float
    gamma: float


@dataclass(frozen=True)
class LinearisedContact:
    """The linearised multipliers lambda+ = lambda^0 + B T dx, (19) of docs/algorithms.md.

    Attributes
    ----------
    multipliers
        lambda^0, those of the residual.
    blocks
        B, the derivative by the nodal unknowns, shape (n, block size, block size), without weights.
    active_set
        Active set of this step.
    unchanged
        Whether it is that of the last step, on all ranks.
    """

    multipliers: Multipliers
    blocks: Array
    active_set: ActiveSet
    unchanged: bool


@np.errstate(over="ignore", invalid="ignore")  # of a body that flies away
def linearise(
    interface: Interface,
    nodal: Array,
    multipliers: Multipliers,
    parameters: ComplementarityParameters,
    before: ActiveSet | None,
    softening: float = np.inf,
) -> LinearisedContact:
    """Linearise the complementarity functions at an iterate. Collective.

    Parameters
    ----------
    interface, nodal, multipliers
        The contact nodes with their laws, the unknowns there, and the contact forces.
    parameters
        Of the complementarity functions.
    before
        Active set of the last step; None in the first one, where closed nodes stick.
    softening
        Largest share of a node's stiffness that a falling friction coefficient takes away.
    """
    nodes, frictional, c = interface.nodes, interface.friction.acts, parameters.c
    p, lam, n, d = multipliers.pressure, multipliers.friction, nodes.normal, nodes.dim
    normal_gap, slip = interface.normal_gap(nodal), interface.slip(nodal)
    length = np.linalg.norm(slip, axis=1)
    total = interface.pressure(nodal, multipliers)
    bound = interface.friction.bound(total, length)
    if before is None:
        active = ActiveSet.without_slip(normal_gap <= 1e-12 * interface.size, frictional)
    else:
        lam = at_bound(before, lam, slip, bound)
        raised = Multipliers(p, lam)
        active = interface.active_set(nodal, raised, bound, c).stopped(before, lam, slip)
    trial = lam + c * slip
    norm = np.linalg.norm(trial, axis=1)
    closed, sticks, slips = active.closed, active.sticks, active.slips
    changed = before is None or not active.same(before)
    unchanged = float(summed(interface.comm, changed)) == 0

    pressure = np.where(closed, p - parameters.gamma * normal_gap, 0.0)
    blocks = np.zeros((p.size, nodes.block_size, nodes.block_size))
    slope = np.where(closed, parameters.gamma, 0.0)[:, None] * n
    blocks[:, :d, :d] = n[:, :, None] * slope[:, None, :]
    friction = np.zeros_like(lam)
    if frictional:
        friction[sticks] = (lam + parameters.gamma * slip)[sticks]
        blocks[sticks, :d, :d] += parameters.gamma * nodes.tangent[sticks]

        e = trial / np.maximum(norm, 1e-300)[:, None]
        projector = nodes.tangent - e[:, :, None] * e[:, None, :]
        # lambda = s z/|z|, z = lambda + c u_tau, linearised and solved for the new lambda:
        # orthogonal to z it is theta times the new slip, theta = s c/(|z| - s).
        least = np.maximum(bound * c / parameters.gamma, 1e-300)  # theta is at most gamma
        theta = bound * c / np.maximum(norm - bound, least)
        sliding = theta[:, None, None] * projector
        friction[slips] = (bound[:, None] * e + np.einsum("nij,nj->ni", sliding, slip))[slips]
        limit = softening * parameters.nodal_stiffness if unchanged else None
        rate = _bound_gradient(interface, total, slip, length, limit)
        # The bound follows the pressure of this very step.
        by_pressure = interface.friction.by_pressure(total, length)
        bound_shift = -by_pressure * parameters.gamma * np.where(closed, normal_gap, 0.0)
        rate[:, :d] += by_pressure[:, None] * slope
        rate += by_pressure[:, None] * interface.foundation.pressure_gradient(nodal)
        friction[slips] += (bound_shift[:, None] * e)[slips]
        blocks[slips, :d, :] += e[slips, :, None] * rate[slips, None, :]
        blocks[slips, :d, :d] += sliding[slips]
    return LinearisedContact(Multipliers(pressure, friction), blocks, active, unchanged)


def at_bound(before: ActiveSet, friction: Array, slip: Array, bound: Array) -> Array:
    """Return friction, raised to its bound at nodes that go on slipping, shape (n, d).

    The linearised bound of a coefficient that falls with the slip may be far below that of the new
    slip: active sets would cycle between stick and slip.
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
    """Return the derivative of the friction bound by the slip, shape (n, block size)."""
    # Where friction falls faster than the node's own stiffness, the linearised node would snap.
    gradient = np.zeros((length.size, interface.nodes.block_size))
    if limit is None:
        return gradient
    fall = np.maximum(interface.friction.by_slip(total, length), -limit)
    gradient[:, : interface.dim] = fall[:, None] * unit_vectors(slip)
    return gradient
