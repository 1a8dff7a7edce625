"""Uzawa block relaxation for one linearised problem: Algorithms 2, 5, 7 and 9.

One step solves for u, projects the auxiliary variables phi and updates the multipliers
lambda, (3.34)-(3.36). Everything that it hands on is z = lambda + r u: the next multiplier is
the projection of z, and r phi = z - lambda. The step is therefore a fixed-point map of z,
which `acceleration` speeds up.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from contact.interface.interface import Interface
from contact.interface.jump import Jump
from contact.interface.layer import NormalLaw
from contact.interface.multipliers import Multipliers
from contact.interface.projections import disc_derivative, project_disc
from contact.interface.residuals import interface_residuals
from contact.linear.operator import Operator
from contact.methods.acceleration import ResidualMinimiser
from contact.methods.stagnation import Stagnation
from contact.problem.scales import Scales
from contact.typing import Array
from forms.foundation import contact_multiplier

logger = logging.getLogger("contact.inner")

#: Iterations without progress, that is 1 %, after which the relaxation is given up: accelerated,
#: and plain. With r far from r* the plain one creeps by 1e-4 an iteration, and still gets there.
PATIENCE, PATIENCE_PLAIN, PROGRESS = 100, 500, 0.99


@dataclass(frozen=True)
class Relaxation:
    """Parameters of the block relaxation.

    Attributes
    ----------
    r
        Augmentation parameter (stress/length).
    tolerance
        On the relative contact and friction residuals of the iterate.
    max_iterations
        Number of linear solves allowed.
    depth
        Number of earlier solves that the acceleration uses, 0 for no acceleration.
    over_relaxation
        Factor in (0, 2) on the step in u; 1 for none. Only without acceleration.
    thesis_tolerance
        If given, stop by the thesis's criterion (3.45) with this epsilon instead.
    single_loop
        Whether the friction bound is updated in every iteration.
    """

    r: float
    tolerance: float
    max_iterations: int
    depth: int = 30
    over_relaxation: float = 1.0
    thesis_tolerance: float | None = None
    single_loop: bool = False


@dataclass(frozen=True)
class Linearised:
    """The linearised problem about an iterate: A dx = -residual - contact forces.

    Attributes
    ----------
    operator
        Factorised operator, augmented by r at the contact nodes.
    residual
        Owned residual without multipliers at the iterate.
    x
        The iterate's owned unknowns.
    nodal
        The iterate at the contact nodes, shape (n, block size).
    bound
        Friction bound s_n, shape (n,).
    law
        The compliant layer in front of the rigid part, to be solved with the constraint; None
        without one. The multipliers are then those of the total pressure -sigma_nu.
    friction
        Whether tangential forces act; the operator is augmented tangentially only then.
    """

    operator: Operator
    residual: Array
    x: Array
    nodal: Array
    bound: Array
    law: NormalLaw | None = None
    friction: bool = False


@dataclass
class RelaxationResult:
    """Outcome of a block relaxation.

    Attributes
    ----------
    increment
        dx on the owned unknowns.
    forces
        Multipliers in equilibrium with the iterate.
    z
        State to start the next relaxation from, shape (n, 1 + d).
    iterations
        Number of linear solves.
    residual
        The largest interface residual reached.
    stalled
        Whether it was given up because nothing got better: rounding, as a rule.
    """

    increment: Array
    forces: Multipliers
    z: Array
    iterations: int
    residual: float
    stalled: bool = False


def automatic_r(scales: Scales) -> float:
    """Return r* = 1.39 E'/sqrt(h H), the geometric mean of the Steklov spectrum's ends.

    E' = E/(1 - nu^2); h is the spacing of the contact nodes and H the volume of the body over
    the area of Gamma_3. Good to a factor of a few, which acceleration makes up for.
    """
    return 1.39 * scales.plane_modulus / math.sqrt(scales.spacing * scales.height)


def augmentation(jump: Jump, r: float, friction: bool) -> Array:
    """Return the nodal blocks of r u_nu v_nu [+ r u_tau v_tau], without weights, (n, bs, bs)."""
    n, d = jump.normal.shape
    blocks = np.zeros((n, jump.block_size, jump.block_size))
    blocks[:, :d, :d] = jump.normal[:, :, None] * jump.normal[:, None, :]
    if friction:
        blocks[:, :d, :d] += jump.tangent
    return r * blocks


def split(interface: Interface, nodal: Array, friction: bool) -> Array:
    """Return normal displacements and what slips side by side, shape (n, 1 + d).

    Without friction the slips are no unknowns of the relaxation, and 0 here.
    """
    slip = interface.slip(nodal)
    if not friction:
        slip = np.zeros_like(slip)
    return np.column_stack([interface.jump.normal_component(nodal), slip])


def _project(jump: Jump, z: Array, r: float, bound: Array, law: NormalLaw | None) -> Array:
    """Return the new multipliers, Steps 2 and 3: (3.43) and the friction disc."""
    if law is None:
        pressure = contact_multiplier(z[:, 0], r, 0.0, jump.gap)
    else:
        pressure = law.pressure(z[:, 0], r)
    return np.column_stack([pressure, project_disc(z[:, 1:], bound)])


def _derivative(
    jump: Jump,
    z: Array,
    r: float,
    bound: Array,
    law: NormalLaw | None,
    directions: Array,
) -> Array:
    """Return the derivatives of `_project` along directions of shape (n, 1 + d, k)."""
    if law is None:
        slope = np.where(z[:, 0] > r * jump.gap, 1.0, 0.0)
    else:
        slope = law.pressure_slope(z[:, 0], r)
    normal = slope[:, None, None] * directions[:, :1]
    return np.concatenate([normal, disc_derivative(z[:, 1:], bound, directions[:, 1:])], axis=1)


def _vectors(jump: Jump, pairs: Array) -> Array:
    """Return (normal, tangential) pairs as vectors, shape (n, d)."""
    return pairs[:, :1] * jump.normal + pairs[:, 1:]


def block_relaxation(
    interface: Interface,
    step: Linearised,
    z: Array,
    parameters: Relaxation,
    domain_norm: Callable[[Array], float] | None = None,
    poll: Callable[[], None] | None = None,
) -> RelaxationResult:
    """Iterate Steps 1 to 3 of Algorithm 2 (5, 7, 9) on one linearised problem. Collective.

    Parameters
    ----------
    interface
        The contact nodes with their laws.
    step
        The linearised problem; its operator holds `augmentation(jump, r, friction)`.
    z
        lambda + r u to start from, shape (n, 1 + d).
    parameters
        Of the method.
    domain_norm
        L2(Omega) norm of owned unknowns, needed for the thesis's criterion.
    poll
        Called before every iteration, on all ranks; what it raises ends the relaxation.
    """
    jump, r, bound, law = interface.jump, parameters.r, step.bound, step.law
    weights = np.repeat(jump.weight, z.shape[1])

    def inner(a: Array, b: Array) -> Array:
        return np.asarray(jump.comm.allreduce(a.T @ (weights[:, None] * b), op=MPI.SUM))

    def project(flat: Array) -> Array:
        return _project(jump, flat.reshape(z.shape), r, bound, law).ravel()

    def derivative(flat: Array, directions: Array) -> Array:
        columns = directions.reshape(*z.shape, directions.shape[1])
        slopes = _derivative(jump, flat.reshape(z.shape), r, bound, law, columns)
        return slopes.reshape(directions.shape)

    accelerator = None
    if parameters.depth > 0:
        accelerator = ResidualMinimiser(inner, project, derivative, parameters.depth)
    old_increment: Array | None = None
    old_phi: Array | None = None
    residual, forces = np.inf, Multipliers.zero(jump)
    increment: Array = np.zeros(step.x.size)
    start = split(interface, step.nodal, step.friction)
    stagnation = Stagnation(PATIENCE_PLAIN if accelerator is None else PATIENCE, PROGRESS)
    for iteration in range(1, parameters.max_iterations + 1):
        if poll is not None:
            poll()
        multiplier = _project(jump, z, r, bound, law)
        q = 2 * multiplier - z
        rhs = -step.residual
        jump.transpose(-jump.weight[:, None] * _vectors(jump, q + r * start), rhs)
        increment = step.operator.solve(rhs, guess=increment)
        nodal = step.nodal + jump.apply(increment)
        u = split(interface, nodal, step.friction)
        # q + r u is the force that the foundation exerted in this very solve.
        total = q + r * u
        layer = 0.0 if law is None else law.layer(u[:, 0])
        forces = Multipliers(total[:, 0] - layer, total[:, 1:])
        if parameters.single_loop and step.friction:
            bound = interface.bound(nodal, forces)
        residual = max(interface_residuals(interface, nodal, forces, bound))
        logger.debug("inner iteration %d: residual %.2e", iteration, residual)
        phi = (z - multiplier) * (1 / r)
        image = multiplier + r * (phi + parameters.over_relaxation * (u - phi))
        measured = residual
        if parameters.thesis_tolerance is not None:
            assert domain_norm is not None
            phi = (image - _project(jump, image, r, bound, law)) * (1 / r)
            if old_phi is not None and old_increment is not None:
                moved, projected = increment - old_increment, phi - old_phi
                change = domain_norm(moved) ** 2 + jump.norm(projected) ** 2
                size = domain_norm(step.x + increment) ** 2
                size += jump.norm(phi) ** 2
                if change < parameters.thesis_tolerance**2 * size:
                    return RelaxationResult(increment, forces, image, iteration, residual)
                measured = float(np.sqrt(change / size)) if size > 0 else 0.0
            old_phi, old_increment = phi, increment
        elif residual <= parameters.tolerance or not np.isfinite(residual):
            return RelaxationResult(increment, forces, image, iteration, residual)
        if stagnation(measured):
            return RelaxationResult(increment, forces, image, iteration, residual, stalled=True)
        z = image
        if accelerator is not None:
            newest = (total + r * u).ravel()
            z = accelerator.next(total.ravel(), newest, image.ravel()).reshape(z.shape)
    return RelaxationResult(increment, forces, z, parameters.max_iterations, residual)
