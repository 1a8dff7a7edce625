"""One step of Newton's method: material, contact, friction, layer and charge linearised together.

The multipliers are eliminated node by node, with gamma far above the stiffness of the body:
lambda+ = lambda + gamma (u_nu+ - rho), (19a). As gamma grows this is the primal-dual
active set strategy. The linear systems keep the size and pattern of the elastic ones. Iterative
solvers stop at a forcing term (inexact Newton). `safeguards` keep active sets from cycling.

References
----------
Dembo, Eisenstat and Steihaug, Inexact Newton methods, SIAM J. Numer. Anal. 19 (1982).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from contact.errors import SingularError
from contact.interface.complementarity import (
    ComplementarityParameters,
    LinearisedBound,
    linearise,
)
from contact.interface.interface import Interface
from contact.interface.multipliers import ActiveSet, Multipliers
from contact.linear.operator import Counters, Operator
from contact.methods.options import NewtonOptions
from contact.methods.safeguards import (
    ConductivityDerivative,
    bound_by_slip,
    guarded_active_set,
    regularisation,
)
from contact.problem.condensed import AnyProblem
from contact.problem.residuals import EvaluatedState, residual_forces
from contact.problem.state import State
from contact.ranks import summed
from contact.typing import Array

#: First forcing term of inexact Newton. One by the residuals (Eisenstat and Walker) would ask for
#: more digits on finer meshes.
FORCING = 1e-2

#: Steps without progress after which the forcing term is multiplied by `REDUCTION`: with two digits
#: the active set may cycle. Its least value is the tolerance.
STAGNANT, REDUCTION = 3, 1e-2

#: Ratio of the equilibrium residual to the largest one below which the stiffness of the last step
#: is reused: the error is in contact and friction.
SMALL = 0.1


@dataclass(frozen=True)
class LinearisedLaws:
    """Contact, friction, layer and charge at the contact nodes, linearised for a step."""

    active_set: ActiveSet  #: of the step
    unchanged: bool  #: whether it is the active set of the last step, on all ranks
    constant: Multipliers  #: lambda^0, the multipliers of (19) in docs/algorithms.md at dx = 0
    blocks: Array  #: B, their derivatives
    layer: Array  #: blocks of the layer
    layer_shift: Array  #: its linearised pressure at dx = 0 less its pressure, (n,)
    charge: Array  #: blocks of the charge, or 0


class NewtonStep:
    """The linearised problem of a step: laws, matrix, solve.

    A matrix that has not changed is neither assembled nor factorised again.
    Steps may be those of the same body with another interface. `underconstrained`: a rigid-body
    mode is constrained neither by the supports nor by the nodes that touch in the reference
    configuration. A body that touches at one node rolls until it touches at another one: a
    Levenberg-Marquardt regularisation at all contact nodes bounds the steps while the active set
    changes, and decreases with the residual.
    """

    def __init__(
        self,
        problem: AnyProblem,
        options: NewtonOptions,
        parameters: ComplementarityParameters,
        counters: Counters,
        underconstrained: bool = False,
    ) -> None:
        self.underconstrained = underconstrained
        self.options, self.parameters = options, parameters
        self._problem, self._counters = problem, counters
        self._operator: Operator | None = None
        self.begin()

    @property
    def fault(self) -> str:
        """Reason of an end where the matrix is singular."""
        body = "no contact constrains the body"
        fault = body if self.underconstrained else "the stiffness is singular"
        return f"{fault} at that displacement"

    def begin(self) -> None:
        """Begin another iteration: forcing term and conductivity derivative anew."""
        self._conductivity_derivative = ConductivityDerivative()
        self._assembled = False
        self._nearest, self._stagnant, self._forcing = np.inf, 0, FORCING

    def rejected(self, residual: float) -> bool:
        """Tell whether the last step raised the residual by a derivative that may be left out.

        It is then to be taken again, without the derivative of psi by the gap.
        """
        return self._conductivity_derivative.worsened(residual)

    def _forcing_term(self, residual: float) -> float:
        """Return the forcing term of a step from the residual before it."""
        self._stagnant = 0 if residual < self._nearest else self._stagnant + 1
        self._nearest = min(self._nearest, residual)
        if self._stagnant >= STAGNANT:
            self._stagnant = 0
            self._forcing = max(self._forcing * REDUCTION, self.options.tolerance)
        return self._forcing

    @property
    def operator(self) -> Operator:
        """The operator of the linear systems."""
        if self._operator is None:
            interface, body = self._problem.interface, self._problem.body
            asymmetric = (
                interface.friction.acts or interface.foundation.active or not body.symmetric
            )
            self._operator = self._problem.operator(
                symmetric=not asymmetric, counters=self._counters, solver=self.options.linear
            )
        return self._operator

    def assemble_secant(self, problem: AnyProblem, state: State, blocks: Array) -> None:
        """Update the operator with secants and given nodal blocks, for other methods. Collective.

        With the blocks of layer and charge; that of a step is `_update`.
        """
        interface = problem.interface
        if interface.foundation.active:
            jump = interface.nodes.jump(state.x)
            blocks = blocks + interface.foundation.block(
                jump, interface.pressure(jump, state.multipliers)
            )
        weighted = interface.weighted(blocks, state.x)
        self.operator.update("secant", state, weighted)

    def without_contact(self, problem: AnyProblem, state: State) -> State:
        """Return the state after one linear solve with all nodes open. Collective."""
        nodes, body = problem.interface.nodes, problem.body
        free = State(state.x, Multipliers.zero(nodes), state.time, state.history)
        size = nodes.block_size
        self.assemble_secant(problem, free, np.zeros((nodes.nodes.size, size, size)))
        step = self.operator.solve(-residual_forces(problem, free))
        return replace(free, x=body.prescribe(body.updated(free.x, step), free.time))

    def __call__(
        self,
        problem: AnyProblem,
        iterate: EvaluatedState,
        tangent: bool,
        exact: bool = False,
    ) -> State | None:
        """Return the next iterate; None if the matrix is singular there. Collective.

        The material is linearised by its tangent, or by its secant (Kacanov). `exact`: iterative
        solvers go to their own tolerance. SingularError if another iterate does not help: with a
        linear body, or in the first step of an underconstrained one.
        """
        body, state, largest = problem.body, iterate.state, iterate.residuals.significant
        laws = self._linearise(problem.interface, state, largest)
        self._update(problem, iterate, laws, tangent)
        residual = _residual(problem, iterate, laws)
        forcing = None if exact else self._forcing_term(largest)
        try:
            increment = self.operator.solve(-residual, forcing)
        except SingularError:
            if body.linear or (self.underconstrained and state.active_set is None):
                raise
            return None
        return _moved(problem, state, laws, increment)

    @np.errstate(over="ignore", invalid="ignore")  # diverging iterates overflow
    def _linearise(self, interface: Interface, state: State, residual: float) -> LinearisedLaws:
        """Linearise contact, friction, layer and charge. Collective."""
        parameters, before = self.parameters, state.active_set
        jump = interface.nodes.jump(state.x)
        pressure, length = interface.pressure(jump, state.multipliers), interface.slip_length(jump)
        s = interface.friction.bound(length, pressure)
        active, about = guarded_active_set(
            interface, jump, state.multipliers, s, parameters.c, before
        )
        changed = before is None or not active.same(before)
        unchanged = float(summed(interface.comm, changed)) == 0
        by_slip = np.zeros_like(s)
        if unchanged:
            limit = self.options.softening * parameters.nodal_stiffness
            by_slip = bound_by_slip(interface, length, pressure, limit)
        bound = LinearisedBound(s, interface.friction.by_pressure(length, pressure), by_slip)
        constant, blocks = linearise(interface, jump, about, active, parameters, bound)
        layer, shift = linearised_layer(interface, jump, state, parameters, unchanged)
        law, charge = interface.foundation, np.zeros_like(blocks)
        if law.active:
            # With the derivative of psi(u_nu - rho), or psi frozen.
            follow = unchanged
            if law.follows_gap:
                follow = self._conductivity_derivative(residual, unchanged)
            charge = law.charge_block(jump, interface.pressure(jump, constant), follow)
        return LinearisedLaws(active, unchanged, constant, blocks, layer, shift, charge)

    def _update(
        self, problem: AnyProblem, iterate: EvaluatedState, laws: LinearisedLaws, tangent: bool
    ) -> None:
        """Update the operator with the matrix of (21) in docs/algorithms.md. Collective."""
        interface, body = problem.interface, problem.body
        state, residuals = iterate.state, iterate.residuals
        blocks = laws.blocks + laws.layer + laws.charge
        if self.underconstrained and not laws.unchanged:
            blocks[:, : body.dim, : body.dim] += regularisation(
                interface, residuals.significant, self.parameters.nodal_stiffness
            )
        reuse = self._assembled and residuals.equilibrium < SMALL * residuals.significant
        weighted = interface.weighted(blocks, state.x)
        self.operator.update("tangent" if tangent else "secant", state, weighted, reuse=reuse)
        self._assembled = True


def _residual(problem: AnyProblem, iterate: EvaluatedState, laws: LinearisedLaws) -> Array:
    """Return G(x, lambda^0), with the linearised pressure of the layer. Collective."""
    state, nodes = replace(iterate.state, multipliers=laws.constant), problem.interface.nodes
    at = iterate.state.secant_at
    internal = iterate.internal if at is None else problem.body.secant_forces(iterate.state)
    residual = residual_forces(problem, state, internal)
    nodes.add_jump_transposed((nodes.weight * laws.layer_shift)[:, None] * nodes.normal, residual)
    return residual


def _moved(problem: AnyProblem, state: State, laws: LinearisedLaws, increment: Array) -> State:
    """Return the next iterate x + dx, with lambda+ = lambda^0 + B T dx. Collective."""
    interface, body = problem.interface, problem.body
    nodes, moved = interface.nodes, interface.nodes.jump(increment)
    change = np.einsum("nij,nj->ni", laws.blocks, moved)
    vectors = laws.constant.vectors(nodes) + change[:, : interface.dim]
    multipliers = Multipliers.of(nodes, nodes.normal_component(vectors), vectors)
    pressed = nodes.normal_component(np.einsum("nij,nj->ni", laws.layer, moved))
    layer = interface.foundation.layer_pressure(nodes.jump(state.x)) + laws.layer_shift + pressed
    # Far motions leave nodes of a rigid part off it by rounding.
    x = body.prescribe(body.updated(state.x, increment), state.time)
    return replace(
        state,
        x=x,
        multipliers=multipliers,
        active_set=laws.active_set,
        layer_pressure=layer,
        secant_at=None,
    )


def linearised_layer(
    interface: Interface,
    jump: Array,
    state: State,
    parameters: ComplementarityParameters,
    full: bool,
) -> tuple[Array, Array]:
    """Linearise the layer; return its block, and the linearised pressure minus the pressure.

    About u* on the graph of the law with p(u*) + c u* = lambda_c + p_l + c u_nu, as for the
    active set: about u_nu itself, a layer stiffer than the body cycles between its regimes.
    """
    law, nodes, c = interface.foundation, interface.nodes, parameters.c
    graph = law.normal_graph(jump)
    if graph is None:
        return law.layer_block(jump, full), np.zeros(jump.shape[0])
    u_n, layer = nodes.normal_component(jump), law.layer_pressure(jump)
    last = layer if state.layer_pressure is None else state.layer_pressure
    place = graph.displacement(state.multipliers.contact + last + c * u_n, c)
    on_graph = jump.copy()
    on_graph[:, : interface.dim] += (place - u_n)[:, None] * nodes.normal
    block = law.layer_block(on_graph, full)
    back = nodes.normal_component(np.einsum("nij,nj->ni", block, jump - on_graph))
    return block, law.layer_pressure(on_graph) + back - layer
