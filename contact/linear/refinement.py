"""Iterative solutions judged by what they leave, not by the norm in which they were iterated.

The norm of the preconditioner is blind where that is nearly singular: of a body that hardly
anything holds the first correction is a huge rigid motion, and beside it all else is small. And
some methods end without a solution, and say so to nobody who does not ask.
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

#: How often a solution is corrected, at most, by a solve for what it leaves.
CORRECTIONS = 3


@dataclass(frozen=True)
class Components:
    """Systems that nothing couples.

    Attributes
    ----------
    comm
        Communicator.
    of
        To which each owned unknown belongs.
    count
        How many they are.
    """

    comm: MPI.Intracomm
    of: NDArray[np.intp]
    count: int

    def norms(self, vector: PETSc.Vec) -> Array:
        """Return the norm of a vector in each of them, shape (count,). Collective."""
        return np.sqrt(component_sums(self.comm, self.of, vector.array_r**2, self.count))


def refine(
    ksp: PETSc.KSP,
    rhs: PETSc.Vec,
    solution: PETSc.Vec,
    solve: Callable[[PETSc.Vec, PETSc.Vec], None],
    components: Components | None = None,
) -> None:
    """Correct a solution while it leaves far too much and corrections help. Collective.

    That is more than the root of what was asked for: norms differ by as much as that. Of systems
    beside each other, which iterations take for one, each has to leave little by itself: beside a
    far larger right-hand side nothing of a small one is seen.

    Parameters
    ----------
    ksp
        Has the matrix and the tolerance.
    rhs, solution
        The system's; the latter is corrected.
    solve
        Solves for another right-hand side, from zero.
    components
        Systems that nothing couples; None where there is one.
    """
    norms = (lambda vector: np.array([vector.norm()])) if components is None else components.norms
    matrix, asked_for = ksp.getOperators()[0], ksp.getTolerances()[0]
    allowed = asked_for**0.5 * norms(rhs)
    left = rhs - matrix * solution
    for _ in range(CORRECTIONS):
        before = norms(left)
        beyond = before > allowed
        if not beyond.any():
            return
        correction, asked = left.duplicate(), left.copy()
        if components is not None:
            asked.array[~beyond[components.of]] = 0.0
        ksp.setInitialGuessNonzero(False)
        # No more than is missing, by what norms may differ.
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
        if components is not None:
            lost = ~gained[components.of]
            correction.array[lost], corrected.array[lost] = 0.0, left.array_r[lost]
        solution.axpy(1.0, correction)
        left = corrected
