"""What is unloaded to nothing: the body at rest."""

from __future__ import annotations

from contact.problem.kkt import KKT, evaluate
from contact.problem.protocols import Problem
from contact.problem.state import State

#: Residuals at rest that are rounding.
ROUNDING = 1e-13


def resting(problem: Problem) -> tuple[State, KKT] | None:
    """Return the body at rest with its residuals, where it is in equilibrium. Collective.

    Beside forces that vanish no residual is small, and only those that are 0 have none: a method
    that comes nearer and nearer to them never ends. Asked where a method has failed: a body that
    friction has locked in may be in equilibrium elsewhere.
    """
    state = problem.start()
    residuals = evaluate(problem, state)
    return (state, residuals) if residuals.largest <= ROUNDING else None
