"""The problem that an outer iteration leaves to the block relaxation: all but contact is frozen."""

from __future__ import annotations

from dataclasses import dataclass

from contact.interface.layer import NormalLaw
from contact.linear.operator import Operator
from contact.problem.kkt import residual_forces
from contact.problem.protocols import Problem
from contact.problem.state import State
from contact.typing import Array


@dataclass(frozen=True)
class Linearised:
    """The linearised problem about an iterate: A dx = -residual - contact forces.

    Attributes
    ----------
    operator
        Factorised operator, augmented by r at the contact nodes.
    residual
        Owned residual without multipliers at the iterate.
    x
        The iterate's owned unknowns.
    nodal
        The iterate at the contact nodes, shape (n, block size).
    bound
        Friction bound s_n, shape (n,).
    law
        The compliant layer in front of the rigid part, to be solved with the constraint; None
        without one. The multipliers are then those of the total pressure -sigma_nu.
    friction
        Whether tangential forces act; the operator is augmented tangentially only then.
    """

    operator: Operator
    residual: Array
    x: Array
    nodal: Array
    bound: Array
    law: NormalLaw | None = None
    friction: bool = False


def linearised(
    problem: Problem,
    state: State,
    operator: Operator,
    bound: Array,
    friction: bool,
    secant_at: Array,
) -> Linearised:
    """Freeze a problem at a state. Collective.

    The multipliers are the unknowns of the relaxation, and no part of the residual. Neither is the
    layer's pressure, unless it is lagged. The contact flag of the perfect conductor still looks
    at the last pressure.

    Parameters
    ----------
    problem, state
        The problem, and where it is.
    operator, bound, friction
        As of `Linearised`.
    secant_at
        Unknowns at which the secant modulus of the material is taken.
    """
    interface, jump = problem.interface, problem.interface.jump
    nodal = jump.apply(state.x)
    law = interface.response.normal_law(nodal)
    residual = residual_forces(problem, state, secant_at)
    unknown = state.forces.vectors(jump)
    if law is not None:
        unknown += interface.response.layer_pressure(nodal)[:, None] * jump.normal
    jump.transpose(-jump.weight[:, None] * unknown, residual)
    owned = problem.equilibrium.owned_part(state.x)
    return Linearised(operator, residual, owned, nodal, bound, law, friction)
