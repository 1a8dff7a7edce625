"""Uzawa block relaxation for one linearised problem: Algorithms 2, 5, 7 and 9.

One step solves for u, projects the auxiliary variables phi and updates the multipliers
lambda, (3.34)-(3.36). Everything that it hands on is z = lambda + r u: the next multiplier is
the projection of z, and r phi = z - lambda. The step is therefore a fixed-point map of z,
which `acceleration` speeds up.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from contact.interface.projections import disc_derivative, project_disc
from contact.interface.response import NormalLaw
from contact.linear.operator import LinearOperator
from contact.methods.acceleration import ResidualMinimiser
from contact.problem.condensed import DenseOperator
from contact.problem.kkt import interface_residuals
from contact.problem.problem import ContactProblem
from contact.problem.state import Multipliers, bound_of
from contact.typing import Array
from forms.foundation import contact_multiplier

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

    operator: LinearOperator | DenseOperator
    residual: Array
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


def automatic_r(problem: ContactProblem) -> float:
    """Return r* = 1.39 E'/sqrt(h H), the geometric mean of the Steklov spectrum's ends.

    E' = E/(1 - nu^2); h is the spacing of the contact nodes and H the volume of the body over
    the area of Gamma_3. Good to a factor of a few, which acceleration makes up for.
    """
    from dolfinx import fem

    domain, law = problem.domain, problem.body.law
    one = problem.constant(1.0)

    def integral(measure: object) -> float:
        return float(problem.comm.allreduce(fem.assemble_scalar(fem.form(one * measure)), MPI.SUM))

    area = integral(domain.ds(problem.contact.on))
    height = integral(domain.dx) / area
    spacing = (area / problem.trace.size) ** (1 / (problem.dim - 1))
    modulus = float(law.young) / (1 - float(law.poisson) ** 2)
    return 1.39 * modulus / float(np.sqrt(spacing * height))


def augmentation(problem: ContactProblem, r: float, friction: bool) -> Array:
    """Return the weighted nodal blocks of r u_nu v_nu [+ r u_tau v_tau], (n, bs, bs)."""
    trace, d = problem.trace, problem.dim
    blocks = np.zeros((trace.nodes.size, trace.block_size, trace.block_size))
    blocks[:, :d, :d] = trace.normal[:, :, None] * trace.normal[:, None, :]
    if friction:
        blocks[:, :d, :d] += trace.tangent
    return r * trace.weight[:, None, None] * blocks


def split(problem: ContactProblem, nodal: Array, friction: bool) -> Array:
    """Return normal and tangential displacements side by side, shape (n, 1 + d).

    Without friction the tangential ones are no unknowns of the relaxation, and 0 here.
    """
    trace = problem.trace
    tangential = trace.tangential_component(nodal)
    if not friction:
        tangential = np.zeros_like(tangential)
    return np.column_stack([trace.normal_component(nodal), tangential])


def _project(
    problem: ContactProblem, z: Array, r: float, bound: Array, law: NormalLaw | None
) -> Array:
    """Return the new multipliers, Steps 2 and 3: (3.43) and the friction disc."""
    if law is None:
        pressure = contact_multiplier(z[:, 0], r, 0.0, problem.trace.gap)
    else:
        pressure = law.pressure(z[:, 0], r)
    return np.column_stack([pressure, project_disc(z[:, 1:], bound)])


def _derivative(
    problem: ContactProblem,
    z: Array,
    r: float,
    bound: Array,
    law: NormalLaw | None,
    directions: Array,
) -> Array:
    """Return the derivatives of `_project` along directions of shape (n, 1 + d, k)."""
    if law is None:
        slope = np.where(z[:, 0] > r * problem.trace.gap, 1.0, 0.0)
    else:
        slope = law.pressure_slope(z[:, 0], r)
    normal = slope[:, None, None] * directions[:, :1]
    return np.concatenate([normal, disc_derivative(z[:, 1:], bound, directions[:, 1:])], axis=1)


def _vectors(problem: ContactProblem, pairs: Array) -> Array:
    """Return (normal, tangential) pairs as vectors, shape (n, d)."""
    return pairs[:, :1] * problem.trace.normal + pairs[:, 1:]


def block_relaxation(
    problem: ContactProblem,
    step: Linearised,
    z: Array,
    parameters: Relaxation,
    domain_norm: Callable[[Array], float] | None = None,
    poll: Callable[[], None] | None = None,
) -> RelaxationResult:
    """Iterate Steps 1 to 3 of Algorithm 2 (5, 7, 9) on one linearised problem. Collective.

    Parameters
    ----------
    problem
        The contact problem; its iterate is left alone.
    step
        The linearised problem; its operator holds `augmentation(problem, r, friction)`.
    z
        lambda + r u to start from, shape (n, 1 + d).
    parameters
        Of the method.
    domain_norm
        L2(Omega) norm of owned unknowns, needed for the thesis's criterion.
    poll
        Called before every iteration, on all ranks; what it raises ends the relaxation.
    """
    trace, r, bound, law = problem.trace, parameters.r, step.bound, step.law
    weights = np.repeat(trace.weight, z.shape[1])

    def inner(a: Array, b: Array) -> Array:
        return np.asarray(trace.comm.allreduce(a.T @ (weights[:, None] * b), op=MPI.SUM))

    def project(flat: Array) -> Array:
        return _project(problem, flat.reshape(z.shape), r, bound, law).ravel()

    def derivative(flat: Array, directions: Array) -> Array:
        columns = directions.reshape(*z.shape, directions.shape[1])
        slopes = _derivative(problem, flat.reshape(z.shape), r, bound, law, columns)
        return slopes.reshape(directions.shape)

    accelerator = None
    if parameters.depth > 0:
        accelerator = ResidualMinimiser(inner, project, derivative, parameters.depth)
    old_increment: Array | None = None
    old_phi: Array | None = None
    residual, forces = np.inf, Multipliers.zero(problem)
    increment: Array = np.zeros(problem.owned)
    start = split(problem, step.nodal, step.friction)
    best, since = np.inf, 0
    patience = PATIENCE_PLAIN if accelerator is None else PATIENCE
    for iteration in range(1, parameters.max_iterations + 1):
        if poll is not None:
            poll()
        multiplier = _project(problem, z, r, bound, law)
        q = 2 * multiplier - z
        rhs = -step.residual
        trace.add(rhs, -trace.weight[:, None] * _vectors(problem, q + r * start))
        increment = step.operator.solve(rhs, guess=increment)
        nodal = step.nodal + trace.values(increment)
        u = split(problem, nodal, step.friction)
        # q + r u is the force that the foundation exerted in this very solve.
        total = q + r * u
        layer = 0.0 if law is None else law.layer(u[:, 0])
        forces = Multipliers(total[:, 0] - layer, total[:, 1:])
        if parameters.single_loop and step.friction:
            bound = bound_of(problem, nodal, forces)
        residual = max(interface_residuals(problem, nodal, forces, bound))
        phi = (z - multiplier) * (1 / r)
        image = multiplier + r * (phi + parameters.over_relaxation * (u - phi))
        measured = residual
        if parameters.thesis_tolerance is not None:
            assert domain_norm is not None
            phi = (image - _project(problem, image, r, bound, law)) * (1 / r)
            if old_phi is not None and old_increment is not None:
                moved, projected = increment - old_increment, phi - old_phi
                change = domain_norm(moved) ** 2 + trace.norm(projected) ** 2
                size = domain_norm(problem.unknowns[: problem.owned] + increment) ** 2
                size += trace.norm(phi) ** 2
                if change < parameters.thesis_tolerance**2 * size:
                    return RelaxationResult(increment, forces, image, iteration, residual)
                measured = float(np.sqrt(change / size)) if size > 0 else 0.0
            old_phi, old_increment = phi, increment
        elif residual <= parameters.tolerance or not np.isfinite(residual):
            return RelaxationResult(increment, forces, image, iteration, residual)
        since = 0 if measured < PROGRESS * best else since + 1
        best = min(best, measured)
        if since >= patience:
            return RelaxationResult(increment, forces, image, iteration, residual, stalled=True)
        z = image
        if accelerator is not None:
            newest = (total + r * u).ravel()
            z = accelerator.next(total.ravel(), newest, image.ravel()).reshape(z.shape)
    return RelaxationResult(increment, forces, z, parameters.max_iterations, residual)
