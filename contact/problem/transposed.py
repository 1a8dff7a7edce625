"""The history of a step transposed: the way back of the adjoint through the steps of an evolution.

A step ends with the unknowns x and the history h' = H(x, h), and its equations R(x, f, h) = 0 know
the history h of its beginning. Given the derivatives of a quantity by h', those by x are
(dH/dx)^T times these, and those by h are (dH/dh)^T times these less (dR/dh)^T w, with the adjoint
w of the step. Each part of the history has its own H: slip adds up at the contact nodes, internal
variables of the material flow at the quadrature points.
"""

from __future__ import annotations

import numpy as np

from contact.body.internal_variables import VARIABLES
from contact.history import History, InternalVariables, Part
from contact.interface.multipliers import SlipHistory
from contact.problem.linearised import Linearised
from contact.problem.problem import SLIP, ContactProblem
from contact.problem.state import State
from contact.typing import Array


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
        by_x += problem.equilibrium.commit_transposed(state, variables)
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
    before = problem.equilibrium.before_transposed(state, along, variables)
    return History(parts if before is None else {**parts, VARIABLES: before})


def _direction(problem: ContactProblem, nodal: Array) -> Array:
    """Return the directions of slip in a step, which its length changes with, shape (n, d)."""
    slip = problem.interface.slip(nodal)
    length = np.linalg.norm(slip, axis=1)
    return np.asarray(slip / np.maximum(length, np.finfo(float).tiny)[:, None])


def _parts(history: History) -> tuple[SlipHistory, InternalVariables | None]:
    slip, variables = history[SLIP], history.get(VARIABLES)
    assert isinstance(slip, SlipHistory)
    assert variables is None or isinstance(variables, InternalVariables)
    return slip, variables
