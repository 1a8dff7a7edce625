"""Slacks and multipliers of an interior-point method, with the scaling of Nesterov and Todd.

Pressures and gaps are in half lines, friction and slip in second-order (Lorentz) cones: with the
slip a, its length t >= |a|, the friction force q and its bound h >= |q|, the pairs (t, a) and
(h, -q) are both in the cone, and orthogonal to each other exactly where Tresca's law is met. In
2-D that cone is a quarter plane, and the method is the one for bounds on single variables.

Near the boundary x_0 - |x_1| has no digits left. Vectors are therefore handled in a frame along the
direction e of the slip: x_0 - e.x_1, x_0 + e.x_1 and the rest of x_1 across e, shape (k, 2 + t),
in which the scaling is diagonal; and determinants x_0^2 - |x_1|^2 are carried along.

References
----------
Nesterov and Todd, Primal-dual interior-point methods for self-scaled cones, SIAM J. Optim. 8
(1998); Vandenberghe, The CVXOPT linear and quadratic cone program solvers (2010), sections 4-5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mpi4py import MPI

from contact.interface.nodes import unit_vectors
from contact.tolerances import HUGE
from contact.typing import Array


def dot(x: Array, y: Array) -> Array:
    """Return the inner products of rows, shape (k,)."""
    return np.einsum("ki,ki->k", x, y)


def _product(x: Array, y: Array) -> Array:
    """Return Jordan's products (x.y, x_0 y_1 + y_0 x_1), in the frame."""
    ends = x[:, :2] * y[:, :2] + dot(x[:, 2:], y[:, 2:])[:, None]
    return np.hstack([ends, _lead(x) * y[:, 2:] + _lead(y) * x[:, 2:]])


def _lead(x: Array) -> Array:
    """Return x_0 of vectors in the frame, shape (k, 1)."""
    return (x[:, :1] + x[:, 1:2]) / 2


def _mixed(x: Array, y: Array) -> Array:
    """Return x_0 y_0 - x_1 . y_1 in the frame."""
    return (x[:, 0] * y[:, 1] + x[:, 1] * y[:, 0]) / 2 - dot(x[:, 2:], y[:, 2:])


@dataclass
class ConeStep:
    """A search direction.

    Attributes
    ----------
    slack, force
        Changes in the half lines, shape (n,).
    slip, friction
        Changes of (t, a) and (h, -q) in the frame, shape (k, 2 + t).
    tails
        Changes of a and -q, shapes (k, t).
    """

    slack: Array
    force: Array
    slip: Array
    friction: Array
    tails: tuple[Array, Array]


class Cones:
    """Slacks and multipliers strictly inside their cones, those of this rank.

    Parameters
    ----------
    slack, force
        Open gaps and contact forces, shape (n,), positive.
    length, slip
        t and a, shapes (k,) and (k, t), t > |a|.
    bound, friction
        h and -q, shapes (k,) and (k, t), h > |q|.
    comm
        Communicator of the cones.
    """

    def __init__(
        self,
        slack: Array,
        force: Array,
        length: Array,
        slip: Array,
        bound: Array,
        friction: Array,
        comm: MPI.Intracomm = MPI.COMM_SELF,
    ) -> None:
        self._comm = comm
        self.slack, self.force = slack, force
        self.length, self.slip, self.bound, self.friction = length, slip, bound, friction
        self._dets = [_determinant(length, slip), _determinant(bound, friction)]

    @property
    def degree(self) -> int:
        """Number of cones."""
        return int(self._comm.allreduce(self.slack.size + self.length.size))

    def interior(self) -> bool:
        """Tell whether all vectors are inside their cones, and finite. Collective."""
        depths = np.concatenate([self.slack, self.force, *self._dets])
        inside = bool(np.all((depths > 1 / HUGE) & (depths < HUGE)))  # NaN is not
        return bool(self._comm.allreduce(inside, op=MPI.LAND))

    def duality_gap(self) -> float:
        """Return the sum of slacks times multipliers. Collective."""
        discs = float(self.length @ self.bound + np.sum(self.slip * self.friction))
        return float(self._comm.allreduce(self.slack @ self.force + max(discs, 0.0)))

    def duality_gap_after(self, step: ConeStep, part: float) -> float:
        """Return the duality gap after part of a step. Collective."""
        slack, force = self.slack + part * step.slack, self.force + part * step.force
        relative = [self._lambda + part * move for move in self._scaled(step)]
        discs = (relative[0][:, :2] * relative[1][:, :2]).sum() / 2
        discs += (relative[0][:, 2:] * relative[1][:, 2:]).sum()
        return float(self._comm.allreduce(slack @ force + discs))

    def scale(self) -> None:
        """Compute the scaling W with W friction = W^-1 slip = lambda, and its frame."""
        roots = [np.sqrt(det) for det in self._dets]
        s1, z1 = self.slip / roots[0][:, None], self.friction / roots[1][:, None]
        a, b = np.linalg.norm(s1, axis=1), np.linalg.norm(z1, axis=1)
        s0, z0 = np.hypot(1.0, a), np.hypot(1.0, b)
        # s.z >= 1 without cancellation
        ratio, aside = (s0 + a) / (z0 + b), unit_vectors(s1) + unit_vectors(z1)
        inner = (ratio + 1 / ratio) / 2 + a * b * dot(aside, aside) / 2
        inner = np.where(a * b > 0, inner, s0 * z0)
        gamma = np.sqrt((1 + inner) / 2)
        w = (s1 - z1) / (2 * gamma[:, None])
        size = np.linalg.norm(w, axis=1)
        self._axis = unit_vectors(w)
        self._axis[size == 0, :1] = 1.0
        self._boost = np.sqrt(1 + size**2) + size
        self._first = 1 + 2 * size**2
        self._scale = np.sqrt(roots[0] / roots[1])
        self._factor = np.ones((w.shape[0], 2 + w.shape[1])) * self._scale[:, None]
        self._factor[:, 0] /= self._boost
        self._factor[:, 1] *= self._boost
        self._multiplier = self._framed(self.bound, self.friction, self._dets[1])
        self._lambda = self._factor * self._multiplier
        self._size = np.sqrt(roots[0] * roots[1])  # root of the determinant of lambda

    def stiffness(self) -> tuple[Array, Array]:
        """Return the nodal stiffness: force/slack, (n,), and W^-2 with t eliminated, (k, t, t)."""
        e = self._axis
        outer = e[:, :, None] * e[:, None, :] * (1 - 1 / self._first)[:, None, None]
        blocks = (np.eye(e.shape[1]) - outer) / (self._scale**2)[:, None, None]
        return self.force / self.slack, blocks

    def affine_target(self) -> tuple[Array, Array]:
        """Return k in d(multiplier) = k - W^-2 d(slack) of the predictor, (n,) and in the frame."""
        return -self.force, -self._multiplier

    def target(self, affine: ConeStep, centre: float) -> tuple[Array, Array]:
        """Return k with Mehrotra's correction, to slack times multiplier = centre."""
        force = -self.force + (centre - affine.slack * affine.force) / self.slack
        cross = -_product(*self._scaled(affine))
        cross[:, :2] += centre
        # lambda o y = cross
        a = self._lambda
        lead = (_mixed(a, cross) / self._size**2)[:, None]
        difference = (cross[:, 1:2] - cross[:, :1] - lead * (a[:, 1:2] - a[:, :1])) / 2
        along, across = difference / _lead(a), (cross[:, 2:] - lead * a[:, 2:]) / _lead(a)
        divided = np.hstack([lead - along, lead + along, across])
        return force, -self._multiplier + divided / self._factor

    def reduced(self, constants: tuple[Array, Array]) -> tuple[Array, Array]:
        """Return the constants with t eliminated, (n,) and (k, t)."""
        force, k = constants
        return force, k[:, 2:] + self._along(k)[:, None] * self._axis

    def complete(self, constants: tuple[Array, Array], slack: Array, slip: Array) -> ConeStep:
        """Return the step for the constants k, and changes of gaps (n,) and slips a (k, t)."""
        force, k = constants
        along = dot(self._axis, slip)
        across = slip - along[:, None] * self._axis
        # t - e.a and t + e.a without cancellation
        lead = self._scale**2 * _lead(k)[:, 0]
        minus = (lead - along / self._boost**2) / self._first
        plus = (lead + along * self._boost**2) / self._first
        rise = self._along(k) - along / (self._scale**2 * self._first)
        rest = k[:, 2:] - across / (self._scale**2)[:, None]
        return ConeStep(
            slack,
            force - self.force / self.slack * slack,
            np.column_stack([minus, plus, across]),
            np.column_stack([-rise, rise, rest]),
            (slip, rest + rise[:, None] * self._axis),
        )

    def to_boundary(self, step: ConeStep) -> float:
        """Return the part of a step to the boundary of a cone; 0 for NaN. Collective."""
        rates = [-step.slack / self.slack, -step.force / self.force]
        for lead, size in self._relative(step):
            rates.append(size - lead)
        fastest = float(np.max(np.concatenate(rates), initial=0.0))
        fastest = np.inf if np.isnan(fastest) else fastest
        fastest = self._comm.allreduce(fastest, op=MPI.MAX)
        return 1 / fastest if fastest > 0 else np.inf

    def move(self, step: ConeStep, part: float) -> None:
        """Take part of a step."""
        for i, (lead, size) in enumerate(self._relative(step)):
            factor = (1 + part * (lead - size)) * (1 + part * (lead + size))
            self._dets[i] = self._dets[i] * factor
        self.slack = self.slack + part * step.slack
        self.force = self.force + part * step.force
        self.slip = self.slip + part * step.tails[0]
        self.length = np.sqrt(self._dets[0] + dot(self.slip, self.slip))
        self.friction = self.friction + part * step.tails[1]

    def _framed(self, lead: Array, tail: Array, det: Array) -> Array:
        """Return vectors x_0, x_1 in the frame, given their determinants."""
        along = dot(self._axis, tail)
        across = tail - along[:, None] * self._axis
        large = lead + np.abs(along)
        small = (det + dot(across, across)) / large
        up = along > 0
        return np.column_stack([np.where(up, small, large), np.where(up, large, small), across])

    def _along(self, k: Array) -> Array:
        """Return e.k_1 + (2 w_0 |w_1| / (1 + 2 |w_1|^2)) k_0, without cancellation."""
        return k[:, 1] - _lead(k)[:, 0] / (self._boost**2 * self._first)

    def _scaled(self, step: ConeStep) -> tuple[Array, Array]:
        """Return W^-1 d(slip) and W d(friction)."""
        return step.slip / self._factor, step.friction * self._factor

    def _relative(self, step: ConeStep) -> list[tuple[Array, Array]]:
        """Return x_0 and |x_1| of both directions, in the frame in which lambda is (1, 0)."""
        unit, found = self._lambda / self._size[:, None], []
        for moved in self._scaled(step):
            lead = _mixed(unit, moved)
            part = (lead + _lead(moved)[:, 0]) / (_lead(unit)[:, 0] + 1)
            rest = moved - part[:, None] * unit
            size = np.hypot((rest[:, 1] - rest[:, 0]) / 2, np.linalg.norm(rest[:, 2:], axis=1))
            found.append((lead / self._size, size / self._size))
        return found


def _determinant(lead: Array, tail: Array) -> Array:
    """Return x_0^2 - |x_1|^2."""
    size = np.linalg.norm(tail, axis=1)
    return (lead - size) * (lead + size)
