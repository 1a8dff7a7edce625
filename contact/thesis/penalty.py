"""Algorithm 3: the penalty method, through PETSc's SNES.

The penalised laws replace those of Signorini and Coulomb, node by node: [u_nu - rho]^+/eps_contact
and s u_tau/(|u_tau| + eps_slip), functions of the displacement: (4.1)-(4.3), there without a gap
and with one eps. The penalised problem
(PV_eps) is one nonlinear equation in the displacement. An outer iteration freezes the
secant modulus of the material and the friction modulus of (4.33); (4.32), with [u_nu - rho]^+ of
the *new* iterate and a compliant layer, is solved by SNES as a semismooth equation. Outer
iterations are those of Algorithm 3, inner ones those of SNES. SNES takes full steps while friction
is frozen, and has a backtracking line search with implicit friction or a layer that is not lagged.

Convergence is that of equilibrium with the forces of the penalised laws. The residuals `contact`
and `friction` are those of Signorini's and Coulomb's laws: the error of the penalised solution, of
order eps. Above `LARGEST_VIOLATION` the method has not converged.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from petsc4py import PETSc

from contact.errors import InputError, SingularError
from contact.interface.interface import Interface
from contact.interface.multipliers import Multipliers
from contact.interface.nodes import unit_vectors
from contact.linear.operator import Counters
from contact.linear.petsc import petsc_options
from contact.methods.options import PenaltyOptions
from contact.methods.report import Outcome
from contact.methods.signals import Interrupted
from contact.methods.unconstrained_modes import UnconstrainedModes
from contact.problem.checks import expected_displacements
from contact.problem.problem import ContactProblem
from contact.problem.residuals import Residuals, residual_forces
from contact.problem.state import State
from contact.thesis.fixed_point import LOST, NEAR, OuterLoop
from contact.tolerances import LARGEST_VIOLATION
from contact.typing import Array
from forms.foundation import penalty_friction_modulus, penalty_pressure


@dataclass(frozen=True)
class Regularisation:
    """Parameters eps of [u_nu - rho]^+/eps (length^3/force) and u_tau/(|u_tau| + eps) (length)."""

    contact: float
    slip: float


def outer(a: Array, b: Array) -> Array:
    """Return a b^T node by node, shape (n, d, k)."""
    return a[:, :, None] * b[:, None, :]


class PenalisedLaw:
    """Contact forces as a function of the jumps, with their derivative.

    `iterate`: jumps at which the friction modulus s/(|u_tau| + eps), (4.32)-(4.33), is frozen,
    shape (n, block size). None: it is implicit, (4.3), but for a smoothed pressure in its
    derivative.
    """

    def __init__(
        self, interface: Interface, eps: Regularisation, iterate: Array | None = None
    ) -> None:
        self._interface, self._eps = interface, eps
        self._modulus = None if iterate is None else self._modulus_at(iterate)

    def acts(self) -> bool:
        """Return whether friction acts: a frozen modulus above 0 anywhere. Collective."""
        return self._modulus is None or self._interface.nodes.maximum(self._modulus) > 0

    def stick(self) -> None:
        """Set the friction modulus to 1/eps_contact at all nodes."""
        self._modulus = np.full(self._interface.gap.shape, 1 / self._eps.contact)

    def _pressed(self, jump: Array) -> tuple[Multipliers, Array]:
        """Return lambda_c, and their derivative in u_nu: 1/eps also at first touch."""
        interface, nodes = self._interface, self._interface.nodes
        normal = nodes.normal_component(jump)
        contact = np.asarray(penalty_pressure(normal, interface.gap, self._eps.contact))
        multipliers = Multipliers(contact, np.zeros(nodes.normal.shape))
        return multipliers, (normal >= interface.gap) / self._eps.contact

    def _modulus_at(self, jump: Array) -> Array:
        """Return the friction modulus, shape (n,). Collective."""
        interface = self._interface
        bound = interface.bound(jump, self._pressed(jump)[0])
        return np.asarray(
            penalty_friction_modulus(bound, interface.slip_length(jump), self._eps.slip)
        )

    def multipliers(self, jump: Array) -> Multipliers:
        """Return lambda_c and lambda_f. Collective."""
        modulus = self._modulus_at(jump) if self._modulus is None else self._modulus
        tangential = self._interface.slip(jump)
        return Multipliers(self._pressed(jump)[0].contact, modulus[:, None] * tangential)

    def block(self, jump: Array) -> Array:
        """Return their derivative by the jumps, shape (n, d, block size). Collective."""
        interface, nodes = self._interface, self._interface.nodes
        multipliers, slope = self._pressed(jump)
        modulus = self._modulus_at(jump) if self._modulus is None else self._modulus
        block = np.zeros((*nodes.normal.shape, nodes.block_size))
        in_space = block[:, :, : nodes.dim]
        in_space += slope[:, None, None] * outer(nodes.normal, nodes.normal)
        in_space += modulus[:, None, None] * nodes.tangential_projector
        if self._modulus is not None:
            return block
        slip, unit = interface.slip_length(jump), unit_vectors(interface.slip(jump))
        pressure, share = interface.pressure(jump, multipliers), slip / (slip + self._eps.slip)
        along = (interface.friction.by_slip(slip, pressure) - modulus) * share
        across = interface.friction.by_pressure(slip, pressure) * share
        in_space += along[:, None, None] * outer(unit, unit)
        # The layer's pressure bounds friction too, and grows with the potential.
        growth = interface.foundation.layer_gradient(jump)
        growth[:, : nodes.dim] += slope[:, None] * nodes.normal
        return block + across[:, None, None] * outer(unit, growth)


logger = logging.getLogger("contact.inner")


class PenalisedProblem:
    """The nonlinear problem of an outer iteration, with SNES (prefix of options ``penalty_``).

    Linear solves are those of `operator`, through a shell preconditioner. The residual is relative
    to the norms of forces and charges.
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
        self._body, self._interface = problem.body, problem.interface
        self.operator = problem.operator(
            symmetric=symmetric, counters=counters, solver=options.linear
        )
        # Global unknowns are on the first rank, behind its own ones.
        self._local_globals = self._body.global_unknowns.size if problem.comm.rank == 0 else 0
        size = (self._body.owned + self._local_globals, None)
        matrix = PETSc.Mat().createPython((size, size), self, problem.comm)
        matrix.setUp()
        self._iterate, self._residual = matrix.createVecs()
        self.snes = PETSc.SNES().create(problem.comm)
        self.snes.setOptionsPrefix("penalty_")
        self.snes.setFunction(self._function, self._residual)
        self.snes.setJacobian(self._jacobian, matrix)
        words = "inner iteration %d: residual %.2e"
        self.snes.setMonitor(lambda _, iteration, norm: logger.debug(words, iteration, norm))
        self.snes.getKSP().setType("preonly")
        pc = self.snes.getKSP().getPC()
        pc.setType("python")
        pc.setPythonContext(self)
        # A change of the active set may raise the residual by 1/eps.
        self.snes.setDivergenceTolerance(1e300)
        # Full steps find the active set in a few iterations; a line search on the residual, with
        # kinks of size 1/eps, takes tiny steps. With a layer that saturates, or implicit friction,
        # full steps cycle.
        database = PETSc.Options()
        name = "penalty_snes_linesearch_type"
        default = not database.hasName(name)
        if default:
            layer = problem.interface.foundation.layer
            database[name] = "basic" if symmetric and (layer is None or layer.lagged) else "bt"
        try:
            with petsc_options("penalty_"):
                self.snes.setFromOptions()
        finally:
            if default:
                database.delValue(name)

    def set_load_step(self, problem: ContactProblem, eps: Regularisation) -> None:
        """Take another load step of the same problem."""
        self._problem, self._interface, self._eps = problem, problem.interface, eps

    def apply(self, _: Any, rhs: PETSc.Vec, solution: PETSc.Vec) -> None:
        """Solve with the operator: the preconditioner of SNES's KSP."""
        try:
            self._poll()
            increment = self.operator.solve(self._units * self._unpacked(rhs.array_r))
            solution.array[:] = self._packed(increment)
        except (InputError, Interrupted) as error:
            # PETSc would wrap the error; SNES stops at NaN.
            self._error = error
            solution.array[:] = np.nan

    def mult(self, _: Any, vector: PETSc.Vec, image: PETSc.Vec) -> None:
        """Multiply by the derivative of the residual."""
        image.array[:] = self._packed(
            self.operator.multiply(self._unpacked(vector.array_r)) / self._units
        )

    def _packed(self, values: Array) -> Array:
        """Return the entries of PETSc's vectors on this rank of owned and global values."""
        return values[: self._body.owned + self._local_globals]

    def _unpacked(self, values: Array) -> Array:
        """Return owned values and global ones behind them, the same on all ranks. Collective."""
        nodal, first = np.split(values, [self._body.owned])
        return np.concatenate([nodal, self._problem.comm.bcast(first)])

    def solve(
        self, law: PenalisedLaw, state: State, implicit: bool, poll: Callable[[], None]
    ) -> tuple[Array, int, str]:
        """Solve from a state; return unknowns, number of iterations, and fault or "". Collective.

        `poll` is called before each linear solve. Raises SingularError, and InputError for overflow
        with frozen laws.
        """
        body, interface = self._body, self._interface
        jump = interface.nodes.jump(state.x)
        self._law, self._implicit, self._jump = law, implicit, jump
        self._state = state
        self._assembled = False
        pressure = interface.pressure(jump, state.multipliers)
        self._response = interface.foundation.force(jump, pressure)
        self._current_block = interface.foundation.charge_block(jump, pressure)
        self._layer = interface.foundation.normal_graph(jump)
        if self._layer is not None:
            # Of the new iterate, as [.]^+, but for h_nu.
            self._response[:, : body.dim] = 0.0
        residual = residual_forces(self._problem, state)
        on_contact = np.zeros_like(residual)
        interface.add_forces(on_contact, state.x, state.multipliers)
        norms = body.load_norms(state.time) + body.norms(residual)
        norms = norms + body.norms(on_contact) + body.piezo_norms(state)
        self._units = body.component_norms.spread(np.where(norms > 0, norms, 1.0))
        self.snes.setTolerances(
            rtol=1e-14,
            # The residual has rounding errors of size 1/eps.
            stol=1e-14,
            atol=self._options.tolerance / 10,
            max_it=min(self._options.max_inner, 20) if implicit else self._options.max_inner,
        )
        self._error, self._poll = None, poll
        self._iterate.array[:] = self._packed(body.owned_part(state.x) + self._touch())
        self.snes.solve(None, self._iterate)
        lasting = isinstance(self._error, SingularError | Interrupted)
        if self._error is not None and (lasting or not implicit):
            raise self._error
        reason = self.snes.getConvergedReason()
        note = "" if reason > 0 else f"SNES stopped with reason {reason}"
        return self._unknowns(self._iterate), self.snes.getIterationNumber(), note

    def _touch(self) -> Array:
        """Return an initial increment that closes the smallest gaps; zero if a node touches.

        Without contact the first system may be singular.
        """
        body, interface, jump = self._body, self._interface, self._jump
        nodes, state = interface.nodes, self._state
        # Gap of the rigid part, or of the layer alone.
        penetration = nodes.normal_component(jump) - nodes.gap
        closest = nodes.maximum(penetration, -np.inf)
        if closest >= 0:
            return np.zeros_like(body.owned_part(state.x))
        # At nodes that face nothing it is infinite, and zero times it no number.
        facing = np.isfinite(penetration)
        stiffness = (facing & (penetration >= closest - 1e-9 * interface.size)) / self._eps.contact
        penetration = np.where(facing, penetration, 0.0)
        n, d = nodes.normal.shape
        blocks = np.zeros((n, nodes.block_size, nodes.block_size))
        blocks[:, :d, :d] = stiffness[:, None, None] * outer(nodes.normal, nodes.normal)
        blocks[:, :d] += self._law.block(jump)
        self.operator.update("secant", state, interface.weighted(blocks, state.x))
        rhs = body.external(state.time) - body.internal_forces(state)
        nodes.add_jump_transposed(
            -(nodes.weight * stiffness * penetration)[:, None] * nodes.normal, rhs
        )
        return self.operator.solve(rhs)

    def _unknowns(self, iterate: PETSc.Vec) -> Array:
        """Return the local unknowns of an iterate of SNES. Collective."""
        return self._body.local(self._unpacked(iterate.array_r))

    def _state_of(self, x: Array) -> State:
        """Return the state of local unknowns, with the frozen secant unless it is implicit."""
        return replace(self._state, x=x, secant_at=None if self._implicit else self._state.x)

    def _function(self, _: PETSc.SNES, iterate: PETSc.Vec, residual: PETSc.Vec) -> None:
        body, nodes, x = self._body, self._interface.nodes, self._unknowns(iterate)
        jump = nodes.jump(x)
        values = body.secant_forces(self._state_of(x))
        values = values - body.external(self._state.time)
        nodes.add_jump_transposed(
            nodes.weight[:, None] * self._law.multipliers(jump).vectors(nodes), values
        )
        change = np.einsum("nij,nj->ni", self._current_block, jump - self._jump)
        if self._layer is not None:
            u_n = np.minimum(nodes.normal_component(jump), self._interface.gap)
            change[:, : nodes.dim] += self._layer.layer_pressure(u_n)[:, None] * nodes.normal
        nodes.add_jump_transposed(nodes.weight[:, None] * (self._response + change), values)
        residual.array[:] = self._packed(body.unbalanced(values) / self._units)

    def _jacobian(
        self, _: PETSc.SNES, iterate: PETSc.Vec, matrix: PETSc.Mat, __: PETSc.Mat
    ) -> None:
        body, nodes, x = self._body, self._interface.nodes, self._unknowns(iterate)
        jump, d = nodes.jump(x), body.dim
        blocks = self._current_block.copy()
        blocks[:, :d] += self._law.block(jump)
        if self._layer is not None:
            u_n = nodes.normal_component(jump)
            slope = np.where(u_n < self._interface.gap, self._layer.layer_slope(u_n), 0.0)
            blocks[:, :d, :d] += slope[:, None, None] * outer(nodes.normal, nodes.normal)
        kind, at = "tangent" if self._implicit else "secant", self._state_of(x)
        blocks = self._interface.weighted(blocks, x)
        reuse = self._assembled and not self._implicit  # SNES asks again at each iterate
        self.operator.update(kind, at, blocks, reuse=reuse)
        self._assembled = True


#: Advice on failure.
HARDER = "; the larger eps_contact and eps_slip, the easier the problem"

#: Least increment of the displacement in a load step, over the displacement.
LEAST_ADDED = 1e-2


def regularisation(problem: ContactProblem, options: PenaltyOptions) -> Regularisation:
    """Return the parameters of the penalised laws. Collective.

    By default the foundation is 100 E/h stiff, h the spacing of the contact nodes, and the slip
    length is a hundredth of the displacement of a block of the body's size under the loads, or
    under their increment in a load step.
    """
    body, scales = problem.body, problem.scales
    loads, prescribed = body.external(problem.time), problem.start().x
    displacement = max(expected_displacements(problem, loads, prescribed))
    if problem.since is not None:
        before = problem.start(problem.since).x
        added = loads - body.external(problem.since), prescribed - before
        displacement = max(*expected_displacements(problem, *added), LEAST_ADDED * displacement)
    slip = 1e-2 * displacement or 1e-6 * scales.size
    # Modulus of the part in contact, however soft its support is.
    young = scales.contact_young
    contact, slip = 1e-2 * scales.spacing / young, slip * min(1.0, scales.young / young)
    if options.eps_contact is not None:
        contact = slip = options.eps_contact
    return Regularisation(contact, slip if options.eps_slip is None else options.eps_slip)


@dataclass
class Penalty(OuterLoop):
    """Algorithm 3; see `OuterLoop`."""

    options: PenaltyOptions
    #: With a frozen modulus of friction it may creep.
    stagnation: ClassVar[tuple[int, float]] = (100, 0.99)

    def __post_init__(self) -> None:
        """Start from zero, without a solver."""
        self._solvers: dict[bool, PenalisedProblem] = {}
        super().__post_init__()

    def set_load_step(self, problem: ContactProblem) -> None:
        """Take another load step; see `Method`. Collective."""
        super().set_load_step(problem)
        self._eps = regularisation(problem, self.options)
        for solver in self._solvers.values():
            solver.set_load_step(problem, self._eps)

    def solve(self, start: State | None = None) -> tuple[State, Outcome]:
        """Iterate until convergence, stagnation or the limit; see `Method`. Collective.

        Small eps may need the solution of a larger one as initial guess.
        """
        self.state = replace(start or self.problem.start(), secant_at=None)
        self.bound = np.zeros_like(self.bound)
        self._implicit = start is not None and self.options.material_step != "secant"
        self._failed = False
        # Residual below which material and friction are implicit.
        self._switch = {"secant": 0.0, "auto": NEAR, "tangent": np.inf}[self.options.material_step]
        outcome = self._iterate()
        return self.state, outcome

    def _step(self, iteration: int) -> tuple[int, str]:
        """Solve (4.32), or the penalised problem itself, by SNES from the state."""
        interface, implicit = self.problem.interface, self._implicit
        x, inner, fault = self._solve(implicit)
        self._failed = implicit and bool(fault)
        if self._failed:  # go on with frozen terms
            x, fault = self.state.x, f"implicit: {fault}"
        multipliers = PenalisedLaw(interface, self._eps).multipliers(interface.nodes.jump(x))
        self.state = replace(self.state, x=x, multipliers=multipliers)
        return inner, fault or ("implicit" if implicit else "")

    def _solve(self, implicit: bool) -> tuple[Array, int, str]:
        """Return unknowns, number of iterations, and fault or ""."""
        interface = self.problem.interface
        jump = interface.nodes.jump(self.state.x)
        law = PenalisedLaw(interface, self._eps) if implicit else self._lagged(jump)
        symmetric = not (implicit and interface.friction.acts)
        if symmetric not in self._solvers:
            self._solvers[symmetric] = PenalisedProblem(
                self.problem, self.options, self._eps, self.counters, symmetric
            )
        solver = self._solvers[symmetric]
        try:
            return solver.solve(law, self.state, implicit, self.recorder.poll)
        except SingularError:
            taken = solver.snes.getIterationNumber()
            if taken == 0 and not self.history:
                raise
            del self._solvers[symmetric]  # MUMPS does not recover
            return self.state.x, taken, LOST

    def _lagged(self, jump: Array) -> PenalisedLaw:
        """Return the laws with the friction modulus of an iterate; sticking if it has no pressure.

        A mode that friction alone constrains would be unconstrained at zero displacement.
        """
        law = PenalisedLaw(self.problem.interface, self._eps, jump)
        if not law.acts() and UnconstrainedModes.of(self.problem).friction_alone:
            law.stick()
        return law

    def _target(self, residuals: Residuals) -> float:
        """Return the residual of equilibrium."""
        return residuals.equilibrium

    def _adapt(self, residual: float, best: float) -> None:
        """Choose implicit laws near the solution; nearer after a failure."""
        self._switch = best / 10 if self._failed else self._switch
        self._implicit = residual < self._switch

    def _advice(self, residual: float | None = None) -> str:
        return HARDER

    def _outcome(self, residuals: Residuals, ended: str = "", criterion: str = "") -> Outcome:
        options, limit, laws = self.options, max(residuals.contact, residuals.friction), ""
        criterion = criterion or (
            f"the residual of the penalised problem is <= {options.tolerance:g}"
        )
        if residuals.equilibrium <= options.tolerance:
            laws += f"; the complementarity conditions are met to {limit:.1e}"
        if limit > LARGEST_VIOLATION:
            laws += "; a smaller eps_contact or eps_slip brings them nearer"
        return super()._outcome(residuals, ended and ended + laws, criterion + laws)
