"""The diagonal of a matrix at fixed unknowns."""

from __future__ import annotations

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from contact.linear.layout import Layout


def balance(matrix: PETSc.Mat, layout: Layout) -> None:
    """Put the size of the matrix's own diagonal at fixed unknowns, in place of ones. Collective.

    Against a modulus of 1e12 ones are nothing, and multigrid takes them for a body that is not
    held; against 1e-12 they are all that it sees.
    """
    diagonal, free = matrix.getDiagonal(), layout.free.ravel()
    sizes = np.array([np.abs(diagonal.array[free]).sum(), np.count_nonzero(free)])
    layout.comm.Allreduce(MPI.IN_PLACE, sizes, op=MPI.SUM)
    if sizes[0] > 0 and np.isfinite(sizes[0]):
        diagonal.array[~free] = sizes[0] / sizes[1]
        matrix.setDiagonal(diagonal)
