"""Uzawa block relaxation for one linearised problem: Algorithms 2, 5, 7 and 9.

The augmented Lagrangian of (3.32), (3.33) has the auxiliary variables phi = (phi_c, phi_f) for
u_nu and the slip, and their multipliers lambda. In Algorithms 5, 7 and 9 the thesis writes p for
them, and phi for the potential; here phi is never the potential. About u_n, with s_n of the outer
iterate, an iteration takes phi^k and lambda^k to

- Step 1, (3.34): u^{k+1} by (K + r) (u^{k+1} - u_n) = f - F(u_n) + r (phi^k - u_n) - lambda^k
  (`FrozenProblem.displacement_load`),
- Step 2, (3.35), (3.44): phi^{k+1} = (q - P(q))/r at q = lambda^k + r u^{k+1}
  (`FrozenProblem.auxiliary`),
- Step 3, (3.36): lambda^{k+1} = lambda^k + r (u^{k+1} - phi^{k+1}) = P(q)
  (`FrozenProblem.project`),

P(q) = ((q_c - r rho)^+, q_f projected onto the disc of radius s_n), (3.43) and section 3.5.2. The
variable of the loop is z = lambda^k + r (u^{k+1} - u_n), q less r u_n: against rounding of a small
lambda beside a large slip. It begins with Step 3 at a given z. As r phi = q - lambda, the load of
Step 1 is r (phi - u_n) - lambda = z - 2 lambda: phi is computed for the thesis's criterion alone.
This map of z to z is accelerated (`contact.thesis.acceleration`). Numbers of equations are those of
the thesis.

References
----------
Glowinski and Le Tallec, Augmented Lagrangian and Operator-Splitting Methods in Nonlinear Mechanics,
SIAM (1989), their ALG2; also known as ADMM.
Koko, Uzawa block relaxation method for the unilateral contact problem, J. Comput. Appl. Math. 235
(2011) 2343.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from contact.interface.complementarity import (
    interface_residuals,
    project_disc,
    project_half_line,
)
from contact.interface.foundation import NormalGraph
from contact.interface.interface import Interface
from contact.interface.multipliers import Multipliers
from contact.interface.nodes import ContactNodes
from contact.linear.multigrid import TOLERANCE
from contact.linear.operator import Operator
from contact.methods.options import FixedPointOptions
from contact.methods.report import Stagnation
from contact.problem.problem import ContactProblem
from contact.problem.residuals import residual_forces
from contact.problem.state import State
from contact.ranks import summed
from contact.thesis.acceleration import ResidualMinimiser
from contact.tolerances import ROUNDING
from contact.typing import Array

logger = logging.getLogger("contact.inner")

#: Stagnation limits of the accelerated and of the plain relaxation, which creeps with r far from
#: the best; ratio of residuals that is progress.
STAGNATION_LIMIT, STAGNATION_LIMIT_PLAIN, PROGRESS = 100, 500, 0.99

#: Tolerance of an iterative solver over that of the relaxation, so that it moves off its initial
#: guess.
SHARE = 0.1


def augmentation(nodes: ContactNodes, r: float, friction: bool) -> Array:
    """Return the nodal blocks of r u_nu v_nu [+ r u_tau v_tau], without weights, (n, bs, bs)."""
    n, d = nodes.normal.shape
    blocks = np.zeros((n, nodes.block_size, nodes.block_size))
    blocks[:, :d, :d] = nodes.normal[:, :, None] * nodes.normal[:, None, :]
    if friction:
        blocks[:, :d, :d] += nodes.tangential_projector
    return r * blocks


def displacement_and_slip(interface: Interface, jump: Array, friction: bool) -> Array:
    """Return normal displacement and slip, shape (n, 1 + d); slip 0 without friction."""
    parts = normal_and_tangential(interface.nodes, jump, friction)
    parts[:, 1:] -= friction * interface.friction.history.jump
    return parts


def normal_and_tangential(nodes: ContactNodes, jump: Array, friction: bool) -> Array:
    """Return normal and tangential displacement, shape (n, 1 + d); 0 without friction."""
    tangential = friction * nodes.tangential_component(jump)
    return np.column_stack([nodes.normal_component(jump), tangential])


@dataclass
class RelaxationResult:
    """End of a Uzawa block relaxation."""

    increment: Array  #: dx on the owned unknowns
    #: Of the contact stress of Step 1, lambda^k + r (u^{k+1} - phi^k), in equilibrium with u^{k+1};
    #: admissible in the limit alone. The next friction bound is taken from them.
    multipliers: Multipliers
    z: Array  #: variable of the next relaxation, about the new iterate, (n, 1 + d)
    iterations: int  #: number of linear solves
    stalled: bool = False  #: whether the stagnation limit has ended it


def disc_derivative(z: Array, radius: Array, directions: Array) -> Array:
    """Return derivatives of `project_disc` at z, (n, d), along directions, (n, d, k).

    On the rim they are those of the inside.
    """
    length = np.linalg.norm(z, axis=1)
    beyond = length > radius
    unit, scale = np.zeros_like(z), np.ones_like(length)
    unit[beyond] = z[beyond] / length[beyond, None]
    scale[beyond] = radius[beyond] / length[beyond]
    across = directions - unit[:, :, None] * np.einsum("ni,nik->nk", unit, directions)[:, None, :]
    return scale[:, None, None] * across


@dataclass(frozen=True)
class FrozenProblem:
    """The problem of one outer iteration, with its frozen terms, and the steps on it.

    Contact forces and jumps are arrays of normal and tangential parts, shape (n, 1 + d). Steps take
    the friction bound s_n, shape (n,): with `single_loop` it is not frozen. `state` is the iterate
    u_n at which layer, charge and geometry are frozen, r the augmentation parameter
    (stress/length).
    """

    problem: ContactProblem
    state: State
    friction: bool
    r: float

    @property
    def interface(self) -> Interface:
        """The interface of the problem."""
        return self.problem.interface

    @property
    def nodes(self) -> ContactNodes:
        """The contact nodes."""
        return self.interface.nodes

    @cached_property
    def jump_0(self) -> Array:
        """u_n at the contact nodes, shape (n, block size)."""
        return self.nodes.jump(self.state.x)

    @cached_property
    def layer(self) -> NormalGraph | None:
        """The contact law (1.29); None without a layer, or where its force is given."""
        return self.interface.foundation.normal_graph(self.jump_0)

    @cached_property
    def r_u_n(self) -> Array:
        """Augmentation r u_n, tangentially that of the slip, shape (n, 1 + d)."""
        return self.r * displacement_and_slip(self.interface, self.jump_0, self.friction)

    @cached_property
    def _load(self) -> Array:
        """f_n - F(u_n) on the owned unknowns, f_n with lagged layer and charge. Collective."""
        internal = self.problem.body.secant_forces(self.state)
        residual = residual_forces(self.problem, self.state, internal)
        contact = self.state.multipliers.vectors(self.nodes)
        if self.layer is not None:
            pressure = self.interface.foundation.layer_pressure(self.jump_0)
            contact += pressure[:, None] * self.nodes.normal
        self._add(-contact, residual)
        return -residual

    def _add(self, stresses: Array, to: Array) -> None:
        """Add the nodal forces of stresses on Gamma_3, shape (n, d)."""
        self.nodes.add_jump_transposed(self.nodes.weight[:, None] * stresses, to)

    def displacement_load(self, multipliers: Array, z: Array) -> Array:
        """Return the right-hand side of Step 1, (3.34): f_n - F(u_n) - (2 lambda - z)."""
        stresses, load = 2 * multipliers - z, self._load.copy()
        self._add(-(stresses[:, :1] * self.nodes.normal + stresses[:, 1:]), load)
        return load

    def augmented(self, moved: Array) -> Array:
        """Return r (u - u_n) of jumps u - u_n, shape (n, block size)."""
        return self.r * normal_and_tangential(self.nodes, moved, self.friction)

    def project(self, z: Array, bound: Array) -> Array:
        """Return P(q) at q = z + r u_n: lambda of Step 3, (3.36); z has shape (..., n, 1 + d).

        With a layer the normal one is the total pressure -sigma_nu.
        """
        q = z + self.r_u_n
        if self.layer is None:
            pressure = project_half_line(q[..., 0] - self.r * self.interface.gap)
        else:
            # Laws of users take one value per node.
            rows = q[..., 0].reshape(math.prod(q.shape[:-2]), q.shape[-2])
            pressure = np.reshape([self.layer.pressure(row, self.r) for row in rows], q.shape[:-1])
        friction = project_disc(q[..., 1:], bound)
        return np.concatenate([pressure[..., None], friction], axis=-1)

    def projection_derivative(self, z: Array, bound: Array, directions: Array) -> Array:
        """Return the derivatives of `project` along directions, shape (n, 1 + d, k)."""
        q = z + self.r_u_n
        if self.layer is None:
            slope = np.where(q[:, 0] > self.r * self.interface.gap, 1.0, 0.0)
        else:
            slope = self.layer.pressure_slope(q[:, 0], self.r)
        normal = slope[:, None, None] * directions[:, :1]
        tangential = disc_derivative(q[:, 1:], bound, directions[:, 1:])
        return np.concatenate([normal, tangential], axis=1)

    def multipliers(self, jump: Array, stress: Array) -> Multipliers:
        """Return lambda_c and lambda_f of a contact stress: without the pressure of the layer."""
        contact = stress[:, 0]
        if self.layer is not None:
            contact = contact - self.layer.layer_pressure(self.nodes.normal_component(jump))
        return Multipliers.of(self.nodes, contact, stress[:, 1:])

    def auxiliary(self, z: Array, bound: Array) -> Array:
        """Return phi of Step 2, (3.44): of Algorithms 5, 7 and 9 p_c and p_f."""
        return (z + self.r_u_n - self.project(z, bound)) * (1 / self.r)

    def accelerator(self, depth: int, size: Array, bound: Array) -> ResidualMinimiser:
        """Return the acceleration of the flat z, given the unit of stresses, (n,), and s_n."""
        nodes, shape = self.nodes, (self.nodes.weight.size, 1 + self.nodes.normal.shape[1])
        weights = np.repeat(nodes.weight / size**2, shape[1])

        def inner(a: Array, b: Array) -> Array:
            return summed(nodes.comm, a.T @ (weights[:, None] * b))

        def project(flat: Array) -> Array:
            z = flat.reshape(*flat.shape[:-1], *shape)
            return self.project(z, bound).reshape(flat.shape)

        def derivative(flat: Array, directions: Array) -> Array:
            columns = directions.reshape(*shape, directions.shape[1])
            slopes = self.projection_derivative(flat.reshape(shape), bound, columns)
            return slopes.reshape(directions.shape)

        return ResidualMinimiser(inner, project, derivative, depth)


@dataclass
class ThesisCriterion:
    """The criterion (3.45), (5.38), (6.41): relative change of unknowns and auxiliary variables.

    `domain_norm` is that of L2(Omega) of owned unknowns, `eps` the tolerance.
    """

    frozen: FrozenProblem
    domain_norm: Callable[[Array], float]
    eps: float
    last: tuple[Array, Array] | None = None

    def __call__(self, increment: Array, auxiliary: Array) -> tuple[bool, float | None]:
        """Return whether it is met, and the relative change, None in the first iteration."""
        before, self.last = self.last, (increment, auxiliary)
        if before is None:
            return False, None
        norm, on_contact = self.domain_norm, self.frozen.nodes.norm
        displacement = self.frozen.problem.body.owned_part(self.frozen.state.x)
        change = norm(increment - before[0]) ** 2 + on_contact(auxiliary - before[1]) ** 2
        size = norm(displacement + increment) ** 2 + on_contact(auxiliary) ** 2
        return change < self.eps**2 * size, float(np.sqrt(change / size)) if size > 0 else 0.0


def uzawa_block_relaxation(
    frozen: FrozenProblem,
    operator: Operator,
    z: Array,
    bound: Array,
    options: FixedPointOptions,
    domain_norm: Callable[[Array], float] | None,
    poll: Callable[[], None],
) -> RelaxationResult:
    """Iterate Steps 1 to 3 of Algorithm 2 (5, 7, 9) on one frozen problem. Collective.

    The operator is factorised with `augmentation(nodes, r, friction)`. Given are the initial z =
    lambda + r (u - u_n), shape (n, 1 + d), the friction bound s_n, shape (n,), and the L2(Omega)
    norm of owned unknowns for the thesis's criterion, None for residuals; `poll` is called before
    each iteration, on all ranks.
    """
    interface, nodes = frozen.interface, frozen.nodes
    accelerated, over = options.acceleration == "anderson", options.relaxation
    accelerator: ResidualMinimiser | None = None
    stress_unit: Array = np.ones_like(nodes.weight)
    criterion = None if domain_norm is None else ThesisCriterion(frozen, domain_norm, options.eps)
    rtol = max(SHARE * options.inner, ROUNDING)
    increment: Array = np.zeros_like(frozen.problem.body.owned_part(frozen.state.x))
    stagnation = Stagnation(STAGNATION_LIMIT if accelerated else STAGNATION_LIMIT_PLAIN, PROGRESS)
    bound = bound.copy()  # with single_loop it changes
    for iteration in range(1, options.max_inner + 1):
        poll()
        # Tangential again: rounding along the normal would be amplified by the acceleration.
        z[:, 1:] = nodes.tangential_component(z[:, 1:])
        # Steps 2 and 3 of the last solve, then Step 1.
        projected = frozen.project(z, bound)
        load = frozen.displacement_load(projected, z)
        increment = operator.solve(load, rtol if rtol < TOLERANCE else None, increment)
        moved = nodes.jump(increment)
        jump, r_u = frozen.jump_0 + moved, frozen.augmented(moved)
        # lambda^k + r (u^{k+1} - phi^k), in equilibrium with u^{k+1}; not yet lambda^{k+1}, (3.36).
        stress = 2 * projected - z + r_u
        if iteration == 1:
            stress_unit = interface.component_norms(stress)
        multipliers = frozen.multipliers(jump, stress)
        if options.single_loop and frozen.friction:
            bound[:] = interface.bound(jump, multipliers)
        residual = float(interface_residuals(interface, jump, multipliers, bound)[0].max())
        logger.debug("inner iteration %d: residual %.2e", iteration, residual)
        next_z = projected + (1 - over) * (z - projected) + over * r_u
        done = residual <= options.inner or not np.isfinite(residual)
        # The residual is small before contact, the defect of the fixed point is not.
        defect = nodes.norm((stress - frozen.project(stress + r_u, bound)) / stress_unit[:, None])
        if criterion is not None:
            done, change = criterion(increment, frozen.auxiliary(next_z, bound))
            defect = defect if change is None else change
        stalled = not done and stagnation(defect)
        if done or stalled:
            return RelaxationResult(increment, multipliers, next_z - r_u, iteration, stalled)
        z = next_z
        if accelerated:
            if accelerator is None:
                accelerator = frozen.accelerator(options.depth, stress_unit, bound)
            solved = (stress + r_u).ravel()
            z = accelerator.next(stress.ravel(), solved, next_z.ravel()).reshape(z.shape)
    return RelaxationResult(increment, multipliers, z - r_u, options.max_inner)
