"""Complementarity (NCP) functions of contact and friction: residuals, generalised derivative.

With projections onto the admissible forces, a half line and a disc, the laws are equations,

    lambda_c - max(0, lambda_c + c (u_nu - rho)) = 0,     lambda_f - proj_s(lambda_f + c u_tau) = 0,

(17) of docs/algorithms.md, with the gap rho of the constraint (`Interface.gap`) and the normal gap
g_N = rho - u_nu. Their pieces are those of the active set (18) (`ActiveSet`). `interface_residuals`
evaluates them. `linearise` linearises them node by node for a step of the semismooth Newton method:

    lambda_c+ = lambda_c + gamma (u_nu+ - rho) closed, (19a); 0 where open
    lambda_f+ = lambda_f + gamma u_tau+        stick, (19b)
    lambda_f+ = s+ e + theta Q u_tau+          slip, (19c), with the linearised bound s+ (19d)

These are lambda+ = lambda^0 + B T dx with the increment dx of the step. (19a) and (19b) perturb the
derivative by c/gamma. With gamma far above the stiffness of the body they are nearly u_nu = rho and
u_tau = 0, the conditions of the primal-dual active set strategy, and their residuals fall by that
ratio in every step. The bound s, the radius of the disc, is that of lambda_c and the layer's
pressure; Alart and Curnier have lambda_c + c (u_nu - rho) in place of lambda_c. The active set and
the derivative of the bound by the slip are given: safeguards against cycling belong to the method
(`contact.methods.safeguards`).

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
from contact.tolerances import EPS
from contact.typing import Array


def project_half_line(z: Array) -> Array:
    """Return max(0, z): the projection onto admissible pressures, (3.43) of the thesis."""
    return np.maximum(z, 0.0)


def project_disc(z: Array, radius: Array) -> Array:
    """Return the projection of tangential vectors, (..., n, d), onto discs of radius s, (n,)."""
    length = np.linalg.norm(z, axis=-1)
    bound = np.broadcast_to(radius, length.shape)
    beyond = length > bound
    scale = np.ones_like(length)
    scale[beyond] = bound[beyond] / length[beyond]
    return z * scale[..., None]


def interface_residuals(
    interface: Interface,
    jump: Array,
    multipliers: Multipliers,
    bound: Array,
    rounding_norms: Array | float = 0.0,
) -> tuple[Array, Array]:
    """Return the contact and friction residuals (16) and their floors, (2,). Collective.

    The `worst` of the connected components, each relative to max(|p|, 1e-4 E/L |g|) with
    p = -sigma_nu, norms in L2(Gamma_3): g is |g_N|, at most the displacement of the node and the
    size. `rounding_norms` are the roundings of the pressures of each component, in L2(Gamma_3).
    """
    c_r, normal_gap = interface.c_r, interface.normal_gap(jump)
    contact = multipliers.contact - project_half_line(multipliers.contact - c_r * normal_gap)
    # Friction along the normal violates the law wherever a node sticks or slips.
    trial = interface.nodes.tangential_component(multipliers.friction)
    trial += c_r[:, None] * interface.slip(jump)
    friction = multipliers.friction - project_disc(trial, bound)
    friction[np.isnan(bound)] = np.nan  # no comparison with NaN is true
    # The scale is max(|p|, 1e-4 E/L |g|), with gaps g of at most the motion of their nodes.
    before = np.linalg.norm(interface.friction.history.jump, axis=1)
    now = np.linalg.norm(jump[:, : interface.dim], axis=1)
    motion = np.maximum(now, before)
    gap = np.minimum(np.minimum(np.abs(normal_gap), motion), interface.size)
    gap_stress = interface.norms(interface.c_0 * gap)
    total = interface.norms(interface.pressure(jump, multipliers))
    # Without pressure nodes may just touch: their gaps are rounding too.
    rounding_stress = interface.norms(np.full_like(motion, interface.rounding_stress(jump)))
    motion_stress = interface.norms(interface.c_0 * np.minimum(now, interface.size))
    gap_stress = np.where(
        total <= rounding_stress, np.maximum(gap_stress, motion_stress), gap_stress
    )
    scale = np.maximum(total, 1e-4 * gap_stress)
    scale = np.maximum(scale, EPS * scale.max())
    norms = np.array([interface.norms(contact), interface.norms(friction)])
    scale = np.where(scale > 0, scale, 1.0)
    return worst(norms / scale, np.broadcast_to(rounding_norms / scale, norms.shape))


def worst(residuals: Array, floors: Array) -> tuple[Array, Array]:
    """Return the largest residual of each row, above its floor if any is, and its floor."""
    above = np.where(residuals <= floors, -1.0, residuals)
    exceeds = (above >= 0) | np.isnan(above)
    chosen = np.where(exceeds.any(axis=1, keepdims=True), above, residuals)
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
        kappa = 1.93 E'/h, an upper estimate of the stiffness of a node of the softest material.
    gamma
        Augmentation parameter of (19), far above the others; the solution does not depend on it.
    """

    c: float
    nodal_stiffness: float
    gamma: float


@dataclass(frozen=True)
class LinearisedBound:
    """The friction bound s(|u_tau|, p) at an iterate, for (19d).

    Attributes
    ----------
    s
        The bound, shape (n,) (stress).
    by_pressure, by_slip
        ds/dp and ds/d|u_tau|, shape (n,).
    """

    s: Array
    by_pressure: Array
    by_slip: Array


def linearise(
    interface: Interface,
    jump: Array,
    multipliers: Multipliers,
    active: ActiveSet,
    parameters: ComplementarityParameters,
    bound: LinearisedBound,
) -> tuple[Multipliers, Array]:
    """Return lambda^0 and the blocks B of the linearised functions, (19a)-(19d). Collective.

    The active set selects the pieces of the complementarity functions. B has the shape
    (n, block size, block size), without weights.
    """
    nodes, normal_gap, gamma = interface.nodes, interface.normal_gap(jump), parameters.gamma
    n, d = nodes.normal, nodes.dim
    # (19a): lambda_c+ = lambda_c + gamma (u_nu+ - rho) where closed, 0 where open.
    contact = np.where(active.closed, multipliers.contact - gamma * normal_gap, 0.0)
    slope = np.where(active.closed, gamma, 0.0)[:, None] * n
    blocks = np.zeros((contact.size, nodes.block_size, nodes.block_size))
    blocks[:, :d, :d] = n[:, :, None] * slope[:, None, :]
    if not interface.friction.acts:
        return Multipliers(contact, np.zeros_like(n)), blocks

    # (19d): s+ = s + ds/dp (p+ - p) + ds/d|u_tau| e_u.(u_tau+ - u_tau), with p+ - p = lambda_c+ -
    # lambda_c + dp_l: (19a) where closed, and the layer by its tangent at the iterate u_nu, not at
    # the place on its graph about which the layer itself is linearised.
    slip, s, by_pressure = interface.slip(jump), bound.s, bound.by_pressure
    s_plus = s - by_pressure * gamma * np.where(active.closed, normal_gap, 0.0)
    gradient = by_pressure[:, None] * interface.foundation.layer_gradient(jump)
    gradient[:, :d] += by_pressure[:, None] * slope + bound.by_slip[:, None] * unit_vectors(slip)

    friction, sticks, slips = np.zeros_like(n), active.sticks, active.slips
    # (19b): lambda_f+ = lambda_f + gamma u_tau+ where it sticks.
    friction[sticks] = (multipliers.friction + gamma * slip)[sticks]
    blocks[sticks, :d, :d] += gamma * nodes.tangential_projector[sticks]
    # (19c): lambda_f+ = s+ e + theta Q u_tau+ where it slips, e = q/|q|, q = lambda_f + c u_tau.
    q = multipliers.friction + parameters.c * slip
    size = np.linalg.norm(q, axis=1)
    e = q / np.maximum(size, 1e-300)[:, None]
    least = np.maximum(s * parameters.c / gamma, 1e-300)  # theta is at most gamma
    theta = s * parameters.c / np.maximum(size - s, least)
    across = theta[:, None, None] * (nodes.tangential_projector - e[:, :, None] * e[:, None, :])
    slipping = s_plus[:, None] * e + np.einsum("nij,nj->ni", across, slip)
    friction[slips] = slipping[slips]
    blocks[slips, :d, :] += e[slips, :, None] * gradient[slips, None, :]
    blocks[slips, :d, :d] += across[slips]
    return Multipliers(contact, friction), blocks
