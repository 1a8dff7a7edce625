"""Iterative refinement of the solutions of Krylov solvers.

Their residuals, in the norm of the preconditioner, are blind where that is nearly singular: for a
weakly constrained body the first correction is a huge rigid motion, beside which all else is small.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from contact.mesh.entities import component_sums
from contact.typing import Array

#: Most corrections of a solution.
CORRECTIONS = 3


@dataclass(frozen=True)
class Subsystems:
    """Uncoupled subsystems: those of connected components.

    Attributes
    ----------
    comm
        Communicator.
    of
        Subsystem of each owned unknown.
    count
        Number of subsystems.
    """

    comm: MPI.Intracomm
    of: NDArray[np.intp]
    count: int

    def norms(self, vector: PETSc.Vec) -> Array:
        """Return the norm of a vector in each subsystem, shape (count,). Collective."""
        return np.sqrt(component_sums(self.comm, self.of, vector.array_r**2, self.count))


def refine(
    ksp: PETSc.KSP,
    rhs: PETSc.Vec,
    solution: PETSc.Vec,
    solve: Callable[[PETSc.Vec, PETSc.Vec], None],
    subsystems: Subsystems | None = None,
) -> None:
    """Correct a solution until |b - A x| <= sqrt(rtol) |b|, in each subsystem. Collective.

    The norms of the preconditioner and of the residual differ by about sqrt(rtol); beside a far
    larger right-hand side a small subsystem is not seen.

    Parameters
    ----------
    ksp
        Solver with the matrix and the tolerance.
    rhs, solution
        b and x; x is corrected.
    solve
        Solver for another right-hand side, from zero.
    subsystems
        Uncoupled subsystems; None for one.
    """
    norms = (lambda vector: np.array([vector.norm()])) if subsystems is None else subsystems.norms
    matrix, asked_for = ksp.getOperators()[0], ksp.getTolerances()[0]
    allowed = asked_for**0.5 * norms(rhs)
    left = rhs - matrix * solution
    for _ in range(CORRECTIONS):
        before = norms(left)
        beyond = before > allowed
        if not beyond.any():
            return
        correction, asked = left.duplicate(), left.copy()
        if subsystems is not None:
            asked.array[~beyond[subsystems.of]] = 0.0
        ksp.setInitialGuessNonzero(False)
        # No more digits than are missing.
        missing = float(allowed[beyond].min() / np.linalg.norm(before[beyond]))
        ksp.setTolerances(rtol=max(asked_for, missing**2))
        try:
            solve(asked, correction)
        finally:
            ksp.setTolerances(rtol=asked_for)
        corrected = left - matrix * correction
        gained = norms(corrected) < before
        if not np.any(gained & beyond):
            return
        if subsystems is not None:
            lost = ~gained[subsystems.of]
            correction.array[lost], corrected.array[lost] = 0.0, left.array_r[lost]
        solution.axpy(1.0, correction)
        left = corrected
