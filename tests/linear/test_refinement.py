"""Solutions are corrected where they leave too much, and only where a correction helps."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from contact.linear.refinement import Pieces, refine

SIZE = np.array([2.0, 3.0, 4.0, 5.0])


def vector(values):
    return PETSc.Vec().createWithArray(np.array(values, dtype=float), comm=MPI.COMM_SELF)


@pytest.mark.parametrize("wrong", [-1.0, 0.0, 5.0])
def test_each_piece_takes_the_corrections_that_help_it(wrong):
    """A correction that helped one piece was taken as a whole, whatever it did to another."""
    matrix = PETSc.Mat().createAIJ((4, 4), nnz=1, comm=MPI.COMM_SELF)
    matrix.setDiagonal(vector(SIZE))
    matrix.assemble()
    ksp = PETSc.KSP().create(MPI.COMM_SELF)
    ksp.setOperators(matrix)
    ksp.setTolerances(rtol=1e-8)

    def solve(asked, found):
        found.array[:] = asked.array_r / SIZE * np.array([1.0, 1.0, wrong, wrong])

    solution = vector([0.1, 0.2, 0.3, 0.4])
    refine(ksp, vector(SIZE), solution, solve, Pieces(MPI.COMM_SELF, np.array([0, 0, 1, 1]), 2))
    assert np.allclose(solution.array_r, [1.0, 1.0, 0.3, 0.4], rtol=0, atol=1e-12)
