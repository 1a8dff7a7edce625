"""The fallback of Newton's method: a primal-dual interior point, sparse or dense.

Frictionless contact and Tresca's friction are convex. The linear systems of an interior point are
those of a Newton step with other nodal blocks: force over slack in place of gamma. So it runs on
whole bodies and condensed ones alike, on any number of ranks.

1. The friction bound is zero at first; where friction alone restrains a body, no load exceeds it.
2. A step of the interior point is Mehrotra's predictor and corrector with the scaling of Nesterov
   and Todd, both with one matrix; material, layer and current are linearised anew in each.
3. Where the duality gap is closed the contact zone is known; Newton's method takes the last steps.
4. Where it has not converged, the friction bound is that of the last solution (Haslinger's
   iteration), and the next problem begins at 2.

References
----------
Mehrotra, On the implementation of a primal-dual interior point method, SIAM J. Optim. 2 (1992).
Haslinger, Approximation of the Signorini problem with friction, obeying the Coulomb law, Math.
Methods Appl. Sci. 5 (1983).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from mpi4py import MPI

from contact.errors import InputError
from contact.interface.multipliers import Multipliers
from contact.methods.cones import Array, Cones, Step
from contact.methods.newton_step import Iterate, Iteration, NewtonStep
from contact.methods.progress import PROGRESS
from contact.methods.report import Outcome
from contact.methods.unconstrained_modes import UnconstrainedModes, all_loads
from contact.problem.protocols import Problem
from contact.problem.residuals import evaluate, residual_forces
from contact.problem.state import State
from contact.tolerances import EPS

#: Note of its steps in the history.
INTERIOR_POINT = "interior point"

#: Steps of one convex problem at most, and convex problems with one friction bound after the other.
LIMIT, UPDATES = 60, 8

#: Duality gap over the work of loads and contact, below which the active sets are known. Below its
#: square no solver tells more.
CLOSED = 1e-10

#: Forcing term of inexact Newton: relative residual of an iterative solve. With a hundredth of that
#: there are as many steps, and a third to a half more iterations. As large may the residual of
#: equilibrium be in the end: where an iterative solver leaves more, the slacks vanish beneath its
#: tolerance long before, and Newton's method, whose right-hand sides are residuals, does better.
FORCING = 1e-4

#: Work at the start, over that of the loads in the way that the foundation bars.
SHARE = 1e-2

#: The same for a body with rigid-body modes that contact alone constrains, over the work of the
#: loads in the mean gap.
SHARE_UNSUPPORTED = 0.1

#: Parts of the way to the rim of a cone that a step takes.
SHORTEST, LONGEST = 0.9, 0.999


def interior_point(
    iteration: Iteration,
    whole: NewtonStep,
    modes: UnconstrainedModes,
    finish: Callable[[State], tuple[Iterate, Outcome]],
) -> tuple[Iterate, Outcome]:
    """Solve convex problems with one friction bound after the other. Collective.

    Parameters
    ----------
    iteration
        The problem, its best iterate and the number of steps left.
    whole
        Has the operator of the body, with blocks at its contact nodes.
    modes
        Of the whole problem.
    finish
        Newton's method, from a state on.
    """
    problem, interface = iteration.problem, iteration.problem.interface
    stuck = modes.stuck_bound()
    bound = np.zeros(interface.jump.weight.size) if stuck is None else stuck
    aside: tuple[Iterate, Outcome] | None = None
    best = 1.0
    for _ in range(UPDATES):
        method = InteriorPoint(problem, whole, bound, modes.constrained_by_supports)
        outcome, state = method.run(iteration), method.state
        iterate = Iterate(state)
        if not outcome.converged and iteration.left > 0:
            iterate, outcome = finish(state)
        if outcome.converged and modes.pushed_aside(problem, iterate.state):
            aside = iterate, outcome
        elif outcome.converged or not interface.friction.acts:
            return iterate, outcome
        if iteration.left <= 0:
            break
        # Where Newton's method makes progress its pressures are nearer; else they may come back.
        if aside is None and outcome.kkt.significant < PROGRESS * best:
            state = iterate.state
        best = min(best, outcome.kkt.significant)
        nodal = interface.jump.apply(state.x)
        bound = interface.bound(nodal, state.forces)
        # Where nothing presses, the next problem is solved by the same state.
        if aside is not None and interface.jump.maximum(bound) <= interface.rounding(nodal):
            break
    return aside or (iterate, outcome)


class InteriorPoint:
    """The interior-point method on a body with its contact nodes, for one friction bound.

    Layer and current are linearised anew in each step, like the material.

    Parameters
    ----------
    problem
        The contact problem.
    whole
        Has the operator of the body, with blocks at its contact nodes.
    bound
        Friction bound, shape (n,) (stress).
    held
        Whether supports hold the body: where it would go without contact then says much.
    """

    def __init__(self, problem: Problem, whole: NewtonStep, bound: Array, held: bool) -> None:
        self.problem, self._whole = problem, whole
        interface = problem.interface
        jump, self._state = interface.jump, problem.start()
        self._near = np.isfinite(jump.gap)
        total, limit = all_loads(problem), jump.weight * bound
        count = max(jump.size, 1)
        self._frictional = self._near & (limit > EPS * max(jump.maximum(limit), total / count))
        nodal = jump.apply(self._state.x)
        moved = np.zeros_like(nodal)
        if held:
            moved = jump.apply(whole.without_contact(self._state, FORCING).x) - nodal
        opening = interface.opening(nodal + moved)[self._near]
        gap = jump.gap[self._near]
        scales = problem.scales
        block = scales.plane_modulus * scales.area / scales.height
        if held:
            way = jump.maximum(np.abs(moved[:, : jump.dim]).max(axis=1, initial=0.0))
            # Where no load moves it the body is taken for a block, and where it touches nothing
            # by that, any work will do.
            far = jump.maximum(-opening) or SHARE * (way or interface.size)
            least = np.sqrt(SHARE) * far
            work = (total / way if total > 0 and way > 0 else block) * least**2
        else:
            total = total or block * jump.maximum(np.abs(opening))
            least = self._sum(float(np.maximum(gap, 0.0).sum())) / count + total / block
            work = SHARE_UNSUPPORTED * total * least / count
        # Where the body would lift off, the slack is that from the beginning.
        slack = np.maximum(np.maximum(gap, opening), least)
        frictional = self._frictional
        slips, limit = interface.slip_length(nodal + moved)[frictional], limit[frictional]
        zeros = np.zeros((limit.size, jump.dim))
        length = np.maximum(work / limit, slips)
        self.cones = Cones(slack, work / slack, length, zeros, limit, zeros, jump.comm)

    def run(self, iteration: Iteration) -> Outcome:
        """Go towards the solution, until the duality gap is closed. Collective."""
        kkt, ended = evaluate(self.problem, self.state), "the interior point was given no step"
        for steps in range(1, min(LIMIT, iteration.left) + 1):
            try:
                taken = self.step()
            except InputError:
                self._whole.renew()
                taken = False
            kkt = evaluate(self.problem, self.state)
            iteration.see(Iterate(self.state), kkt)
            iteration.history.record(kkt, INTERIOR_POINT, 2)
            ended = f"the interior point has not converged in {steps} steps"
            if not taken or not np.isfinite(kkt.significant):
                ended = f"rounding ends the interior point after {steps} steps"
                break
            nodal = self.problem.interface.jump.apply(self._state.x)
            pressure = self.problem.interface.jump.maximum(self.state.forces.pressure)
            if pressure <= self.problem.interface.rounding(nodal):
                ended = f"nothing presses after {steps} steps"
                break
            gap = self.gap()
            if gap <= CLOSED and (
                kkt.equilibrium <= max(FORCING, kkt.floors[0]) or gap <= CLOSED**2
            ):
                ended = f"duality gap closed after {steps} steps"
                break
        return Outcome(kkt, iteration.options.allowed, ended)

    def _sum(self, value: float) -> float:
        """Return the sum of the values of all ranks. Collective."""
        return float(self.problem.equilibrium.comm.allreduce(value, op=MPI.SUM))

    @property
    def state(self) -> State:
        """Where the method is."""
        cones, jump = self.cones, self.problem.interface.jump
        pressure, friction = np.zeros(jump.weight.size), np.zeros(jump.normal.shape)
        pressure[self._near] = cones.force / jump.weight[self._near]
        friction[self._frictional] = -cones.friction / jump.weight[self._frictional, None]
        return replace(self._state, forces=Multipliers.of(jump, pressure, friction))

    def gap(self) -> float:
        """Return slacks times forces, over the work of loads and contact. Collective."""
        body, interface, x = self.problem.equilibrium, self.problem.interface, self._state.x
        jump, cones, nodal = interface.jump, self.cones, interface.jump.apply(x)
        ways = np.abs(jump.gap) + np.abs(jump.normal_component(nodal))
        slips = interface.slip_length(nodal)[self._frictional]
        contact = self._sum(float(cones.force @ ways[self._near] + cones.bound @ slips))
        own = body.owned_part(x)[: body.owned]
        forces = body.internal_forces(replace(self._state, x=x)), body.external(self._state.time)
        works = [abs(self._sum(float(own @ force[: body.owned]))) for force in forces]
        return cones.work() / ((contact + sum(works)) or 1.0)

    def step(self) -> bool:
        """Take a step; False if rounding lets no more be taken. Collective."""
        cones, interface, state = self.cones, self.problem.interface, self.state
        if not cones.interior():
            return False
        jump, near, frictional = interface.jump, self._near, self._frictional
        body, d = self.problem.equilibrium, jump.dim
        nodal = jump.apply(state.x)
        residual = -residual_forces(self.problem, state)
        slack = interface.opening(nodal)[near] - cones.slack
        slip = interface.slip(nodal)[frictional] - cones.slip
        cones.scale()
        stiff, across = cones.stiffness()
        blocks = np.zeros((jump.nodes.size, jump.block_size, jump.block_size))
        normal, tangent = jump.normal[near], jump.tangent[frictional]
        blocks[near, :d, :d] = (stiff[:, None] * normal)[:, :, None] * normal[:, None, :]
        blocks[frictional, :d, :d] += tangent @ across @ tangent
        self._whole.assemble(state, blocks / jump.weight[:, None, None])

        def solve(constants: tuple[Array, Array]) -> tuple[Array, Step]:
            force, friction = cones.reduced(constants)
            at_nodes = np.zeros((jump.nodes.size, d))
            at_nodes[near] = -(force - stiff * slack)[:, None] * normal
            at_nodes[frictional] += friction - np.einsum("kij,kj->ki", across, slip)
            rhs = residual.copy()
            jump.transpose(at_nodes, rhs)
            dx = self._whole.operator.solve(rhs, FORCING)
            moved = jump.apply(dx)
            closed = slack - jump.normal_component(moved)[near]
            return dx, cones.complete(
                constants, closed, jump.tangential_component(moved)[frictional] + slip
            )

        dx, step, length = central(cones, solve)
        if not (np.isfinite(length) and length > 1e-12):
            return False
        x = body.prescribe(body.moved(state.x, length * dx), state.time)
        self._state = replace(state, x=x)
        cones.move(step, length)
        return True


#: From constants of the cones, see `Cones.affine_target`, to the step of the body and of the cones.
Solve = Callable[[tuple[Array, Array]], tuple[Array, Step]]


def central(cones: Cones, solve: Solve) -> tuple[Array, Step, float]:
    """Return the step of the body, that of the cones, and how much of both is to be taken.

    Parameters
    ----------
    cones
        The point of the method, scaled.
    solve
        Solves the linearised problem; both times with the same matrix.
    """
    now, degree = cones.work(), max(cones.degree, 1)
    dx, affine = solve(cones.affine_target())
    length = min(1.0, cones.longest(affine))
    if length == 0:  # the system is singular to rounding
        return dx, affine, length
    centre = (cones.work_after(affine, length) / now) ** 3 if now > 0 else 0.0
    centre = max(0.0, centre)
    dx, step = solve(cones.target(affine, centre * now / degree))
    share = min(LONGEST, max(SHORTEST, 1 - centre))
    return dx, step, min(1.0, share * cones.longest(step))
