"""Primal-dual interior-point method, a fallback of Newton's, on whole and condensed bodies.

Frictionless contact and Tresca's friction are convex. The linear systems of an interior point are
those of a Newton step with other nodal blocks: along the normal, force over slack in place of
gamma. So it runs on whole bodies and condensed ones alike, on any number of ranks. Its steps are
Mehrotra's predictor and corrector with the scaling of Nesterov and Todd (`Cones`), both with one
matrix; docs/algorithms.md has all of the method, with Newton's last steps and the updates of the
friction bound.

Pressures and gaps are in half lines, friction and slip in second-order (Lorentz) cones: with the
slip a, its length t >= |a|, the friction force q and its bound h >= |q|, the pairs (t, a) and
(h, -q) are both in the cone, and orthogonal to each other exactly where Tresca's law is met. In
2-D that cone is a quarter plane, and the method is the one for bounds on single variables. Near the
boundary x_0 - |x_1| has no digits left. Vectors are therefore handled in a frame along the
direction e of the slip: x_0 - e.x_1, x_0 + e.x_1 and the rest of x_1 across e, shape (k, 2 + t),
in which the scaling is diagonal; and determinants x_0^2 - |x_1|^2 are carried along.

References
----------
Nesterov and Todd, Primal-dual interior-point methods for self-scaled cones, SIAM J. Optim. 8
(1998); Vandenberghe, The CVXOPT linear and quadratic cone program solvers (2010), sections 4-5.
Mehrotra, On the implementation of a primal-dual interior point method, SIAM J. Optim. 2 (1992).
Haslinger, Approximation of the Signorini problem with friction, obeying the Coulomb law, Math.
Methods Appl. Sci. 5 (1983).
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from mpi4py import MPI

from contact.errors import InputError, SingularError
from contact.interface.multipliers import Multipliers
from contact.interface.nodes import unit_vectors
from contact.methods.report import PROGRESS, Outcome
from contact.methods.semismooth import SemismoothNewton
from contact.methods.unconstrained_modes import all_loads
from contact.problem.residuals import evaluate, evaluate_state, residual_forces
from contact.problem.state import State
from contact.ranks import summed
from contact.tolerances import EPS, HUGE
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
    """A search direction: the changes of the variables in `Cones`."""

    slack: Array  #: in the half lines, (n,)
    force: Array  #: in the half lines, (n,)
    slip: Array  #: of (t, a), in the frame, (k, 2 + t)
    friction: Array  #: of (h, -q), in the frame, (k, 2 + t)
    tails: tuple[Array, Array]  #: of a and -q, (k, t)


class Cones:
    """Slacks and multipliers strictly inside their cones, those of this rank.

    In the half lines, open gaps `slack` and contact forces `force`, shape (n,), positive. In the
    second-order cones, (t, a) = (`length`, `slip`) with t > |a|, and (h, -q) = (`bound`,
    `friction`) with h > |q|, shapes (k,) and (k, t).
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
        unit, pairs = self._lambda / self._size[:, None], []
        for moved in self._scaled(step):
            lead = _mixed(unit, moved)
            part = (lead + _lead(moved)[:, 0]) / (_lead(unit)[:, 0] + 1)
            rest = moved - part[:, None] * unit
            size = np.hypot((rest[:, 1] - rest[:, 0]) / 2, np.linalg.norm(rest[:, 2:], axis=1))
            pairs.append((lead / self._size, size / self._size))
        return pairs


def _determinant(lead: Array, tail: Array) -> Array:
    """Return x_0^2 - |x_1|^2."""
    size = np.linalg.norm(tail, axis=1)
    return (lead - size) * (lead + size)


#: Note of the steps in the history.
INTERIOR_POINT = "interior point"

#: Reason of an end whose next convex problem has no solution.
OVERLOADED = "the friction of the pressures that were found does not balance the loads"

#: Most steps of a convex problem, and most friction bounds (Haslinger's iterations).
LIMIT, UPDATES = 60, 8

#: Ratio of the duality gap to the work of loads and contact below which the active set is known.
#: Below its square the iteration ends whatever the residual of equilibrium is.
CLOSED = 1e-10

#: Forcing term of inexact Newton, and residual of equilibrium that suffices at the end: with a
#: hundredth of it there are as many steps, and a third to a half more iterations.
FORCING = 1e-4

#: Slack times force of each node at the start, over the work of the loads in the penetration of
#: the displacement without contact.
SHARE = 1e-4

#: The same over the work of the loads in the mean gap, where the supports do not constrain all
#: rigid-body modes.
SHARE_UNSUPPORTED = 0.1

#: Least and largest step, over that to the boundary of the cones.
SHORTEST, LONGEST = 0.9, 0.999


def interior_point(
    semismooth: SemismoothNewton, begin: State | None = None, steps: int | None = None
) -> tuple[State, Outcome]:
    """Solve by the interior point, Newton's last steps and updates of the bound. Collective.

    `begin` is a state without contact, whose gaps are the first slacks; None where contact has to
    constrain a rigid-body mode or the potential. At most as many `steps`, those left by default.
    """
    problem, modes, interface = semismooth.problem, semismooth.modes, semismooth.problem.interface
    last_step = len(semismooth.recorder.records) + (
        semismooth.steps_left if steps is None else steps
    )

    def steps_left() -> int:
        return last_step - len(semismooth.recorder.records)

    bound: Array = np.zeros(interface.nodes.weight.size)
    aside: tuple[State, Outcome] | None = None
    best = 1.0
    for _ in range(UPDATES):
        method = InteriorPoint(semismooth, bound, begin)
        outcome, state = method.iterate(min(LIMIT, steps_left())), method.state
        last = state
        if not outcome.converged and steps_left() > 0:
            # Another bound may constrain a body whose matrix is singular.
            with suppress(SingularError):
                last, outcome = semismooth.iterate(
                    semismooth.started(state), note=INTERIOR_POINT, steps=steps_left()
                )
        if outcome.converged and modes.unconstrained_at(problem, last):
            aside = last, outcome
        elif outcome.converged or not interface.friction.acts:
            return last, outcome
        if steps_left() <= 0:
            break
        # Pressures of Newton's last steps if these have made progress, else of the interior point.
        if aside is None and outcome.residuals.significant < PROGRESS * best:
            state = last
        best = min(best, outcome.residuals.significant)
        jump = interface.nodes.jump(state.x)
        bound = interface.bound(jump, state.multipliers)
        # With all nodes open the next bound is zero, and the solution the same.
        if aside is not None and interface.nodes.maximum(bound) <= interface.rounding_stress(jump):
            break
        # Pressures in a nonlinear body may be far from the loads, as beyond its limit load.
        pressure = interface.pressure(jump, state.multipliers)
        if problem.body.linear and modes.overloaded(bound, pressure):
            outcome = replace(outcome, residuals=evaluate(problem, state))
            last, outcome = state, replace(outcome, ended=OVERLOADED, overloaded=True)
            break
    return aside or (last, outcome)


class InteriorPoint:
    """The interior-point method for a friction bound (n,) (Tresca), on the operator of Newton's.

    `begin` is a state whose gaps are the first slacks; None for none.
    """

    def __init__(self, semismooth: SemismoothNewton, bound: Array, begin: State | None) -> None:
        problem = semismooth.problem
        self.problem, self._semismooth, self._step = problem, semismooth, semismooth.step
        interface = problem.interface
        nodes, self._state = interface.nodes, problem.start()
        # A layer without a rigid part bears friction too, without a unilateral constraint.
        self._rigid = np.isfinite(interface.gap)
        total, limit = all_loads(problem), nodes.weight * bound
        count = max(nodes.size, 1)
        self._frictional = limit > EPS * max(nodes.maximum(limit), total / count)
        jump = nodes.jump(self._state.x)
        moved = np.zeros_like(jump) if begin is None else nodes.jump(begin.x) - jump
        normal_gap = interface.normal_gap(jump + moved)[self._rigid]
        gap = interface.gap[self._rigid]
        scales = problem.scales
        block = scales.plane_modulus * scales.area / scales.height
        if begin is not None:
            way = nodes.maximum(np.abs(moved[:, : nodes.dim]).max(axis=1, initial=0.0))
            # Without loads the stiffness is that of a block; without penetration any work will do.
            far = nodes.maximum(-normal_gap) or SHARE * (way or interface.size)
            least = np.sqrt(SHARE) * far
            work = (total / way if total > 0 and way > 0 else block) * least**2
        else:
            total = total or block * nodes.maximum(np.abs(normal_gap))
            least = float(summed(nodes.comm, np.maximum(gap, 0.0).sum())) / count + total / block
            work = SHARE_UNSUPPORTED * total * least / count
        # Where the body lifts off without contact, the first slack is the normal gap.
        slack = np.maximum(np.maximum(gap, normal_gap), least)
        frictional = self._frictional
        slips, limit = interface.slip_length(jump + moved)[frictional], limit[frictional]
        zeros = np.zeros((limit.size, nodes.dim))
        length = np.maximum(work / limit, slips)
        self.cones = Cones(slack, work / slack, length, zeros, limit, zeros, nodes.comm)
        #: Least reference of the duality gap, where no work is done: all nodes stick.
        self._least_work = CLOSED * self.cones.duality_gap() if begin is None else 0.0

    def iterate(self, most: int = LIMIT) -> Outcome:
        """Take steps until the duality gap is closed, or as many as given. Collective."""
        semismooth = self._semismooth
        self._evaluated = evaluate_state(self.problem, self.state)
        ended = "the interior point was given no step"
        for steps in range(1, most + 1):
            try:
                taken = self.step()
            except InputError as error:
                # Near the solution the matrices are singular to rounding.
                if error.identifier == "memory":
                    raise
                taken = False
            self._evaluated = evaluate_state(self.problem, self.state)
            state, residuals = self._evaluated.state, self._evaluated.residuals
            semismooth.see(state, residuals)
            semismooth.recorder.record(residuals, INTERIOR_POINT, 2)
            ended = f"the interior point has not converged in {steps} steps"
            if not taken or not np.isfinite(residuals.significant):
                ended = f"rounding ends the interior point after {steps} steps"
                break
            interface = self.problem.interface
            jump = interface.nodes.jump(state.x)
            pressure = interface.nodes.maximum(interface.pressure(jump, state.multipliers))
            if pressure <= interface.rounding_stress(jump):
                ended = f"nothing presses after {steps} steps"
                break
            gap = self.relative_gap()
            balanced = residuals.equilibrium <= max(FORCING, residuals.floors[0])
            if gap <= CLOSED and (balanced or 0 < gap <= CLOSED**2):
                ended = f"duality gap closed after {steps} steps"
                break
        return Outcome(self._evaluated.residuals, semismooth.options.allowed, ended)

    @property
    def state(self) -> State:
        """The iterate."""
        cones, nodes = self.cones, self.problem.interface.nodes
        contact, friction = np.zeros(nodes.weight.size), np.zeros(nodes.normal.shape)
        contact[self._rigid] = cones.force / nodes.weight[self._rigid]
        friction[self._frictional] = -cones.friction / nodes.weight[self._frictional, None]
        return replace(self._state, multipliers=Multipliers.of(nodes, contact, friction))

    def relative_gap(self) -> float:
        """Return the duality gap over the work of loads and contact. Collective."""
        body, interface, x = self.problem.body, self.problem.interface, self._state.x
        nodes, cones, jump = interface.nodes, self.cones, interface.nodes.jump(x)
        ways = np.abs(interface.gap) + np.abs(nodes.normal_component(jump))
        slips = interface.slip_length(jump)[self._frictional]
        contact = float(summed(nodes.comm, cones.force @ ways[self._rigid] + cones.bound @ slips))
        nodal = body.owned_part(x)[: body.owned]
        forces = self._evaluated.internal, body.external(self._state.time)
        works = [abs(float(summed(nodes.comm, nodal @ force[: body.owned]))) for force in forces]
        return cones.duality_gap() / (max(contact + sum(works), self._least_work) or 1.0)

    @np.errstate(over="ignore", invalid="ignore")  # such a step is not taken
    def step(self) -> bool:
        """Take a step by Mehrotra's predictor and corrector; False at rounding. Collective."""
        cones, interface, state = self.cones, self.problem.interface, self.state
        if not cones.interior():
            return False
        nodes, rigid, frictional = interface.nodes, self._rigid, self._frictional
        body, d = self.problem.body, nodes.dim
        jump = nodes.jump(state.x)
        residual = -residual_forces(self.problem, state, internal=self._evaluated.internal)
        slack = interface.normal_gap(jump)[rigid] - cones.slack
        slip = interface.slip(jump)[frictional] - cones.slip
        cones.scale()
        stiff, across = cones.stiffness()
        blocks = np.zeros((nodes.nodes.size, nodes.block_size, nodes.block_size))
        normal, tangent = nodes.normal[rigid], nodes.tangential_projector[frictional]
        blocks[rigid, :d, :d] = (stiff[:, None] * normal)[:, :, None] * normal[:, None, :]
        blocks[frictional, :d, :d] += tangent @ across @ tangent
        self._step.assemble_secant(self.problem, state, blocks / nodes.weight[:, None, None])

        def solve(constants: tuple[Array, Array]) -> tuple[Array, ConeStep]:
            force, friction = cones.reduced(constants)
            at_nodes = np.zeros((nodes.nodes.size, d))
            at_nodes[rigid] = -(force - stiff * slack)[:, None] * normal
            at_nodes[frictional] += friction - np.einsum("kij,kj->ki", across, slip)
            rhs = residual.copy()
            nodes.add_jump_transposed(at_nodes, rhs)
            dx = self._step.operator.solve(rhs, FORCING)
            moved = nodes.jump(dx)
            closed = slack - nodes.normal_component(moved)[rigid]
            return dx, cones.complete(
                constants, closed, nodes.tangential_component(moved)[frictional] + slip
            )

        now, affine = cones.duality_gap(), solve(cones.affine_target())[1]
        length = min(1.0, cones.to_boundary(affine))
        if length == 0:  # the system is singular to rounding
            return False
        centre = (cones.duality_gap_after(affine, length) / now) ** 3 if now > 0 else 0.0
        centre = max(0.0, centre)
        dx, step = solve(cones.target(affine, centre * now / max(cones.degree, 1)))
        share = min(LONGEST, max(SHORTEST, 1 - centre))
        length = min(1.0, share * cones.to_boundary(step))
        if not (np.isfinite(length) and length > 1e-12):
            return False
        x = body.prescribe(body.updated(state.x, length * dx), state.time)
        self._state = replace(state, x=x)
        cones.move(step, length)
        return True
