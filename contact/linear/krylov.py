"""Krylov solvers: iterative refinement of their solutions, and operators known by their products.

The norm of the preconditioner is blind where that is nearly singular: of a body that hardly
anything holds the first correction is a huge rigid motion, and beside it all else is small. And
some methods end without a solution, and tell only who asks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray
from petsc4py import PETSc

from contact.mesh.entities import component_sums
from contact.typing import Array

#: How often a solution is corrected, at most, by a solve for its residual.
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

    That is more than the root of the tolerance: norms differ by as much as that. Of systems
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
        # No more than is missing, by the factor that norms may differ by.
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


class Multiplies(Protocol):
    """An operator that is known by its products."""

    def multiply(self, values: Array) -> Array:
        """Return the matrix times owned values and q. Collective."""


class _Products:
    """The context of a matrix that is known by its products."""

    def __init__(self, operator: Multiplies, packing: Packing) -> None:
        self._operator, self._packing = operator, packing

    def mult(self, _: Any, vector: PETSc.Vec, image: PETSc.Vec) -> None:
        """Multiply."""
        values = self._packing.unpacked(vector.array_r)
        image.array[:] = self._packing.packed(self._operator.multiply(values))


class Packing:
    """Global unknowns in PETSc's vectors: the first rank holds them, behind its own.

    Parameters
    ----------
    comm
        Communicator.
    size
        Number of global unknowns.
    """

    def __init__(self, comm: MPI.Intracomm, size: int) -> None:
        self._comm, self._size = comm, size

    @property
    def here(self) -> int:
        """How many of them this rank holds."""
        return self._size if self._comm.rank == 0 else 0

    def packed(self, values: Array) -> Array:
        """Return the share of owned values and global ones that a rank holds."""
        return values if self.here == self._size else values[: values.size - self._size]

    def unpacked(self, values: Array) -> Array:
        """Return owned values and global ones behind them, the same on all ranks. Collective."""
        if self._size == 0:
            return values.copy()
        own = values[: values.size - self.here]
        return np.concatenate([own, self._comm.bcast(values[own.size :])])


def shell(operator: Multiplies, comm: MPI.Intracomm, owned: int, size: int) -> PETSc.Mat:
    """Return a matrix that multiplies as an operator does."""
    packing = Packing(comm, size)
    local = owned + packing.here
    context = _Products(operator, packing)
    matrix = PETSc.Mat().createPython(((local, None), (local, None)), context, comm)
    matrix.setUp()
    return matrix
