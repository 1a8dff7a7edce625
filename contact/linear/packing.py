"""Global unknowns in PETSc's vectors, and operators that are known by their products."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from contact.typing import Array


class Multiplies(Protocol):
    """What is known by its products."""

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
        """Return what of owned values and global ones a rank holds."""
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
