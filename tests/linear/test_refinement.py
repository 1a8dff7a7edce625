"""Solutions are corrected where they leave too much, and only where a correction helps."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc

from contact.linear.petsc import refine

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
    refine(ksp, vector(SIZE), solution, solve, (np.array([0, 0, 1, 1]), 2))
    assert np.allclose(solution.array_r, [1.0, 1.0, 0.3, 0.4], rtol=0, atol=1e-12)


RTOL = 1e-8


def refined(sizes, off, components=None):
    """Return what is left over each right-hand side, and the tolerance of each correction.

    Solutions of unit systems are a part `off` wrong, and the solver is as bad as norms may differ:
    what it leaves is the root of its tolerance of all that it was asked for.
    """
    sizes, asked_for = np.array(sizes), []
    matrix = PETSc.Mat().createAIJ((sizes.size, sizes.size), nnz=1, comm=MPI.COMM_SELF)
    matrix.setDiagonal(vector(np.ones(sizes.size)))
    matrix.assemble()
    ksp = PETSc.KSP().create(MPI.COMM_SELF)
    ksp.setOperators(matrix)
    ksp.setTolerances(rtol=RTOL)

    def solve(asked, found):
        asked_for.append(ksp.getTolerances()[0])
        unseen = 0.99 * asked_for[-1] ** 0.5 * asked.norm()
        values = asked.array_r
        found.array[:] = np.sign(values) * np.maximum(np.abs(values) - unseen, 0.0)

    solution = vector(sizes * (1 - np.array(off)))
    refine(ksp, vector(sizes), solution, solve, components)
    assert ksp.getTolerances()[0] == RTOL
    return np.abs(1 - solution.array_r / sizes), asked_for


@pytest.mark.parametrize(("off", "digits"), [(1.0, 8), (1e-2, 4), (2e-4, 0.61)])
def test_a_correction_is_asked_for_the_digits_that_are_missing(off, digits):
    """Once, by as much as norms may differ: all digits are no better, fewer need another one."""
    left, asked_for = refined([3.0], [off])
    assert -np.log10(asked_for) == pytest.approx([digits], abs=0.02)
    assert left[0] <= RTOL**0.5


def test_no_piece_waits_for_its_correction_because_another_is_larger():
    """Each of four took a correction of its own, and the last one got none."""
    sizes, count = [1.0, 1e-2, 1e-4, 1e-6], 4
    left, _ = refined(sizes, 4 * [1e-2], (np.arange(count), count))
    assert left.max() <= RTOL**0.5
