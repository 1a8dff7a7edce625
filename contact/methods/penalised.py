"""The nonlinear problem of an outer iteration of Algorithm 3, for PETSc's SNES."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from petsc4py import PETSc

from contact.errors import InputError, SingularError
from contact.interface.penalised import NodalLaw, Regularisation, outer
from contact.linear.faults import petsc_options
from contact.linear.operator import Counters
from contact.linear.packing import Packing, shell
from contact.methods.interrupt import Interrupted
from contact.methods.options import PenaltyOptions
from contact.problem.kkt import residual_forces
from contact.problem.problem import ContactProblem
from contact.problem.state import State
from contact.typing import Array

logger = logging.getLogger("contact.inner")


class PenalisedProblem:
    """The nonlinear problem of an outer iteration, in the owned unknowns.

    SNES asks `SparseOperator` for its linear solves, through a shell preconditioner. Its residual
    are forces, and charges, over the sizes of those that act. Its options have the prefix
    ``penalty_``, for instance ``-penalty_snes_monitor``.
    """

    def __init__(
        self,
        problem: ContactProblem,
        options: PenaltyOptions,
        eps: Regularisation,
        counters: Counters,
        symmetric: bool,
    ) -> None:
        self._options, self._eps = options, eps
        self._error: InputError | Interrupted | None = None
        self._problem = problem
        self._body, self._interface = problem.equilibrium, problem.interface
        self.operator = self._body.operator(
            self._interface.coupled,
            self._interface.jump.carried,
            self._interface.change,
            symmetric=symmetric,
            counters=counters,
            kind=options.linear,
        )
        self._packing = Packing(problem.comm, self._body.masters.size)
        matrix = shell(self, problem.comm, self._body.owned, self._body.masters.size)
        self._iterate, self._residual = matrix.createVecs()
        self.snes = PETSc.SNES().create(problem.comm)
        self.snes.setOptionsPrefix("penalty_")
        self.snes.setFunction(self._function, self._residual)
        self.snes.setJacobian(self._jacobian, matrix)
        self.snes.setMonitor(self._tell)
        self.snes.getKSP().setType("preonly")
        pc = self.snes.getKSP().getPC()
        pc.setType("python")
        pc.setPythonContext(self)
        # A wrong active set raises the residual by 1/eps, for a step.
        self.snes.setDivergenceTolerance(1e300)
        # Full steps: the active set of the pressure settles in a few of them, while a line
        # search on the residual, which has kinks of the size 1/eps, takes tiny ones. A layer that
        # saturates needs the search: full steps cycle between its open and its saturated state.
        # So do implicit friction and material: full steps jump between sticking and sliding.
        given = PETSc.Options()
        name = "penalty_snes_linesearch_type"
        default = not given.hasName(name)
        if default:
            layer = problem.interface.response.layer
            given[name] = "basic" if symmetric and (layer is None or layer.lagged) else "bt"
        try:
            with petsc_options("penalty_"):
                self.snes.setFromOptions()
        finally:
            if default:
                given.delValue(name)

    def turn_to(self, problem: ContactProblem, eps: Regularisation) -> None:
        """Go on with another step of the same problem."""
        self._problem, self._interface, self._eps = problem, problem.interface, eps

    def apply(self, _: Any, rhs: PETSc.Vec, solution: PETSc.Vec) -> None:
        """Solve with the operator: the preconditioner of SNES's KSP."""
        try:
            self._poll()
            found = self.operator.solve(self._units * self._packing.unpacked(rhs.array_r))
            solution.array[:] = self._packing.packed(found)
        except (InputError, Interrupted) as error:
            # Not through PETSc, which would wrap it; SNES stops at a solution without numbers.
            self._error = error
            solution.array[:] = np.nan

    def multiply(self, values: Array) -> Array:
        """Return the derivative of the residual times owned values. Collective."""
        return self.operator.multiply(values) / self._units

    def solve(
        self, law: NodalLaw, state: State, implicit: bool, poll: Callable[[], None]
    ) -> tuple[Array, int, str]:
        """Solve from a state; return the unknowns, the iterations and what went wrong.

        Before each of them `poll` is called, on all ranks.

        Raises
        ------
        Interrupted
            If `poll` raises it.
        SingularError
            If nothing holds the body at an iterate.
        InputError
            If numbers overflow, where the laws are not implicit.
        """
        body, interface = self._body, self._interface
        nodal = interface.jump.apply(state.x)
        self._law, self._implicit, self._nodal = law, implicit, nodal
        self._state = state
        self._assembled = body.linear
        pressure = interface.pressure(nodal, state.forces)
        self._response = interface.response.force(nodal, pressure)
        self._current_block = interface.response.current_block(nodal, pressure)
        self._layer = interface.response.normal_law(nodal)
        if self._layer is not None:
            # Like the unilateral [.]^+ it is that of the new iterate, but for h_nu.
            self._response[:, : body.dim] = 0.0
        residual = residual_forces(self._problem, state)
        on_contact = np.zeros_like(residual)
        interface.add_forces(on_contact, state.x, state.forces)
        sizes = body.load_sizes(state.time) + body.sizes(residual)
        sizes = sizes + body.sizes(on_contact) + body.exchanged(state)
        self._units = body.shares.spread(np.where(sizes > 0, sizes, 1.0))
        self.snes.setTolerances(
            rtol=1e-14,
            # Rounding is magnified by 1/eps: the residual may stay above any tolerance.
            stol=1e-14,
            atol=self._options.tolerance / 10,
            max_it=min(self._options.max_inner, 20) if implicit else self._options.max_inner,
        )
        self._error, self._poll = None, poll
        self._iterate.array[:] = self._packing.packed(body.owned_part(state.x) + self._touch())
        self.snes.solve(None, self._iterate)
        lasting = isinstance(self._error, SingularError | Interrupted)
        if self._error is not None and (lasting or not implicit):
            raise self._error
        reason = self.snes.getConvergedReason()
        note = "" if reason > 0 else f"SNES stopped with reason {reason}"
        return self._unknowns(self._iterate), self.snes.getIterationNumber(), note

    def _touch(self) -> Array:
        """Return a first guess: zero, or where nothing touches yet, the closest nodes in touch.

        A body that only the foundation holds would otherwise give a singular first system.
        """
        body, interface, nodal = self._body, self._interface, self._nodal
        jump, state = interface.jump, self._state
        # Of the rigid part, or without one of the layer.
        opening = jump.normal_component(nodal) - interface.response.jump.gap
        closest = jump.maximum(opening, -np.inf)
        if closest >= 0:
            return np.zeros_like(body.owned_part(state.x))
        spring = (opening >= closest - 1e-9 * interface.size) / self._eps.contact
        n, d = jump.normal.shape
        blocks = np.zeros((n, jump.block_size, jump.block_size))
        blocks[:, :d, :d] = spring[:, None, None] * outer(jump.normal, jump.normal)
        blocks[:, :d, :d] += self._law.block(nodal)
        self.operator.update("secant", state, interface.weighted(blocks, state.x))
        rhs = body.external(state.time) - body.internal_forces(state)
        jump.transpose(-(jump.weight * spring * opening)[:, None] * jump.normal, rhs)
        return self.operator.solve(rhs)

    def _unknowns(self, iterate: PETSc.Vec) -> Array:
        """Return the local unknowns of an iterate of SNES. Collective."""
        return self._body.local(self._packing.unpacked(iterate.array_r))

    def _tell(self, _: PETSc.SNES, iteration: int, norm: float) -> None:
        logger.debug("inner iteration %d: residual %.2e", iteration, norm)

    def _function(self, _: PETSc.SNES, iterate: PETSc.Vec, residual: PETSc.Vec) -> None:
        body, jump, x = self._body, self._interface.jump, self._unknowns(iterate)
        nodal = jump.apply(x)
        secant_at = None if self._implicit else self._state.x
        values = body.internal_forces(replace(self._state, x=x), secant_at)
        values = values - body.external(self._state.time)
        jump.transpose(jump.weight[:, None] * self._law.forces(nodal).vectors(jump), values)
        change = np.einsum("nij,nj->ni", self._current_block, nodal - self._nodal)
        if self._layer is not None:
            u_n = np.minimum(jump.normal_component(nodal), jump.gap)
            change[:, : jump.dim] += self._layer.layer(u_n)[:, None] * jump.normal
        jump.transpose(jump.weight[:, None] * (self._response + change), values)
        residual.array[:] = self._packing.packed(body.unbalanced(values) / self._units)

    def _jacobian(
        self, _: PETSc.SNES, iterate: PETSc.Vec, matrix: PETSc.Mat, __: PETSc.Mat
    ) -> None:
        body, jump, x = self._body, self._interface.jump, self._unknowns(iterate)
        nodal, d = jump.apply(x), body.dim
        blocks = self._current_block.copy()
        blocks[:, :d, :d] += self._law.block(nodal)
        if self._layer is not None:
            u_n = jump.normal_component(nodal)
            slope = np.where(u_n < jump.gap, self._layer.layer_slope(u_n), 0.0)
            blocks[:, :d, :d] += slope[:, None, None] * outer(jump.normal, jump.normal)
        kind, about = ("tangent", x) if self._implicit else ("secant", self._state.x)
        unchanged = body.linear or (self._assembled and not self._implicit)
        blocks = self._interface.weighted(blocks, x)
        at = replace(self._state, x=about)
        self.operator.update(kind, at, blocks, constant=unchanged)
        self._assembled = True
