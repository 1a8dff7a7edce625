"""Primal-dual interior-point method, a fallback of Newton's, on whole and condensed bodies.

Frictionless contact and Tresca's friction are convex. The linear systems of an interior point are
those of a Newton step with other nodal blocks: along the normal, force over slack in place of
gamma. So it runs on whole bodies and condensed ones alike, on any number of ranks.

1. The first friction bound is zero; where friction alone constrains a rigid-body mode, or has to
   balance loads on one, it is above all loads at the nodes that touch first.
2. A step of the interior point is Mehrotra's predictor and corrector with the scaling of Nesterov
   and Todd (`cones`), both with one matrix. Every step linearises layer and current, and the
   material by its secant.
3. With a closed duality gap the active set is known. From there, or where rounding ends the steps
   before, Newton's method takes the last steps.
4. Without convergence, or where a rigid-body mode has become unconstrained at the solution, the
   friction bound becomes that of the pressures found (Haslinger's fixed point), and the next
   problem begins at 2. It has a solution if this friction balances the loads on rigid motions
   (`limit_analysis`). If not, the bound is scaled once, to twice its least multiple that does. The
   method ends where no multiple does, where a later bound does not either, where a body with an
   unconstrained mode is not in contact, or after a number of bounds.

References
----------
Mehrotra, On the implementation of a primal-dual interior point method, SIAM J. Optim. 2 (1992).
Haslinger, Approximation of the Signorini problem with friction, obeying the Coulomb law, Math.
Methods Appl. Sci. 5 (1983).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from contact.errors import InputError, SingularError
from contact.interface.multipliers import Multipliers
from contact.methods.cones import Cones, ConeStep
from contact.methods.report import Outcome
from contact.methods.semismooth import SemismoothNewton
from contact.methods.step_control import PROGRESS
from contact.methods.unconstrained_modes import all_loads
from contact.problem.residuals import evaluate, evaluate_forces, residual_forces
from contact.problem.state import State
from contact.ranks import summed
from contact.tolerances import EPS
from contact.typing import Array

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


def interior_point(newton: SemismoothNewton, begin: State | None = None) -> tuple[State, Outcome]:
    """Solve by the interior point, Newton's last steps and updates of the bound. Collective.

    Parameters
    ----------
    newton
        Newton's method on the problem.
    begin
        State without contact, whose gaps are the first slacks; None where contact has to constrain
        a rigid-body mode or the potential.
    """
    problem, modes, interface = newton.problem, newton.modes, newton.problem.interface
    stuck = modes.stuck_bound()
    bound = np.zeros(interface.nodes.weight.size) if stuck is None else stuck
    aside: tuple[State, Outcome] | None = None
    best, raised = 1.0, False
    for _ in range(UPDATES):
        method = InteriorPoint(newton, bound, begin)
        outcome, state = method.iterate(), method.state
        last = state
        if not outcome.converged and newton.steps_left > 0:
            try:
                last, outcome = newton.iterate(newton.started(state), note=INTERIOR_POINT)
            except SingularError:  # another bound may constrain the body
                newton.step.renew()
        if outcome.converged and modes.unconstrained_at(problem, last):
            aside = last, outcome
        elif outcome.converged or not interface.friction.acts:
            return last, outcome
        if newton.steps_left <= 0:
            break
        # Pressures of Newton's last steps if these have made progress, else of the interior point.
        if aside is None and outcome.residuals.significant < PROGRESS * best:
            state = last
        best = min(best, outcome.residuals.significant)
        nodal = interface.nodes.apply(state.x)
        bound = interface.bound(nodal, state.forces)
        # With all nodes open the next bound is zero, and the solution the same.
        if aside is not None and interface.nodes.maximum(bound) <= interface.rounding(nodal):
            break
        multiple = modes.overload(bound)
        if multiple == np.inf or (raised and multiple > 1):
            outcome = replace(outcome, residuals=evaluate(problem, state))
            last, outcome = state, replace(outcome, ended=OVERLOADED, overloaded=True)
            break
        if multiple > 1:  # pressures may differ with as much friction as the loads need
            bound, raised = np.asarray(multiple / PROGRESS * bound, dtype=float), True
    return aside or (last, outcome)


class InteriorPoint:
    """The interior-point method for a given friction bound (Tresca), on the operator of Newton's.

    Parameters
    ----------
    newton
        Newton's method on the problem.
    bound
        Friction bound, shape (n,) (stress).
    begin
        State whose gaps are the first slacks; None for none.
    """

    def __init__(self, newton: SemismoothNewton, bound: Array, begin: State | None) -> None:
        problem = newton.problem
        self.problem, self._newton, self._step = problem, newton, newton.step
        interface = problem.interface
        nodes, self._state = interface.nodes, problem.start()
        self._near = np.isfinite(interface.gap)
        total, limit = all_loads(problem), nodes.weight * bound
        count = max(nodes.size, 1)
        self._frictional = self._near & (limit > EPS * max(nodes.maximum(limit), total / count))
        nodal = nodes.apply(self._state.x)
        moved = np.zeros_like(nodal) if begin is None else nodes.apply(begin.x) - nodal
        normal_gap = interface.normal_gap(nodal + moved)[self._near]
        gap = interface.gap[self._near]
        scales = problem.scales
        block = scales.plane_modulus * scales.area / scales.height
        if begin is not None:
            way = nodes.maximum(np.abs(moved[:, : nodes.dim]).max(axis=1, initial=0.0))
            # Without loads the stiffness is that of a block; without penetration any work will do.
            far = nodes.maximum(-normal_gap) or SHARE * (way or interface.diameter)
            least = np.sqrt(SHARE) * far
            work = (total / way if total > 0 and way > 0 else block) * least**2
        else:
            total = total or block * nodes.maximum(np.abs(normal_gap))
            least = float(summed(nodes.comm, np.maximum(gap, 0.0).sum())) / count + total / block
            work = SHARE_UNSUPPORTED * total * least / count
        # Where the body lifts off without contact, the first slack is the normal gap.
        slack = np.maximum(np.maximum(gap, normal_gap), least)
        frictional = self._frictional
        slips, limit = interface.slip_length(nodal + moved)[frictional], limit[frictional]
        zeros = np.zeros((limit.size, nodes.dim))
        length = np.maximum(work / limit, slips)
        self.cones = Cones(slack, work / slack, length, zeros, limit, zeros, nodes.comm)
        #: Least reference of the duality gap, where no work is done: all nodes stick.
        self._least_work = CLOSED * self.cones.duality_gap() if begin is None else 0.0

    def iterate(self) -> Outcome:
        """Take steps until the duality gap is closed. Collective."""
        newton = self._newton
        residuals, self._internal = evaluate_forces(self.problem, self.state)
        ended = "the interior point was given no step"
        for steps in range(1, min(LIMIT, newton.steps_left) + 1):
            try:
                taken = self.step()
            except InputError as error:
                # Near the solution the matrices are singular to rounding.
                if error.identifier == "memory":
                    raise
                self._step.renew()
                taken = False
            residuals, self._internal = evaluate_forces(self.problem, self.state)
            newton.see(self.state, residuals)
            newton.recorder.record(residuals, INTERIOR_POINT, 2)
            ended = f"the interior point has not converged in {steps} steps"
            if not taken or not np.isfinite(residuals.significant):
                ended = f"rounding ends the interior point after {steps} steps"
                break
            nodal = self.problem.interface.nodes.apply(self._state.x)
            pressure = self.problem.interface.nodes.maximum(self.state.forces.pressure)
            if pressure <= self.problem.interface.rounding(nodal):
                ended = f"nothing presses after {steps} steps"
                break
            gap = self.relative_gap()
            balanced = residuals.equilibrium <= max(FORCING, residuals.floors[0])
            if gap <= CLOSED and (balanced or gap <= CLOSED**2):
                ended = f"duality gap closed after {steps} steps"
                break
        return Outcome(residuals, newton.options.allowed, ended)

    @property
    def state(self) -> State:
        """The iterate."""
        cones, nodes = self.cones, self.problem.interface.nodes
        pressure, friction = np.zeros(nodes.weight.size), np.zeros(nodes.normal.shape)
        pressure[self._near] = cones.force / nodes.weight[self._near]
        friction[self._frictional] = -cones.friction / nodes.weight[self._frictional, None]
        return replace(self._state, forces=Multipliers.of(nodes, pressure, friction))

    def relative_gap(self) -> float:
        """Return the duality gap over the work of loads and contact. Collective."""
        body, interface, x = self.problem.equilibrium, self.problem.interface, self._state.x
        nodes, cones, nodal = interface.nodes, self.cones, interface.nodes.apply(x)
        ways = np.abs(interface.gap) + np.abs(nodes.normal_component(nodal))
        slips = interface.slip_length(nodal)[self._frictional]
        contact = float(summed(nodes.comm, cones.force @ ways[self._near] + cones.bound @ slips))
        own = body.owned_part(x)[: body.owned]
        forces = self._internal, body.external(self._state.time)
        works = [abs(float(summed(nodes.comm, own @ force[: body.owned]))) for force in forces]
        return cones.duality_gap() / (max(contact + sum(works), self._least_work) or 1.0)

    @np.errstate(over="ignore", invalid="ignore")  # such a step is not taken
    def step(self) -> bool:
        """Take a step by Mehrotra's predictor and corrector; False at rounding. Collective."""
        cones, interface, state = self.cones, self.problem.interface, self.state
        if not cones.interior():
            return False
        nodes, near, frictional = interface.nodes, self._near, self._frictional
        body, d = self.problem.equilibrium, nodes.dim
        nodal = nodes.apply(state.x)
        residual = -residual_forces(self.problem, state, internal=self._internal)
        slack = interface.normal_gap(nodal)[near] - cones.slack
        slip = interface.slip(nodal)[frictional] - cones.slip
        cones.scale()
        stiff, across = cones.stiffness()
        blocks = np.zeros((nodes.nodes.size, nodes.block_size, nodes.block_size))
        normal, tangent = nodes.normal[near], nodes.tangent[frictional]
        blocks[near, :d, :d] = (stiff[:, None] * normal)[:, :, None] * normal[:, None, :]
        blocks[frictional, :d, :d] += tangent @ across @ tangent
        self._step.assemble(self.problem, state, blocks / nodes.weight[:, None, None])

        def solve(constants: tuple[Array, Array]) -> tuple[Array, ConeStep]:
            force, friction = cones.reduced(constants)
            at_nodes = np.zeros((nodes.nodes.size, d))
            at_nodes[near] = -(force - stiff * slack)[:, None] * normal
            at_nodes[frictional] += friction - np.einsum("kij,kj->ki", across, slip)
            rhs = residual.copy()
            nodes.transpose(at_nodes, rhs)
            dx = self._step.operator.solve(rhs, FORCING)
            moved = nodes.apply(dx)
            closed = slack - nodes.normal_component(moved)[near]
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
        x = body.prescribe(body.moved(state.x, length * dx), state.time)
        self._state = replace(state, x=x)
        cones.move(step, length)
        return True
