"""A step of an evolution linearised, and transposed: derivatives carried through the history.

A step ends with the unknowns x and the history h' = H(x, h), and its equations R(x, f, h) = 0 know
the history h of its beginning. The tangent goes forwards with dh' = dH/dx dx + dH/dh dh; dR/dh dh
is part of the equations of dx. The adjoint goes back: given the derivatives of a quantity by h',
those by x are (dH/dx)^T times these, and those by h are (dH/dh)^T times these less (dR/dh)^T w,
with the adjoint w of the step. Each part of the history has its own H: slip adds up at the contact
nodes, internal variables of the material flow at the quadrature points.
"""

from __future__ import annotations

import numpy as np

from contact.body.internal_variables import VARIABLES
from contact.history import History, InternalVariables, Part
from contact.interface.multipliers import SlipHistory
from contact.interface.nodes import unit_vectors
from contact.problem.linearised import Equations, Linearised
from contact.problem.problem import SLIP, ContactProblem
from contact.problem.state import State
from contact.typing import Array


def commit_along(linearised: Linearised, x: Array, change: History) -> History:
    """Return how the history at the end of a step changes. Collective.

    Parameters
    ----------
    linearised
        The equations of the step.
    x, change
        Changes of the owned unknowns, and of the history at its beginning.
    """
    problem, state = linearised.problem, linearised.state
    slip, variables = _parts(change)
    along = problem.equilibrium.local(x)
    jump = problem.nodes.tangential_component(problem.nodes.apply(along))
    longer = np.einsum("ni,ni->n", _direction(problem, problem.nodal(state)), jump - slip.jump)
    parts: dict[str, Part] = {SLIP: SlipHistory(jump, slip.accumulated + longer)}
    if variables is not None:
        parts[VARIABLES] = problem.equilibrium.laws.commit_along(state, along, variables)
    return History(parts)


def before_along(linearised: Linearised, change: History) -> Equations:
    """Return how the equations of a step change with the history at its beginning. Collective.

    Parameters
    ----------
    linearised
        The equations of the step.
    change
        Of the history.
    """
    problem, state = linearised.problem, linearised.state
    slip, variables = _parts(change)
    conditions = linearised.by_length * slip.accumulated[:, None]
    conditions -= np.einsum("nij,nj->ni", linearised.by_slip, slip.jump)
    if variables is None:
        return Equations(np.zeros_like(problem.equilibrium.owned_part(state.x)), conditions)
    problem.equilibrium.laws.before_along(state, variables)
    return Equations(problem.equilibrium.forces_of_laws(), conditions)


def commit_transposed(problem: ContactProblem, state: State, after: History) -> Array:
    """Return the derivatives of a quantity by the owned unknowns at the end of a step. Collective.

    Parameters
    ----------
    problem, state
        The step and its solution.
    after
        The derivatives by the history at its end, in the places of that.
    """
    slip, variables = _parts(after)
    by_x = np.zeros_like(problem.equilibrium.owned_part(state.x))
    if variables is not None:
        problem.equilibrium.laws.commit_transposed(state, variables)
        by_x += problem.equilibrium.forces_of_laws()
    jump, nodal = problem.nodes, problem.nodal(state)
    by_jump = np.zeros_like(nodal)
    by_jump[:, : jump.dim] = jump.tangential_component(slip.jump)
    by_jump[:, : jump.dim] += slip.accumulated[:, None] * _direction(problem, nodal)
    jump.transpose(by_jump, by_x)
    return by_x


def before_transposed(
    linearised: Linearised, along: Array, conditions: Array, after: History | None
) -> History:
    """Return the derivatives of a quantity by the history at the beginning of a step. Collective.

    Parameters
    ----------
    linearised
        The equations of the step.
    along, conditions
        The derivatives by the forces of the stresses on the owned unknowns, and its adjoint of the
        conditions.
    after
        The derivatives by the history at its end; None for a last step.
    """
    problem, state = linearised.problem, linearised.state
    jump = np.einsum("nji,nj->ni", linearised.by_slip, conditions)
    accumulated = -np.einsum("ni,ni->n", linearised.by_length, conditions)
    slip, variables = (None, None) if after is None else _parts(after)
    if slip is not None:
        jump -= slip.accumulated[:, None] * _direction(problem, problem.nodal(state))
        accumulated += slip.accumulated
    parts: dict[str, Part] = {SLIP: SlipHistory(jump, accumulated)}
    local = problem.equilibrium.local(along)
    before = problem.equilibrium.laws.before_transposed(state, local, variables)
    return History(parts if before is None else {**parts, VARIABLES: before})


def _direction(problem: ContactProblem, nodal: Array) -> Array:
    """Return the directions of slip in a step, which its length changes with, shape (n, d)."""
    return unit_vectors(problem.interface.slip(nodal))


def _parts(history: History) -> tuple[SlipHistory, InternalVariables | None]:
    slip, variables = history[SLIP], history.get(VARIABLES)
    assert isinstance(slip, SlipHistory)
    assert variables is None or isinstance(variables, InternalVariables)
    return slip, variables
