"""Primal-dual interior-point steps towards the minimum of a contact problem without units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dpotrs

from contact.methods.convex.cones import Array, Cones, Step, dot
from contact.methods.convex.path import central
from contact.methods.convex.reduced import Reduced, cholesky
from contact.tolerances import EPS

#: Work at the start, over that of closing each gap alone; a body that nothing but contact
#: holds comes from further away.
SHARE, LOOSE = 1e-2, 100.0

#: The same for such a body over gaps, over that of the load along these.
SINKING = 0.1

#: Stiffness against free motions, beside 1 of the nodes: what contact does not hold drifts.
DRIFT = 1e-8


@dataclass(frozen=True)
class Certificate:
    """How far a point is from the minimum at most; all relative.

    Attributes
    ----------
    gap
        Duality gap, that of the forces out of balance included, over the energy.
    penetration
        Largest penetration, over the largest displacement or gap of a node that touches, or how
        far its contact force alone moves a node between others that are held.
    balance
        Largest force out of balance, beyond rounding, over the largest force.
    """

    gap: float
    penetration: float
    balance: float

    @property
    def largest(self) -> float:
        """The largest of the three; infinity if any is not a number."""
        values = (self.gap, self.penetration, self.balance)
        return max(values) if np.all(np.isfinite(values)) else np.inf


@dataclass(frozen=True)
class Point:
    """Displacements x, contact forces r >= 0, (k,), and friction forces |q| <= h, (r, d - 1)."""

    x: Array
    force: Array
    friction: Array

    def scaled(self, length: float, force: float) -> Point:
        """Return the same in other units."""
        return Point(length * self.x, force * self.force, force * self.friction)


class Program:
    """min x'Ax/2 - b'x + sum h_i |a_i|, x_n <= g: all without units.

    Parameters
    ----------
    body
        A, and which unknowns are normals and tangents.
    load, gap, bound
        b, shape (m,); g of the nodes that may touch, (k,); h of those with friction, (r,).
    """

    def __init__(self, body: Reduced, load: Array, gap: Array, bound: Array) -> None:
        self.body, self.load, self.gap, self.bound = body, load, gap, bound
        self.stiffest = float(np.abs(body.matrix).sum(axis=1).max(initial=0.0))
        self.local = 0.5 * float(np.sum(load**2 / np.diag(body.matrix)))

    def slip(self, x: Array) -> Array:
        """Return the tangential displacements, shape (r, d - 1)."""
        return np.append(x, 0.0)[self.body.tangents]

    def contact(self, force: Array, friction: Array) -> Array:
        """Return the forces of contact on all unknowns, shape (m,)."""
        total = np.zeros(self.load.size + 1)
        total[self.body.tangents] = friction
        total[self.body.normals] = force
        return total[:-1]

    def certify(self, point: Point) -> Certificate:
        """Bound the distance of a point from the minimum.

        With forces e out of balance, the dual point of (r, q) is e'A^-1 e/2 below the energy
        that complementarity alone would give.
        """
        x, slack = point.x, self.gap - point.x[self.body.normals]
        slip, internal = self.slip(x), self.body.matrix @ x
        slipping = self.bound * np.linalg.norm(slip, axis=1)
        pushed = point.force @ slack
        lost = self.body.inverse @ self.residual(point, internal)
        gap = abs(pushed) + float(np.sum(np.abs(slipping - dot(point.friction, slip))))
        energy = 0.5 * abs(x @ internal) + abs(self.load @ x) + float(np.sum(slipping))
        energy += float(np.abs(point.force @ self.gap))
        touching = point.force > 0
        pressed = point.force / np.diag(self.body.matrix)[self.body.normals]
        lengths = np.abs(np.concatenate([x, self.gap[touching], pressed]))
        closed = float(lengths.max(initial=0.0))
        noise = 4 * EPS * self.stiffest * float(np.abs(x).max(initial=0.0))
        unbalanced = float(np.abs(self.residual(point, internal)).max(initial=0.0))
        contact = self.contact(point.force, point.friction)
        largest = float(np.abs(np.append(contact, self.load)).max(initial=0.0))
        return Certificate(
            (gap + 0.5 * float(lost @ lost)) / (max(energy, self.local) or 1.0),
            float(np.max(np.maximum(-slack, 0.0), initial=0.0)) / (closed or 1.0),
            max(0.0, unbalanced - noise) / (largest or 1.0),
        )

    def residual(self, point: Point, internal: Array | None = None) -> Array:
        """Return the forces out of balance, b - A x - contact, shape (m,)."""
        internal = self.body.matrix @ point.x if internal is None else internal
        return self.load - internal - self.contact(point.force, point.friction)


class Interior:
    """The iteration for one problem.

    Parameters
    ----------
    program
        The problem.
    """

    def __init__(self, program: Program) -> None:
        self.program, body = program, program.body
        largest = max(program.bound.max(initial=0.0), np.abs(program.load).max(initial=0.0))
        self.rubbing = program.bound > EPS * largest
        self.tangents = body.tangents[self.rubbing]
        rows = np.broadcast_to(
            self.tangents[:, :, None], (*self.tangents.shape, body.tangents.shape[1])
        )
        columns = rows.swapaxes(1, 2)
        self._there = (rows >= 0) & (columns >= 0)
        self._places = rows[self._there], columns[self._there]
        self._start()

    def _start(self) -> None:
        """Begin where slack times force is the same everywhere, whatever the units.

        That work is a share of what closes the gaps one by one, each against the flexibility
        of its own node, or of what slips by the friction alone.
        """
        program, body = self.program, self.program.body
        bound, gap = program.bound[self.rubbing], program.gap
        give = body.flexibility[body.normals]
        aside = np.append(body.flexibility, 0.0)[self.tangents].max(axis=1, initial=0.0)
        free = body.inverse.T @ (body.inverse @ program.load)
        depth = np.maximum(free[body.normals] - gap, 0.0)
        share = LOOSE if body.motions.size else SHARE
        work = share * max(
            float(np.max(depth**2 / give, initial=0.0)),
            float(np.max(bound**2 * aside, initial=0.0)),
        )
        if body.motions.size and gap.size:
            # It sinks until the other gaps are small beside what they were.
            load = float(np.abs(program.load).sum())
            work = max(work, SINKING * load * float(gap.mean()) / gap.size)
        work = max(work, EPS * program.local)
        # Where the body would lift off, the slack is that from the beginning: grown from a small
        # one it would take the force beyond zero at once, and the step would be cut to nothing.
        slack = np.maximum(np.maximum(gap, gap - free[body.normals]), np.sqrt(work * give))
        # Likewise where friction hardly holds what slips.
        slips = np.linalg.norm(np.append(free, 0.0)[self.tangents], axis=1)
        length = np.maximum(work / bound, slips)
        zeros = np.zeros(self.tangents.shape)
        self.x = np.zeros_like(program.load)
        self.cones = Cones(slack, work / slack, length, zeros, bound, zeros)

    @property
    def point(self) -> Point:
        """The iterate."""
        friction = np.zeros(self.program.body.tangents.shape)
        friction[self.rubbing] = -self.cones.friction
        return Point(self.x, self.cones.force, friction)

    def step(self) -> bool:
        """Take a step; False if rounding lets no more be taken."""
        cones, body = self.cones, self.program.body
        residual = self.program.residual(self.point)
        slack = self.program.gap - self.x[body.normals] - cones.slack
        slip = np.append(self.x, 0.0)[self.tangents] - cones.slip
        cones.scale()
        self._stiff, self._blocks = cones.stiffness()
        matrix = np.array(body.matrix, order="F")
        if body.motions.size:
            matrix += DRIFT * body.motions @ body.motions.T
        matrix[body.normals, body.normals] += self._stiff
        matrix[self._places] += self._blocks[self._there]
        factor = cholesky(matrix)
        if factor is None:
            return False

        def solve(constants: tuple[Array, Array]) -> tuple[Array, Step]:
            force, friction = cones.reduced(constants)
            rhs = np.append(residual, 0.0)
            rhs[body.normals] -= force - self._stiff * slack
            rhs[self.tangents] += friction - np.einsum("kij,kj->ki", self._blocks, slip)
            dx = dpotrs(factor, rhs[:-1], lower=1)[0]
            moved = np.append(dx, 0.0)
            return dx, cones.complete(
                constants, slack - dx[body.normals], moved[self.tangents] + slip
            )

        dx, step, length = central(cones, solve)
        if not (np.isfinite(dx).all() and length > 1e-12):
            return False
        self.x = self.x + length * dx
        cones.move(step, length)
        self.last = length
        self.direction = dx
        return True
