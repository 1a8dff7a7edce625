"""Algorithm 3: the penalty method, through PETSc's SNES.

The Signorini and Coulomb conditions are replaced by the laws of `contact.interface.penalised`,
so that the penalised problem (PV_eps) is one nonlinear equation in the displacement. An outer
iteration freezes the secant modulus of the material and the friction modulus of (4.33); what is
left of (4.32), the unilateral [u_nu - rho]^+ of the *new* iterate, is solved by SNES as a
semismooth equation, with a compliant layer where there is one. An outer count is that of
Algorithm 3; the inner one counts SNES's iterations.

Convergence. A penalty run solves the penalised problem: it has converged when the equilibrium
residual with the forces of the regularised laws at the final displacement is below the
tolerance (those laws then hold by construction). The residuals `contact` and `friction` of the
reported KKT are those of the Signorini-Coulomb laws themselves; they measure how far the
penalised solution is from the limit, and fall like eps. Where they are above `LAWS_HOLD`, what
has been solved says nothing of contact, and the run has not converged.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from contact.body.norms import domain_norm
from contact.errors import InputError
from contact.interface.penalised import (
    Implicit,
    Lagged,
    NodalLaw,
    Regularisation,
    outer,
    penalised_forces,
)
from contact.linear.operator import Counters, LinearOperator, petsc_options
from contact.methods.options import PenaltyOptions
from contact.methods.report import History, Monitor, Outcome, Record
from contact.problem.kkt import KKT, evaluate, residual_forces
from contact.problem.problem import ContactProblem
from contact.problem.state import Multipliers, bound_of, nodal_iterate, total_pressure
from contact.tolerances import LAWS_HOLD
from contact.typing import Array

#: What to do about an end without convergence.
HARDER = "the larger eps_contact and eps_slip, the easier the problem"


def regularisation(problem: ContactProblem, options: PenaltyOptions) -> Regularisation:
    """Return the parameters of the penalised laws. Collective."""
    automatic = automatic_eps(problem)
    if options.eps_contact is None:
        contact, slip = automatic.contact, automatic.slip
    else:
        contact = slip = options.eps_contact
    return Regularisation(contact, slip if options.eps_slip is None else options.eps_slip)


def automatic_eps(problem: ContactProblem) -> Regularisation:
    """Return parameters that fit the body, its mesh and its loads, in any units. Collective.

    The foundation is a hundred times stiffer than a layer of elements, E/h. The slip length is a
    hundredth of the displacement that the loads, as a stress on Gamma_3, give a block of the
    body's size.
    """
    young, trace = float(problem.body.law.young), problem.trace
    area = trace.sum(np.ones_like(trace.weight))
    spacing = (area / trace.size) ** (1 / (problem.dim - 1))
    local = np.abs(problem.external.reshape(-1, problem.block_size)[:, : problem.dim]).sum()
    stress = problem.comm.allreduce(float(local), op=MPI.SUM) / area
    displacement = max(stress / young * problem.domain.size, problem.largest_prescribed)
    slip = 1e-2 * displacement or 1e-6 * problem.domain.size
    return Regularisation(1e-2 * spacing / young, slip)


@dataclass
class Penalty:
    """Algorithm 3, one outer iteration at a time.

    Parameters
    ----------
    problem
        The contact problem; its iterate is the current one.
    options
        Options of the method.
    """

    problem: ContactProblem
    options: PenaltyOptions
    monitor: Monitor | None = None
    counters: Counters = field(default_factory=Counters)

    def __post_init__(self) -> None:
        """Start with zero forces and an empty history."""
        self.history = History(self.monitor)
        self.forces = Multipliers.zero(self.problem)
        self._eps = regularisation(self.problem, self.options)
        self._solvers: dict[bool, _Inner] = {}
        self._norm = domain_norm(self.problem) if self.options.stopping == "thesis" else None

    def solve(self) -> Outcome:
        """Iterate from zero displacement until convergence, stagnation or the limit. Collective."""
        self.problem.reset()
        return self._solve(implicit=False)

    def solve_from(self, forces: Multipliers) -> Outcome:
        """Iterate from the problem's present iterate and given contact forces. Collective.

        From the solution of a somewhat larger eps, small ones are reached that are too hard from
        zero displacement.
        """
        self.forces = forces
        return self._solve(implicit=self.options.material_step != "secant")

    def _solve(self, implicit: bool) -> Outcome:
        """Iterate from the problem's iterate; the first time with implicit laws or not."""
        begin, problem, options = time.perf_counter(), self.problem, self.options
        best, mark, since = np.inf, np.inf, 0
        # The residual below which material and friction become implicit.
        switch = {"secant": 0.0, "auto": 1e-2, "tangent": np.inf}[options.material_step]
        bound: Array = np.zeros(problem.trace.nodes.size)
        for iteration in range(1, options.max_outer + 1):
            previous = problem.x.x.array[: problem.owned].copy()
            inner, note = self._step(implicit)
            failed = implicit and bool(note)
            if failed:
                # Newton's method failed: give its step up, and go on with Algorithm 3 for a while.
                problem.x.x.array[: problem.owned] = previous
                problem.x.x.scatter_forward()
            nodal = nodal_iterate(problem)
            self.forces = penalised_forces(problem, nodal, self._eps)
            residuals = evaluate(problem, self.forces)
            old, bound = bound, bound_of(problem, nodal, self.forces)
            record = Record(
                iteration,
                inner,
                residuals,
                self._change(old, bound),
                time.perf_counter() - begin,
                note or ("implicit" if implicit else ""),
            )
            self.history.add(record)
            residual = residuals.equilibrium
            if not np.isfinite(residual):
                return self._outcome(residuals, "the iteration diverged")
            if options.stopping == "thesis":
                if self._thesis_criterion(previous):
                    return self._outcome(residuals, "the thesis's criterion is met")
            elif residual <= options.tolerance:
                return self._outcome(residuals)
            best = min(best, residual)
            switch = best / 10 if failed else switch
            # The lagged friction modulus can creep: what counts is the last hundred iterations.
            since, mark = (0, residual) if residual < 0.99 * mark else (since + 1, mark)
            if since >= 100 and options.stopping == "residual":
                words = f"the residual stalled at {best:.2e}; {HARDER}"
                return self._outcome(residuals, words)
            implicit = residual < switch
        words = f"not converged in {options.max_outer} outer iterations; {HARDER}"
        return self._outcome(residuals, words)

    def _step(self, implicit: bool) -> tuple[int, str]:
        """Solve (4.32), or the penalised problem itself, by SNES from the iterate."""
        problem = self.problem
        problem.freeze()
        nodal = nodal_iterate(problem)
        law: NodalLaw = Lagged(problem, self._eps, nodal)
        if implicit:
            law = Implicit(problem, self._eps)
        symmetric = not (implicit and problem.frictional)
        if symmetric not in self._solvers:
            self._solvers[symmetric] = _Inner(
                problem, self.options, self._eps, self.counters, symmetric
            )
        return self._solvers[symmetric].solve(law, nodal, implicit, self.forces)

    def _change(self, old: Array, new: Array) -> float:
        """Return the relative change (3.46) of the friction bound."""
        if not self.problem.frictional:
            return np.nan
        size = self.problem.trace.norm(new)
        return self.problem.trace.norm(new - old) / size if size > 0 else 0.0

    def _thesis_criterion(self, previous: Array) -> bool:
        """Tell whether (4.38) is met."""
        assert self._norm is not None
        now = self.problem.x.x.array[: self.problem.owned]
        return self._norm(now - previous) < self.options.eps_fp * self._norm(now)

    def _outcome(self, residuals: KKT, words: str = "") -> Outcome:
        options, limit = self.options, max(residuals.contact, residuals.friction)
        words = words or f"the residual of the penalised problem is <= {options.tolerance:g}"
        if residuals.equilibrium <= options.tolerance:
            words += f"; the contact laws hold to {limit:.1e}"
        if limit > LAWS_HOLD:
            words += "; a smaller eps_contact or eps_slip brings them nearer"
        return Outcome(residuals, options.allowed, words)


class _Inner:
    """The nonlinear problem of an outer iteration, in the owned unknowns.

    SNES asks `LinearOperator` for its linear solves, through a shell preconditioner. Its
    options have the prefix ``penalty_``, for instance ``-penalty_snes_monitor``.
    """

    def __init__(
        self,
        problem: ContactProblem,
        options: PenaltyOptions,
        eps: Regularisation,
        counters: Counters,
        symmetric: bool,
    ) -> None:
        self._problem, self._options, self._eps = problem, options, eps
        self._error: InputError | None = None
        self.operator = LinearOperator(
            problem, symmetric=symmetric, counters=counters, kind=options.linear
        )
        matrix = self.operator.matrix
        self._iterate, self._residual = matrix.createVecs()
        self.snes = PETSc.SNES().create(problem.comm)
        self.snes.setOptionsPrefix("penalty_")
        self.snes.setFunction(self._function, self._residual)
        self.snes.setJacobian(self._jacobian, matrix)
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
            layer = problem.contact.layer
            given[name] = "basic" if symmetric and (layer is None or layer.lagged) else "bt"
        try:
            with petsc_options("penalty_"):
                self.snes.setFromOptions()
        finally:
            if default:
                given.delValue(name)

    def apply(self, _: Any, rhs: PETSc.Vec, solution: PETSc.Vec) -> None:
        """Solve with the operator: the preconditioner of SNES's KSP."""
        try:
            solution.array[:] = self.operator.solve(rhs.array_r)
        except InputError as error:
            # Not through PETSc, which would wrap it; SNES stops at a solution without numbers.
            self._error = error
            solution.array[:] = np.nan

    def solve(
        self, law: NodalLaw, nodal: Array, implicit: bool, forces: Multipliers
    ) -> tuple[int, str]:
        """Move the iterate to the solution; return the iterations and what went wrong."""
        problem = self._problem
        self._law, self._implicit, self._nodal = law, implicit, nodal
        self._assembled = problem.linear_material
        pressure = total_pressure(problem, nodal, forces)
        self._response = problem.response.force(nodal, pressure)
        self._current_block = problem.response.current_block(nodal, pressure)
        self._layer = problem.response.normal_law(nodal)
        if self._layer is not None:
            # Like the unilateral [.]^+ it is that of the new iterate, but for h_nu.
            self._response[:, : problem.dim] = 0.0
        scale = self._norm(problem.external) + self._norm(residual_forces(problem, forces))
        scale += self._norm(problem.trace.weight[:, None] * forces.vectors(problem))
        self.snes.setTolerances(
            rtol=1e-14,
            # Rounding is magnified by 1/eps: the residual may stay above any tolerance.
            stol=1e-14,
            atol=self._options.tolerance / 10 * scale,
            max_it=min(self._options.max_inner, 20) if implicit else self._options.max_inner,
        )
        self._error = None
        self._iterate.array[:] = problem.x.x.array[: problem.owned] + self._touch()
        self.snes.solve(None, self._iterate)
        if self._error is not None and not implicit:
            raise self._error
        self._move(self._iterate)
        reason = self.snes.getConvergedReason()
        note = "" if reason > 0 else f"SNES stopped with reason {reason}"
        return self.snes.getIterationNumber(), note

    def _touch(self) -> Array:
        """Return a first guess: zero, or where nothing touches yet, the closest nodes in touch.

        A body that only the foundation holds would otherwise give a singular first system.
        """
        problem, trace, nodal = self._problem, self._problem.trace, self._nodal
        # Of the rigid part, or without one of the layer.
        opening = trace.normal_component(nodal) - problem.response.trace.gap
        closest = trace.maximum(opening, -np.inf)
        if closest >= 0:
            return np.zeros(problem.owned)
        spring = (opening >= closest - 1e-9 * problem.domain.size) / self._eps.contact
        spring = spring * trace.weight
        blocks = np.zeros((trace.nodes.size, trace.block_size, trace.block_size))
        blocks[:, : trace.dim, : trace.dim] = np.einsum(
            "n,ni,nj->nij", spring, trace.normal, trace.normal
        )
        self.operator.update(problem.secant, blocks)
        rhs = problem.external - problem.internal_forces()
        trace.add(rhs, -(spring * opening)[:, None] * trace.normal)
        return self.operator.solve(rhs)

    def _norm(self, values: Array) -> float:
        return float(np.sqrt(self._problem.comm.allreduce(np.sum(values**2), op=MPI.SUM)))

    def _move(self, iterate: PETSc.Vec) -> Array:
        """Take over an iterate of SNES; return its nodal values."""
        problem = self._problem
        problem.x.x.array[: problem.owned] = iterate.array_r
        problem.x.x.scatter_forward()
        if self._implicit:
            problem.freeze()
        return nodal_iterate(problem)

    def _function(self, _: PETSc.SNES, iterate: PETSc.Vec, residual: PETSc.Vec) -> None:
        problem, trace = self._problem, self._problem.trace
        nodal = self._move(iterate)
        values = problem.internal_forces() - problem.external
        trace.add(values, trace.weight[:, None] * self._law.forces(nodal).vectors(problem))
        change = np.einsum("nij,nj->ni", self._current_block, nodal - self._nodal)
        if self._layer is not None:
            u_n = np.minimum(trace.normal_component(nodal), trace.gap)
            change[:, : trace.dim] += self._layer.layer(u_n)[:, None] * trace.normal
        trace.add(values, trace.weight[:, None] * (self._response + change))
        residual.array[:] = np.where(problem.free.ravel(), values, 0.0)

    def _jacobian(
        self, _: PETSc.SNES, iterate: PETSc.Vec, matrix: PETSc.Mat, __: PETSc.Mat
    ) -> None:
        problem, d = self._problem, self._problem.dim
        nodal = self._move(iterate)
        blocks, trace = self._current_block.copy(), problem.trace
        blocks[:, :d, :d] += self._law.block(nodal)
        if self._layer is not None:
            u_n = trace.normal_component(nodal)
            slope = np.where(u_n < trace.gap, self._layer.layer_slope(u_n), 0.0)
            blocks[:, :d, :d] += slope[:, None, None] * outer(trace.normal, trace.normal)
        blocks *= trace.weight[:, None, None]
        form = problem.tangent if self._implicit else problem.secant
        unchanged = problem.linear_material or (self._assembled and not self._implicit)
        self.operator.update(form, blocks, constant=unchanged)
        self._assembled = True
