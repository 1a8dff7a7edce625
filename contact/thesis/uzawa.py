"""Uzawa block relaxation for one linearised problem: Algorithms 2, 5, 7 and 9.

One step solves for u, projects the auxiliary variables phi and updates the multipliers lambda,
(3.34)-(3.36): the alternating direction method of multipliers. It is a fixed-point map of
lambda + r u: its projection is the next multiplier, the remainder r phi. The variable is
z = lambda + r (u - u_0), with u_0 of the outer iterate, against rounding of a small lambda beside a
large slip.

It is accelerated by nonlinear GMRES over all solves so far. Affine combinations of forces and
displacements in equilibrium are in equilibrium: only complementarity is nonlinear. The combination
of least defect of complementarity costs no linear solve, and is the next iterate. With the right
active set this is GMRES.

References
----------
Glowinski and Le Tallec, Augmented Lagrangian and Operator-Splitting Methods in Nonlinear Mechanics,
SIAM (1989), their ALG2; also known as ADMM.
Koko, Uzawa block relaxation domain decomposition method for a two-body frictionless contact
problem, Appl. Math. Lett. 22 (2009) 1534.
"""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass

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
from contact.tolerances import ROUNDING
from contact.typing import Array

#: Trial lengths: of a Gauss-Newton step, between two points, beyond the last one.
DAMPED = 0.5 ** np.arange(5)
BETWEEN = np.linspace(0, 1, 5)
BEYOND = 2.0 ** np.arange(1, 21)

#: Most Gauss-Newton steps of a search.
SWEEPS = 20


class ResidualMinimiser:
    """Nonlinear GMRES for lambda = P(z), z = lambda + r u, with u affine in lambda.

    Points are pairs (lambda, z), arrays of shape (2, m) with m values on this rank.

    Parameters
    ----------
    inner
        Global inner products: maps two matrices (m, k) and (m, l) of local values to the
        (k, l) matrix of sums over all ranks.
    project
        P: the projections of z, the next contact forces, shape (..., m).
    derivative
        Maps z and directions, shape (m, k), to the directional derivatives of P, (m, k).
    depth
        Number of directions kept.

    References
    ----------
    Washio and Oosterlee, Krylov subspace acceleration for nonlinear multigrid schemes,
    Electron. Trans. Numer. Anal. 6 (1997); Walker and Ni, Anderson acceleration for
    fixed-point iterations, SIAM J. Numer. Anal. 49 (2011).
    """

    def __init__(
        self,
        inner: Callable[[Array, Array], Array],
        project: Callable[[Array], Array],
        derivative: Callable[[Array, Array], Array],
        depth: int,
    ) -> None:
        self._inner, self._project, self._derivative = inner, project, derivative
        self._directions: deque[Array] = deque(maxlen=depth)
        self._best: Array | None = None

    def next(self, force: Array, z: Array, image: Array) -> Array:
        """Return the next z. Collective.

        Parameters
        ----------
        force, z
            The last lambda and lambda + r u, shape (m,).
        image
            The next z of the plain relaxation.
        """
        new, old = np.stack([force, z]), self._best
        if old is None:
            self._best = new
            return z
        self._append(new - old)
        # Without contact there is no slope: try points in between.
        starts = [old + t * (new - old) for t in BETWEEN]
        norms = self._defect_norms(starts)
        first = int(np.argmin(norms))
        point, norm = self._descend(starts[first], float(norms[first]))
        if norm < (1 - 1e-9) * norms[0]:
            self._best = point
            return point[1]
        beyond = self._beyond(old, new)
        if beyond is not None:
            self._best = beyond
            return beyond[1]
        # No descent: a plain step, which contracts.
        self._directions.clear()
        self._best = new
        return image

    def _defect(self, point: Array) -> Array:
        return point[0] - self._project(point[1])

    def _defect_norms(self, points: Sequence[Array]) -> Array:
        """Return the norms of lambda - P(z) at several points."""
        defects = self._defect(np.stack(points, axis=1)).T
        return np.sqrt(np.maximum(np.diag(self._inner(defects, defects)), 0.0))

    def _append(self, direction: Array) -> None:
        """Add a direction, orthonormal in z to the others, unless it depends on them."""
        length = self._norm(direction)
        for _ in range(2):  # twice is enough, in spite of cancellation
            if self._directions:
                basis = np.stack(self._directions, axis=-1)
                direction = direction - basis @ self._inner(basis[1], direction[1][:, None])[:, 0]
        rest = self._norm(direction)
        if rest > 1e-10 * length:
            self._directions.append(direction * (1 / rest))

    def _norm(self, direction: Array) -> float:
        column = direction[1][:, None]
        return float(np.sqrt(self._inner(column, column)[0, 0]))

    def _descend(self, point: Array, norm: float) -> tuple[Array, float]:
        """Minimise the residual over the directions by damped Gauss-Newton steps."""
        if not self._directions:
            return point, norm
        basis = np.stack(self._directions, axis=-1)
        for _ in range(SWEEPS):
            slopes = basis[0] - self._derivative(point[1], basis[1])
            load = self._inner(slopes, self._defect(point)[:, None])[:, 0]
            step = -basis @ least_squares(self._inner(slopes, slopes), load)
            trials = [point + t * step for t in DAMPED]
            norms = self._defect_norms(trials)
            k = int(np.argmin(norms))
            if not norms[k] < (1 - 1e-6) * norm:
                break
            point, norm, old = trials[k], float(norms[k]), norm
            if norm > 0.99 * old:
                break
        return point, norm

    def _beyond(self, old: Array, new: Array) -> Array | None:
        """Extend a step without change of the forces until they change; else None.

        A body that contact alone constrains moves freely until it touches.
        """
        before, after = self._defect(old), self._defect(new)
        changes = np.column_stack([after - before, after])
        change, norm = np.sqrt(np.maximum(np.diag(self._inner(changes, changes)), 0.0))
        if change > 1e-6 * norm:
            return None
        trials = [new, *(new + t * (new - old) for t in BEYOND)]
        norms = self._defect_norms(trials)
        level = (1 + 1e-6) * np.min(norms)
        return trials[int(np.flatnonzero(norms <= level)[-1])]


def least_squares(gram: Array, load: Array) -> Array:
    """Solve the normal equations, without singular values below 1e-6: free motions."""
    values, vectors = np.linalg.eigh(gram)
    kept = values > 1e-12
    return vectors[:, kept] @ ((vectors[:, kept].T @ load) / values[kept])


logger = logging.getLogger("contact.inner")

#: Stagnation limits of the accelerated and of the plain relaxation, which creeps with r far from
#: r*; ratio of residuals that is progress.
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
        blocks[:, :d, :d] += nodes.tangent
    return r * blocks


def split(interface: Interface, nodal: Array, friction: bool) -> Array:
    """Return normal displacement and slip, shape (n, 1 + d); slip 0 without friction."""
    parts = normal_and_tangential(interface.nodes, nodal, friction)
    parts[:, 1:] -= friction * interface.friction.history.jump
    return parts


def normal_and_tangential(nodes: ContactNodes, nodal: Array, friction: bool) -> Array:
    """Return normal and tangential displacement, shape (n, 1 + d); 0 without friction."""
    tangential = friction * nodes.tangential_component(nodal)
    return np.column_stack([nodes.normal_component(nodal), tangential])


@dataclass
class Relaxed:
    """End of a Uzawa block relaxation.

    Attributes
    ----------
    increment
        dx on the owned unknowns.
    forces
        Multipliers in equilibrium with the iterate.
    z
        Variable of the next relaxation, about the new iterate, shape (n, 1 + d).
    iterations
        Number of linear solves.
    stalled
        Whether the stagnation limit has ended it.
    """

    increment: Array
    forces: Multipliers
    z: Array
    iterations: int
    stalled: bool = False


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


@dataclass
class _Projection:
    """Steps 2 and 3, from z, shape (..., n, 1 + d), to the multipliers: (3.43) and the disc.

    Attributes
    ----------
    nodes, gap, r
        The contact nodes, the gap of the constraint, and the augmentation parameter.
    bound
        Friction bound, shape (n,).
    law
        Compliant layer in front of the rigid part, None without one; multipliers are then those of
        the total pressure -sigma_nu.
    origin
        r u_0, shape (n, 1 + d).
    """

    nodes: ContactNodes
    gap: Array
    r: float
    bound: Array
    law: NormalGraph | None
    origin: Array

    def __call__(self, z: Array) -> Array:
        """Return the new multipliers."""
        z = z + self.origin
        if self.law is None:
            pressure = project_half_line(z[..., 0] - self.r * self.gap)
        else:
            # Laws of users take one value per node.
            rows = z[..., 0].reshape(math.prod(z.shape[:-2]), z.shape[-2])
            pressure = np.reshape([self.law.pressure(row, self.r) for row in rows], z.shape[:-1])
        friction = project_disc(z[..., 1:], self.bound)
        return np.concatenate([pressure[..., None], friction], axis=-1)

    def derivative(self, z: Array, directions: Array) -> Array:
        """Return the derivatives of the multipliers along directions, shape (n, 1 + d, k)."""
        z = z + self.origin
        if self.law is None:
            slope = np.where(z[:, 0] > self.r * self.gap, 1.0, 0.0)
        else:
            slope = self.law.pressure_slope(z[:, 0], self.r)
        normal = slope[:, None, None] * directions[:, :1]
        tangential = disc_derivative(z[:, 1:], self.bound, directions[:, 1:])
        return np.concatenate([normal, tangential], axis=1)

    def accelerator(self, depth: int, size: Array) -> ResidualMinimiser:
        """Return the acceleration of the flat z; `size`: unit of stresses, (n,)."""
        nodes, shape = self.nodes, (self.nodes.weight.size, 1 + self.nodes.normal.shape[1])
        weights = np.repeat(nodes.weight / size**2, shape[1])

        def inner(a: Array, b: Array) -> Array:
            return summed(nodes.comm, a.T @ (weights[:, None] * b))

        def project(flat: Array) -> Array:
            return self(flat.reshape(*flat.shape[:-1], *shape)).reshape(flat.shape)

        def derivative(flat: Array, directions: Array) -> Array:
            columns = directions.reshape(*shape, directions.shape[1])
            return self.derivative(flat.reshape(shape), columns).reshape(directions.shape)

        return ResidualMinimiser(inner, project, derivative, depth)


def _residual(problem: ContactProblem, state: State, secant_at: Array, layer: bool) -> Array:
    """Return the owned residual without multipliers and implicit layer. Collective."""
    interface, nodes = problem.interface, problem.interface.nodes
    residual, unknown = residual_forces(problem, state, secant_at), state.forces.vectors(nodes)
    if layer:
        pressure = interface.foundation.pressure(nodes.apply(state.x))
        unknown += pressure[:, None] * nodes.normal
    nodes.transpose(-nodes.weight[:, None] * unknown, residual)
    return residual


def uzawa_block_relaxation(
    problem: ContactProblem,
    state: State,
    operator: Operator,
    bound: Array,
    friction: bool,
    secant_at: Array,
    z: Array,
    r: float,
    options: FixedPointOptions,
    domain_norm: Callable[[Array], float] | None,
    poll: Callable[[], None],
) -> Relaxed:
    """Iterate Steps 1 to 3 of Algorithm 2 (5, 7, 9) on one frozen problem. Collective.

    Parameters
    ----------
    problem, state
        The problem, and the iterate at which it is frozen.
    operator
        Factorised operator with `augmentation(nodes, r, friction)`.
    bound
        Friction bound s_n, shape (n,).
    friction
        Whether there is friction.
    secant_at
        Unknowns of the secant modulus.
    z
        Initial lambda + r (u - u_0), shape (n, 1 + d), with u_0 of the iterate.
    r, options
        Augmentation parameter (stress/length), and the options.
    domain_norm
        L2(Omega) norm of owned unknowns, for the thesis's criterion (3.45); None for residuals.
    poll
        Called before each iteration, on all ranks.
    """
    interface, nodes = problem.interface, problem.interface.nodes
    at, own = nodes.apply(state.x), problem.equilibrium.owned_part(state.x)
    law = interface.foundation.normal_graph(at)
    constant = -_residual(problem, state, secant_at, law is not None)
    origin = r * split(interface, at, friction)
    project = _Projection(nodes, interface.gap, r, bound, law, origin)
    accelerated, over = options.acceleration == "anderson", options.relaxation
    accelerator: ResidualMinimiser | None = None
    stress_unit: Array = np.ones_like(nodes.weight)
    last: tuple[Array, Array] | None = None
    rtol = max(SHARE * options.inner, ROUNDING)
    increment: Array = np.zeros(own.size)
    stagnation = Stagnation(STAGNATION_LIMIT if accelerated else STAGNATION_LIMIT_PLAIN, PROGRESS)
    for iteration in range(1, options.max_inner + 1):
        poll()
        # Tangential again: rounding along the normal would be amplified by the acceleration.
        z[:, 1:] = nodes.tangential_component(z[:, 1:])
        multiplier = project(z)
        q = 2 * multiplier - z
        rhs = constant.copy()
        vectors = q[:, :1] * nodes.normal + q[:, 1:]
        nodes.transpose(-nodes.weight[:, None] * vectors, rhs)
        increment = operator.solve(rhs, rtol if rtol < TOLERANCE else None, increment)
        moved = nodes.apply(increment)
        nodal = at + moved
        augmented_jump = r * normal_and_tangential(nodes, moved, friction)
        # q + r (u - u_0) is the contact force of this solve.
        total = q + augmented_jump
        if iteration == 1:
            stress_unit = interface.component_norms(total)
        layer = 0.0 if law is None else law.layer(nodes.normal_component(nodal))
        forces = Multipliers.of(nodes, total[:, 0] - layer, total[:, 1:])
        if options.single_loop and friction:
            project.bound = interface.bound(nodal, forces)
        residual = float(interface_residuals(interface, nodal, forces, project.bound)[0].max())
        logger.debug("inner iteration %d: residual %.2e", iteration, residual)
        image = multiplier + (1 - over) * (z - multiplier) + over * augmented_jump
        done = residual <= options.inner or not np.isfinite(residual)
        # The residual is small before contact, the defect of the fixed point is not.
        defect = nodes.norm((total - project(total + augmented_jump)) / stress_unit[:, None])
        if domain_norm is not None:
            phi: Array = (image + origin - project(image)) * (1 / r)
            before, done = last, False
            last = increment, phi
            if before is not None:
                change = domain_norm(increment - before[0]) ** 2 + nodes.norm(phi - before[1]) ** 2
                size = domain_norm(own + increment) ** 2 + nodes.norm(phi) ** 2
                done = change < options.eps**2 * size
                defect = float(np.sqrt(change / size)) if size > 0 else 0.0
        stalled = not done and stagnation(defect)
        if done or stalled:
            return Relaxed(increment, forces, image - augmented_jump, iteration, stalled)
        z = image
        if accelerated:
            if accelerator is None:
                accelerator = project.accelerator(options.depth, stress_unit)
            newest = (total + augmented_jump).ravel()
            z = accelerator.next(total.ravel(), newest, image.ravel()).reshape(z.shape)
    return Relaxed(increment, forces, z - augmented_jump, options.max_inner)
