"""Iterative solutions judged by what they leave, not by the norm in which they were iterated.

The norm of the preconditioner is blind where that is nearly singular: of a body that hardly
anything holds the first correction is a huge rigid motion, and beside it all else is small. And
some methods end without a solution, and say so to nobody who does not ask.
"""

from __future__ import annotations

from collections.abc import Callable

from petsc4py import PETSc

#: How often a solution is corrected, at most, by a solve for what it leaves.
CORRECTIONS = 3


def refine(
    ksp: PETSc.KSP,
    rhs: PETSc.Vec,
    solution: PETSc.Vec,
    solve: Callable[[PETSc.Vec, PETSc.Vec], None],
) -> None:
    """Correct a solution while it leaves far too much and corrections help. Collective.

    That is more than the root of what was asked for: norms differ by as much as that.

    Parameters
    ----------
    ksp
        Has the matrix and the tolerance.
    rhs, solution
        The system's; the latter is corrected.
    solve
        Solves for another right-hand side, from zero.
    """
    matrix, allowed = ksp.getOperators()[0], ksp.getTolerances()[0] ** 0.5 * rhs.norm()
    left = rhs - matrix * solution
    for _ in range(CORRECTIONS):
        before = left.norm()
        if not before > allowed:
            return
        correction = left.duplicate()
        ksp.setInitialGuessNonzero(False)
        solve(left.copy(), correction)
        left.axpy(-1.0, matrix * correction)
        if not left.norm() < before:
            return
        solution.axpy(1.0, correction)
