"""Uzawa block relaxation for one linearised problem: Algorithms 2, 5, 7 and 9.

One step solves for u, projects the auxiliary variables phi and updates the multipliers
lambda, (3.34)-(3.36). Everything that it hands on is lambda + r u: the next multiplier is its
projection, and r phi the difference to it. The step is therefore a fixed-point map, which
`acceleration` speeds up. Its variable is z = lambda + r (u - u_0), with the iterate's u_0: beside
slips of the whole load a lambda that is unloaded to 1e-12 of it would be lost in rounding.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from contact.interface.complementarity import disc_derivative, interface_residuals, project_disc
from contact.interface.interface import Interface
from contact.interface.jump import Jump, Multipliers
from contact.interface.layer import NormalLaw
from contact.interface.nodes import ContactNodes
from contact.linear.multigrid import TOLERANCE
from contact.linear.operator import Operator
from contact.methods.progress import Stagnation
from contact.methods.thesis.acceleration import ResidualMinimiser
from contact.problem.kkt import residual_forces
from contact.problem.protocols import Problem
from contact.problem.state import State
from contact.typing import Array
from forms.foundation import contact_multiplier


def augmentation(jump: Jump, r: float, friction: bool) -> Array:
    """Return the nodal blocks of r u_nu v_nu [+ r u_tau v_tau], without weights, (n, bs, bs)."""
    n, d = jump.normal.shape
    blocks = np.zeros((n, jump.block_size, jump.block_size))
    blocks[:, :d, :d] = jump.normal[:, :, None] * jump.normal[:, None, :]
    if friction:
        blocks[:, :d, :d] += jump.tangent
    return r * blocks


def split(interface: Interface, nodal: Array, friction: bool) -> Array:
    """Return normal displacements and slips side by side, shape (n, 1 + d).

    Without friction the slips are no unknowns of the relaxation, and 0 here.
    """
    parts = components(interface.jump, nodal, friction)
    parts[:, 1:] -= friction * interface.friction.history.jump
    return parts


def components(jump: Jump, nodal: Array, friction: bool) -> Array:
    """Return normal and tangential displacements side by side, shape (n, 1 + d); as `split`."""
    tangential = friction * jump.tangential_component(nodal)
    return np.column_stack([jump.normal_component(nodal), tangential])


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


def linearised(
    problem: Problem,
    state: State,
    operator: Operator,
    bound: Array,
    friction: bool,
    secant_at: Array,
) -> Linearised:
    """Freeze a problem at a state. Collective.

    The multipliers are the unknowns of the relaxation, and no part of the residual. Neither is the
    layer's pressure, unless it is lagged. The contact flag of the perfect conductor still looks
    at the last pressure.

    Parameters
    ----------
    problem, state
        The problem, and where it is.
    operator, bound, friction
        As of `Linearised`.
    secant_at
        Unknowns at which the secant modulus of the material is taken.
    """
    interface, jump = problem.interface, problem.interface.jump
    nodal = jump.apply(state.x)
    law = interface.law.normal_law(nodal)
    residual = residual_forces(problem, state, secant_at)
    unknown = state.forces.vectors(jump)
    if law is not None:
        unknown += interface.law.layer_pressure(nodal)[:, None] * jump.normal
    jump.transpose(-jump.weight[:, None] * unknown, residual)
    owned = problem.equilibrium.owned_part(state.x)
    return Linearised(operator, residual, owned, nodal, bound, law, friction)


logger = logging.getLogger("contact.inner")

#: Iterations without progress, that is 1 %, after which the relaxation is given up: accelerated,
#: and plain. With r far from r* the plain one creeps by 1e-4 an iteration, and still gets there.
STAGNATION_LIMIT, STAGNATION_LIMIT_PLAIN, PROGRESS = 100, 500, 0.99

#: Tolerance of an iterative solver over that of the relaxation: with one as large it returns its
#: initial guess, and rounding decides when it does. And the least one.
SHARE, LEAST = 0.1, 1e-13


@dataclass(frozen=True)
class Relaxation:
    """Parameters of the Uzawa block relaxation.

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
    anew
        Whether the acceleration begins anew after as many solves as it uses.
    """

    r: float
    tolerance: float
    max_iterations: int
    depth: int = 30
    over_relaxation: float = 1.0
    thesis_tolerance: float | None = None
    single_loop: bool = False
    anew: bool = False


@dataclass
class RelaxationResult:
    """Outcome of a Uzawa block relaxation.

    Attributes
    ----------
    increment
        dx on the owned unknowns.
    forces
        Multipliers in equilibrium with the iterate.
    z
        State to start the next relaxation from, relative to the new iterate, shape (n, 1 + d).
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


@dataclass
class _Projection:
    """Steps 2 and 3, from z of shape (n, 1 + d) to the new multipliers: (3.43) and the disc.

    All that is given is about `origin`.

    Attributes
    ----------
    jump
        The contact nodes.
    r
        Augmentation parameter.
    bound, law
        Friction bound and layer, as in `Linearised`.
    origin
        r u_0 of the iterate, shape (n, 1 + d).
    """

    jump: ContactNodes
    r: float
    bound: Array
    law: NormalLaw | None
    origin: Array

    def __call__(self, z: Array) -> Array:
        """Return the new multipliers."""
        z = z + self.origin
        if self.law is None:
            pressure = contact_multiplier(z[:, 0], self.r, 0.0, self.jump.gap)
        else:
            pressure = self.law.pressure(z[:, 0], self.r)
        return np.column_stack([pressure, project_disc(z[:, 1:], self.bound)])

    def derivative(self, z: Array, directions: Array) -> Array:
        """Return their derivatives along directions of shape (n, 1 + d, k)."""
        z = z + self.origin
        if self.law is None:
            slope = np.where(z[:, 0] > self.r * self.jump.gap, 1.0, 0.0)
        else:
            slope = self.law.pressure_slope(z[:, 0], self.r)
        normal = slope[:, None, None] * directions[:, :1]
        tangential = disc_derivative(z[:, 1:], self.bound, directions[:, 1:])
        return np.concatenate([normal, tangential], axis=1)

    def accelerator(self, depth: int, anew: bool, size: Array) -> ResidualMinimiser:
        """Return the acceleration of the iteration of z, as a flat array.

        Parameters
        ----------
        depth, anew
            As of `Relaxation`.
        size
            Unit of the forces at each node, shape (n,).
        """
        jump, shape = self.jump, (self.jump.weight.size, 1 + self.jump.normal.shape[1])
        weights = np.repeat(jump.weight / size**2, shape[1])

        def inner(a: Array, b: Array) -> Array:
            return np.asarray(jump.comm.allreduce(a.T @ (weights[:, None] * b), op=MPI.SUM))

        def project(flat: Array) -> Array:
            return self(flat.reshape(shape)).ravel()

        def derivative(flat: Array, directions: Array) -> Array:
            columns = directions.reshape(*shape, directions.shape[1])
            return self.derivative(flat.reshape(shape), columns).reshape(directions.shape)

        return ResidualMinimiser(inner, project, derivative, depth, anew)


class _Changes:
    """How much an iteration changes, for the thesis's criterion (3.45).

    Parameters
    ----------
    project
        From z to the multipliers.
    x
        The iterate's owned unknowns.
    norm
        L2(Omega) norm of owned unknowns.
    """

    def __init__(self, project: _Projection, x: Array, norm: Callable[[Array], float]) -> None:
        self._project, self._x, self._norm = project, x, norm
        self._last: tuple[Array, Array] | None = None

    def squares(self, increment: Array, image: Array) -> tuple[float, float] | None:
        """Return the squares of the change and of the size; None after the first iteration."""
        jump, norm, last = self._project.jump, self._norm, self._last
        project = self._project
        phi = (image + project.origin - project(image)) * (1 / project.r)
        self._last = increment, phi
        if last is None:
            return None
        change = norm(increment - last[0]) ** 2 + jump.norm(phi - last[1]) ** 2
        return change, norm(self._x + increment) ** 2 + jump.norm(phi) ** 2


def _vectors(jump: Jump, pairs: Array) -> Array:
    """Return (normal, tangential) pairs as vectors, shape (n, d)."""
    return pairs[:, :1] * jump.normal + pairs[:, 1:]


def uzawa_block_relaxation(
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
        lambda + r (u - u_0) to start from, shape (n, 1 + d); u_0 is that of the iterate.
    parameters
        Of the method.
    domain_norm
        L2(Omega) norm of owned unknowns, needed for the thesis's criterion.
    poll
        Called before every iteration, on all ranks; an exception ends the relaxation.
    """
    jump, r, law = interface.jump, parameters.r, step.law
    origin = r * split(interface, step.nodal, step.friction)
    project = _Projection(jump, r, step.bound, law, origin)
    accelerator: ResidualMinimiser | None = None
    beside: Array = np.ones_like(jump.weight)
    changes = None if domain_norm is None else _Changes(project, step.x, domain_norm)
    rtol = max(SHARE * parameters.tolerance, LEAST)
    residual, forces = np.inf, Multipliers.zero(jump)
    increment: Array = np.zeros(step.x.size)
    way: Array = np.zeros_like(z)
    stagnation = Stagnation(
        STAGNATION_LIMIT if parameters.depth > 0 else STAGNATION_LIMIT_PLAIN, PROGRESS
    )
    for iteration in range(1, parameters.max_iterations + 1):
        if poll is not None:
            poll()
        # Neither projections nor solves change the part of z along the normal beside its first
        # column: of rounding, the acceleration makes a pressure that no law sees.
        z[:, 1:] = jump.tangential_component(z[:, 1:])
        multiplier = project(z)
        q = 2 * multiplier - z
        rhs = -step.residual
        jump.transpose(-jump.weight[:, None] * _vectors(jump, q), rhs)
        increment = step.operator.solve(rhs, rtol if rtol < TOLERANCE else None, increment)
        moved = jump.apply(increment)
        nodal = step.nodal + moved
        way = r * components(jump, moved, step.friction)
        # q + r (u - u_0) is the force that the foundation exerted in this very solve.
        total = q + way
        if iteration == 1:
            beside = interface.component_norms(total)
        layer = 0.0 if law is None else law.layer(jump.normal_component(nodal))
        forces = Multipliers.of(jump, total[:, 0] - layer, total[:, 1:])
        if parameters.single_loop and step.friction:
            project.bound = interface.bound(nodal, forces)
        residual = float(interface_residuals(interface, nodal, forces, project.bound)[0].max())
        logger.debug("inner iteration %d: residual %.2e", iteration, residual)
        relaxed = (1 - parameters.over_relaxation) * (z - multiplier)
        image = multiplier + relaxed + parameters.over_relaxation * way
        done = residual <= parameters.tolerance or not np.isfinite(residual)
        # Not the residual: where nothing touches yet it is small, beside the stress of closing.
        measured = jump.norm((total - project(total + way)) / beside[:, None])
        if parameters.thesis_tolerance is not None:
            assert changes is not None
            squares, done = changes.squares(increment, image), False
            if squares is not None:
                change, size = squares
                done = change < parameters.thesis_tolerance**2 * size
                measured = float(np.sqrt(change / size)) if size > 0 else 0.0
        stalled = not done and stagnation(measured)
        if done or stalled:
            return RelaxationResult(increment, forces, image - way, iteration, residual, stalled)
        z = image
        if parameters.depth > 0:
            if accelerator is None:
                accelerator = project.accelerator(parameters.depth, parameters.anew, beside)
            newest = (total + way).ravel()
            z = accelerator.next(total.ravel(), newest, image.ravel()).reshape(z.shape)
    return RelaxationResult(increment, forces, z - way, parameters.max_iterations, residual)
